"""Which body parts are through which openings of a garment: legs through a hem, arms in sleeves.

A skirt beside both legs has no leg in it, and none runs through its cloth: that no core of a limb
pierces a garment does not say that it is worn. The joints of the body make a tree. A curve from
one of its tips to another that goes through an opening once cannot leave it but past a tip, or
through the cloth. An opening is the cone from its middle to its edge.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import boundary_loops
from garment_sim_ros.geometry.winding_number import inside_of
from garment_sim_ros.jit import exact_kernel
from garment_sim_ros.sim.limb_tree import LimbTree

_MOST = 256
"""Crossings of one opening that are kept."""


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
        before: See `LimbTree`.
        tip: See `LimbTree`.
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


class Lids(NamedTuple):
    """A garment with lids on its openings, so that a point is inside of it or not.

    Attributes:
        triangles: Its own, then those of the lids, shape [t, 3].
        x: Scratch: its vertices, then the middle of each lid [m], shape [v + o, 3].
    """

    triangles: IntArray
    x: SingleArray

    @classmethod
    def of(cls, triangles: IntArray, rims: Rims) -> "Lids":
        """Lids on some openings."""
        count = int(triangles.max(initial=-1)) + 1
        lids = []
        for o, (begin, end) in enumerate(zip(rims.first[:-1], rims.first[1:], strict=True)):
            corners = np.append(count + o, rims.vertex[begin:end])
            # Against the direction of the garment's own edges there, which fans have.
            lids.append(corners[rims.fan[begin:end, ::-1]])
        x = np.zeros((count + len(lids), 3), np.float32)
        return cls(np.concatenate([triangles, *lids]).astype(np.int32), x)

    def around(self, x: SingleArray, rims: Rims, points: FloatArray) -> NDArray[np.bool_]:
        """Which points are inside of a garment.

        Args:
            x: Its vertices [m], shape [v, 3].
            rims: Its openings.
            points: World positions [m], shape [p, 3].
        """
        count = len(self.x) - (len(rims.first) - 1)
        self.x[:count] = x[:count]
        for o, (begin, end) in enumerate(zip(rims.first[:-1], rims.first[1:], strict=True)):
            self.x[count + o] = x[rims.vertex[begin:end]].mean(axis=0)
        found = np.zeros(len(points), np.bool_)
        inside_of(self.x, self.triangles, points, found)
        return found


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
        try:
            self._rims = Rims.of(boundary_loops(triangles))
        except GeometryError:  # openings that touch
            self._rims = Rims.of([])
        self._lids = Lids.of(triangles, self._rims)
        self._tree = LimbTree.of(colliders, T_world_rest)
        self._worn = np.zeros((0, 0), np.bool_)

    def begin(self, x: SingleArray, poses: ColliderPoses) -> None:
        """The garment was put on: what is through its openings now shall be.

        Args:
            x: Its vertices [m], shape [v, 3].
            poses: World poses of the colliders.
        """
        if self._tree is None:
            return
        nodes = self._tree.posed(poses)
        self._worn = self._beyond(x, self._tree, nodes)
        self._drawn_in(x, self._tree, nodes)  # so that it is compiled before it is needed

    def lost(self, x: SingleArray, poses: ColliderPoses) -> bool:
        """Whether nothing is through an opening any more that something was through.

        What is drawn in, as feet are in a long skirt when the body crouches, is not lost.
        """
        if self._tree is None or not self._worn.any():
            return False  # It was not put on, or nothing is through it.
        nodes = self._tree.posed(poses)
        holds = self._worn & self._beyond(x, self._tree, nodes)
        lost = self._worn.any(axis=1) & ~holds.any(axis=1)
        if not lost.any():
            return False
        drawn_in = self._worn & self._drawn_in(x, self._tree, nodes)
        return bool((lost & ~drawn_in.any(axis=1)).any())

    def _beyond(self, x: SingleArray, tree: LimbTree, nodes: FloatArray) -> NDArray[np.bool_]:
        """For each opening, the tips on its other side as seen from the first tip."""
        later = tree.order[1:]
        edges = np.stack([nodes[tree.before[later]], nodes[later]], axis=1)
        beyond = np.zeros((len(self._rims.first) - 1, len(tree.tip)), np.bool_)
        find_beyond(self._rims, x, edges, later, tree.before, tree.tip, beyond)
        return beyond

    def _drawn_in(self, x: SingleArray, tree: LimbTree, nodes: FloatArray) -> NDArray[np.bool_]:
        """Which limbs end inside of the garment."""
        return self._lids.around(x, self._rims, nodes[tree.tip - len(tree.tip)])


def _fan(count: int) -> IntArray:
    """Triangles from point 0 to a ring of so many points from 1 on."""
    ring = np.arange(count, dtype=np.int32)
    return np.stack([np.zeros_like(ring), 1 + ring, 1 + (ring + 1) % count], axis=1)
