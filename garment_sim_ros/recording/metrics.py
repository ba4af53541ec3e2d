"""How good a dressed body looks, measured against its posed skin.

Penetration and gap are signed distances to the true skin, not to the colliders that the cloth
was simulated against; penetration is taken at particles, edge midpoints and triangle centres,
since cloth may cut through skin between its particles. Cloth outside of the skin, but on the
wrong side of a part that it is worn over, penetrates by its distance (see `own_sides`). `inside`
is the share of a garment's area that is deeper than 2 mm in the skin: percentiles of the depth
cannot see a patch of half a percent. `crossed` is the share of a garment's edges that run through
another garment: one that shows through the one worn over it. `creased` is the share of its edges
at which two triangles turn by over 90 degrees: cloth that is bunched more finely than its mesh can
show looks torn there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.geometry.locality import near_together
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import hinge_vertices, mesh_topology, vertex_normals
from garment_sim_ros.geometry.triangles import triangle_areas
from garment_sim_ros.recording.own_sides import OwnSides
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.rest_shape import edge_lengths, rest_corners

DEEP = 0.002
"""Depth in the skin from which on cloth counts as inside [m]."""


@dataclass(frozen=True, kw_only=True)
class GarmentMesh:
    """What is measured on one garment.

    Attributes:
        vertices: Number of vertices.
        triangles: Vertex indices, shape [t, 3].
        edges: Vertex indices, shape [e, 2].
        rest_length: Lengths of the edges at rest [m], shape [e].
        rest_area: Areas of the triangles at rest [m^2], shape [t].
        samples_of_triangle: Which `samples` lie on each triangle, shape [t, 7].
        near: The triangles in an order in which those in a row are near each other, shape [t, 3].
        hinges: Pairs of triangles at an edge: its ends, then the other corners, shape [h, 4].
    """

    vertices: int
    triangles: IntArray
    edges: IntArray
    rest_length: FloatArray
    rest_area: FloatArray
    samples_of_triangle: IntArray
    near: IntArray
    hinges: IntArray

    @classmethod
    def from_rest(cls, vertices: FloatArray, triangles: IntArray) -> "GarmentMesh":
        """Of cloth that is at rest in its vertices, shape [v, 3]; triangles of shape [t, 3]."""
        edges = mesh_topology(triangles).edges
        v, e = len(vertices), len(edges)
        number = {(min(i, j), max(i, j)): k for k, (i, j) in enumerate(edges.tolist())}
        sides = [
            [number[min(i, j), max(i, j)] for i, j in ((a, b), (b, c), (c, a))]
            for a, b, c in triangles.tolist()
        ]
        side = np.array(sides, np.int32).reshape(-1, 3)
        middle = np.arange(len(triangles), dtype=np.int32)[:, None]
        return cls(
            vertices=v,
            triangles=triangles,
            edges=edges,
            rest_length=_lengths(vertices, edges),
            rest_area=triangle_areas(vertices, triangles),
            samples_of_triangle=np.concatenate([triangles, v + side, v + e + middle], axis=1),
            near=near_together(vertices, triangles),
            hinges=hinge_vertices(triangles),
        )

    @classmethod
    def of(cls, garment: GarmentLike) -> "GarmentMesh":
        """Of a garment, which may be cut flat, or at rest elsewhere than where it is put on."""
        mesh = cls.from_rest(garment.vertices, garment.triangles)
        corners = rest_corners(garment)
        t = len(corners)
        return replace(
            mesh,
            rest_length=edge_lengths(corners, garment.triangles, mesh.edges),
            rest_area=triangle_areas(
                corners.reshape(-1, 3), np.arange(3 * t, dtype=np.int32).reshape(t, 3)
            ),
        )

    def samples(self, x: FloatArray) -> FloatArray:
        """Particles, edge midpoints and triangle centres [m], shape [v + e + t, 3]."""
        return np.concatenate([x, x[self.edges].mean(axis=1), x[self.triangles].mean(axis=1)])

    def normals(self, x: FloatArray) -> FloatArray:
        """Outward unit normals at the `samples`, shape [v + e + t, 3]."""
        x = np.ascontiguousarray(x, np.float64)
        normal = np.empty_like(x)
        vertex_normals(x, self.triangles, normal)
        rows = [normal, normal[self.edges].sum(axis=1), normal[self.triangles].sum(axis=1)]
        every = np.concatenate(rows)
        length = np.linalg.norm(every, axis=1, keepdims=True)
        return np.asarray(every / np.maximum(length, 1e-300))

    def inside(self, distance: FloatArray, depth: float = DEEP) -> float:
        """Share of the area at rest that is so deep in the skin, by the samples' distances [m]."""
        deep = (distance < -depth)[self.samples_of_triangle].mean(axis=1)
        return float(deep @ self.rest_area / self.rest_area.sum())

    def strain(self, x: FloatArray) -> FloatArray:
        """Extension of the edges, as a fraction of their rest length, shape [e]."""
        return _lengths(x, self.edges) / self.rest_length - 1.0

    def creased(self, x: FloatArray) -> float:
        """Share of the edges between two triangles at which these turn by over 90 degrees."""
        a, b, c, d = np.moveaxis(x[self.hinges], 1, 0)
        turn = np.einsum("hi,hi->h", np.cross(b - a, c - a), np.cross(d - a, b - a))
        return float(np.mean(turn < 0.0)) if len(turn) else 0.0


