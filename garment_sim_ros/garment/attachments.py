"""How a garment is attached to its body: frames it would follow as skin, and pinned vertices."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.special import gammaln

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.colliders.regions import bone_weights
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.geometry.connectivity import adjacency
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import boundary_loops, vertex_normals
from garment_sim_ros.geometry.triangles import barycentric

FRAMES_PER_VERTEX = 4

_SMOOTHING_LENGTH = 0.06  # weights are blended over this distance on a person of 1.65 m [m]
_MOST_ROUNDS = 10_000
_TAIL = 6.5  # standard deviations of the walk beyond which nothing is left in float64
_SLEEVE = 0.45  # of the upper arm's length: what is farther from its bone is no sleeve
_SLEEVE_PINS = 0.35  # place along the upper arm
_HOLE = 0.15  # an open edge up to so much of the longest one is a hole, no waist
_SHOULDER_PINS = (0.3, 0.55, 0.8)  # places from the neck's side to the shoulder joint


@dataclass(frozen=True, kw_only=True)
class Binding:
    """The frames that a garment's vertices follow.

    Attributes:
        frames: Joint names, length b.
        T_world_frame: Their transforms in the pose that the garment was made in, [b, 4, 4].
        index: Frames of each vertex, shape [v, k].
        weight: Weights of those frames, rows sum to 1, shape [v, k].
    """

    frames: tuple[str, ...]
    T_world_frame: FloatArray
    index: IntArray
    weight: FloatArray

    def heaviest(self, vertices: IntArray) -> int:
        """The frame that carries most of these vertices' weight."""
        chosen = self.index[vertices].ravel(), self.weight[vertices].ravel()
        return int(np.argmax(np.bincount(*chosen, minlength=len(self.frames))))


def bind(measures: Measures, mesh: GarmentMesh, covered: IntArray) -> Binding:
    """Skin weights of major bones carried over to a garment.

    Each vertex takes the weights at the nearest point of the skin; they are then smoothed over
    the garment, so that cloth between two legs or under an arm follows both sides.

    Args:
        measures: The body in the pose of the garment.
        mesh: The garment.
        covered: Triangles of the skin that the garment may lie on, shape [t, 3].

    Raises:
        GeometryError: No skin to lie on.
    """
    if not len(covered):
        raise GeometryError(f"{measures.body.name}: no skin that the garment could lie on")
    body = measures.body
    bones = major_bones(body)
    distance = MeshDistance(measures.vertices, covered)
    _, closest, triangle = distance.signed_distance(mesh.vertices)
    corners = covered[triangle]
    share = barycentric(measures.vertices[corners], closest)
    weights = np.einsum("vk,vkm->vm", share, bone_weights(body.skin, bones)[corners])

    neighbours = adjacency(mesh.triangles, len(mesh.vertices))
    a, b = neighbours.nonzero()
    edge = np.median(np.linalg.norm(mesh.vertices[a] - mesh.vertices[b], axis=1))
    rounds = int(np.clip((_SMOOTHING_LENGTH * measures.unit / edge) ** 2, 1, _MOST_ROUNDS))
    weights = smoothed(neighbours, weights, 2 * rounds)

    kept = np.argsort(-weights, axis=1, kind="stable")[:, :FRAMES_PER_VERTEX]
    weight = np.take_along_axis(weights, kept, axis=1)
    weight /= weight.sum(axis=1, keepdims=True)
    weight[weight < 1e-4] = 0.0
    weight /= weight.sum(axis=1, keepdims=True)
    used = np.unique(kept[weight > 0.0])
    number = np.zeros(len(bones), dtype=np.int32)
    number[used] = np.arange(len(used))
    return Binding(
        frames=tuple(bones.names[i] for i in used),
        T_world_frame=measures.T_world_joint[bones.joint[used]],
        index=np.where(weight > 0.0, number[kept], 0).astype(np.int32),
        weight=weight,
    )


def smoothed(neighbours: sp.csr_matrix, values: FloatArray, rounds: int) -> FloatArray:
    """Values after `rounds` times the mean of each vertex and the mean of its neighbours.

    With P the mean over neighbours that is ((I + P) / 2)^rounds. In Chebyshev polynomials its
    coefficients are those of a binomial distribution, so that some 5 sqrt(rounds) products with P
    do for all rounds: a finer mesh needs as many more rounds as it has vertices.

    Args:
        neighbours: Adjacency of the vertices, shape [v, v].
        values: Shape [v, m].
        rounds: How often.
    """
    mean = sp.csr_matrix(sp.diags(1.0 / np.asarray(neighbours.sum(axis=1)).ravel()) @ neighbours)
    terms = min(rounds, int(np.ceil(_TAIL * np.sqrt(0.5 * rounds))) + 1)
    j = np.arange(terms + 1)
    share = np.exp(
        gammaln(2 * rounds + 1)
        - gammaln(rounds + j + 1)
        - gammaln(rounds - j + 1)
        - 2.0 * rounds * np.log(2.0)
    )
    share[1:] *= 2.0
    share /= share.sum()
    before, now = values, mean @ values
    result = share[0] * before + share[1] * now
    for k in range(2, terms + 1):
        before, now = now, 2.0 * (mean @ now) - before
        result += share[k] * now
    return np.maximum(result, 0.0)


