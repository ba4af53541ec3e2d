"""A garment's triangles in connected patches, and room for what they sweep."""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.geometry.topology import edge_table, triangles_across

_PATCH = 12
"""Triangles of a patch."""


class Mesh(NamedTuple):
    """A garment's triangles, patch by patch.

    Attributes:
        rest: Rest positions of its particles [m], shape [n, 3].
        triangles: Triangles as particles, shape [t, 3].
        wing: The corner on the far side of edges ab, bc, ca, -1 at a border, shape [t, 3].
        owned: Bits 0 to 2: corners that a triangle looks after; 3 to 5: edges, shape [t].
        first: The first triangle of each patch, and the end, shape [p + 1].
    """

    rest: SingleArray
    triangles: IntArray
    wing: IntArray
    owned: NDArray[np.uint8]
    first: IntArray

    @classmethod
    def of(cls, triangles: IntArray, rest: SingleArray) -> "Mesh":
        """Triangles [t, 3] of particles that rest at [m], shape [n, 3]."""
        triangles, first = _in_patches(triangles)
        return cls(rest, triangles, _wings(triangles), _owned(triangles), first)


class Swept(NamedTuple):
    """Scratch arrays of a search, for triangles and for patches of them.

    Attributes:
        boxes: Boxes that triangles sweep, low and high [m], shape [t, 6].
        normal: Their unit normals, shape [t, 3].
        centre: Their centres [m], shape [t, 3].
        rest_centre: The same at rest.
        radius: How far their corners are from there [m], shape [t].
        mean_way: Mean ways of their corners [m], shape [t, 3].
        sway: How far those of corners are from that [m], shape [t].
        patch_boxes: Boxes of patches, and of all [m], shape [p + 1, 6].
        axis: Means of their normals, of unit length, shape [p, 3].
        spread: The greatest angle of a normal to that [rad], shape [p].
        patch_centre: Their centres [m], shape [p, 3].
        patch_rest_centre: The same at rest.
        patch_way: Their mean ways [m], shape [p, 3].
        flutter: How far those of corners are from that [m], shape [p].
        reach: How far from each other triangles, and patches, are neighbours at rest; and what
            they may move against each other to stay side by side [m], shape [3].
    """

    boxes: SingleArray
    normal: SingleArray
    centre: SingleArray
    rest_centre: SingleArray
    radius: SingleArray
    mean_way: SingleArray
    sway: SingleArray
    patch_boxes: SingleArray
    axis: SingleArray
    spread: SingleArray
    patch_centre: SingleArray
    patch_rest_centre: SingleArray
    patch_way: SingleArray
    flutter: SingleArray
    reach: SingleArray

    @classmethod
    def room_for(cls, mesh: Mesh, edge: np.float32) -> "Swept":
        """For a mesh with a mean edge [m]."""
        t, p = len(mesh.triangles), len(mesh.first) - 1
        centre = mesh.rest[mesh.triangles].mean(axis=1)
        patch = np.add.reduceat(centre, mesh.first[:-1]) / np.diff(mesh.first)[:, None]
        rest_of = {"rest_centre": centre, "patch_rest_centre": patch.astype(np.float32)}
        widths = {"boxes": 6, "normal": 3, "centre": 3, "mean_way": 3}
        patch_widths = {"axis": 3, "patch_centre": 3, "patch_way": 3}
        return cls(
            **{name: np.zeros((t, width), np.float32) for name, width in widths.items()},
            **{name: np.zeros((p, width), np.float32) for name, width in patch_widths.items()},
            **rest_of,
            patch_boxes=np.zeros((p + 1, 6), np.float32),
            radius=np.zeros(t, np.float32),
            sway=np.zeros(t, np.float32),
            spread=np.zeros(p, np.float32),
            flutter=np.zeros(p, np.float32),
            reach=edge * np.array([4.0, 2.0 * np.sqrt(0.5 * _PATCH), 0.5], np.float32),
        )


def _in_patches(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles in the order of connected patches, and the first of each patch, shape [p + 1]."""
    beyond = triangles_across(triangles)
    taken = np.zeros(len(triangles), bool)
    order: list[int] = []
    first = [0]
    seeds = deque(range(len(triangles)))
    while seeds:
        seed = seeds.popleft()
        if taken[seed]:
            continue
        taken[seed] = True
        order.append(seed)
        place = first[-1]
        while place < len(order) and len(order) - first[-1] < _PATCH:
            for u in beyond[order[place]]:
                if u >= 0 and not taken[u] and len(order) - first[-1] < _PATCH:
                    taken[u] = True
                    order.append(int(u))
            place += 1
        # The next patch begins beside this one, so that none is left between.
        seeds.extendleft(
            int(u) for t in order[first[-1] :] for u in beyond[t] if u >= 0 and not taken[u]
        )
        first.append(len(order))
    return np.ascontiguousarray(triangles[order]), np.array(first, np.int32)


def _wings(triangles: IntArray) -> IntArray:
    """The corner across edges ab, bc, ca, -1 at a border, shape [t, 3]."""
    beyond = triangles_across(triangles)
    wing = np.full((len(triangles), 3), -1, np.int32)
    for k in range(3):
        t = np.flatnonzero(beyond[:, k] >= 0)
        there = triangles[beyond[t, k]]
        ends = triangles[t][:, [k, (k + 1) % 3]]
        off = (there[:, :, None] != ends[:, None, :]).all(axis=2)
        wing[t, k] = there[np.arange(len(t)), off.argmax(axis=1)]
    return wing


def _owned(triangles: IntArray) -> NDArray[np.uint8]:
    """Corners (bits 0 to 2) and edges (bits 3 to 5) that each triangle is the first to have."""
    owned = np.zeros(3 * len(triangles), np.uint8)
    corner = np.arange(3 * len(triangles)) % 3
    _, first = np.unique(triangles, return_index=True)
    owned[first] |= (1 << corner[first]).astype(np.uint8)
    _, first = np.unique(edge_table(triangles)[1], return_index=True)
    owned[first] |= (8 << corner[first]).astype(np.uint8)
    return np.bitwise_or.reduce(owned.reshape(-1, 3), axis=1)