class ClothMeter:
    """Collects measures over frames.

    Args:
        skin_vertices: Skin in any pose [m], shape [v, 3].
        skin_triangles: Shape [t, 3].
        garments: By name.
        own_sides: Which skin they are worn over; None: not looked at.
    """

    def __init__(
        self,
        skin_vertices: FloatArray,
        skin_triangles: IntArray,
        garments: Mapping[str, GarmentMesh],
        own_sides: OwnSides | None = None,
    ) -> None:
        self._own_sides = own_sides
        self._skin = MeshDistance(skin_vertices, skin_triangles)
        self._garments = garments
        self._penetration: list[NDArray[np.float32]] = []
        self._gap: list[NDArray[np.float32]] = []
        self._strain: list[NDArray[np.float32]] = []
        self._inside: list[float] = []
        self._shows: list[float] = []
        self._crossed: list[float] = []
        self._creased: list[float] = []
        self._finite = True

    def add(self, skin: FloatArray, garments: Mapping[str, FloatArray]) -> None:
        """Measure one frame.

        Args:
            skin: Posed skin vertices [m], shape [v, 3].
            garments: Vertices of each garment at the same instant [m].
        """
        self._skin.refit(skin)
        for name, x in garments.items():
            mesh = self._garments[name]
            if not np.isfinite(x).all():
                self._finite = False
                continue
            samples = mesh.samples(x)
            distance, closest, triangle = self._skin.signed_distance(samples)
            self._inside.append(mesh.inside(distance))
            self._shows.append(mesh.inside(distance, 0.0))
            depth = np.maximum(-distance, 0.0)
            if self._own_sides is not None:
                way = np.stack([closest, samples], axis=1)
                behind = (distance > 0.0) & self._own_sides.behind(
                    *(name, (x, mesh.triangles), mesh.normals(x), way, triangle, skin)
                )
                depth[behind] = distance[behind]
            self._penetration.append(depth.astype(np.float32))
            self._gap.append(distance[: len(x)].astype(np.float32))
            self._strain.append(mesh.strain(x).astype(np.float32))
            self._creased.append(mesh.creased(x))
            for other, y in garments.items():
                if other != name and np.isfinite(y).all():
                    self._crossed.append(crossed(mesh, x, self._garments[other], y))

    def result(self) -> dict[str, float | bool | None]:
        """Figures over all frames; None where there was nothing to measure."""
        return {
            "penetration_mm_p99": _statistic(self._penetration, 99.0, 1e3),
            "penetration_mm_max": _statistic(self._penetration, 100.0, 1e3),
            "inside_p99": _statistic([np.array(self._inside, np.float32)], 99.0, 1.0),
            "inside_median": _statistic([np.array(self._inside, np.float32)], 50.0, 1.0),
            "skin_shows_p99": _statistic([np.array(self._shows, np.float32)], 99.0, 1.0),
            "crossed_p99": _statistic([np.array(self._crossed, np.float32)], 99.0, 1.0),
            "creased_p99": _statistic([np.array(self._creased, np.float32)], 99.0, 1.0),
            "gap_mm_median": _statistic(self._gap, 50.0, 1e3),
            "strain_p95": _statistic(self._strain, 95.0, 1.0),
            "strain_max": _statistic(self._strain, 100.0, 1.0),
            "finite": self._finite,
        }


def crossed(mesh: GarmentMesh, x: FloatArray, other: GarmentMesh, y: FloatArray) -> float:
    """Share of a garment's edges that run through another garment."""
    # Garments meet in a small part of each: the rest need not be looked at.
    ends = x[mesh.edges]
    ends = ends[_meets(ends, y)]
    triangles = other.near[_meets(y[other.near], ends.reshape(-1, 3))]
    edge, at = np.empty(len(ends), np.int32), np.empty(len(ends))
    count = find_hits(ends, y, triangles, edge, at)
    while count > len(edge):  # one edge may run through many triangles
        edge, at = np.empty(count, np.int32), np.empty(count)
        find_hits(ends, y, triangles, edge, at)
    return len(np.unique(edge[:count])) / max(len(mesh.edges), 1)


def _meets(simplices: FloatArray, points: FloatArray) -> NDArray[np.bool_]:
    """Which simplices, shape [n, k, 3], have a box that meets that of points, shape [m, 3]."""
    if not len(points):
        return np.zeros(len(simplices), bool)
    low, high = points.min(axis=0), points.max(axis=0)
    beyond = (simplices.max(axis=1) < low) | (simplices.min(axis=1) > high)
    return ~beyond.any(axis=1)


def _statistic(parts: Sequence[NDArray[np.float32]], percent: float, scale: float) -> float | None:
    values = np.concatenate(parts) if parts else np.zeros(0)
    if not len(values):
        return None
    return round(scale * float(np.percentile(values, percent)), 4)


def _lengths(x: FloatArray, edges: IntArray) -> FloatArray:
    return np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)


def rate(times: NDArray[np.floating]) -> float:
    """Frames per second from first to last."""
    span = float(times[-1] - times[0]) if len(times) > 1 else 0.0
    return (len(times) - 1) / span if span > 0.0 else 0.0