def waist_pins(mesh: GarmentMesh) -> IntArray:
    """The open edge that lies highest: the waist of skirts and trousers. Holes are none.

    Raises:
        GeometryError: The garment has no open boundary.
    """
    loop = highest_edge(mesh.vertices, mesh.triangles)
    if not len(loop):
        raise GeometryError("it has no open edge to pin at the waist; allowed: one")
    return np.sort(loop)


def highest_edge(x: FloatArray, triangles: IntArray) -> IntArray:
    """Vertices of the highest open edge that is no hole, in order; none of a closed surface.

    Args:
        x: Vertices [m], shape [v, 3].
        triangles: Shape [t, 3].
    """
    loops = boundary_loops(triangles)
    if not loops:
        return np.zeros(0, np.int32)
    around = [np.linalg.norm(x[loop] - x[np.roll(loop, 1)], axis=1).sum() for loop in loops]
    wide = [loop for loop, w in zip(loops, around, strict=True) if w > _HOLE * max(around)]
    return max(wide, key=lambda loop: float(x[loop, 2].mean()))


def shoulder_pins(measures: Measures, mesh: GarmentMesh) -> IntArray:
    """A few vertices on top of both shoulders, between neck and shoulder joint.

    Raises:
        GeometryError: The garment does not lie on the shoulders.
    """
    x = mesh.vertices
    normal = np.empty_like(x)
    vertex_normals(x, mesh.triangles, normal)
    pins: list[int] = []
    neck = measures.neck_base
    for side in ("left", "right"):
        shoulder = measures.joint(f"{side}UpperArm")
        outward = np.sign(shoulder[1] - neck.centre[1])
        inner = neck.centre + np.array([0.0, outward * neck.radius, 0.0])
        on_top = np.flatnonzero((normal[:, 2] > 0.4) & (x[:, 2] > measures.waist))
        for s in _SHOULDER_PINS:
            place = inner + s * (shoulder - inner)
            free = np.setdiff1d(on_top, pins)
            apart = np.linalg.norm(x[free, :2] - place[:2], axis=1)
            if not free.size or apart.min() > 0.1 * measures.unit:
                raise GeometryError(
                    "it does not lie on the shoulders; allowed: cloth over both, from beside the "
                    "neck on, or attachments"
                )
            pins.append(free[np.argmin(apart)])
    return np.sort(pins).astype(np.int32)


def lifted_shoulder_pins(measures: Measures, mesh: GarmentMesh, cut: GarmentMesh) -> IntArray:
    """`shoulder_pins` of a garment that colliders may have lifted off the shoulders since its cut.

    Args:
        measures: The body in the pose of the garment.
        mesh: The garment over its colliders.
        cut: The garment as it was cut to the skin.

    Raises:
        GeometryError: It was not cut to lie on the shoulders.
    """
    try:
        return shoulder_pins(measures, mesh)
    except GeometryError:
        return shoulder_pins(measures, cut)


def arm_pins(
    measures: Measures, mesh: GarmentMesh, cut: GarmentMesh, binding: Binding
) -> dict[str, IntArray]:
    """Vertices at both shoulders and, where there are sleeves, at both upper arms, by bone.

    As Sun et al. 2007, Fig. 7 b. Arguments and errors as those of `lifted_shoulder_pins`.
    """
    shoulders = lifted_shoulder_pins(measures, mesh, cut)
    pins = {binding.frames[binding.heaviest(shoulders)]: shoulders}
    for side in ("left", "right"):
        sleeve = np.setdiff1d(sleeve_pins(measures, cut, side), shoulders)
        if sleeve.size:
            pins[f"{side}UpperArm"] = sleeve
    return pins


def sleeve_pins(measures: Measures, mesh: GarmentMesh, side: str) -> IntArray:
    """A few vertices of a sleeve, before, over and behind the upper arm; none without a sleeve.

    Args:
        measures: The body in the pose of the garment.
        mesh: The garment as cut.
        side: "left" or "right".
    """
    start, end = measures.joint(f"{side}UpperArm"), measures.joint(f"{side}LowerArm")
    along = end - start
    length = float(np.linalg.norm(along))
    along = along / length
    way = (mesh.vertices - start) @ along
    away = np.linalg.norm(mesh.vertices - start - way[:, None] * along, axis=1)
    near = np.flatnonzero((way > 0.0) & (way < length) & (away < _SLEEVE * length))
    if not near.size:
        return near.astype(np.int32)
    place = start + min(_SLEEVE_PINS * length, 0.5 * float(way[near].max())) * along
    forward = np.array([1.0, 0.0, 0.0])
    forward -= (forward @ along) * along
    up = np.array([0.0, 0.0, 1.0])
    up -= (up @ along) * along
    radius = float(np.median(away[near]))
    pins = set()
    for out in (forward, up, -forward):
        target = place + radius * out / max(float(np.linalg.norm(out)), 1e-12)
        pins.add(int(near[np.argmin(np.linalg.norm(mesh.vertices[near] - target, axis=1))]))
    return np.array(sorted(pins), np.int32)
