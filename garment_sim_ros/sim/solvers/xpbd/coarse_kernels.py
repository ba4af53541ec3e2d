"""Strain of triangles of cells: the coarse level of a garment in a sub-step."""

import numpy as np

from garment_sim_ros.jit import lean_kernel

_ONE = np.uint64(1)
_TWO = np.uint64(2)
_THREE = np.uint64(3)
_ONCE = np.float32(1.0)
_BENT = np.float32(0.002)
"""Threads shorter by this part are bent and do not push; less so, the more they are. Where no side
of a triangle is longer, it is folded, and its threads are not where its corners tell."""


@lean_kernel(forceinline=True)
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
    _find_centres(x, moved, apart, coarse, centre)
    shift[:] = np.float32(0.0)
    pulled = False
    for t in range(coarse.strains.shape[0]):
        i = _THREE * np.uint64(coarse.corners[3 * t])
        j = _THREE * np.uint64(coarse.corners[3 * t + 1])
        k = _THREE * np.uint64(coarse.corners[3 * t + 2])
        taut = _tautness(coarse.sides[t], centre, shift, i, j, k)
        if taut < np.float32(0.0):
            continue
        for direction in range(2):
            if _pull(coarse.strains[t, direction], taut, centre, shift, i, j, k):
                pulled = True
    if pulled:
        for p in range(coarse.free):
            i = _THREE * np.uint64(p)
            c = _THREE * np.uint64(coarse.cell[p])
            moved[i] += shift[c]
            moved[i + _ONE] += shift[c + _ONE]
            moved[i + _TWO] += shift[c + _TWO]


@lean_kernel(inner=True)
def _find_centres(x, moved, apart, coarse, centre):
    """Centres of the cells [m], flat, shape [3 c]; the other arguments are those of the pass."""
    centre[:] = np.float32(0.0)
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


@lean_kernel(inner=True)
def _tautness(sides, centre, shift, i, j, k):
    """How much of their pull a triangle's threads have: 1, less where it is folded, below 0 none.

    Args:
        sides: One over the squared rest length of each of its sides [1/m^2], shape [3].
        centre: Centres of the cells, flat [m].
        shift: What they have moved by [m].
        i: Where its first corner is there.
        j: Where its second corner is.
        k: Where its third corner is.
    """
    longest = np.float32(0.0)
    for a, b, side in ((i, j, 0), (i, k, 1), (j, k, 2)):
        dx = (centre[a] - centre[b]) + (shift[a] - shift[b])
        dy = (centre[a + _ONE] - centre[b + _ONE]) + (shift[a + _ONE] - shift[b + _ONE])
        dz = (centre[a + _TWO] - centre[b + _TWO]) + (shift[a + _TWO] - shift[b + _TWO])
        longest = max(longest, (dx * dx + dy * dy + dz * dz) * sides[side])
    return min(_ONCE, _ONCE + (longest - _ONCE) / (_BENT + _BENT))


@lean_kernel(inner=True)
def _pull(strain, taut, centre, shift, i, j, k):
    """Pulls a triangle's threads of one direction to their length.

    Args:
        strain: Weights of the second and third corner in the thread, and how far each corner
            moves, shape [5].
        taut: See `_tautness`, as the other arguments.
        centre: See `taut`.
        shift: Changed in place.
        i: See `taut`.
        j: See `taut`.
        k: See `taut`.

    Returns:
        Whether anything moved.
    """
    u, v = strain[0], strain[1]
    x0, y0, z0 = shift[i], shift[i + _ONE], shift[i + _TWO]
    dx = u * ((centre[j] - centre[i]) + (shift[j] - x0))
    dx += v * ((centre[k] - centre[i]) + (shift[k] - x0))
    dy = u * ((centre[j + _ONE] - centre[i + _ONE]) + (shift[j + _ONE] - y0))
    dy += v * ((centre[k + _ONE] - centre[i + _ONE]) + (shift[k + _ONE] - y0))
    dz = u * ((centre[j + _TWO] - centre[i + _TWO]) + (shift[j + _TWO] - z0))
    dz += v * ((centre[k + _TWO] - centre[i + _TWO]) + (shift[k + _TWO] - z0))
    squared = dx * dx + dy * dy + dz * dz
    if squared < _ONCE - _BENT - _BENT:
        return False
    f = taut - taut / np.sqrt(squared)
    if f < np.float32(0.0):
        f *= max(np.float32(0.0), _ONCE + f / _BENT)
    dx *= f
    dy *= f
    dz *= f
    a, b, c = strain[2], strain[3], strain[4]
    shift[i] = x0 - a * dx
    shift[i + _ONE] = y0 - a * dy
    shift[i + _TWO] = z0 - a * dz
    shift[j] -= b * dx
    shift[j + _ONE] -= b * dy
    shift[j + _TWO] -= b * dz
    shift[k] -= c * dx
    shift[k + _ONE] -= c * dy
    shift[k + _TWO] -= c * dz
    return True
