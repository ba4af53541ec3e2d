"""Convex-hull colliders for any body: regions, hulls, simplification, joints (Sun et al. 2007).

Each rigid region of the skin becomes a hull, or several where one would be much too fat; joints
get a sphere, and hulls, that turn by a share of the joint's rotation. All of it is verified: no
skin of a region is outside its hulls.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import NamedTuple, TypeVar

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders.capsules.capsules import frame_colliders
from garment_sim_ros.colliders.hulls.convex_parts import convex_parts
from garment_sim_ros.colliders.hulls.hull import (
    Hull,
    clearance,
    convex_hull,
    inflate_planes,
    inflate_vertices,
)
from garment_sim_ros.colliders.hulls.hull_placement import QUADRIC, VOLUME
from garment_sim_ros.colliders.hulls.hull_simplify import Simplification, simplify_hull
from garment_sim_ros.colliders.joint_shapes import (
    SHARE,
    BandHull,
    Joint,
    band_hulls,
    choose_hulls,
    covering_sphere,
    gaps,
    holding_radius,
    is_covered,
    is_worth_it,
    joints,
)
from garment_sim_ros.colliders.regions import Regions, region_surface, skin_regions
from garment_sim_ros.contact.kinds.capsule import CAPSULE
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.kinds.sphere import SPHERE
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.obb import oriented_box
from garment_sim_ros.geometry.transforms import quaternion_from_matrix, transform_points
from garment_sim_ros.params import declarations, validated

_T = TypeVar("_T")
_S = TypeVar("_S")

_MOST_PARTS = 20
"""Most hulls for one region; a body without a rig is one region."""
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


@dataclass(frozen=True, kw_only=True)
class HullFit:
    """Fitted colliders and how each came about, in the same order without the frames."""

    colliders: ColliderSet
    shapes: tuple[ShapeFit, ...] = field(default_factory=tuple)


def fit_hulls(
    body: Body, settings: HullSettings | None = None, *, thickness: float = 0.002
) -> HullFit:
    """Hulls, joint colliders, and one frame per major bone.

    Args:
        body: Rig and skin; without a rig the skin is cut into convex parts.
        settings: How; the defaults give a human about 20 hulls.
        thickness: Distance that cloth keeps on top [m].

    Raises:
        ParameterError: A setting out of range.
        GeometryError: The skin has no triangles.
    """
    given = settings or HullSettings()
    settings = validated(
        HullSettings, {name: getattr(given, name) for name in declarations(HullSettings)}
    )
    if len(body.skin.triangles) == 0:
        raise GeometryError(f"body {body.name!r} has no triangles to fit hulls to")
    regions = skin_regions(body, merge=settings.merge)
    surfaces = [region_surface(body.skin, regions, m) for m in range(len(regions))]
    total = sum(_volume(surface) for surface in surfaces)
    saving = max(settings.split * total, 1e-12)

    def of_region(m: int) -> list[_OfRegion]:
        return list(_hulls_of_region(body, regions, m, surfaces[m], saving, settings))

    fitted = _all(of_region, range(len(surfaces)))
    hulls = [(one.region, one.hull) for one in fitted if one.hull is not None]
    joints = _joint_colliders(body, regions, hulls, settings)
    colliders = [one.collider for one in fitted] + [collider for collider, _ in joints]
    shapes = [one.shape for one in fitted] + [shape for _, shape in joints]
    frames = frame_colliders(major_bones(body))
    return HullFit(
        colliders=ColliderSet(colliders=(*colliders, *frames), thickness=thickness),
        shapes=tuple(shapes),
    )


class _OfRegion(NamedTuple):
    """A collider of a region, and its hull if it is one."""

    region: int
    collider: Collider
    shape: ShapeFit
    hull: Hull | None


def _hulls_of_region(
    body: Body,
    regions: Regions,
    m: int,
    surface: FloatArray,
    saving: float,
    settings: HullSettings,
) -> Iterator[_OfRegion]:
    if len(surface) == 0:
        return
    bone = regions.names[m]
    T_bone_bind = body.skin.T_bone_bind[regions.joint[m]]
    parts = convex_parts(surface, saving=saving, most=_MOST_PARTS)
    for k, part in enumerate(parts):
        name = bone if len(parts) == 1 else f"{bone}_{k}"
        points = np.unique(part.reshape(-1, 3), axis=0)
        try:
            inner = convex_hull(points)
        except GeometryError as error:
            capsule = _capsule_around(name, bone, points, settings.delta, T_bone_bind)
            shape = ShapeFit(name=name, kind=CAPSULE.name, note=f"no hull: {error}")
            yield _OfRegion(m, capsule, shape, None)
            continue
        hull = _fitted(inner, points, settings)
        shape = _figures(name, inner, hull, points, _remark(inner, hull, settings))
        yield _OfRegion(m, _collider(name, bone, hull, T_bone_bind), shape, hull)


def _volume(surface: FloatArray) -> float:
    try:
        return convex_hull(surface.reshape(-1, 3)).volume
    except GeometryError:
        return 0.0


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


def _figures(name: str, inner: Hull, hull: Hull, points: FloatArray, note: str = "") -> ShapeFit:
    gained = clearance(hull, inner)
    return ShapeFit(
        name=name,
        kind=HULL.name,
        faces_before=len(inner.faces),
        faces=len(hull.faces),
        volume_before=inner.volume,
        volume=hull.volume,
        clearance_min=float(gained.min()),
        clearance_mean=float(gained.mean()),
        outside=int(hull.outside(points).sum()),
        note=note,
    )


def _joint_colliders(
    body: Body, regions: Regions, hulls: list[tuple[int, Hull]], settings: HullSettings
) -> list[tuple[Collider, ShapeFit]]:
    """A sphere, hulls that turn by a share, both or nothing for each joint."""
    if settings.joints == "none" or not hulls:
        return []
    skin = MeshDistance(body.skin.vertices, body.skin.triangles)

    def of_joint(joint: Joint) -> list[tuple[Collider, ShapeFit]]:
        posed, height = gaps(joint, hulls)
        if settings.joints == "spheres":
            radius = holding_radius(joint)
            own = np.linalg.norm(posed, axis=-1) - radius
            return [_joint_sphere(body, regions, joint, joint.centre, radius, height, own)]
        if is_covered(height):
            return []
        made = []
        centre, radius, own = covering_sphere(joint, posed, height, skin)
        if is_worth_it(height, own):
            made.append(_joint_sphere(body, regions, joint, centre, radius, height, own))
            height = np.minimum(height, own)
        for k, band in enumerate(choose_hulls(height, band_hulls(body, regions, joint, posed))):
            note = _opening(band.share, height, band.height)
            made.append(_joint_hull(body, regions, joint, k, band, note, settings))
            height = np.minimum(height, band.height)
        return made

    made = _all(of_joint, joints(body, regions, skin, settings.flexible))
    return [(_inflated(collider, settings.delta), shape) for collider, shape in made]


def _all(of: Callable[[_T], Iterable[_S]], items: Iterable[_T]) -> list[_S]:
    """What a function makes of independent items, in their order; threads share the work."""
    with ThreadPoolExecutor() as pool:
        return list(chain.from_iterable(pool.map(of, items)))


def _inflated(collider: Collider, delta: float) -> Collider:
    """A sphere with a larger radius; hulls have their delta."""
    if collider.kind != SPHERE.name:
        return collider
    radius = float(collider.geometry["radius"]) + delta  # type: ignore[arg-type]
    return replace(collider, geometry={**collider.geometry, "radius": radius})


def _joint_sphere(
    body: Body,
    regions: Regions,
    joint: Joint,
    centre: FloatArray,
    radius: float,
    height: FloatArray,
    own: FloatArray,
) -> tuple[Collider, ShapeFit]:
    bone = regions.names[joint.region]
    T_bone_bind = body.skin.T_bone_bind[regions.joint[joint.region]]
    sphere = Collider(
        name=f"joint_{bone}",
        kind=SPHERE.name,
        bone=bone,
        position=transform_points(T_bone_bind, centre[None])[0],
        geometry={"radius": radius, "share": SHARE},
    )
    return sphere, ShapeFit(name=sphere.name, kind=SPHERE.name, note=_opening(SHARE, height, own))


def _opening(share: float, height: FloatArray, own: FloatArray) -> str:
    left = max(float(np.minimum(height, own).max()), 0.0)
    return (
        f"turns by {share:g} of the joint's rotation; leaves {1e3 * left:.1f} of "
        f"{1e3 * height.max():.1f} mm open through the range of motion"
    )


def _joint_hull(
    body: Body,
    regions: Regions,
    joint: Joint,
    number: int,
    band: BandHull,
    note: str,
    settings: HullSettings,
) -> tuple[Collider, ShapeFit]:
    bone = regions.names[joint.region]
    name = f"joint_{bone}_{number}"
    hull = _fitted(band.hull, band.hull.vertices, settings)
    T_bone_bind = body.skin.T_bone_bind[regions.joint[joint.region]]
    collider = _collider(name, bone, hull, T_bone_bind, share=band.share)
    return collider, _figures(name, band.hull, hull, band.hull.vertices, note)


def _collider(
    name: str, bone: str, hull: Hull, T_bone_bind: FloatArray, share: float | None = None
) -> Collider:
    """A hull given in the bind pose as a collider in the frame of its oriented box."""
    box = oriented_box(hull.vertices, hull.faces)
    geometry: dict[str, object] = {"vertices": box.local(hull.vertices), "faces": hull.faces}
    if share is not None:
        geometry["share"] = share
    return Collider(
        name=name,
        kind=HULL.name,
        bone=bone,
        position=transform_points(T_bone_bind, box.centre[None])[0],
        orientation=quaternion_from_matrix(T_bone_bind[:3, :3] @ box.axes),
        geometry=geometry,
    )


def _capsule_around(
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
