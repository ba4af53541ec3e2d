"""How well a collider set describes the skin that it was fitted to, in the bind pose.

Distances are those of skin points to the union of all colliders, positive where the skin sticks
out of it. Shares and percentiles are by area.
"""

from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.regions import bone_weights
from garment_sim_ros.colliders.report.fatness import fatness
from garment_sim_ros.colliders.report.motion_report import AT_ALL, range_report
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.transforms import invert_transform, transform_from, transform_points
from garment_sim_ros.geometry.triangles import vertex_areas

_DIRECTIONS = 2000  # on round shapes: flat parts are off by less than 0.1 mm


def fit_report(body: Body, colliders: ColliderSet) -> dict[str, Any]:
    """Figures of a fit, for the whole body and under ``regions`` for each major bone.

    Args:
        body: The body that the colliders were fitted to.
        colliders: The fit.

    Returns:
        ``colliders`` (count by kind), ``outside_share`` (of the skin's area), ``outside_mm_p99``
        and ``outside_mm_max`` (how far skin sticks out), ``inside_mm_median``,
        ``inside_mm_p95`` and ``inside_mm_max`` (how far colliders reach over the skin), and for
        the whole body and each of the ``shapes`` how fat they are (see `fatness`); under
        ``range`` how far skin is outside over the range of the joints (see `range_report`).
    """
    distance = skin_distance(body, colliders)
    area = vertex_areas(body.skin.vertices, body.skin.triangles)
    bones = major_bones(body)
    owner = bone_weights(body.skin, bones).argmax(axis=1)
    kinds = [c.kind for c in colliders.colliders]
    report: dict[str, Any] = {
        "body": body.name,
        "vertices": len(distance),
        "colliders": {kind: kinds.count(kind) for kind in sorted(set(kinds))},
        **_figures(distance, area),
        **fatness(
            colliders,
            ColliderPoser(colliders, body).poses(invert_transform(body.skin.T_bone_bind)),
            body.skin.vertices,
            body.skin.triangles,
        ),
    }
    report["range"] = range_report(body, colliders)
    report["regions"] = {
        name: {
            "vertices": int((owner == m).sum()),
            **_figures(distance[owner == m], area[owner == m]),
        }
        for m, name in enumerate(bones.names)
        if (owner == m).any()
    }
    return report


def skin_distance(body: Body, colliders: ColliderSet) -> FloatArray:
    """Signed distance of every skin vertex to the union of the colliders [m], shape [v].

    Measured on the shapes' meshes, so that it owes nothing to the code that cloth collides with;
    of sampled distances in double precision.
    """
    T_world_bone = np.asarray(np.linalg.inv(body.skin.T_bone_bind), np.float64)
    poses = ColliderPoser(colliders, body).poses(T_world_bone)
    if colliders.has_skin:  # the skin itself
        return np.zeros(len(body.skin.vertices))
    T_world_collider = transform_from(poses.position, poses.orientation)
    distance = np.full(len(body.skin.vertices), np.inf)
    for collider, T in zip(colliders.colliders, T_world_collider):
        if collider.shape is None:
            continue
        if collider.shape.distance is not None:
            local = transform_points(invert_transform(T), body.skin.vertices)
            own = collider.shape.distance(collider.geometry, local)
            distance = np.minimum(distance, own)
        else:
            vertices, triangles = surface(collider, directions=_DIRECTIONS)
            mesh = MeshDistance(transform_points(T, vertices), triangles)
            distance = np.minimum(distance, mesh.signed_distance(body.skin.vertices)[0])
    return distance


def _figures(distance: FloatArray, area: FloatArray) -> dict[str, float]:
    outside, inside = np.maximum(distance, 0.0), np.maximum(-distance, 0.0)
    figures = {
        "outside_share": float(area[distance > AT_ALL].sum() / max(area.sum(), 1e-12)),
        "outside_mm_p99": 1e3 * _percentile(outside, area, 99.0),
        "outside_mm_max": 1e3 * float(outside.max()),
        "inside_mm_median": 1e3 * _percentile(inside, area, 50.0),
        "inside_mm_p95": 1e3 * _percentile(inside, area, 95.0),
        "inside_mm_max": 1e3 * float(inside.max()),
    }
    return {name: round(value, 4) for name, value in figures.items()}


def _percentile(values: FloatArray, weight: FloatArray, percent: float) -> float:
    """The value below which `percent` of the weight lies."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    at = np.searchsorted(total, 0.01 * percent * total[-1])
    return float(values[order[min(at, len(values) - 1)]])
