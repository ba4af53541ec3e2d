"""Distances of a block of particles to one shape at a time, several particles at once.

What is not an exact distance here is a lower bound of it. These passes tell which particles need a
closer look, and which shape is the deepest; of hulls also which face, so that nothing is asked
twice. Of other shapes positions come from `contact.distance`.

The scratch array of a block is flat, `BLOCK` numbers for each quantity: with offsets that are
known when the kernel is compiled the loops run without branches, in the processor's vectors.
"""

import numpy as np

from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.jit import lean_kernel

_ONE = np.uint64(1)
_TWO = np.uint64(2)
_THREE = np.uint64(3)

X, Y, Z = 0, BLOCK, 2 * BLOCK
"""Offsets: positions [m]."""
NEAREST, NEXT, WHICH = 3 * BLOCK, 4 * BLOCK, 5 * BLOCK
"""Distance to the nearest and the next shape under the cloth [m], and which the nearest is."""
OUTER = 6 * BLOCK
"""Distance to the nearest of all other shapes [m]."""
U, V, W = 7 * BLOCK, 8 * BLOCK, 9 * BLOCK
"""Positions in the frame of the hull or grid at hand [m]."""
DISTANCE = 10 * BLOCK
"""Distance to the shape at hand [m]."""
PLANE, FIRM = 11 * BLOCK, 12 * BLOCK
"""If the nearest shape is a hull: its plane, and how far along it that stays the nearest [m].
Numbers of planes are exact in single precision up to a quarter of a gigabyte of them."""
PLANE_HERE, FIRM_HERE = 13 * BLOCK, 14 * BLOCK
"""The same of the hull at hand."""
ROWS = 15
ROW_DISTANCE = np.uint64(DISTANCE)
ROW_PLANE, ROW_FIRM = np.uint64(PLANE_HERE), np.uint64(FIRM_HERE)
ROW_U, ROW_V, ROW_W = np.uint64(U), np.uint64(V), np.uint64(W)


@lean_kernel(inner=True)
def load_block(x, begin, end, block):
    """Copies positions of particles begin to end - 1; repeats the last one up to `BLOCK`.

    Args:
        x: Positions, flat [m], shape [3 n].
        begin: First particle.
        end: One after the last.
        block: Scratch, filled.

    Returns:
        Their box: lowest and highest x, y and z.
    """
    if end - begin == BLOCK:
        for p in range(BLOCK):
            block[X + p] = x[3 * (begin + p)]
            block[Y + p] = x[3 * (begin + p) + 1]
            block[Z + p] = x[3 * (begin + p) + 2]
    else:
        for p in range(BLOCK):
            q = 3 * min(begin + p, end - 1)
            block[X + p] = x[q]
            block[Y + p] = x[q + 1]
            block[Z + p] = x[q + 2]
    for p in range(BLOCK):
        block[NEAREST + p] = np.float32(np.inf)
        block[NEXT + p] = np.float32(np.inf)
        block[OUTER + p] = np.float32(np.inf)
        block[WHICH + p] = np.float32(-1.0)
    x0, x1 = _extremes(block, X + BLOCK)
    y0, y1 = _extremes(block, Y + BLOCK)
    z0, z1 = _extremes(block, Z + BLOCK)
    return x0, y0, z0, x1, y1, z1


@lean_kernel(inner=True)
def lower(a, b):
    """The lesser; a comparison, which the processor's vectors have, and `min` is not."""
    return a if a < b else b


@lean_kernel(inner=True)
def higher(a, b):
    """The greater; see `lower`."""
    return a if a > b else b


@lean_kernel(inner=True)
def _extremes(numbers, end):
    """Lowest and highest of a block of numbers, in four chains at once."""
    begin = end - BLOCK
    at = np.uint64(begin)
    a0 = a1 = numbers[at]
    b0 = b1 = numbers[at + _ONE]
    c0 = c1 = numbers[at + _TWO]
    d0 = d1 = numbers[at + _THREE]
    for p in range(begin + 4, end, 4):
        at = np.uint64(p)
        a0 = lower(a0, numbers[at])
        a1 = higher(a1, numbers[at])
        b0 = lower(b0, numbers[at + _ONE])
        b1 = higher(b1, numbers[at + _ONE])
        c0 = lower(c0, numbers[at + _TWO])
        c1 = higher(c1, numbers[at + _TWO])
        d0 = lower(d0, numbers[at + _THREE])
        d1 = higher(d1, numbers[at + _THREE])
    return lower(lower(a0, b0), lower(c0, d0)), higher(higher(a1, b1), higher(c1, d1))


@lean_kernel(inner=True)
def keep_nearest(k, block):
    """Notes the distances to shape k, which is under all of a block."""
    which = np.float32(k)
    for p in range(BLOCK):
        d = block[DISTANCE + p]
        n = block[NEAREST + p]
        closer = d < n
        other = n if closer else d
        block[NEXT + p] = min(block[NEXT + p], other)
        block[NEAREST + p] = d if closer else n
        block[WHICH + p] = which if closer else block[WHICH + p]
        block[PLANE + p] = block[PLANE_HERE + p] if closer else block[PLANE + p]
        block[FIRM + p] = block[FIRM_HERE + p] if closer else block[FIRM + p]


@lean_kernel(inner=True)
def keep_nearest_by_side(k, side, begin, block):
    """Notes the distances to shape k, which is under some particles of a block only."""
    which = np.float32(k)
    far = np.float32(np.inf)
    last = side.shape[1] - 1 - begin
    for p in range(BLOCK):
        d = block[DISTANCE + p]
        under = side[k, begin + min(p, last)] == 0
        outer = far if under else d
        d = d if under else far
        n = block[NEAREST + p]
        closer = d < n
        other = n if closer else d
        block[OUTER + p] = min(block[OUTER + p], outer)
        block[NEXT + p] = min(block[NEXT + p], other)
        block[NEAREST + p] = d if closer else n
        block[WHICH + p] = which if closer else block[WHICH + p]
        block[PLANE + p] = block[PLANE_HERE + p] if closer else block[PLANE + p]
        block[FIRM + p] = block[FIRM_HERE + p] if closer else block[FIRM + p]
