"""Nested dissection: an order in which a mesh's matrix is factored with little fill.

A set of vertices is halved across its longest side; the vertices of one half that touch the other
are its separator, which is eliminated after both halves (George 1973). Each separator, and each
set too small to halve, is one front: a dense block of columns with the same rows below it (Duff &
Reid 1983, "The multifrontal solution of indefinite sparse symmetric linear equations").
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, LongArray

_LEAF = 28
"""Sets of so many vertices are not halved."""
PAD = 32
"""Columns of a factor are so long or a multiple: whole vectors, no remainders."""


class Fronts(NamedTuple):
    """What numerical factorisation needs to know of a matrix, in the order of elimination.

    Front s has the columns ``first[s]..first[s + 1]`` and, below them, the rows
    ``rows[row_start[s]..row_start[s + 1]]``, ascending.

    Attributes:
        place: Where each vertex is in the order of elimination, shape [n].
        first: Shape [fronts + 1].
        row_start: Shape [fronts + 1].
        rows: Shape [sum of rows].
        factor_start: Where each front's part of the factor starts, shape [fronts + 1].
        update_start: Where what it adds to its parent starts, shape [fronts + 1].
        parent: The front that takes it, -1 for none, shape [fronts].
        child_start: Where each front's children start, shape [fronts + 1].
        child: Shape [fronts - roots].
        local_start: Where each child's `local` starts, shape [fronts - roots + 1].
        local: Place of a child's rows in its parent's columns and rows.
        entry_start: Where each front's edges start, shape [fronts + 1].
        entry_edge: Edges whose earlier end is a column of the front, shape [m].
        entry_local: Their places in the front as row-major upper triangle, shape [m].
        owner: Front of each column, shape [n].
        widest: Largest number of columns and rows of a front, padded.
    """

    place: LongArray
    first: LongArray
    row_start: LongArray
    rows: LongArray
    factor_start: LongArray
    update_start: LongArray
    parent: LongArray
    child_start: LongArray
    child: LongArray
    local_start: LongArray
    local: LongArray
    entry_start: LongArray
    entry_edge: LongArray
    entry_local: LongArray
    owner: LongArray
    widest: int


class _Front(NamedTuple):
    vertices: list[int]
    children: list[int]


def _starts(counts: list[int]) -> LongArray:
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int64)


def _joined(parts: list[LongArray]) -> LongArray:
    return np.concatenate([np.zeros(0, np.int64), *parts])


def _divide(
    vertices: LongArray, position: FloatArray, neighbours: list[LongArray], fronts: list[_Front]
) -> int:
    """Appends the fronts of a set of vertices, children first; the index of the last."""
    if len(vertices) <= _LEAF:
        fronts.append(_Front(vertices.tolist(), []))
        return len(fronts) - 1
    there = position[vertices]
    order = np.argsort(there[:, np.argmax(np.ptp(there, axis=0))], kind="stable")
    one, other = np.split(vertices[order], [len(vertices) // 2])
    inside = np.zeros(len(position), bool)
    inside[one] = True
    between = np.array([inside[neighbours[v]].any() for v in other])
    children = [
        _divide(half, position, neighbours, fronts) for half in (one, other[~between]) if len(half)
    ]
    fronts.append(_Front(other[between].tolist(), children))
    return len(fronts) - 1


def dissect(position: FloatArray, edges: IntArray) -> Fronts:
    """Order and fronts of the matrix that has an entry for each vertex and each edge.

    Args:
        position: Where vertices are; neighbours should be near each other, shape [n, 3].
        edges: Pairs of vertices, each pair once, shape [m, 2].
    """
    n = len(position)
    both = np.concatenate([edges, edges[:, ::-1]]).astype(np.int64)
    both = both[np.argsort(both[:, 0], kind="stable")]
    neighbours = np.split(both[:, 1], np.searchsorted(both[:, 0], np.arange(1, max(n, 1))))
    fronts: list[_Front] = []
    _divide(np.arange(n), position, neighbours, fronts)

    place = np.empty(n, np.int64)
    place[[v for front in fronts for v in front.vertices]] = np.arange(n)
    first = _starts([len(front.vertices) for front in fronts])
    parent = np.full(len(fronts), -1)
    rows: list[LongArray] = []
    local: list[LongArray] = []
    for s, (vertices, children) in enumerate(fronts):
        below: set[int] = set()
        for v in vertices:
            below.update(place[neighbours[v]].tolist())
        for c in children:
            below.update(rows[c].tolist())
            parent[c] = s
        rows.append(np.array(sorted(r for r in below if r >= first[s + 1]), np.int64))
        columns = np.concatenate([np.arange(first[s], first[s + 1]), rows[s]])
        local += [np.searchsorted(columns, rows[c]) for c in children]

    width = np.diff(first)
    count = np.array([len(r) for r in rows])
    padded = -(-(width + count) // PAD) * PAD
    ends = np.sort(place[edges], axis=1)
    owner = np.repeat(np.arange(len(fronts)), width)
    front = owner[ends[:, 0]]
    order = np.argsort(front, kind="stable")
    entry_local = np.empty(len(edges), np.int64)
    for e in order:
        s, (low, high) = front[e], ends[e]
        inside = high < first[s + 1]
        column = high - first[s] if inside else width[s] + np.searchsorted(rows[s], high)
        entry_local[e] = (low - first[s]) * (width[s] + count[s]) + column
    return Fronts(
        place=place,
        first=first,
        row_start=_starts(count.tolist()),
        rows=_joined(rows),
        factor_start=_starts((width * padded).tolist()),
        update_start=_starts((count**2).tolist()),
        parent=parent,
        child_start=_starts([len(front.children) for front in fronts]),
        child=np.array([c for front in fronts for c in front.children], np.int64),
        local_start=_starts([len(part) for part in local]),
        local=_joined(local),
        entry_start=np.searchsorted(front[order], np.arange(len(fronts) + 1)),
        entry_edge=order,
        entry_local=entry_local[order],
        owner=owner,
        widest=int(padded.max()),
    )
