"""Lengths of edges by curvature: short where a surface or one of its lines bends.

As Dunyach et al. 2013, "Adaptive Remeshing for Real-Time Mesh Deformation", section 3, have it:
the middle of an even triangle with edges L on a surface of curvature k is L^2 k / 6 off it, that
of an edge of a line L^2 k / 8. The curvature is that of Cohen-Steiner and Morvan 2003, "Restricted
Delaunay triangulations and normal cycle": dihedral angles, summed over the surroundings.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.connectivity import links
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.geometry.triangles import unit_vectors, vertex_areas

_TRIANGLE, _CHORD = 6.0, 8.0
_GRADING = 0.5
"""How much longer edges may be than others, for each metre between them [m/m]."""


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """What edges shall be like.

    Attributes:
        longest: Where the surface is flat [m].
        shortest: Where it bends most [m]; as long as `longest`: all edges are alike.
        deviation: How far the middles of triangles and edges may be from surface and lines, where
            `shortest` lets them [m].

    Raises:
        ParameterError: The shortest are longer than the longest.
    """

    longest: float
    shortest: float
    deviation: float

    @classmethod
    def even(cls, length: float) -> "Sizes":
        """The same length everywhere [m]."""
        return cls(longest=length, shortest=length, deviation=length)

    def __post_init__(self) -> None:
        if not self.shortest <= self.longest:
            raise ParameterError(
                "shortest_edge",
                f"found {self.shortest:g} m",
                f"allowed: up to edge_length, which is {self.longest:g} m",
            )


def edge_sizes(
    vertices: FloatArray, triangles: IntArray, lines: IntArray, sizes: Sizes
) -> FloatArray:
    """Length that edges shall have at each vertex of a surface [m], shape [v].

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices of a manifold, shape [t, 3].
        lines: Edges of its lines, shape [l, 2].
        sizes: The longest and shortest, and how far triangles may be from the surface.
    """
    edges = edge_table(triangles)[0]
    apart = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    # What is smaller than the shortest edges cannot be followed: it is averaged.
    rings = max(1, int(np.ceil(sizes.shortest / np.median(apart))))
    bend = np.maximum(
        surface_curvature(vertices, triangles, rings) / _TRIANGLE,
        line_curvature(vertices, lines, rings) / _CHORD,
    )
    wanted = np.sqrt(sizes.deviation / np.maximum(bend, 1e-12))
    wanted = np.clip(wanted, sizes.shortest, sizes.longest)
    while True:
        before = wanted.copy()
        for a, b in (edges.T, edges.T[::-1]):
            np.minimum.at(wanted, a, before[b] + _GRADING * apart)
        if np.array_equal(wanted, before):
            return wanted


def surface_curvature(vertices: FloatArray, triangles: IntArray, rings: int) -> FloatArray:
    """Larger principal curvature at each vertex, without its sign [1/m], shape [v].

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Shape [t, 3], wound alike.
        rings: How many edges around a vertex count.
    """
    edges, side_edge, count = edge_table(triangles)
    side = np.argsort(side_edge.ravel(), kind="stable")
    first = (np.cumsum(count) - count)[count == 2]
    s, inner = side[first], edges[count == 2]
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    normal = unit_vectors(np.cross(b - a, c - a))
    left, right = normal[s // 3], normal[side[first + 1] // 3]
    along = vertices[inner[:, 1]] - vertices[inner[:, 0]]
    length = np.linalg.norm(along, axis=1)
    along = unit_vectors(along)
    # Positive where the surface bends outwards, whichever of the two triangles comes first.
    sense = np.where(triangles.ravel()[s] == inner[:, 0], 1.0, -1.0)
    turn = sense * np.einsum("ei,ei->e", np.cross(left, right), along)
    angle = np.arctan2(turn, np.einsum("ei,ei->e", left, right))
    tensor = (angle * length)[:, None, None] * (along[:, :, None] * along[:, None, :])
    n = len(vertices)
    halves = _halves(tensor.reshape(-1, 9), inner, n)
    mean = _averaged(halves, vertex_areas(vertices, triangles), edges, rings)
    return np.abs(np.linalg.eigvalsh(mean.reshape(n, 3, 3))).max(axis=1)


def line_curvature(vertices: FloatArray, lines: IntArray, rings: int) -> FloatArray:
    """Curvature of lines at each vertex, 0 beside them [1/m], shape [v].

    Args:
        vertices: Positions [m], shape [v, 3].
        lines: Their edges, shape [l, 2]; a line bends where just two of them meet.
        rings: How many edges along the line count.
    """
    n = len(vertices)
    ends = np.concatenate([lines, lines[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    here, first, size = np.unique(ends[:, 0], return_index=True, return_counts=True)
    here, first = here[size == 2], first[size == 2]
    p, q = (vertices[ends[first + k, 1]] - vertices[here] for k in (0, 1))
    turn = np.zeros((n, 1))
    turn[here, 0] = np.arctan2(
        np.linalg.norm(np.cross(p, q), axis=1), -np.einsum("ni,ni->n", p, q)
    )
    length = np.linalg.norm(vertices[lines[:, 0]] - vertices[lines[:, 1]], axis=1)
    weight = _halves(length[:, None], lines, n)[:, 0]
    return _averaged(turn, weight, lines, rings)[:, 0]


def _halves(values: FloatArray, edges: IntArray, count: int) -> FloatArray:
    """Half of the values of edges [e, k] at each of their ends, shape [v, k]."""
    result = np.zeros((count, values.shape[1]))
    np.add.at(result, edges, 0.5 * values[:, None, :])
    return result


def _averaged(values: FloatArray, weight: FloatArray, edges: IntArray, rings: int) -> FloatArray:
    """Sums of values [v, k] over sums of weights [v], so many edges around each vertex."""
    n = len(values)
    near = links(edges, np.ones(len(edges)), n) + sp.identity(n, format="csr")
    for _ in range(rings):
        values, weight = near @ values, near @ weight
    mean: FloatArray = values / np.maximum(weight, 1e-300)[:, None]
    return mean
