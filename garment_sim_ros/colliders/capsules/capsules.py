"""Tapered capsules, or spheres, for any skinned body: the baselines of all other colliders.

Every major bone gets as few capsules as describe its patch of skin: one for a limb, several side
by side for the flat cross-sections of trunk, hands and feet.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, LongArray
from garment_sim_ros.body.major_bones import MajorBones, major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.capsules.capsule_fit import refine, slabs, union_distance
from garment_sim_ros.colliders.regions import bone_weights, skin_normals
from garment_sim_ros.contact.kinds.capsule import CAPSULE
from garment_sim_ros.contact.kinds.sphere import SPHERE
from garment_sim_ros.contact.shapes import Collider, ColliderSet, frame_of
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.transforms import quaternion_from_matrix, transform_points
from garment_sim_ros.geometry.triangles import vertex_areas

_CONTAINED = 0.97
"""Share of a patch's area that its capsules contain before `delta` is added."""
_STICKS_OUT = 0.004
"""How far all but the last 0.5 % of the rest may stick out [m]."""
_MAX_PER_BONE = 4
_GOOD_ENOUGH = 0.006
"""Root mean square distance to the skin [m] at which no further capsule is tried."""
_PRICE = 0.25
"""A further capsule must reduce that distance by about this share of it."""
_SAMPLES = 300
"""Skin points that a fit looks at per bone, and as many of its neighbours."""
_AIR = (0.015, 0.04, 0.08)
"""Distances from the skin [m] at which the air is sampled."""


@dataclass(frozen=True)
class _Patch:
    """Skin of one major bone sampled evenly, and points that its colliders should leave out.

    Attributes:
        points: Positions in the bind pose [m], shape [n, 3].
        weight: Area shares, 1 in sum over the own points, shape [n].
        foreign: True for points on other bones' skin and in the air around, shape [n].
    """

    points: FloatArray
    weight: FloatArray
    foreign: NDArray[np.bool_]

    @property
    def own(self) -> FloatArray:
        """The bone's own points, shape [n_own, 3]."""
        return self.points[~self.foreign]


def fit_capsules(body: Body, *, delta: float = 0.0, thickness: float = 0.002) -> ColliderSet:
    """Tapered capsules per major bone, then one frame per major bone.

    Args:
        body: Rig and skin.
        delta: Inflation of all shapes [m].
        thickness: Distance that cloth keeps on top [m].

    Raises:
        ParameterError: `delta` or `thickness` is negative or not finite.
    """
    return _fit(body, delta, thickness, spheres=False)


def fit_spheres(body: Body, *, delta: float = 0.0, thickness: float = 0.002) -> ColliderSet:
    """Spheres in a row per major bone, then one frame per major bone; see `fit_capsules`."""
    return _fit(body, delta, thickness, spheres=True)


def frame_colliders(bones: MajorBones) -> tuple[Collider, ...]:
    """One ``frame_<joint>`` per major bone: what attachments and skinned shapes follow.

    That of the body's root is the first, see `ColliderSet.root`.
    """
    names = dict.fromkeys((bones.root, *bones.names))
    return tuple(frame_of(name) for name in names)


def _fit(body: Body, delta: float, thickness: float, *, spheres: bool) -> ColliderSet:
    for name, value in (("delta", delta), ("thickness", thickness)):
        if not 0.0 <= value < np.inf:
            raise ParameterError(name, f"found {value!r}", "allowed: 0 m or more")
    bones = major_bones(body)
    weights = bone_weights(body.skin, bones)
    owner = weights.argmax(axis=1)
    areas = vertex_areas(body.skin.vertices, body.skin.triangles)
    normals = skin_normals(body.skin)
    skin = MeshDistance(body.skin.vertices, body.skin.triangles)
    colliders: list[Collider] = []
    for m, name in enumerate(bones.names):
        if not (owner == m).any():
            continue
        patch = _patch(body, owner == m, areas, normals, skin)
        capsules = _fit_spheres(patch) if spheres else _fit_capsules(patch)
        capsules[:, 6:] += delta
        T_bone_bind = body.skin.T_bone_bind[bones.joint[m]]
        for k, capsule in enumerate(capsules):
            label = name if len(capsules) == 1 else f"{name}_{k}"
            colliders.append(_collider(label, name, capsule, T_bone_bind, spheres))
    return ColliderSet(colliders=(*colliders, *frame_colliders(bones)), thickness=thickness)


def _even(index: LongArray, areas: FloatArray) -> tuple[LongArray, FloatArray]:
    """At most `_SAMPLES` of the vertices `index`, with the area that each stands for."""
    if len(index) <= _SAMPLES:
        return index, areas[index]
    # Even steps through the accumulated area: dense fingers and faces count by size.
    total = np.cumsum(areas[index])
    step = total[-1] / _SAMPLES
    at = np.searchsorted(total, (np.arange(_SAMPLES) + 0.5) * step)
    return index[at], np.full(_SAMPLES, step)


