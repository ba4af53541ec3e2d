"""A garment that was made on one body carried over to another, part by part.

Each vertex goes with the parts that it would follow as skin. On the trunk it keeps its height
between landmarks (sole, knees, crotch, shoulders, neck), and how far out it is in its direction,
measured by the outline of trunk and legs at that height; on a leg the same by the leg's outline,
but for what goes around both. Joints do not decide there: rigs put them where they like. On an arm
it is turned and moved as the bone of the one body is to that of the other, both in rest pose, and
scaled by their lengths along the bone and by their girths across it. What is then nearer to the
skin than it was on the one body is moved out, and its neighbours with it.
"""

from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.attachments import bind
from garment_sim_ros.garment.dressing import covered_skin, reaches_shoulders
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.garment.slices import NORMALS, Profile, sections
from garment_sim_ros.geometry.connectivity import adjacency
from garment_sim_ros.geometry.mesh_distance import MeshDistance

_MOST = 0.01
"""Distance to the skin up to which gaps are kept [m]."""
_ROUNDS = 12
_SLICES = 48
_CROTCH = 0.05
"""Height below the crotch in which trunk becomes legs, per body height."""
_TRUNK_AND_LEGS = (
    *("hips", "spine", "chest", "upperChest", "Shoulder", "neck"),
    *("UpperLeg", "LowerLeg", "Foot", "Toes"),
)
_BETWEEN_LEGS = 0.8
"""Cloth nearer to the middle than this share of the outline is between the legs."""
_NEXT = {"UpperArm": ("LowerArm",), "LowerArm": ("Hand",)}
"""Where each humanoid bone ends: the first of these that both bodies have."""


def carried_over(mesh: GarmentMesh, made_on: Body, body: Body) -> GarmentMesh:
    """The garment in its place on another body, in that body's rest pose.

    On the body that it was made for it stays as it is.

    Args:
        mesh: The garment on the body that it was made for.
        made_on: That body.
        body: Who shall wear it.

    Raises:
        GeometryError: One of the bodies lacks bones or skin that a garment needs.
    """
    if np.array_equal(made_on.skin.vertices, body.skin.vertices):
        return mesh
    source, target = Measures(made_on), Measures(body)
    covered = covered_skin(source, reaches_shoulders(mesh, source))
    binding = bind(source, mesh, covered)
    whole = target.height / source.height
    names = {joint: bone for bone, joint in made_on.humanoid.items()}
    body_part, far_out = _around_trunk(mesh.vertices, source, target)
    low = source.crotch - _CROTCH * source.height
    below = mesh.vertices[:, 2] < low
    if below.any() and (far_out[below] < _BETWEEN_LEGS).mean() > 0.05:
        on_legs = _around_legs(mesh.vertices, source, target)
        share = np.clip((source.crotch - mesh.vertices[:, 2]) / (source.crotch - low), 0.0, 1.0)
        body_part = (1.0 - share)[:, None] * body_part + share[:, None] * on_legs
    placed = np.zeros_like(mesh.vertices)
    for f, frame in enumerate(binding.frames):
        weight = np.where(binding.index == f, binding.weight, 0.0).sum(axis=1)
        bone = _known(names.get(frame, ""), made_on, frame, names, body)
        if bone.removeprefix("left").removeprefix("right") in _TRUNK_AND_LEGS:
            placed += weight[:, None] * body_part
            continue
        start, end = _segment(bone, source, target)
        turn, scale = _turn(start[1] - start[0], end[1] - end[0], whole)
        wider = _girth(bone, end, target) / _girth(bone, start, source)
        axis = _direction(start)
        x = mesh.vertices - start[0]
        along = (x @ axis)[:, None] * axis
        x = scale * along + wider * (x - along)
        placed += weight[:, None] * (x @ turn.T + end[0])
    gap = MeshDistance(source.vertices, covered).signed_distance(mesh.vertices)[0]
    upper = reaches_shoulders(replace(mesh, vertices=placed), target)
    placed = _moved_out(placed, mesh, np.clip(gap, 0.0, _MOST), target, upper)
    note = f"carried over from {made_on.name} to {body.name}"
    return replace(mesh, vertices=placed, notes=(*mesh.notes, note))


