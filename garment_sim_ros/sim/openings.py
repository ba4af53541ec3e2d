"""Which body parts are through which openings of a garment: legs through a hem, arms in sleeves.

A skirt beside both legs has no leg in it, and none runs through its cloth: that no core of a limb
pierces a garment does not say that it is worn. Cores of body parts make a tree. A curve from one
of its tips to another that goes through an opening once cannot leave it but past a tip, or through
the cloth. An opening is the cone from its middle to its edge.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial.distance import cdist

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import boundary_loops
from garment_sim_ros.jit import exact_kernel

_BEYOND = 0.4
"""How far a tip reaches [m]: a foot that is drawn into a long skirt still points at its hem."""
_SHORT = 0.35
"""Branches that are shorter are no limbs, but colliders side by side [m]."""
_MOST = 256
"""Crossings of one opening that are kept."""


class Tips(NamedTuple):
    """The tree of a body's cores.

    Attributes:
        before: Node that comes before each node, -1 at the first, shape [n]; nodes 2 c and 2 c + 1
            are the ends of core c, then comes a node for each tip.
        order: Nodes, each after the one before it, shape [n].
        tip: The nodes that are tips, shape [t].
        end: The end of a core that each tip goes on from, shape [t].
    """

    before: IntArray
    order: IntArray
    tip: IntArray
    end: IntArray


def tips_of(ends: FloatArray) -> Tips | None:
    """The shortest tree of cores, each whole, with ends in a pose at rest [m], shape [c, 2, 3].

    Returns:
        The tree; None where nothing sticks out.
    """
    points = ends.reshape(-1, 3)
    n = len(points)
    length = cdist(points, points) + 1e-3
    own = np.arange(0, n, 2)
    # Each core is whole: no other way joins its ends.
    whole = length[own, own + 1].copy()
    length[own, own + 1] = length[own + 1, own] = 1e-6
    tree = minimum_spanning_tree(length).tocoo()
    is_core = tree.row // 2 == tree.col // 2
    tree.data[is_core] = whole[tree.row[is_core] // 2]
    degree = np.bincount(np.concatenate([tree.row, tree.col]), minlength=n)
    tips = np.flatnonzero(degree == 1).tolist()
    end = np.array([k for k in tips if _branch(tree, degree, k) > _SHORT], np.int32)
    if not len(end):
        return None
    tip = n + np.arange(len(end), dtype=np.int32)
    row, col = np.concatenate([tree.row, end]), np.concatenate([tree.col, tip])
    graph = coo_matrix((np.ones(len(row)), (row, col)), shape=(n + len(end),) * 2)
    order, before = breadth_first_order(graph, int(tip[0]), directed=False)
    return Tips(np.where(before < 0, -1, before), order, tip, end)


def _branch(tree: coo_matrix, degree: NDArray[np.integer], tip: int) -> float:
    """Length of a tree from a tip to where it branches [m]."""
    far, node, came = 0.0, tip, -1
    while node == tip or degree[node] == 2:
        edges = np.flatnonzero((tree.row == node) | (tree.col == node))
        other = tree.row[edges] + tree.col[edges] - node
        on = int(np.flatnonzero(other != came)[0])
        far += float(tree.data[edges[on]])
        came, node = node, int(other[on])
        if degree[node] == 1:
            break
    return far


class Rims(NamedTuple):
    """The edges of a garment's openings, each a fan of triangles about its middle.

    Attributes:
        vertex: The vertices of all edges, one after the other, shape [p].
        first: Where those of each opening start, one more at the end, shape [o + 1].
        fan: Triangles of each opening, as many as vertices: 0 its middle, then they, shape [p, 3].
        corners: Scratch: an opening's middle and edge [m], shape [any, 3].
        node: Scratch: nodes before which the tree crosses a fan, shape [any].
        at: Scratch, shape [any].
    """

    vertex: IntArray
    first: IntArray
    fan: IntArray
    corners: SingleArray
    node: IntArray
    at: FloatArray

    @classmethod
    def of(cls, loops: Sequence[IntArray]) -> "Rims":
        """Those of closed loops of vertices."""
        sizes = [len(loop) for loop in loops]
        return cls(
            vertex=np.concatenate([np.zeros(0, np.int32), *loops]),
            first=np.cumsum([0, *sizes], dtype=np.int32),
            fan=np.concatenate([np.zeros((0, 3), np.int32), *map(_fan, sizes)]),
            corners=np.zeros((1 + max(sizes, default=0), 3), np.float32),
            node=np.empty(_MOST, np.int32),
            at=np.empty(_MOST),
        )


@exact_kernel()
def find_beyond(rims, x, edges, later, before, tip, beyond):
    """For each opening, the tips on its other side as seen from the first tip.

    Args:
        rims: `Rims`.
        x: Vertices of the garment [m], shape [v, 3].
        edges: The edge of the tree that ends at each node of `later` [m], shape [n - 1, 2, 3].
        later: Nodes, each after the one before it, without the first, shape [n - 1].
        before: See `Tips`.
        tip: See `Tips`.
        beyond: Receives them, shape [o, t].
    """
    side, odd = np.zeros(before.size, np.bool_), np.zeros(later.size, np.bool_)
    for o in range(rims.first.size - 1):
        begin, end = rims.first[o], rims.first[o + 1]
        corners = rims.corners[: 1 + end - begin]
        corners[0] = np.float32(0.0)
        for n in range(begin, end):
            for k in range(3):
                at = x[rims.vertex[n], k]
                corners[1 + n - begin, k] = at
                corners[0, k] += at / np.float32(end - begin)
        count = find_hits(edges, corners, rims.fan[begin:end], rims.node, rims.at)
        odd[:] = False
        for n in range(min(count, rims.node.size)):
            odd[rims.node[n]] = not odd[rims.node[n]]
        for n in range(later.size):
            side[later[n]] = side[before[later[n]]] != odd[n]
        for n in range(tip.size):
            beyond[o, n] = side[tip[n]]


class Openings:
    """The openings of one garment on one body.

    Args:
        colliders: The body's colliders.
        T_world_rest: Where they are at rest, where no limb touches another, shape [n, 4, 4]; NaN
            where that is not known.
        triangles: Of the garment, shape [t, 3].
    """

    def __init__(
        self, colliders: ColliderSet, T_world_rest: FloatArray, triangles: IntArray
    ) -> None:
        self._cores = cores = Cores.of(colliders)
        try:
            self._rims = Rims.of(boundary_loops(triangles))
        except GeometryError:  # openings that touch
            self._rims = Rims.of([])
        T = T_world_rest[cores.collider]
        rest = np.einsum("cij,cej->cei", T[:, :3, :3], cores.ends) + T[:, None, :3, 3]
        self._used = np.flatnonzero(np.isfinite(rest).all(axis=(1, 2)))
        self._tips = tips_of(rest[self._used]) if len(self._used) else None
        self._worn = np.zeros((0, 0), np.bool_)

    def begin(self, x: SingleArray, poses: ColliderPoses) -> None:
        """The garment was put on: what is through its openings now shall be.

        Args:
            x: Its vertices [m], shape [v, 3].
            poses: World poses of the colliders.
        """
        self._worn = self._through(x, self._cores.posed(poses))

    def lost(self, x: SingleArray, poses: ColliderPoses) -> bool:
        """Whether nothing is through an opening any more that something was through."""
        if not self._worn.any():
            return False  # It was not put on, or nothing is through it.
        now = self._through(x, self._cores.posed(poses))
        return bool((self._worn.any(axis=1) & ~(self._worn & now).any(axis=1)).any())

    def _through(self, x: SingleArray, ends: FloatArray) -> NDArray[np.bool_]:
        """For each opening, the tips on its other side as seen from the first tip."""
        if self._tips is None:
            return np.zeros((0, 0), np.bool_)
        tips = self._tips
        points = ends[self._used].reshape(-1, 3)
        way = points[tips.end] - points[tips.end ^ 1]
        way *= _BEYOND / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        nodes = np.concatenate([points, points[tips.end] + way])
        later = tips.order[1:]
        edges = np.stack([nodes[tips.before[later]], nodes[later]], axis=1)
        beyond = np.zeros((len(self._rims.first) - 1, len(tips.tip)), np.bool_)
        find_beyond(self._rims, x, edges, later, tips.before, tips.tip, beyond)
        return beyond


def _fan(count: int) -> IntArray:
    """Triangles from point 0 to a ring of so many points from 1 on."""
    ring = np.arange(count, dtype=np.int32)
    return np.stack([np.zeros_like(ring), 1 + ring, 1 + (ring + 1) % count], axis=1)
