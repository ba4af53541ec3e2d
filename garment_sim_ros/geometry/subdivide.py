"""Refining a triangle mesh to a wanted edge length without moving its vertices."""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import edge_table

MAX_TRIANGLES = 500_000
"""Largest mesh that refinement may make."""


def subdivided(
    vertices: FloatArray, triangles: IntArray, edge_length: float
) -> tuple[FloatArray, IntArray]:
    """The mesh with edges halved until none is longer than 4/3 `edge_length`.

    From 4/3 on, halves are nearer to the wanted length than the whole. Both triangles of an edge
    are split at its middle, so a manifold stays one. Old vertices keep their numbers, new ones
    follow.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        edge_length: Edge length wanted [m].

    Raises:
        GeometryError: The result would have over `MAX_TRIANGLES` triangles.
    """
    while True:
        edges, side_edge, _ = edge_table(triangles)
        length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
        long = length > 4.0 / 3.0 * edge_length
        if not long.any():
            return vertices, triangles
        if len(triangles) + 2 * long.sum() > MAX_TRIANGLES:
            raise GeometryError(
                f"edges of {edge_length:g} m need over {MAX_TRIANGLES} triangles; "
                "allowed: a longer edge"
            )
        vertices, triangles = split_edges(vertices, triangles, long, edges, side_edge)


def split_edges(
    vertices: FloatArray,
    triangles: IntArray,
    chosen: NDArray[np.bool_],
    edges: IntArray,
    side_edge: IntArray,
) -> tuple[FloatArray, IntArray]:
    """The mesh with the chosen edges cut at their middles.

    Args:
        vertices: Positions, shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        chosen: Edges to cut, shape [e].
        edges: Vertices of the edges, shape [e, 2].
        side_edge: Edge of each triangle side, shape [t, 3].
    """
    middle = np.full(len(edges), -1)
    middle[chosen] = len(vertices) + np.arange(chosen.sum())
    vertices = np.concatenate([vertices, vertices[edges[chosen]].mean(axis=1)])
    return vertices, _split(vertices, triangles, middle[side_edge])


def _split(vertices: FloatArray, triangles: IntArray, middle: IntArray) -> IntArray:
    """Triangles cut at the middles of their sides (-1 where a side stays), shape [t, 3] each."""
    pieces = [triangles[(middle < 0).all(axis=1)]]
    count = (middle >= 0).sum(axis=1)
    one, two, three = count == 1, count == 2, count == 3
    # Turned so that the only cut side comes first, or the only whole side last.
    first = np.where(one, np.argmax(middle >= 0, axis=1), (np.argmin(middle, axis=1) + 1) % 3)
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middle, turn, axis=1).T

    def add(mask: NDArray[np.bool_], *corners: IntArray) -> None:
        pieces.append(np.stack(corners, axis=1)[mask].astype(np.int32))

    add(one, a, ab, c)
    add(one, ab, b, c)
    add(two, ab, b, bc)
    x = vertices
    shorter = np.linalg.norm(x[a] - x[bc], axis=1) <= np.linalg.norm(x[ab] - x[c], axis=1)
    add(two & shorter, a, ab, bc)
    add(two & shorter, a, bc, c)
    add(two & ~shorter, a, ab, c)
    add(two & ~shorter, ab, bc, c)
    add(three, a, ab, ca)
    add(three, ab, b, bc)
    add(three, bc, c, ca)
    add(three, ab, bc, ca)
    return np.concatenate(pieces)