def _around_trunk(
    x: FloatArray, source: Measures, target: Measures
) -> tuple[FloatArray, FloatArray]:
    """Vertices where they are around another trunk.

    Below the crotch cloth hangs: it is as wide as at the hips, but around both legs.

    Returns:
        Positions [m], shape [v, 3], and shares of the outline, 1 on it, shape [v].
    """
    z = _heights(x[:, 2], source, target)
    here, there = np.maximum(x[:, 2], source.crotch), np.maximum(z, target.crotch)
    placed = _by_outlines(x, z, source.trunk.at(here), target.trunk.at(there))
    far_out = _far_out(x, source.trunk.at(x[:, 2]))
    legs = target.trunk.at(z)
    wanted, now = np.minimum(far_out, 1.0 + _MOST), _far_out(placed, legs)
    wider = np.where(x[:, 2] < source.crotch, np.maximum(wanted / now, 1.0), 1.0)
    centre = _centred(legs)[0]
    placed[:, :2] = centre + wider[:, None] * (placed[:, :2] - centre)
    return placed, far_out


def _around_legs(x: FloatArray, source: Measures, target: Measures) -> FloatArray:
    """Vertices below the crotch where they are around the nearer leg of another body [m]."""
    z = _heights(x[:, 2], source, target)
    placed = []
    distance = []
    for side in ("left", "right"):
        here, there = _leg(source, side).at(x[:, 2]), _leg(target, side).at(z)
        placed.append(_by_outlines(x, z, here, there))
        distance.append(np.linalg.norm(x[:, :2] - _centred(here)[0], axis=1))
    return np.where((distance[0] < distance[1])[:, None], *placed)


def _heights(z: FloatArray, source: Measures, target: Measures) -> FloatArray:
    """Heights [m] on one body where they are on another, between landmarks of both."""
    ankles = all(
        f"{s}Foot" in m.body.humanoid for s in ("left", "right") for m in (source, target)
    )
    here, there = _landmarks(source, ankles), _landmarks(target, ankles)
    inside = np.interp(z, here, there)
    return inside + np.minimum(z - here[0], 0.0) + np.maximum(z - here[-1], 0.0)


def _landmarks(m: Measures, ankles: bool) -> FloatArray:
    """Heights that bodies have in common, rising [m], shape [n]."""
    ankle = [0.5 * (m.joint("leftFoot") + m.joint("rightFoot"))[2]] if ankles else []
    heights = [m.sole, *ankle, m.knee, m.crotch, m.shoulders, m.neck_base.centre[2]]
    return np.maximum.accumulate(np.array(heights))


def _leg(m: Measures, side: str) -> Profile:
    """Outlines of one leg at heights up to where all that is there belongs to it."""
    low, high = m.sole + 0.02 * m.height, m.crotch - 0.5 * _CROTCH * m.height
    share = m.share(f"{side}UpperLeg")
    heights = np.linspace(low, high, _SLICES)
    profile = sections(m.vertices, m.body.skin.triangles, share, np.eye(4), heights).filled()
    if not len(profile.offset):
        raise GeometryError(f"{m.body.name}: no skin on the {side} leg")
    return profile


def _by_outlines(x: FloatArray, z: FloatArray, here: FloatArray, there: FloatArray) -> FloatArray:
    """Vertices where they are around another outline, in the same direction and as far out.

    Args:
        x: Vertices on the one body [m], shape [v, 3].
        z: Their heights on the other [m], shape [v].
        here: Supports of the one body's outline there [m], shape [v, DIRECTIONS].
        there: Those of the other's.
    """
    across = x[:, :2] - _centred(here)[0]
    moved = np.column_stack([_centred(there)[0] + across, z])
    scale = _far_out(x, here) / _far_out(moved, there)
    return np.column_stack([_centred(there)[0] + scale[:, None] * across, z])


