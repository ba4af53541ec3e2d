"""What runs through the cloth at the joints of limbs: a knee that sticks out of a skirt.

The core of a shape is its middle, so that there is none around a joint: cloth that lies over thigh
and shin, but behind the knee between them, is run through by no core. Links close that gap inside
of limbs: from the end of one core to the place that is half way between the two at rest, where
limbs are all but straight, and on to the next core. That place goes with the first of them.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import invert_transform, transform_from
from garment_sim_ros.sim.limb_tree import neighbours_in, to_branch

_SHORT = 0.35
"""Branches that are shorter are no limbs, but colliders side by side [m]."""
_MOST = 64
"""Hits of one garment that are kept: more change nothing."""


class JointLinks:
    """The links of a body's limbs.

    Args:
        colliders: The body's colliders.
        T_world_rest: Where they are at rest, shape [n, 4, 4]; NaN where that is not known.

    Attributes:
        cores: The two cores that each link joins, shape [l, 2].
        at: The ends of them that it joins: 0 or 1, shape [l, 2].
    """

    def __init__(self, colliders: ColliderSet, T_world_rest: FloatArray) -> None:
        self._cores = cores = Cores.of(colliders)
        T = T_world_rest[cores.collider]
        rest = np.einsum("cij,cej->cei", T[:, :3, :3], cores.ends) + T[:, None, :3, 3]
        used = np.flatnonzero(np.isfinite(rest).all(axis=(1, 2)))
        pairs = list(_inside_limbs(*limbs_of(rest[used]))) if len(used) else []
        nodes = np.array(pairs, np.int32).reshape(-1, 2)
        self.cores = used[nodes // 2].astype(np.int32)
        self.at = nodes % 2
        self._carrier = cores.collider[self.cores[:, 0]]
        to_carrier = invert_transform(T_world_rest[self._carrier])
        half_way = rest[self.cores, self.at].mean(axis=1)
        self._joint = np.einsum("lij,lj->li", to_carrier[:, :3, :3], half_way)
        self._joint += to_carrier[:, :3, 3]
        self._core, self._where = np.empty(_MOST, np.int32), np.empty(_MOST)

    def through(
        self, x: SingleArray, triangles: IntArray, poses: ColliderPoses
    ) -> NDArray[np.integer]:
        """The links that run through cloth.

        Args:
            x: Vertices [m], shape [v, 3].
            triangles: Vertex indices, shape [t, 3].
            poses: World poses of the colliders.
        """
        if not len(self.cores):
            return np.zeros(0, np.int32)
        ends = self._cores.posed(poses)[self.cores, self.at]
        T = transform_from(poses.position[self._carrier], poses.orientation[self._carrier])
        joint = np.einsum("lij,lj->li", T[:, :3, :3], self._joint) + T[:, :3, 3]
        halves = np.stack([ends, np.stack([joint, joint], axis=1)], axis=2).reshape(-1, 2, 3)
        count = min(find_hits(halves, x, triangles, self._core, self._where), _MOST)
        return np.unique(self._core[:count] // 2)


def limbs_of(ends: FloatArray) -> tuple[list[list[int]], list[int]]:
    """The shortest tree of cores, each whole, and where its limbs end.

    Args:
        ends: Ends of the cores in a pose at rest [m], shape [c, 2, 3]; nodes 2 c and 2 c + 1.

    Returns:
        Neighbours of each node, and the nodes that are ends of limbs.
    """
    points = ends.reshape(-1, 3)
    n = len(points)
    length = cdist(points, points) + 1e-3
    own = np.arange(0, n, 2)
    # Each core is whole: no other way joins its ends.
    whole = length[own, own + 1].copy()
    length[own, own + 1] = length[own + 1, own] = 1e-6
    neighbours = neighbours_in(length)
    length[own, own + 1] = length[own + 1, own] = whole
    tips = [k for k in range(n) if len(neighbours[k]) == 1]
    return neighbours, [k for k in tips if to_branch(neighbours, length, k) > _SHORT]


def _inside_limbs(neighbours: list[list[int]], ends: list[int]) -> Iterator[tuple[int, int]]:
    """Pairs of nodes, ends of two cores that follow on each other in a limb."""
    found = set()
    for end in ends:
        came, node = -1, end
        while len(on := [k for k in neighbours[node] if k != came]) == 1:
            came, node = node, on[0]
            if came // 2 != node // 2 and len(neighbours[node]) == 2:
                found.add((min(came, node), max(came, node)))
    yield from sorted(found)
