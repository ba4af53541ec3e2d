"""The tree of a body's joints, and the tips of its limbs.

Joints are where bones begin, inside of the body in every pose. Ways from joint to joint stay in
it where cores of shapes do not: hulls of a trunk lie across each other.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial.distance import cdist

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import invert_transform, matrix_from_quaternion

_BEYOND = 0.4
"""How far a tip reaches, in lengths of the longest limb: a foot that is drawn into a long skirt
still points at its hem."""
_SHORT = 0.3
"""Branches that are shorter than this share of the longest one are no limbs; a head is, with the
neck."""


class LimbTree(NamedTuple):
    """Joints, then the ends of limbs, then tips, which go on from these.

    Attributes:
        before: Node that comes before each node, -1 at the first, shape [n].
        order: Nodes, each after the one before it, shape [n]; the first is the tip of the
            shortest limb, the head of a human.
        tip: The nodes that are tips, shape [t].
        carrier: Collider that carries each joint and end, then where each tip's direction begins,
            shape [n].
        place: Their places in its frame [m], shape [n, 3].
        beyond: How far a tip is from the end of its limb [m].
    """

    before: IntArray
    order: IntArray
    tip: IntArray
    carrier: IntArray
    place: FloatArray
    beyond: float

    @classmethod
    def of(cls, colliders: ColliderSet, T_world_rest: FloatArray) -> "LimbTree | None":
        """The tree of the bones that have cores.

        Args:
            colliders: The body's colliders.
            T_world_rest: Where they are at rest, where no limb touches another, shape [n, 4, 4];
                NaN where that is not known.

        Returns:
            The tree; None where there is no bone.
        """
        bones = list(_bones(colliders, T_world_rest))
        if not bones:
            return None
        neighbours, length = _tree([bone.points for bone in bones])
        ends = [limb for k in range(len(bones)) for limb in _limbs_from(k, bones, neighbours)]
        reach = {limb: _reach(limb, bones, neighbours, length) for limb in ends}
        longest = max(reach.values())
        limbs = [
            limb for limb in sorted(ends, key=reach.__getitem__) if reach[limb] >= _SHORT * longest
        ]
        points = [bone.points[0] for bone in bones]
        points += [bones[limb.bone].points[limb.end] for limb in limbs]
        points += [bones[limb.bone].points[limb.start] for limb in limbs]
        of = [*range(len(bones)), *(limb.bone for limb in limbs), *(limb.bone for limb in limbs)]
        carrier = np.array([bones[k].joint for k in of], np.int32)
        to_carrier = invert_transform(T_world_rest[carrier])
        place = np.einsum("nij,nj->ni", to_carrier[:, :3, :3], np.array(points))
        count, tips = len(bones), len(bones) + len(limbs) + np.arange(len(limbs))
        graph = np.zeros((count + 2 * len(limbs),) * 2)
        for k, others in enumerate(neighbours):
            graph[k, others] = 1.0
        graph[[limb.bone for limb in limbs], tips - len(limbs)] = 1.0
        graph[tips - len(limbs), tips] = 1.0
        order, before = breadth_first_order(graph, int(tips[0]), directed=False)
        return cls(
            before=np.where(before < 0, -1, before).astype(np.int32),
            order=order.astype(np.int32),
            tip=tips.astype(np.int32),
            carrier=carrier,
            place=place + to_carrier[:, :3, 3],
            beyond=_BEYOND * longest,
        )

    def posed(self, poses: ColliderPoses) -> FloatArray:
        """The nodes in the world [m], shape [n, 3]."""
        R = matrix_from_quaternion(poses.orientation[self.carrier])
        points = np.einsum("nij,nj->ni", R, self.place) + poses.position[self.carrier]
        count = len(self.tip)
        way = points[-2 * count : -count] - points[-count:]
        way *= self.beyond / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        points[-count:] = points[-2 * count : -count] + way
        return points


class _Bone(NamedTuple):
    """The collider that goes with its joint, and its joint and ends of cores at rest [m]."""

    joint: int
    points: FloatArray


class _Limb(NamedTuple):
    """A bone at the end of a limb, which of its points is the end, and where that points from."""

    bone: int
    end: int
    start: int


def _bones(colliders: ColliderSet, T_world_rest: FloatArray) -> Iterator[_Bone]:
    cores = Cores.of(colliders)
    T = T_world_rest[cores.collider]
    ends = np.einsum("cij,cej->cei", T[:, :3, :3], cores.ends) + T[:, None, :3, 3]
    frames = {c.bone: k for k, c in enumerate(colliders.colliders) if c.is_frame}
    for name in dict.fromkeys(cores.bone):
        own = np.flatnonzero([bone == name for bone in cores.bone])
        joint = frames.get(name, int(cores.collider[own[0]]))
        points = np.concatenate([T_world_rest[joint, None, :3, 3], ends[own].reshape(-1, 3)])
        if np.isfinite(points).all() and np.isfinite(T_world_rest[joint]).all():
            yield _Bone(joint, points)


def neighbours_in(gaps: FloatArray) -> list[list[int]]:
    """Neighbours in the shortest tree of nodes that are so far apart, shape [n, n]."""
    tree = minimum_spanning_tree(gaps).tocoo()
    neighbours: list[list[int]] = [[] for _ in gaps]
    for a, b in zip(tree.row.tolist(), tree.col.tolist(), strict=True):
        neighbours[a].append(b)
        neighbours[b].append(a)
    return neighbours


def to_branch(neighbours: Sequence[Sequence[int]], length: NDArray[np.float64], tip: int) -> float:
    """Length of a tree from a tip to where it branches, by those of its edges, shape [n, n]."""
    far, came, node = 0.0, -1, tip
    while len(on := [k for k in neighbours[node] if k != came]) == 1:
        far += float(length[node, on[0]])
        came, node = node, on[0]
    return far


def _tree(points: Sequence[FloatArray]) -> tuple[list[list[int]], FloatArray]:
    """Bones next to each bone, by where they are nearest; and distances of their joints [m]."""
    first = np.cumsum([0, *map(len, points)])[:-1]
    everything = np.concatenate(points)
    gap = np.minimum.reduceat(cdist(everything, everything), first, axis=0)
    gap = np.minimum.reduceat(gap, first, axis=1) + 1e-3
    joints = everything[first]
    return neighbours_in(np.triu(gap, 1)), cdist(joints, joints)


def _limbs_from(
    k: int, bones: Sequence[_Bone], neighbours: Sequence[Sequence[int]]
) -> Iterator[_Limb]:
    """Where bone k ends a limb; one alone ends it on both sides."""
    points = bones[k].points
    apart = cdist(points, points)
    if not neighbours[k]:
        a, b = (int(end) for end in np.unravel_index(np.argmax(apart), apart.shape))
        yield from (_Limb(k, a, b), _Limb(k, b, a))
    elif len(neighbours[k]) == 1:
        joint = bones[neighbours[k][0]].points[0]
        end = int(np.argmax(np.linalg.norm(points - joint, axis=1)))
        yield _Limb(k, end, int(np.argmax(apart[end])))


def _reach(
    limb: _Limb,
    bones: Sequence[_Bone],
    neighbours: Sequence[Sequence[int]],
    length: NDArray[np.float64],
) -> float:
    """How long a limb is from its end to the joint where it branches off [m]."""
    points = bones[limb.bone].points
    if not neighbours[limb.bone]:
        return float(np.linalg.norm(points[limb.end] - points[limb.start]))
    bone = float(np.linalg.norm(points[limb.end] - points[0]))
    return bone + to_branch(neighbours, length, limb.bone)
