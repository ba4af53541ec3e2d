"""Where two garments run through each other: edges of either through triangles of the other."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.self_collision.gaps import crosses
from garment_sim_ros.sim.self_collision.patches import Mesh


class Boxes(NamedTuple):
    """Scratch arrays: boxes as low and high corners [m].

    Attributes:
        triangles: Of the triangles, shape [t, 6].
        patches: Of the patches, shape [p, 6].
        whole: Of each garment, shape [2, 6].
        near: Patches of each garment that are in the box of the other one, shape [2, p].
        corner: The particles of all patches, one patch after the other, shape [any].
        first_corner: The first of each patch, and the end, shape [p + 1].
    """

    triangles: SingleArray
    patches: SingleArray
    whole: SingleArray
    near: IntArray
    corner: IntArray
    first_corner: IntArray

    @classmethod
    def room_for(cls, mesh: Mesh) -> "Boxes":
        """For the triangles and patches of a mesh."""
        t, p = len(mesh.triangles), len(mesh.first) - 1
        corners = [np.unique(mesh.triangles[a:b]) for a, b in pairwise(mesh.first)]
        return cls(
            np.zeros((t, 6), np.float32),
            np.zeros((p, 6), np.float32),
            np.zeros((2, 6), np.float32),
            np.zeros((2, p), np.int32),
            np.concatenate(corners).astype(np.int32),
            np.cumsum([0, *map(len, corners)], dtype=np.int32),
        )


@lean_kernel(inner=True)
def _box_of_patch(x, scratch, p):
    """The box of a patch."""
    corner, first, boxes = scratch.corner, scratch.first_corner, scratch.patches
    for d in range(3):
        low = high = x[corner[first[p]], d]
        for c in range(first[p] + 1, first[p + 1]):
            at = x[corner[c], d]
            low, high = min(low, at), max(high, at)
        boxes[p, d], boxes[p, 3 + d] = low, high


@lean_kernel(inner=True)
def _boxes_in_patch(x, mesh, scratch, p):
    """The boxes of a patch's triangles."""
    boxes = scratch.triangles
    for t in range(mesh.first[p], mesh.first[p + 1]):
        i, j, k = mesh.triangles[t, 0], mesh.triangles[t, 1], mesh.triangles[t, 2]
        for d in range(3):
            boxes[t, d] = min(min(x[i, d], x[j, d]), x[k, d])
            boxes[t, 3 + d] = max(max(x[i, d], x[j, d]), x[k, d])


@lean_kernel(inner=True)
def _apart(boxes, a, others, b):
    """Whether two boxes do not overlap; what is not finite overlaps nothing."""
    return not (
        boxes[a, 0] <= others[b, 3]
        and others[b, 0] <= boxes[a, 3]
        and boxes[a, 1] <= others[b, 4]
        and others[b, 1] <= boxes[a, 4]
        and boxes[a, 2] <= others[b, 5]
        and others[b, 2] <= boxes[a, 5]
    )


@lean_kernel(inner=True)
def _add_edges(x, mesh, t, u, crossings, count):
    """Adds edges that triangle t looks after and that run through triangle u; the new count."""
    triangles = mesh.triangles
    i, j, k = triangles[u, 0], triangles[u, 1], triangles[u, 2]
    for c in range(3):
        if not (mesh.owned[t] >> c) & 8:
            continue
        a, b = triangles[t, c], triangles[t, (c + 1) % 3]
        if crosses(x, a, b, i, j, k):
            if count < crossings.shape[0]:
                crossings[count, 0], crossings[count, 1] = a, b
                crossings[count, 2] = triangles[t, (c + 2) % 3]
                crossings[count, 3] = mesh.wing[t, c]
                crossings[count, 4], crossings[count, 5], crossings[count, 6] = i, j, k
            count += 1
    return count


@lean_kernel(inner=True)
def _in_reach(patch_boxes, first, last, whole, w, near):
    """Patches in a row whose boxes overlap box w of `whole`, into `near`; their number."""
    count = 0
    for p in range(first, last):
        if not _apart(patch_boxes, p, whole, w):
            near[count] = p
            count += 1
    return count


@lean_kernel(inner=True)
def _join(patch_boxes, first, last, whole, w):
    """The box of boxes in a row into row w of `whole`."""
    for d in range(3):
        low, high = patch_boxes[first, d], patch_boxes[first, 3 + d]
        for p in range(first, last):
            low, high = min(low, patch_boxes[p, d]), max(high, patch_boxes[p, 3 + d])
        whole[w, d], whole[w, 3 + d] = low, high


@lean_kernel()
def find_crossings(x, mesh, split, scratch, crossings):
    """Finds the edges of two garments that run through a triangle of the other one.

    Boxes of patches of triangles tell which triangles may meet.

    Args:
        x: Positions of both garments' particles [m], shape [n, 3].
        mesh: Both garments in one: `sim.self_collision.patches.Mesh`.
        split: The first patch of the second garment.
        scratch: `Boxes`.
        crossings: Output, ends of an edge, the corners beside it (the second -1 at a border), and
            the triangle, shape [any, 7].

    Returns:
        How many there are; more than there is room for where some were left out.
    """
    first = mesh.first
    patch_boxes, boxes, whole, near = (
        scratch.patches,
        scratch.triangles,
        scratch.whole,
        scratch.near,
    )
    patches = first.size - 1
    for p in range(patches):
        _box_of_patch(x, scratch, p)
    _join(patch_boxes, 0, split, whole, 0)
    _join(patch_boxes, split, patches, whole, 1)
    ones = _in_reach(patch_boxes, 0, split, whole, 1, near[0])
    others = _in_reach(patch_boxes, split, patches, whole, 0, near[1])
    for n in range(others):
        _boxes_in_patch(x, mesh, scratch, near[1, n])
    count = 0
    for m in range(ones):
        p = near[0, m]
        _boxes_in_patch(x, mesh, scratch, p)
        for n in range(others):
            q = near[1, n]
            if _apart(patch_boxes, p, patch_boxes, q):
                continue
            for t in range(first[p], first[p + 1]):
                if _apart(boxes, t, patch_boxes, q):
                    continue
                for u in range(first[q], first[q + 1]):
                    if not _apart(boxes, t, boxes, u):
                        count = _add_edges(x, mesh, t, u, crossings, count)
                        count = _add_edges(x, mesh, u, t, crossings, count)
    return count


@lean_kernel()
def leave_out(touches, crossings, count):
    """Leaves out the crossings in which a particle takes part that touches a shape.

    Args:
        touches: Whether each particle does, shape [n].
        crossings: As of `find_crossings`, changed in place.
        count: Number of them.

    Returns:
        How many are left, the first ones.
    """
    left = 0
    for c in range(count):
        a, b = crossings[c, 0], crossings[c, 1]
        i, j, k = crossings[c, 4], crossings[c, 5], crossings[c, 6]
        for n in range(crossings.shape[1]):
            crossings[left, n] = crossings[c, n]
        if not (touches[a] or touches[b] or touches[i] or touches[j] or touches[k]):
            left += 1
    return left