def _far_out(x: FloatArray, support: FloatArray) -> FloatArray:
    """How far out of outlines' middles vertices are, 1 on the outline, shape [v]."""
    centre, support = _centred(support)
    return np.maximum(((x[:, :2] - centre) @ NORMALS.T / support).max(axis=1), 1e-9)


def _centred(support: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middles of outlines [m], shape [n, 2], and supports from there, above zero."""
    first, second, third, fourth = support[:, :: support.shape[1] // 4].T
    centre = 0.5 * np.column_stack([first - third, second - fourth])
    return centre, np.maximum(support - centre @ NORMALS.T, 1e-6)


def _moved_out(
    x: FloatArray, mesh: GarmentMesh, gap: FloatArray, target: Measures, upper: bool
) -> FloatArray:
    """Vertices no nearer to the skin than a gap [m], moved smoothly."""
    distance = MeshDistance(target.vertices, covered_skin(target, upper))
    neighbours = adjacency(mesh.triangles, len(x))
    degree = np.asarray(neighbours.sum(axis=1)).reshape(-1, 1)
    moved = np.zeros_like(x)
    for _ in range(_ROUNDS):
        moved = 0.5 * (moved + np.asarray(neighbours @ moved) / degree)
        d, closest, _ = distance.signed_distance(x + moved)
        out = (x + moved - closest) * np.sign(d)[:, None]
        out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
        moved += np.maximum(gap - d, 0.0)[:, None] * out
    return x + moved


def _known(bone: str, made_on: Body, frame: str, names: dict[str, str], body: Body) -> str:
    """The humanoid bone that a frame goes with on both bodies: its own, or the next above."""
    joint = made_on.rig.index(frame)
    while (not bone or bone not in body.humanoid) and made_on.rig.parent[joint] >= 0:
        joint = int(made_on.rig.parent[joint])
        bone = names.get(made_on.rig.joint_names[joint], "")
    return bone if bone in body.humanoid else "hips"


def _segment(bone: str, *bodies: Measures) -> tuple[FloatArray, ...]:
    """Where a bone begins and ends on each body [m], shape [2, 3].

    Without an end that both bodies have it ends where it begins.
    """
    side = next((s for s in ("left", "right") if bone.startswith(s)), "")
    ends = [f"{side}{name}" for name in _NEXT.get(bone[len(side) :], ())]
    common = [e for e in ends if all(e in m.body.humanoid for m in bodies)]
    return tuple(np.stack([m.joint(bone), m.joint(*common[:1] or (bone,))]) for m in bodies)


def _direction(segment: FloatArray) -> FloatArray:
    """Unit vector along a bone; upwards where it has no length."""
    along = segment[1] - segment[0]
    length = float(np.linalg.norm(along))
    return along / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])


def _girth(bone: str, segment: FloatArray, measures: Measures) -> float:
    """How far the skin that a bone moves most is from its axis [m]."""
    skin = measures.body.skin
    below = measures.share(bone)
    side = next((s for s in ("left", "right") if bone.startswith(s)), "")
    next_bones = [f"{side}{n}" for n in _NEXT.get(bone[len(side) :], ())]
    beyond = [n for n in next_bones if n in measures.body.humanoid][:1]
    own = below - (measures.share(*beyond) if beyond else 0.0)
    x = measures.vertices[own > 0.5] - segment[0]
    if not len(x):
        x = measures.vertices[skin.weight.max(axis=1) > 0.0] - segment[0]
    axis = _direction(segment)
    across = x - (x @ axis)[:, None] * axis
    return float(np.median(np.linalg.norm(across, axis=1)))


def _turn(a: FloatArray, b: FloatArray, whole: float) -> tuple[FloatArray, float]:
    """The least rotation from one direction to another and the scale; none of zero length."""
    long, wide = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if min(long, wide) < 1e-6:
        return np.eye(3), whole
    u, v = a / long, b / wide
    axis, cosine = np.cross(u, v), float(u @ v)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + cross + cross @ cross / max(1.0 + cosine, 1e-3), wide / long
