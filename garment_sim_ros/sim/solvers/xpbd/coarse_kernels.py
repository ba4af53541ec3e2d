"""Strain of triangles of cells: the coarse level of a garment in a sub-step."""

import numpy as np

from garment_sim_ros.jit import kernel

_ONE = np.uint64(1)
_TWO = np.uint64(2)
_THREE = np.uint64(3)
_ONCE = np.float32(1.0)
_BENT = np.float32(0.002)
"""Threads shorter by this part are bent and do not push; less so, the more they are. Where no side
of a triangle is longer, it is folded, and its threads are not where its corners tell."""


@kernel(forceinline=True)
def pull_cells(x, moved, apart, coarse):
    """One Gauss-Seidel pass over triangles of cells; free particles move as their cells do.

    Args:
        x: Positions, flat [m], shape [3 n].
        moved: What is changed in place, flat [m], shape [3 n]: the positions themselves, or what
            is added to them.
        apart: Whether it is the latter.
        coarse: `solvers.xpbd.coarse.CoarseLevel`.
    """
    if coarse.strains.shape[0] == 0:
        return
    # Shifts are kept apart: in short sub-steps they are less than a coordinate is rounded to.
    centre, shift = coarse.centre.reshape(-1), coarse.shift.reshape(-1)
    centre[:] = np.float32(0.0)
    shift[:] = np.float32(0.0)
    for p in range(coarse.cell.size):
        i = _THREE * np.uint64(p)
        c = _THREE * np.uint64(coarse.cell[p])
        part = coarse.part[p]
        px, py, pz = moved[i], moved[i + _ONE], moved[i + _TWO]
        if apart:
            px += x[i]
            py += x[i + _ONE]
            pz += x[i + _TWO]
        centre[c] += part * px
        centre[c + _ONE] += part * py
        centre[c + _TWO] += part * pz
    pulled = False
    for t in range(coarse.strains.shape[0]):
        i = _THREE * np.uint64(coarse.corners[3 * t])
        j = _THREE * np.uint64(coarse.corners[3 * t + 1])
        k = _THREE * np.uint64(coarse.corners[3 * t + 2])
        longest = np.float32(0.0)
        for a, b, side in ((i, j, 0), (i, k, 1), (j, k, 2)):
            dx = (centre[a] - centre[b]) + (shift[a] - shift[b])
            dy = (centre[a + _ONE] - centre[b + _ONE]) + (shift[a + _ONE] - shift[b + _ONE])
            dz = (centre[a + _TWO] - centre[b + _TWO]) + (shift[a + _TWO] - shift[b + _TWO])
            longest = max(longest, (dx * dx + dy * dy + dz * dz) * coarse.sides[t, side])
        taut = min(_ONCE, _ONCE + (longest - _ONCE) / (_BENT + _BENT))
        if taut < np.float32(0.0):
            continue
        for direction in range(2):
            u = coarse.strains[t, direction, 0]
            v = coarse.strains[t, direction, 1]
            x0, y0, z0 = shift[i], shift[i + _ONE], shift[i + _TWO]
            dx = u * ((centre[j] - centre[i]) + (shift[j] - x0))
            dx += v * ((centre[k] - centre[i]) + (shift[k] - x0))
            dy = u * ((centre[j + _ONE] - centre[i + _ONE]) + (shift[j + _ONE] - y0))
            dy += v * ((centre[k + _ONE] - centre[i + _ONE]) + (shift[k + _ONE] - y0))
            dz = u * ((centre[j + _TWO] - centre[i + _TWO]) + (shift[j + _TWO] - z0))
            dz += v * ((centre[k + _TWO] - centre[i + _TWO]) + (shift[k + _TWO] - z0))
            squared = dx * dx + dy * dy + dz * dz
            if squared < _ONCE - _BENT - _BENT:
                continue
            f = taut - taut / np.sqrt(squared)
            if f < np.float32(0.0):
                f *= max(np.float32(0.0), _ONCE + f / _BENT)
            dx *= f
            dy *= f
            dz *= f
            a = coarse.strains[t, direction, 2]
            b = coarse.strains[t, direction, 3]
            c = coarse.strains[t, direction, 4]
            shift[i] = x0 - a * dx
            shift[i + _ONE] = y0 - a * dy
            shift[i + _TWO] = z0 - a * dz
            shift[j] -= b * dx
            shift[j + _ONE] -= b * dy
            shift[j + _TWO] -= b * dz
            shift[k] -= c * dx
            shift[k + _ONE] -= c * dy
            shift[k + _TWO] -= c * dz
            pulled = True
    if pulled:
        for p in range(coarse.free):
            i = _THREE * np.uint64(p)
            c = _THREE * np.uint64(coarse.cell[p])
            moved[i] += shift[c]
            moved[i + _ONE] += shift[c + _ONE]
            moved[i + _TWO] += shift[c + _TWO]
