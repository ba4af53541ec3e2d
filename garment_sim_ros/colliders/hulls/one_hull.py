"""One collider of a bone or a joint: a hull that is inflated, simplified and checked.

What has no hull, because it is flat or tiny, becomes a capsule.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders.hulls.hull import (
    Hull,
    clearance,
    inflate_planes,
    inflate_vertices,
)
from garment_sim_ros.colliders.hulls.hull_placement import QUADRIC, VOLUME
from garment_sim_ros.colliders.hulls.hull_simplify import Simplification, simplify_hull
from garment_sim_ros.contact.kinds.capsule import CAPSULE
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.shapes import Collider
from garment_sim_ros.geometry.obb import oriented_box
from garment_sim_ros.geometry.transforms import quaternion_from_matrix, transform_points

_ROUNDING = 1e-9
"""Share by which an un-inflated hull grows."""
_THICK = 3.0
"""A hull with this many times the volume of what it holds is told of."""
_NO_THINNER = 1e-3
"""Radius that a capsule in the place of a flat region has at least [m]."""


@dataclass(frozen=True, kw_only=True)
class ShapeFit:
    """How one collider came about; lengths in metres, volumes in cubic metres.

    Attributes:
        name: The collider's.
        kind: Its kind.
        faces_before: Triangles of the hull before inflation, 0 for other kinds.
        faces: Triangles of the collider, 0 for other kinds.
        volume_before: Volume of the hull before inflation.
        volume: Volume of the collider's hull.
        clearance_min: What the worst face has gained over the un-inflated hull.
        clearance_mean: What faces have gained on average.
        outside: Skin points of its region that are outside it; 0 unless the fit is faulty.
        note: What was done instead of a hull, or about a joint; empty for a plain hull.
    """

    name: str
    kind: str
    faces_before: int = 0
    faces: int = 0
    volume_before: float = 0.0
    volume: float = 0.0
    clearance_min: float = 0.0
    clearance_mean: float = 0.0
    outside: int = 0
    note: str = ""


class Content(NamedTuple):
    """What a hull is made for, in the bind pose.

    Attributes:
        name: The collider's.
        bone: The joint that carries it.
        T_bone_bind: From the bind pose to the joint's frame, shape [4, 4].
        inner: What the collider contains.
        points: Skin points of its own, which `inner` contains [m], shape [n, 3].
        share: Share of the joint's rotation that it takes part in; None for all of it.
        note: About a joint.
    """

    name: str
    bone: str
    T_bone_bind: FloatArray
    inner: Hull
    points: FloatArray
    share: float | None = None
    note: str = ""


class Made(NamedTuple):
    """A collider and how it came about; of a hull also itself and its content."""

    collider: Collider
    shape: ShapeFit
    hull: Hull | None = None
    content: Content | None = None


def made_hull(content: Content, settings: HullSettings) -> Made:
    """The hull around a content."""
    hull = _fitted(content.inner, content.points, settings)
    note = content.note or _remark(content.inner, hull, settings)
    return Made(
        _collider(content, hull),
        _figures(content, hull, note),
        hull,
        content,
    )


def capsule_around(
    name: str, bone: str, points: FloatArray, delta: float, T_bone_bind: FloatArray
) -> Collider:
    """A capsule that contains points which have no hull, along their longest axis."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    _, _, axes = np.linalg.svd(points - middle)
    z = axes[0]
    along = (points - middle) @ z
    across = np.linalg.norm(points - middle - along[:, None] * z, axis=1)
    radius = max(float(across.max()) + delta, _NO_THINNER)
    x = axes[1]
    frame = np.column_stack([x, np.cross(z, x), z])
    start = middle + along.min() * z
    return Collider(
        name=name,
        kind=CAPSULE.name,
        bone=bone,
        position=transform_points(T_bone_bind, start[None])[0],
        orientation=quaternion_from_matrix(T_bone_bind[:3, :3] @ frame),
        geometry={"radius0": radius, "radius1": radius, "length": float(np.ptp(along))},
    )


def _fitted(inner: Hull, points: FloatArray, settings: HullSettings) -> Hull:
    """Inflate and simplify; the result contains the points, verified."""
    inflate = inflate_vertices if settings.inflation == "vertices" else inflate_planes
    how = Simplification(
        max_faces=settings.max_faces,
        outside=settings.reach * settings.delta,
        objective=QUADRIC if settings.placement == "quadric" else VOLUME,
        triangles_only=settings.deletion == "triangles",
    )
    if settings.delta > 0.0:
        start = inflate(inner, settings.delta)
        for candidate in (simplify_hull(start, inner, how), start):
            if not candidate.outside(points).any():
                return candidate
    # Without slack a point on a face may be outside by rounding.
    middle = inner.vertices.mean(axis=0)
    return Hull(middle + (inner.vertices - middle) * (1.0 + _ROUNDING), inner.faces)


def _remark(inner: Hull, hull: Hull, settings: HullSettings) -> str:
    """What did not go as asked for."""
    if settings.delta == 0.0:
        return "no delta: not inflated, not simplified"
    remarks = []
    if len(hull.faces) > settings.max_faces + 1:  # faces go in pairs
        remarks.append(f"stopped at {len(hull.faces)} faces: fewer do not fit within the reach")
    if hull.volume > _THICK * inner.volume:
        remarks.append("delta makes it much thicker than what it holds")
    return "; ".join(remarks)


def _figures(content: Content, hull: Hull, note: str) -> ShapeFit:
    gained = clearance(hull, content.inner)
    return ShapeFit(
        name=content.name,
        kind=HULL.name,
        faces_before=len(content.inner.faces),
        faces=len(hull.faces),
        volume_before=content.inner.volume,
        volume=hull.volume,
        clearance_min=float(gained.min()),
        clearance_mean=float(gained.mean()),
        outside=int(hull.outside(content.points).sum()),
        note=note,
    )


def _collider(content: Content, hull: Hull) -> Collider:
    """A hull given in the bind pose as a collider in the frame of its oriented box."""
    T_bone_bind = content.T_bone_bind
    box = oriented_box(hull.vertices, hull.faces)
    geometry: dict[str, object] = {"vertices": box.local(hull.vertices), "faces": hull.faces}
    if content.share is not None:
        geometry["share"] = content.share
    return Collider(
        name=content.name,
        kind=HULL.name,
        bone=content.bone,
        position=transform_points(T_bone_bind, box.centre[None])[0],
        orientation=quaternion_from_matrix(T_bone_bind[:3, :3] @ box.axes),
        geometry=geometry,
    )
