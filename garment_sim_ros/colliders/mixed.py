"""For each part of a body the kind of collider that is tightest at equal run-time cost.

Cost is the number of shapes times what one query of their kind takes. Hulls set it: ellipsoids are
as many as cost the same, capsules (which cost far less) are as their own fit makes them. Tight is
who has the smallest mean distance between skin and shapes, whichever of the two is outside.

Parts that keep different kinds may leave skin bare where they meet; shapes that were not kept then
come back, those first that cover most of it for their cost.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import EllipsoidSettings, HullSettings
from garment_sim_ros.colliders.capsules.capsules import fit_capsules
from garment_sim_ros.colliders.ellipsoids.ellipsoid_binding import ellipsoid_colliders
from garment_sim_ros.colliders.ellipsoids.ellipsoids import PARTS, ellipsoids_around, segment_body
from garment_sim_ros.colliders.hulls.hulls import fit_hulls
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.regions import bone_weights
from garment_sim_ros.colliders.report.fatness import Union
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.triangles import vertex_areas

QUERY_NS = {"sphere": 5.0, "capsule": 12.0, "hull": 27.0, "ellipsoid": 97.0}
"""What one query near a shape takes [ns], measured by ``bench/query_cost.py``; only their ratios
matter here."""
_DEARER = 1.25
"""A kind takes part where it costs at most so many times what hulls do."""
_BARE = 1e-5
"""Skin that leaves the shapes by no more than this is covered [m]: single precision."""


@dataclass(frozen=True)
class _Candidates:
    """All shapes that may be kept.

    Attributes:
        colliders: The shapes.
        method: The name of the fit that made each.
        part: The part of the body that each belongs to, shape [m].
        distance: Signed distance of every skin vertex to each [m], shape [m, v].
    """

    colliders: list[Collider]
    method: NDArray[np.str_]
    part: IntArray
    distance: FloatArray

    @property
    def cost(self) -> FloatArray:
        """Of each [ns]."""
        return np.array([QUERY_NS[c.kind] for c in self.colliders])


def fit_mixed(
    body: Body,
    settings: HullSettings | None = None,
    *,
    segmentation: str = "auto",
    thickness: float = 0.002,
) -> tuple[ColliderSet, dict[str, Any]]:
    """The tightest of hulls, ellipsoids and capsules for each part; frames come last.

    Args:
        body: Rig and skin.
        settings: Of the hulls; their `delta` inflates the others, too.
        segmentation: See `ellipsoids_around`. A body that is no human is one part.
        thickness: Distance that cloth keeps on top [m].

    Returns:
        The set, and a report: ``query_ns``; ``parts``, for each the cost, mean distance and
        farthest skin outside of each kind and which was ``chosen``; ``whole``, the same of each
        kind alone and of the result; ``added`` names of shapes that came back; ``bare`` vertices
        in the end (0); ``assumed``.
    """
    settings = settings or HullSettings()
    assumed: list[str] = []
    names = PARTS
    try:
        divided = segment_body(body, segmentation)
        part_of_region = np.array([0 if i > 8 else i + 1 for i in range(15)])
        part = part_of_region[divided.region].astype(np.int32)
        assumed += divided.report()["assumed"]
    except GeometryError as error:
        assumed.append(f"the body is one part: {error}")
        names, segmentation, part = (
            ("body",),
            "none",
            np.zeros(len(body.skin.vertices), np.int32),
        )
    hulls = fit_hulls(body, settings, thickness=thickness).colliders
    capsules = fit_capsules(body, delta=settings.delta, thickness=thickness)
    frames = [c for c in hulls.colliders if c.kind == "frame"]
    part_of_bone = _parts_of_bones(body, part)

    budget = np.zeros(len(names))
    for c in _shapes(hulls):
        budget[part_of_bone[c.bone]] += QUERY_NS[c.kind]
    counts = {
        name: max(1, round(budget[i] / QUERY_NS["ellipsoid"])) for i, name in enumerate(names)
    }
    fit = ellipsoids_around(body, EllipsoidSettings(segmentation=segmentation), counts=counts)
    made = {
        "hull": _shapes(hulls),
        "ellipsoid": ellipsoid_colliders(body, fit, settings.delta),
        "capsule": _shapes(capsules),
    }
    candidates = _measured(body, made, part_of_bone)
    area = vertex_areas(body.skin.vertices, body.skin.triangles)
    chosen = np.zeros(len(candidates.colliders), np.bool_)
    report: dict[str, Any] = {"query_ns": QUERY_NS, "parts": {}}
    for i, name in enumerate(names):
        mine = part == i
        row = {}
        for method in made:
            own = (candidates.method == method) & (candidates.part == i)
            everything = candidates.method == method
            row[method] = _figures(candidates, own, everything, mine, area)
        able = [
            m for m in made if row[m]["shapes"] and row[m]["cost_ns"] <= _DEARER * budget[i]
        ] or ["ellipsoid"]
        best = min(able, key=lambda m: row[m]["mean_mm"])
        chosen |= (candidates.method == best) & (candidates.part == i)
        report["parts"][name] = {**row, "chosen": best}
    added = _cover(candidates, chosen)
    everywhere = np.ones(len(part), np.bool_)
    report["whole"] = {
        method: _figures(candidates, own, own, everywhere, area)
        for method, own in [
            *((m, candidates.method == m) for m in made),
            ("mixed", chosen),
        ]
    }
    report["added"] = [candidates.colliders[k].name for k in added]
    left = candidates.distance[chosen].min(axis=0) > _BARE
    report["bare"] = int(left.sum())
    report["assumed"] = assumed
    kept = _renamed([candidates.colliders[k] for k in np.flatnonzero(chosen)])
    return ColliderSet(colliders=(*kept, *frames), thickness=thickness), report


def _shapes(colliders: ColliderSet) -> list[Collider]:
    return [c for c in colliders.colliders if c.kind != "frame"]


def _parts_of_bones(body: Body, part: IntArray) -> dict[str, int]:
    """The part that most of each joint's skin, or else of the next bone above it, belongs to."""
    bones = major_bones(body)
    owner = bone_weights(body.skin, bones).argmax(axis=1)
    result: dict[str, int] = {}
    for j, name in enumerate(body.rig.joint_names):
        weight = ((body.skin.bone == j) * body.skin.weight).sum(axis=1)
        if weight.max() < 0.5:
            weight = (owner == bones.owner[j]).astype(np.float64)
        result[name] = int(np.bincount(part, weight).argmax())
    return result


