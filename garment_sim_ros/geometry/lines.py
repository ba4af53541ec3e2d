"""Lines on a surface: open edges and seams, which a surface that is meshed anew keeps."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.geometry.triangles import unit_vectors

_SHARP = 0.7
"""Where a line turns by an angle of a smaller cosine it has a corner."""
_AT_ONCE = 256
"""Points whose distances to all segments are held at once."""

Project = Callable[[FloatArray], FloatArray]
"""Moves points [n, 3] onto a surface or a line."""


class Lines(NamedTuple):
    """Edges of a surface that its remeshed one keeps.

    Attributes:
        edges: Ends of the edges, boundaries among them, shape [f, 2].
        corner: Vertices that stay where they are, shape [v].
        project: Moves points of lines onto them.
    """

    edges: IntArray
    corner: NDArray[np.bool_]
    project: Project


def lines_of(x: FloatArray, triangles: IntArray, seams: IntArray) -> Lines:
    """Open edges and seams of a surface, and where they turn or meet.

    Args:
        x: Its vertices [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        seams: Other edges to be kept, lower vertex first, shape [s, 2].
    """
    edges, _, sides = edge_table(triangles)
    lines = np.unique(np.concatenate([edges[sides == 1], seams]), axis=0)
    ends = np.concatenate([lines, lines[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    here, first, size = np.unique(ends[:, 0], return_index=True, return_counts=True)
    corner = np.zeros(len(x), dtype=bool)
    corner[here[size != 2]] = True
    two, at = here[size == 2], first[size == 2]
    unit = [unit_vectors(x[ends[at + k, 1]] - x[two]) for k in (0, 1)]
    corner[two[-np.einsum("ni,ni->n", *unit) < _SHARP]] = True
    start, along = x[lines[:, 0]], x[lines[:, 1]] - x[lines[:, 0]]
    return Lines(lines.astype(np.int32), corner, lambda p: on_segments(p, start, along))


def on_segments(points: FloatArray, start: FloatArray, along: FloatArray) -> FloatArray:
    """The nearest points of segments to points [n, 3], which start and run so, shape [s, 3].

    Where there are no segments points stay where they are.
    """
    if not len(start):
        return points.copy()
    squared = np.maximum(np.einsum("si,si->s", along, along), 1e-300)
    nearest = np.empty_like(points)
    for k in range(0, len(points), _AT_ONCE):
        p = points[k : k + _AT_ONCE, None]
        share = np.clip(np.einsum("nsi,si->ns", p - start, along) / squared, 0.0, 1.0)
        there = start + share[..., None] * along
        chosen = np.argmin(((p - there) ** 2).sum(axis=2), axis=1)
        nearest[k : k + _AT_ONCE] = there[np.arange(len(chosen)), chosen]
    return nearest