def _patch(
    body: Body, own: NDArray[np.bool_], areas: FloatArray, normals: FloatArray, skin: MeshDistance
) -> _Patch:
    """Sample a bone's skin, the other skin in its bounding box, and the air around."""
    x = body.skin.vertices
    low, high = x[own].min(axis=0) - _AIR[0], x[own].max(axis=0) + _AIR[0]
    near = ~own & (x >= low).all(axis=1) & (x <= high).all(axis=1)
    mine, my_area = _even(np.flatnonzero(own), areas)
    other, other_area = _even(np.flatnonzero(near), areas)
    on_skin = np.concatenate([mine, other])
    area = np.maximum(np.concatenate([my_area, other_area]), 1e-12)
    air = np.concatenate([x[on_skin] + offset * normals[on_skin] for offset in _AIR])
    clear = skin.signed_distance(air)[0] > 0.5 * np.repeat(_AIR, len(on_skin))
    return _Patch(
        points=np.concatenate([x[on_skin], air[clear]]),
        weight=np.concatenate([area, np.tile(area, len(_AIR))[clear]]) / area[: len(mine)].sum(),
        foreign=np.arange(len(on_skin) + clear.sum()) >= len(mine),
    )


def _principal_axes(patch: _Patch) -> tuple[FloatArray, FloatArray]:
    """Mean and principal axes (columns, longest first) of a patch."""
    w = patch.weight[~patch.foreign]
    mean = w @ patch.own / w.sum()
    centred = patch.own - mean
    _, axes = np.linalg.eigh((centred * w[:, None]).T @ centred)
    return mean, axes[:, ::-1]


def _fit_capsules(patch: _Patch) -> FloatArray:
    """As few capsules as describe the patch, the best of several starts."""
    mean, axes = _principal_axes(patch)
    local = (patch.own - mean) @ axes
    weight = patch.weight[~patch.foreign]
    best = np.empty((0, 8))
    best_value = np.inf
    for count in range(1, _MAX_PER_BONE + 1):
        if len(patch.own) < 8 * count and len(best):
            break
        starts = [
            slabs(local, weight, split, along, count)
            for split in range(3 if count > 1 else 1)
            for along in range(3)
            if count == 1 or split != along
        ]
        fits = []
        for start in starts:
            for end in (slice(0, 3), slice(3, 6)):
                start[:, end] = start[:, end] @ axes.T + mean
            fits.append(refine(start, patch.points, patch.weight, patch.foreign, iterations=12))
        fit, _ = min(fits, key=lambda f: f[1])
        fit, cost = refine(fit, patch.points, patch.weight, patch.foreign)
        error = float(np.sqrt(cost))
        if error * (1.0 + _PRICE * count) < best_value:
            best, best_value = fit, error * (1.0 + _PRICE * count)
        if error < _GOOD_ENOUGH:
            break
    return _containing(best, patch)


def _fit_spheres(patch: _Patch) -> FloatArray:
    """A row of spheres along the patch's longest axis, spaced by about their radius."""
    mean, axes = _principal_axes(patch)
    local = (patch.own - mean) @ axes
    extent = np.ptp(local, axis=0)
    count = int(np.clip(round(2.0 * extent[0] / max(extent[1], 1e-6)), 1, 6))
    start = slabs(local, patch.weight[~patch.foreign], 0, 0, count)
    centre = 0.5 * (start[:, :3] + start[:, 3:6]) @ axes.T + mean
    start[:, :3] = start[:, 3:6] = centre
    fit, _ = refine(start, patch.points, patch.weight, patch.foreign, spheres=True)
    return _containing(fit, patch)


def _containing(capsules: FloatArray, patch: _Patch) -> FloatArray:
    """Radii changed so that each capsule contains its share of the skin nearest to it."""
    capsules = capsules.copy()
    own = patch.own
    weight = patch.weight[~patch.foreign]
    distance = np.empty(len(own))
    nearest = np.zeros(len(own), dtype=np.int32)
    union_distance(capsules, own, distance, nearest)
    for k in range(len(capsules)):
        mine = nearest == k
        if mine.any():
            order = np.argsort(distance[mine])
            share = np.cumsum(weight[mine][order])
            ranked = distance[mine][order]
            at = np.searchsorted(share, np.array([_CONTAINED, 0.995]) * share[-1])
            most, nearly_all = ranked[np.minimum(at, len(ranked) - 1)]
            capsules[k, 6:] += max(most, nearly_all - _STICKS_OUT)
    capsules[:, 6:] = np.maximum(capsules[:, 6:], 1e-4)
    return capsules


def _collider(
    name: str, bone: str, capsule: FloatArray, T_bone_bind: FloatArray, sphere: bool
) -> Collider:
    """A capsule given in the bind pose as a collider in its bone's frame."""
    p0, p1 = transform_points(T_bone_bind, capsule[:6].reshape(2, 3))
    r0, r1 = float(capsule[6]), float(capsule[7])
    if sphere:
        return Collider(
            name=name, kind=SPHERE.name, bone=bone, position=p0, geometry={"radius": r0}
        )
    length = float(np.linalg.norm(p1 - p0))
    z = (p1 - p0) / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    orientation = quaternion_from_matrix(np.column_stack([x, np.cross(z, x), z]))
    return Collider(
        name=name,
        kind=CAPSULE.name,
        bone=bone,
        position=p0,
        orientation=orientation,
        geometry={"radius0": r0, "radius1": r1, "length": length},
    )
