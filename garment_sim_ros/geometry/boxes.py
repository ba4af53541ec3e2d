"""Which of many boxes come near one of them, four at a time."""

import numpy as np

from garment_sim_ros.geometry.four import any_above, each_number, four_at, higher_four, same_four
from garment_sim_ros.jit import lean_kernel

_THREE, _FOUR, _FIVE = np.uint64(3), np.uint64(4), np.uint64(5)
_TINY = 1e-30
"""Boxes that are apart by less touch [m]."""


@lean_kernel(inner=True)
def in_columns(box, columns):
    """Writes boxes [m, 6] number by number, so that four are looked at at once; pads them.

    Args:
        box: The boxes, low and high corners [m], shape [m, 6].
        columns: Output, flat, room for six columns of `column_of` numbers each.
    """
    width = columns.size // 6
    for d in range(6):
        for k in range(width):
            inside = k < box.shape[0]
            columns[d * width + k] = box[k, d] if inside else np.float32(np.inf)


def column_of(boxes: int) -> int:
    """Numbers in each column of `in_columns`."""
    return -(-boxes // 4) * 4


@lean_kernel(inner=True)
def boxes_near(columns, low_x, low_y, low_z, high_x, high_y, high_z, reach, found):
    """Finds the boxes that are at most `reach` away from a box, along every axis.

    Args:
        columns: The boxes, see `in_columns`.
        low_x: Lowest corner of the box [m].
        low_y: See `low_x`.
        low_z: See `low_x`.
        high_x: Highest corner of the box [m].
        high_y: See `high_x`.
        high_z: See `high_x`.
        reach: How far away they may be [m].
        found: Output, room for all boxes and one more.

    Returns:
        Number of boxes found.
    """
    width = np.uint64(columns.size // 6)
    two, three, four, five = width + width, _THREE * width, _FOUR * width, _FIVE * width
    lx, ly, lz = same_four(low_x - reach), same_four(low_y - reach), same_four(low_z - reach)
    hx, hy, hz = same_four(high_x + reach), same_four(high_y + reach), same_four(high_z + reach)
    zero, touching = np.float32(0.0), same_four(np.float32(_TINY))
    n = 0
    for first in range(0, width, 4):
        k = np.uint64(first)
        x = higher_four(four_at(columns, k) - hx, lx - four_at(columns, k + three))
        y = higher_four(four_at(columns, k + width) - hy, ly - four_at(columns, k + four))
        z = higher_four(four_at(columns, k + two) - hz, lz - four_at(columns, k + five))
        apart = higher_four(higher_four(x, y), z)
        if not any_above(touching, apart):
            continue
        a, b, c, d = each_number(apart)
        found[n] = first
        n += 1 if a <= zero else 0
        found[n] = first + 1
        n += 1 if b <= zero else 0
        found[n] = first + 2
        n += 1 if c <= zero else 0
        found[n] = first + 3
        n += 1 if d <= zero else 0
    return n
