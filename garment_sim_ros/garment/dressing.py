"""From a garment's mesh and a body to a garment ready to be simulated."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.attachments import (
    Binding,
    arm_pins,
    bind,
    lifted_shoulder_pins,
    waist_pins,
)
from garment_sim_ros.garment.garment import Garment, without_bones
from garment_sim_ros.garment.holds import (
    ARMS,
    AUTOMATIC,
    NONE,
    Attachment,
    Holds,
    Place,
    VertexDistance,
)
from garment_sim_ros.garment.letting_out import let_out
from garment_sim_ros.garment.listed_holds import listed_bands, listed_pins
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.garment.mesh_checks import (
    OFF_THE_BODY,
    OTHER_BODY,
    check_stretch,
    check_waist,
)
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.params import Material
from garment_sim_ros.sim.placement import SoftAttachments

_DEEPEST = 0.03  # vertices deeper under the skin than this are not a fit of millimetres [m]
_MOST_DEEP = 0.4  # share of vertices so deep from which a garment is in the body, not on it
_MANY_DEEP = 0.05  # likewise from which it looks like one for another body
_LEFT_DEEP = 0.01  # likewise that may be left where a garment was let out over colliders
_MAX_DISTANCE = 0.1  # how far a shirt may get from where it was put on [m]
_CLEARANCE = 0.002  # where vertices under the skin are put [m]


def dressed(
    name: str,
    mesh: GarmentMesh,
    measures: Measures,
    material: Material,
    attachments: str | Sequence[Attachment] = AUTOMATIC,
    colliders: ColliderSet | None = None,
    holds: Holds | None = None,
) -> tuple[Garment, tuple[str, ...]]:
    """A mesh in its place on a body made a garment.

    Args:
        name: The garment's name.
        mesh: Its surface in the frame of the body.
        measures: The body, in the pose that the garment was made for.
        material: Its fabric.
        attachments: "auto" (shoulders where it reaches them, else its highest open edge),
            "arms" (shoulders and upper arms, and no distance limit of its own), "none", or a list.
        colliders: Where given, the garment is let out to fit over them.
        holds: What holds it beside its pins; the defaults where None.

    Returns:
        The garment, and what was repaired or assumed, one sentence each.

    Raises:
        GeometryError: The garment is not on the body, or an attachment does not exist.
    """
    holds = holds or Holds()
    upper = reaches_shoulders(mesh, measures)
    covered = covered_skin(measures, upper)
    given = mesh
    mesh, notes = _put_outside(name, mesh, measures, covered)
    check_stretch(name, given, mesh.vertices, measures.body.name)
    binding = bind(measures, mesh, covered)
    passed_by = _passed_by(measures, binding, upper)
    cut = mesh
    mesh = _over_colliders(name, mesh, measures, covered, material, colliders, passed_by)
    limited = upper and attachments != ARMS
    if upper and attachments == ARMS:
        pinned = arm_pins(measures, mesh, cut, binding)
        attachments = [
            Attachment(bone=b, place=Place(vertices=(*p.tolist(),))) for b, p in pinned.items()
        ]
    pins, pin_frame, spring, binding, marks = _attached(
        name, mesh, measures, binding, attachments, holds, cut if upper else None
    )
    elastic, banded = listed_bands(name, mesh, measures, holds.elastic, upper)
    rigid = np.isinf(spring[:, 0])
    if holds.tethers is not None and not rigid.any():
        raise GeometryError(
            f"garment {name!r} has tethers but nothing that they could hang from; allowed: with "
            "attachments that are not soft"
        )
    limits = dict(holds.skin_limits)
    if limited:
        usual = VertexDistance(distance=_MAX_DISTANCE * measures.unit)
        limits.setdefault("max_distance", (usual,))
    garment = Garment(
        name=name,
        vertices=mesh.vertices,
        triangles=mesh.triangles,
        material=material,
        frames=binding.frames,
        T_world_frame_rest=binding.T_world_frame,
        frame_index=binding.index,
        frame_weight=binding.weight,
        pins=pins[rigid],
        pin_frame=pin_frame[rigid],
        passed_by=passed_by,
        skin_limits={
            key: _per_vertex(name, len(mesh.vertices), entries) for key, entries in limits.items()
        },
        soft=_soft(pins, pin_frame, spring),
        tethers=holds.tethers,
        T_world_bone_rest=_bones_at_rest(measures),
        flat=mesh.flat,
        elastic=elastic,
        marks={**marks, **banded},
    )
    return garment, notes


def _soft(pins: IntArray, frame: IntArray, spring: FloatArray) -> SoftAttachments | None:
    """Those of the attached vertices that springs hold; None without any."""
    soft = np.isfinite(spring[:, 0])
    if not soft.any():
        return None
    return SoftAttachments(
        vertices=pins[soft],
        frame=frame[soft],
        stiffness=spring[soft, 0],
        damping=spring[soft, 1],
    )


def _attached(
    name: str,
    mesh: GarmentMesh,
    measures: Measures,
    binding: Binding,
    attachments: str | Sequence[Attachment],
    holds: Holds,
    cut: GarmentMesh | None,
) -> tuple[IntArray, IntArray, FloatArray, Binding, dict[str, IntArray]]:
    """Attached vertices, their frames and springs, the binding with these frames, their names.

    Of what hangs from the shoulders `cut` is the mesh before it was let out; None of others.

    Raises:
        GeometryError: An attachment that does not exist.
    """
    if not isinstance(attachments, str):
        return listed_pins(
            name, mesh, measures, binding, attachments, holds, upper=cut is not None
        )
    marks = {}
    if attachments == NONE:
        pins = np.zeros(0, dtype=np.int32)
    elif cut is None:
        marks["waist"] = pins = waist_pins(mesh)
        check_waist(name, mesh, pins, measures, covered_skin(measures, upper=False))
    else:
        marks["shoulders"] = pins = lifted_shoulder_pins(measures, mesh, cut)
    heaviest = binding.heaviest(pins) if pins.size else 0
    frame = np.full(len(pins), heaviest, dtype=np.int32)
    spring = np.tile([holds.stiffness, holds.damping], (len(pins), 1))
    return pins, frame, spring, binding, marks


def _bones_at_rest(measures: Measures) -> dict[str, FloatArray]:
    """World transforms of all bones in the pose of the garment, by name."""
    bones = major_bones(measures.body)
    return dict(zip(bones.names, measures.T_world_joint[bones.joint], strict=True))


def _per_vertex(name: str, count: int, given: Sequence[VertexDistance]) -> FloatArray:
    """A distance for each vertex [m], infinite where none is given.

    Raises:
        GeometryError: A vertex that does not exist.
    """
    result: FloatArray = np.full(count, np.inf)
    for entry in given:
        if entry.vertices is None:
            result[:] = entry.distance
            continue
        wrong = [v for v in entry.vertices if not 0 <= v < count]
        if wrong:
            raise GeometryError(
                f"garment {name!r}: vertices {wrong[:5]} do not exist; allowed: 0 to {count - 1}"
            )
        result[list(entry.vertices)] = entry.distance
    return result


def reaches_shoulders(mesh: GarmentMesh, measures: Measures) -> bool:
    """Whether a garment hangs from the shoulders rather than from the waist."""
    try:
        level = measures.shoulders
    except GeometryError:
        return False
    return bool(mesh.vertices[:, 2].max() > level)


def covered_skin(measures: Measures, upper: bool) -> IntArray:
    """Triangles of the skin that a garment may lie on: no head or hands; no arms for skirts."""
    sides = ("left", "right")
    ends = [f"{s}Hand" for s in sides] if upper else [f"{s}UpperArm" for s in sides]
    left_out = measures.share("head", *ends) > 0.5
    triangles = measures.body.skin.triangles
    return triangles[~left_out[triangles].any(axis=1)]


def _passed_by(measures: Measures, binding: Binding, upper: bool) -> tuple[str, ...]:
    """Major bones that are head, hands and, unless the garment has sleeves there, arms."""
    parts = ["LowerArm", "Hand"] if upper else ["UpperArm", "LowerArm", "Hand"]
    passing = ["head", *(f"{side}{part}" for part in parts for side in ("left", "right"))]
    bones = major_bones(measures.body)
    name_of = dict(zip(bones.human, bones.names, strict=True))
    worn = {f for k, f in enumerate(binding.frames) if _carried(binding, k) > 0.5}
    frames = [name_of[bone] for bone in passing if bone in name_of]
    return tuple(frame for frame in frames if frame not in worn)


def _carried(binding: Binding, frame: int) -> float:
    """The largest weight that a frame has at any vertex."""
    return float(np.where(binding.index == frame, binding.weight, 0.0).max())


def _put_outside(
    name: str,
    mesh: GarmentMesh,
    measures: Measures,
    covered: IntArray,
    most_deep: float = _MOST_DEEP,
) -> tuple[GarmentMesh, tuple[str, ...]]:
    """The mesh with its outside outwards and vertices just under the skin put over it.

    Raises:
        GeometryError: The mesh is not on the body, or more than a share of it is deep in there.
    """
    unit = measures.unit
    notes: tuple[str, ...] = ()
    distance = MeshDistance(measures.vertices, covered)
    gap, closest, _ = distance.signed_distance(mesh.vertices)
    away = float(np.median(np.abs(gap)))
    if away > OFF_THE_BODY * unit:
        raise GeometryError(
            f"garment {name!r} is {away:.3g} m away from {measures.body.name}; allowed: one in "
            "its place on the body (is its unit or its up axis another one?)"
        )
    triangles, flat = mesh.triangles, mesh.flat
    normal = np.empty_like(mesh.vertices)
    vertex_normals(mesh.vertices, triangles, normal)
    outward = (mesh.vertices - closest) * np.sign(gap)[:, None]
    if np.einsum("vi,vi->", normal, outward) < 0.0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
        flat = None if flat is None else np.ascontiguousarray(flat[:, ::-1])
        notes += ("all triangles were turned: the inside was out",)
    vertices = mesh.vertices.copy()
    if (gap < 0.0).any():
        # Beside the rim of an open part, such as clothes in a body's file, signs say nothing.
        skin = MeshDistance(measures.vertices, measures.body.skin.triangles)
        gap = np.where(skin.is_inside(vertices), gap, np.abs(gap))
    under = (gap < 0.0) & (gap > -_DEEPEST * unit)
    if under.any():
        step = closest[under] - vertices[under]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        vertices[under] = closest[under] + step * (_CLEARANCE * unit / np.maximum(length, 1e-300))
        notes += (
            f"{under.sum()} vertices up to {-1e3 * gap[under].min():.1f} mm under the skin were "
            "put over it",
        )
    deep = gap <= -_DEEPEST * unit
    if deep.any():
        found = f"{deep.sum()} vertices are over {1e3 * _DEEPEST * unit:.0f} mm under the skin"
        if deep.mean() > most_deep:
            raise GeometryError(
                f"garment {name!r} is in {measures.body.name}, not on it: {found} of "
                f"{len(deep)}; allowed: up to {100.0 * most_deep:.0f} % ({OTHER_BODY})"
            )
        notes += (found + f" ({OTHER_BODY})" * bool(deep.mean() > _MANY_DEEP),)
    return replace(mesh, vertices=vertices, triangles=triangles, flat=flat, notes=()), notes


def _over_colliders(
    name: str,
    mesh: GarmentMesh,
    measures: Measures,
    covered: IntArray,
    material: Material,
    colliders: ColliderSet | None,
    passed_by: tuple[str, ...],
) -> GarmentMesh:
    """The mesh let out to fit over colliders beside those that pass it by, where there are any."""
    if colliders is None:
        return mesh
    met = without_bones(colliders, passed_by)
    mesh = replace(mesh, vertices=let_out(mesh, measures, met, material.thickness))
    return _put_outside(name, mesh, measures, covered, _LEFT_DEEP)[0]


def over_the_body(
    mesh: GarmentMesh, measures: Measures, colliders: ColliderSet | None, garment: Garment
) -> GarmentMesh:
    """A surface that was changed, over skin and colliders again.

    Args:
        mesh: The surface.
        measures: The body in the pose of the garment.
        colliders: What it will lie on; None where only the skin matters.
        garment: The garment that it is the surface of.

    Raises:
        GeometryError: The surface is not on the body.
    """
    covered = covered_skin(measures, reaches_shoulders(mesh, measures))
    mesh, _ = _put_outside(garment.name, mesh, measures, covered)
    return _over_colliders(
        *(garment.name, mesh, measures, covered, garment.material, colliders, garment.passed_by)
    )
