"""Links between cells of a garment: its coarse level in a sub-step."""

import numpy as np

from garment_sim_ros.geometry.jit import kernel

_ONE = np.uint64(1)
_TWO = np.uint64(2)
_THREE = np.uint64(3)
_ONCE = np.float32(1.0)
_BENT = np.float32(0.002)
"""A link that is shorter by this part is bent and does not push; less so, the more it is."""


@kernel(forceinline=True)
def pull_links(x, moved, apart, coarse):
    """One Gauss-Seidel pass over links; free particles move as their cells do.

    Args:
        x: Positions, flat [m], shape [3 n].
        moved: What is changed in place, flat [m], shape [3 n]: the positions themselves, or what
            is added to them.
        apart: Whether it is the latter.
        coarse: `solvers.coarse.CoarseLevel`.
    """
    if coarse.links.shape[0] == 0:
        return
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
    for m in range(coarse.links.shape[0]):
        i = _THREE * np.uint64(coarse.ends[2 * m])
        j = _THREE * np.uint64(coarse.ends[2 * m + 1])
        dx = (centre[i] - centre[j]) + (shift[i] - shift[j])
        dy = (centre[i + _ONE] - centre[j + _ONE]) + (shift[i + _ONE] - shift[j + _ONE])
        dz = (centre[i + _TWO] - centre[j + _TWO]) + (shift[i + _TWO] - shift[j + _TWO])
        squared = dx * dx + dy * dy + dz * dz
        rest = coarse.links[m, 0]
        if squared > (_ONCE - _BENT - _BENT) * rest * rest:
            f = _ONCE - rest / np.sqrt(squared)
            if f < np.float32(0.0):
                f *= max(np.float32(0.0), _ONCE + f / _BENT)
            a = coarse.links[m, 1] * f
            b = coarse.links[m, 2] * f
            shift[i] -= a * dx
            shift[i + _ONE] -= a * dy
            shift[i + _TWO] -= a * dz
            shift[j] += b * dx
            shift[j + _ONE] += b * dy
            shift[j + _TWO] += b * dz
            pulled = True
    if pulled:
        for p in range(coarse.free):
            i = _THREE * np.uint64(p)
            c = _THREE * np.uint64(coarse.cell[p])
            moved[i] += shift[c]
            moved[i + _ONE] += shift[c + _ONE]
            moved[i + _TWO] += shift[c + _TWO]
