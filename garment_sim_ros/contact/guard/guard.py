"""What the guard keeps of one garment and one body, see `contact.guard.keep_out`."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.guard.outside import outside
from garment_sim_ros.contact.packed import PackedShapes
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.geometry.boxes import column_of

_SHARE = 0.6
"""Distance that triangles keep from a core, as a share of how deep it is in its shape."""
_LEAST, _LARGEST = 0.004, 0.03
"""Least and most of it [m]: a core may touch the surface of a slanting shape."""
TRACK = 0.015
"""Sides are remembered so far beyond that distance [m]."""
BLOCK = 16
"""Triangles of a block, which has one box."""
_MOST = 8192
"""Pairs of a core and a triangle that can be near each other at once."""


class Guard(NamedTuple):
    """Cores, triangles, and on which side of each other they are.

    Attributes:
        shape: The packed shape of each core, shape [c].
        ends: Both ends in its frame [m], shape [c, 2, 3].
        radius: Distance that triangles keep from each core [m], shape [c].
        triangles: As particles, neighbours one after the other, shape [t, 3].
        corner: Corners of the triangles of each block, each once, one block after the other.
        corner_start: First corner of each block and the end, shape [b + 1].
        outside: Whether each core belongs outside of each triangle, not under it, shape [c, t].
        either: Whether it may be on either side of it, shape [c, t].
        box: Scratch: boxes of blocks of triangles [m], shape [b, 6].
        posed: Scratch: ends of the cores at the last search and now [m], shape [2, c, 2, 3].
        columns: Scratch: the same boxes, see `geometry.boxes`.
        blocks: Scratch: blocks of triangles that are near a core, shape [b + 1].
        pairs: Scratch: cores and triangles that are near each other, room for one more, shape
            [2, k + 1].
        seen: Number of the search in which each core was near each triangle, shape [c, t].
        side: Unit direction from the core to the triangle then, shape [c, t, 3].
        crossed: Whether the triangle has to come back to that side, shape [c, t].
        stuck: The search in which each core was last found in a triangle, and in how many of them
            it was, less those without, shape [2, c].
        kept: The core that holds each free particle since the last search, -1 for none, shape [n].
        moved: Scratch: how far each free particle was moved in the search [m], shape [n].
        counts: Number of the search; pairs of the last one; triangles moved in it; cores that
            were found in a triangle, without a side that they came from; shape [4].
    """

    shape: IntArray
    ends: FloatArray
    radius: FloatArray
    triangles: IntArray
    corner: IntArray
    corner_start: IntArray
    outside: NDArray[np.bool_]
    either: NDArray[np.bool_]
    box: SingleArray
    posed: FloatArray
    columns: SingleArray
    blocks: IntArray
    pairs: IntArray
    seen: IntArray
    side: SingleArray
    crossed: NDArray[np.bool_]
    stuck: IntArray
    kept: IntArray
    moved: SingleArray
    counts: IntArray

    @classmethod
    def of(
        cls,
        colliders: ColliderSet,
        shapes: PackedShapes,
        triangles: IntArray,
        side: NDArray[np.int8],
        T_world_rest: FloatArray,
        x_rest: FloatArray,
    ) -> "Guard":
        """For one garment.

        Args:
            colliders: The body's colliders.
            shapes: Those that can be touched, m.
            triangles: Of the garment, as particles, counter-clockwise from outside, shape [t, 3].
            side: Side of each shape for each free particle, see `contact.sides.Sides`, [m, n].
            T_world_rest: Where the colliders are at rest, shape [k, 4, 4]; NaN: not known.
            x_rest: All particles there [m], shape [n + p, 3].
        """
        cores = Cores.of(colliders)
        shape_of = {int(i): k for k, i in enumerate(shapes.collider)}
        used = [k for k, i in enumerate(cores.collider) if int(i) in shape_of]
        shape = np.array([shape_of[int(cores.collider[k])] for k in used], np.int32)
        order = np.lexsort(np.sort(triangles, axis=1).T[::-1])
        triangles = np.ascontiguousarray(triangles[order], np.int32)
        c, t, free = len(used), len(triangles), side.shape[1]
        corners = [np.unique(triangles[b : b + BLOCK]) for b in range(0, t, BLOCK)]
        T = T_world_rest[cores.collider[used]]
        rest = np.einsum("cij,cej->cei", T[:, :3, :3], cores.ends[used]) + T[:, None, :3, 3]
        out, either = outside(side[shape], rest, triangles, x_rest, float(shapes.longest))
        return cls(
            shape=shape,
            ends=np.ascontiguousarray(cores.ends[used]),
            radius=np.clip(_SHARE * cores.depth[used], _LEAST, _LARGEST),
            triangles=triangles,
            corner=np.concatenate([*corners, np.zeros(0, np.int32)]).astype(np.int32),
            corner_start=np.cumsum([0, *map(len, corners)], dtype=np.int32),
            outside=out,
            either=either,
            box=np.zeros((-(-t // BLOCK), 6), np.float32),
            posed=np.zeros((2, c, 2, 3)),
            columns=np.zeros(6 * column_of(-(-t // BLOCK)), np.float32),
            blocks=np.zeros(-(-t // BLOCK) + 1, np.int32),
            pairs=np.zeros((2, _MOST + 1), np.int32),
            seen=np.full((c, t), -9, np.int32),
            side=np.zeros((c, t, 3), np.float32),
            crossed=np.zeros((c, t), np.bool_),
            stuck=np.zeros((2, c), np.int32),
            kept=np.full(free, -1, np.int32),
            moved=np.zeros(free, np.float32),
            counts=np.zeros(4, np.int32),
        )

    @classmethod
    def none(cls, free: int) -> "Guard":
        """Without any core, for a garment of so many free particles."""
        return cls(
            shape=np.zeros(0, np.int32),
            ends=np.zeros((0, 2, 3)),
            radius=np.zeros(0),
            triangles=np.zeros((0, 3), np.int32),
            corner=np.zeros(0, np.int32),
            corner_start=np.zeros(1, np.int32),
            outside=np.zeros((0, 0), np.bool_),
            either=np.zeros((0, 0), np.bool_),
            box=np.zeros((0, 6), np.float32),
            posed=np.zeros((2, 0, 2, 3)),
            columns=np.zeros(0, np.float32),
            blocks=np.zeros(1, np.int32),
            pairs=np.zeros((2, 1), np.int32),
            seen=np.zeros((0, 0), np.int32),
            side=np.zeros((0, 0, 3), np.float32),
            crossed=np.zeros((0, 0), np.bool_),
            stuck=np.zeros((2, 0), np.int32),
            kept=np.full(free, -1, np.int32),
            moved=np.zeros(free, np.float32),
            counts=np.zeros(4, np.int32),
        )

    def forget(self) -> None:
        """The garment was put elsewhere: sides are found anew."""
        self.seen[:] = -9
        self.kept[:] = -1
