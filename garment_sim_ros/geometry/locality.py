"""Order of points in memory: near in space, near in memory, in compact blocks."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int32]

BLOCK = 32
"""Points per block: contact tests reject colliders for a block at a time."""
PARTS = 8
"""Parts of many points: compact, a power of two, the most threads that can share the work."""
SPLIT_FROM = 5000
"""Fewer points are one part."""


def _middle(begin: int, end: int) -> int:
    """Where a run of points is halved."""
    return begin + -(-(end - begin) // BLOCK) // 2 * BLOCK


def spatial_order(points: NDArray[np.floating]) -> IntArray:
    """An order of the points in which every aligned run of `BLOCK` points is compact.

    Sets of points are halved at the median of their longest extent, at a multiple of `BLOCK`,
    until one block is left. Equal coordinates keep their order.

    Args:
        points: Positions, shape [n, 3].

    Returns:
        Indices into `points`, shape [n].
    """
    points = np.asarray(points, dtype=np.float64)
    order = np.arange(len(points), dtype=np.int32)
    pending = [(0, len(points))]
    while pending:
        begin, end = pending.pop()
        part = order[begin:end]
        if len(part) > 1:
            axis = int(np.argmax(np.ptp(points[part], axis=0)))
            part = part[np.argsort(points[part, axis], kind="stable")]
            order[begin:end] = part
        if len(part) > BLOCK:
            middle = _middle(begin, end)
            pending += [(begin, middle), (middle, end)]
    return order


def part_starts(n: int) -> IntArray:
    """Where each of the parts starts that n points in `spatial_order` are worked on in.

    The same for any number of threads, so that the order of arithmetic is. Every part is one that
    the points were halved into, and so compact.

    Args:
        n: Number of points.

    Returns:
        Starts, 0 to n, shape [parts + 1].
    """
    starts = [0, n]
    while n >= SPLIT_FROM and len(starts) <= PARTS:
        halves = [_middle(begin, end) for begin, end in pairwise(starts)]
        starts = sorted(starts + halves)
    return np.array(starts, dtype=np.int32)


def order_by_part(groups: IntArray, starts: IntArray) -> tuple[IntArray, IntArray]:
    """An order in which groups within one part come part by part, and all others last.

    Groups of different parts share no point that moves: what they do to their points they can do
    at once, with the same result as one after the other.

    Args:
        groups: Points, shape [m, k]. Those from `starts[-1]` on stand still and belong nowhere.
        starts: From `part_starts`, shape [parts + 1].

    Returns:
        Indices into `groups`, else in the given order, shape [m]; where each part starts there,
        and those between parts, shape [parts + 2].
    """
    parts = len(starts) - 1
    part = np.searchsorted(starts, groups, side="right") - 1
    first = part.min(axis=1, initial=parts)
    last = np.where(part < parts, part, -1).max(axis=1, initial=-1)
    part = np.where(first == last, first, parts)
    order = np.argsort(part, kind="stable")
    start = np.searchsorted(part[order], np.arange(parts + 2))
    return order.astype(np.int32), start.astype(np.int32)
