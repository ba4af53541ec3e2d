"""What a sewn garment has to be before it is called done: figures beside their limits."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.pierced import PiercedSoFar
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.garment.patterns.ironing import self_intersections
from garment_sim_ros.garment.patterns.sewing import Sewn
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.sim.rest_shape import edge_lengths, upright

LIMITS: Mapping[str, tuple[float, str]] = {
    "penetration_mm_p99": (1.0, "depth in the skin, 99th percentile"),
    "pierced": (0.0, "body parts that run through it"),
    "self_intersections": (0.0, "edges that run through its own triangles"),
    "seam_gap_mm": (0.5, "largest gap of a seam before it was joined"),
    "stretch_p95": (0.03, "excess length of edges, 95th percentile"),
    "speed_mm_s": (10.0, "RMS speed, the highest over half a second"),
}
"""Figures, what they may be at most, and what they are."""


@dataclass(frozen=True, kw_only=True)
class Gates:
    """Figures of a garment, by the names in `LIMITS`.

    Attributes:
        figures: The figures.
        pierced_by: Bones that run through it.
        taut: Where it is stretched most, in words.
    """

    figures: Mapping[str, float]
    pierced_by: tuple[str, ...] = ()
    taut: str = ""

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of figures beyond their limits."""
        return tuple(n for n, v in self.figures.items() if not v <= LIMITS[n][0])

    def lines(self) -> list[str]:
        """One line of text for each figure."""
        more = {"pierced": ", ".join(self.pierced_by), "stretch_p95": self.taut}
        return [
            f"{'FAIL' if n in self.failed else 'ok  '} {n} {v:.4g} (at most {LIMITS[n][0]:g}): "
            f"{LIMITS[n][1]}" + (f": {more[n]}" if n in self.failed and more.get(n) else "")
            for n, v in self.figures.items()
        ]


def gates(
    sewn: Sewn,
    skin: FloatArray,
    skin_triangles: IntArray,
    colliders: ColliderSet,
    poses: ColliderPoses,
) -> Gates:
    """Measures a sewn garment.

    Args:
        sewn: The garment.
        skin: The body's skin [m], shape [v, 3].
        skin_triangles: Shape [t, 3].
        colliders: What it lies on.
        poses: Where they are.
    """
    x, t = sewn.vertices, sewn.triangles
    edges = mesh_topology(t).edges
    limbs = PiercedSoFar(colliders, ["sewn"])
    limbs.add(poses, {"sewn": (x, t)})
    through = limbs.now["sewn"]
    stretch = strains(sewn, edges)
    return Gates(
        figures={
            "penetration_mm_p99": depth_mm(x, t, skin, skin_triangles),
            "pierced": float(len(through)),
            "self_intersections": float(len(self_intersections(x, t))),
            "seam_gap_mm": 1e3 * max(sewn.gaps, default=0.0),
            "stretch_p95": float(np.percentile(stretch, 95.0)),
            "speed_mm_s": 1e3 * sewn.rms_speed,
        },
        pierced_by=through,
    )


def of_mesh(x: FloatArray, t: IntArray, skin: FloatArray, skin_triangles: IntArray) -> Gates:
    """What can be measured of a garment that is not sewn; arguments as for `depth_mm`."""
    return Gates(
        figures={
            "penetration_mm_p99": depth_mm(x, t, skin, skin_triangles),
            "self_intersections": float(len(self_intersections(x, t))),
        }
    )


def depth_mm(x: FloatArray, t: IntArray, skin: FloatArray, skin_triangles: IntArray) -> float:
    """Depth of vertices and middles of edges and triangles, 99th percentile [mm].

    Args:
        x: Vertices of a garment [m], shape [v, 3].
        t: Its triangles, shape [t, 3].
        skin: The body's skin [m], shape [s, 3].
        skin_triangles: Shape [u, 3].
    """
    edges = mesh_topology(t).edges
    samples = np.concatenate([x, x[edges].mean(axis=1), x[t].mean(axis=1)])
    depth = -MeshDistance(skin, skin_triangles).signed_distance(samples)[0]
    return max(0.0, 1e3 * float(np.percentile(depth, 99.0)))


def strains(sewn: Sewn, edges: IntArray) -> FloatArray:
    """Excess length of edges over their rest length, shape [e]."""
    x = sewn.vertices
    rest = edge_lengths(upright(sewn.flat, len(sewn.flat), "sewn"), sewn.triangles, edges)
    strain: FloatArray = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) / rest - 1.0
    return strain
