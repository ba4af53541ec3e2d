"""Convex-hull colliders for any body: regions, hulls, simplification, joints (Sun et al. 2007).

Each rigid region of the skin becomes a hull, or several where one would be much too fat; joints
get a sphere, and hulls, that turn by a share of the joint's rotation. All of it is verified: no
skin of a region is outside its hulls.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TypeVar

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders.capsules.capsules import frame_colliders
from garment_sim_ros.colliders.hulls.convex_parts import convex_parts
from garment_sim_ros.colliders.hulls.growing import grown
from garment_sim_ros.colliders.hulls.hull import Hull, convex_hull
from garment_sim_ros.colliders.hulls.one_hull import (
    Content,
    Made,
    ShapeFit,
    capsule_around,
    made_hull,
)
from garment_sim_ros.colliders.hulls.thickening import comes_out, deepened, thickened
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
from garment_sim_ros.contact.kinds.sphere import SPHERE
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.ties import to_nanometres
from garment_sim_ros.geometry.transforms import transform_points
from garment_sim_ros.params import declarations, validated

_T = TypeVar("_T")
_S = TypeVar("_S")

_MOST_PARTS = 20
"""Most hulls for one region; a body without a rig is one region."""


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
    skin = MeshDistance(body.skin.vertices, body.skin.triangles)

    def of_region(m: int) -> list[tuple[int, Made]]:
        made = _hulls_of_region(body, regions, m, surfaces[m], skin, saving, settings)
        return [(m, one) for one in made]

    fitted = _all(of_region, range(len(surfaces)))
    hulls = [(m, one.hull) for m, one in fitted if one.hull is not None]
    joints = _joint_colliders(body, regions, hulls, skin, settings)
    made = [one for _, one in fitted] + joints
    if settings.joints == "auto":
        made = grown(body, made, settings)
    colliders = (*(one.collider for one in made), *frame_colliders(major_bones(body)))
    return HullFit(
        colliders=ColliderSet(colliders=colliders, thickness=thickness),
        shapes=tuple(one.shape for one in made),
    )


def _hulls_of_region(
    body: Body,
    regions: Regions,
    m: int,
    surface: FloatArray,
    skin: MeshDistance,
    saving: float,
    settings: HullSettings,
) -> Iterator[Made]:
    if len(surface) == 0:
        return
    bone = regions.names[m]
    T_bone_bind = body.skin.T_bone_bind[regions.joint[m]]
    parts = convex_parts(surface, saving=saving, most=_MOST_PARTS)
    for k, part in enumerate(parts):
        name = bone if len(parts) == 1 else f"{bone}_{k}"
        points = np.unique(to_nanometres(part.reshape(-1, 3)), axis=0)
        try:
            inner = convex_hull(points)
            inner = thickened(inner, skin) if len(parts) > 1 else inner
        except GeometryError as error:
            capsule = capsule_around(name, bone, points, settings.delta, T_bone_bind)
            yield Made(capsule, ShapeFit(name=name, kind=CAPSULE.name, note=f"no hull: {error}"))
            continue
        made = made_hull(Content(name, bone, T_bone_bind, inner, points), settings)
        if len(parts) > 1 and made.hull is not None and comes_out(made.hull, skin):
            deep = Content(name, bone, T_bone_bind, deepened(inner, skin), points)
            made = made_hull(deep, settings)
        yield made


def _volume(surface: FloatArray) -> float:
    try:
        return convex_hull(surface.reshape(-1, 3)).volume
    except GeometryError:
        return 0.0


def _joint_colliders(
    body: Body,
    regions: Regions,
    hulls: list[tuple[int, Hull]],
    skin: MeshDistance,
    settings: HullSettings,
) -> list[Made]:
    """A sphere, hulls that turn by a share, both or nothing for each joint."""
    if settings.joints == "none" or not hulls:
        return []

    def of_joint(joint: Joint) -> list[Made]:
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
    return [one._replace(collider=_inflated(one.collider, settings.delta)) for one in made]


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
) -> Made:
    bone = regions.names[joint.region]
    T_bone_bind = body.skin.T_bone_bind[regions.joint[joint.region]]
    sphere = Collider(
        name=f"joint_{bone}",
        kind=SPHERE.name,
        bone=bone,
        position=transform_points(T_bone_bind, centre[None])[0],
        geometry={"radius": radius, "share": SHARE},
    )
    shape = ShapeFit(name=sphere.name, kind=SPHERE.name, note=_opening(SHARE, height, own))
    return Made(sphere, shape)


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
) -> Made:
    bone = regions.names[joint.region]
    content = Content(
        name=f"joint_{bone}_{number}",
        bone=bone,
        T_bone_bind=body.skin.T_bone_bind[regions.joint[joint.region]],
        inner=band.hull,
        points=band.hull.vertices,
        share=band.share,
        note=note,
    )
    return made_hull(content, settings)