def _measured(
    body: Body, made: dict[str, list[Collider]], part_of_bone: dict[str, int]
) -> _Candidates:
    """All shapes with their distances to the skin in the bind pose."""
    colliders = [c for shapes in made.values() for c in shapes]
    T_world_joint = rest_transforms(body.rig)
    distance = []
    for c in colliders:
        alone = ColliderSet(colliders=(c,))
        union = Union(alone, ColliderPoser(alone, body).poses(T_world_joint))
        distance.append(union.distance(body.skin.vertices))
    return _Candidates(
        colliders=colliders,
        method=np.repeat(list(made), [len(shapes) for shapes in made.values()]),
        part=np.array([part_of_bone[c.bone] for c in colliders], np.int32),
        distance=np.array(distance, np.float64),
    )


def _figures(
    candidates: _Candidates,
    own: NDArray[np.bool_],
    union: NDArray[np.bool_],
    mine: NDArray[np.bool_],
    area: FloatArray,
) -> dict[str, float]:
    """Shapes and cost of `own`; how far the skin vertices `mine` are from the shapes `union`."""
    distance = candidates.distance[union].min(axis=0)[mine]
    weight = area[mine]
    return {
        "shapes": int(own.sum()),
        "cost_ns": round(float(candidates.cost[own].sum()), 1),
        "mean_mm": round(1e3 * float((np.abs(distance) * weight).sum() / weight.sum()), 3),
        "outside_mm_max": round(1e3 * max(float(distance.max()), 0.0), 3),
    }


def _cover(candidates: _Candidates, chosen: NDArray[np.bool_]) -> list[int]:
    """Chooses more shapes until no skin is bare that any of them covers; their indices."""
    holds = candidates.distance <= _BARE
    bare = ~holds[chosen].any(axis=0)
    added: list[int] = []
    while True:
        gain = (holds & bare).sum(axis=1) / candidates.cost
        gain[chosen] = 0.0
        k = int(gain.argmax())
        if gain[k] == 0.0:
            return added
        chosen[k] = True
        bare &= ~holds[k]
        added.append(k)


def _renamed(colliders: list[Collider]) -> list[Collider]:
    """The same, with their kind in names that several fits gave."""
    names = [c.name for c in colliders]
    return [
        c
        if names.count(c.name) == 1
        else Collider(
            name=f"{c.name}_{c.kind}",
            kind=c.kind,
            bone=c.bone,
            position=c.position,
            orientation=c.orientation,
            geometry=c.geometry,
        )
        for c in colliders
    ]
