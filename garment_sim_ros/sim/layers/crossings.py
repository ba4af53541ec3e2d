"""Where two garments run through each other: edges of either through triangles of the other."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.geometry.boxes import boxes_near, column_of
from garment_sim_ros.geometry.vectors import cross, dot, less, row
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.self_collision.gaps import crosses
from garment_sim_ros.sim.self_collision.patches import Mesh


class Boxes(NamedTuple):
    """Scratch arrays: boxes as low and high corners [m].

    Attributes:
        patches: Of the patches, shape [p, 6].
        whole: Of each garment, shape [2, 6].
        near: Patches of each garment that are in the box of the other one, shape [2, p].
        columns: Of those of the second garment, as `geometry.boxes` has them, flat.
        triangles: Of the triangles of each of those, likewise, shape [p, any].
        found: Patches of these that are near one of the first garment, shape [p + 1].
        meets: Triangles of a patch that are near a triangle, shape [any].
        corner: The particles of all patches, one patch after the other, shape [any].
        first_corner: The first of each patch, and the end, shape [p + 1].
    """

    patches: SingleArray
    whole: SingleArray
    near: IntArray
    columns: SingleArray
    triangles: SingleArray
    found: IntArray
    meets: IntArray
    corner: IntArray
    first_corner: IntArray

    @classmethod
    def room_for(cls, mesh: Mesh) -> "Boxes":
        """For the triangles and patches of a mesh."""
        p, largest = len(mesh.first) - 1, int(np.diff(mesh.first).max())
        corners = [np.unique(mesh.triangles[a:b]) for a, b in pairwise(mesh.first)]
        return cls(
            np.zeros((p, 6), np.float32),
            np.zeros((2, 6), np.float32),
            np.zeros((2, p), np.int32),
            np.zeros(6 * column_of(p), np.float32),
            np.zeros((p, 6 * column_of(largest)), np.float32),
            np.zeros(p + 1, np.int32),
            np.zeros(largest + 1, np.int32),
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
def _of_triangle(x, triangles, t):
    """The box of a triangle, six numbers."""
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    return (
        min(min(x[i, 0], x[j, 0]), x[k, 0]),
        min(min(x[i, 1], x[j, 1]), x[k, 1]),
        min(min(x[i, 2], x[j, 2]), x[k, 2]),
        max(max(x[i, 0], x[j, 0]), x[k, 0]),
        max(max(x[i, 1], x[j, 1]), x[k, 1]),
        max(max(x[i, 2], x[j, 2]), x[k, 2]),
    )


@lean_kernel(inner=True)
def _columns_in_patch(x, mesh, p, columns):
    """The boxes of a patch's triangles in columns."""
    columns[:] = np.float32(np.inf)
    width = columns.size // 6
    for t in range(mesh.first[p], mesh.first[p + 1]):
        box = _of_triangle(x, mesh.triangles, t)
        for d in range(6):
            columns[d * width + t - mesh.first[p]] = box[d]


@lean_kernel(inner=True)
def _of_patch(boxes, p):
    """The box of a patch, six numbers."""
    return boxes[p, 0], boxes[p, 1], boxes[p, 2], boxes[p, 3], boxes[p, 4], boxes[p, 5]


@lean_kernel(inner=True)
def _beside(box, boxes, b):
    """Whether a box, six numbers, does not touch box b; what is not finite touches nothing."""
    return not (
        box[0] <= boxes[b, 3]
        and boxes[b, 0] <= box[3]
        and box[1] <= boxes[b, 4]
        and boxes[b, 1] <= box[4]
        and box[2] <= boxes[b, 5]
        and boxes[b, 2] <= box[5]
    )


@lean_kernel(inner=True)
def _on_one_side(x, mesh, t, u):
    """Whether triangle t is on one side of the plane of triangle u, or somewhere not finite."""
    i, j, k = mesh.triangles[u, 0], mesh.triangles[u, 1], mesh.triangles[u, 2]
    at = row(x, i)
    normal = cross(less(row(x, j), at), less(row(x, k), at))
    a = dot(normal, less(row(x, mesh.triangles[t, 0]), at))
    b = dot(normal, less(row(x, mesh.triangles[t, 1]), at))
    c = dot(normal, less(row(x, mesh.triangles[t, 2]), at))
    zero = np.float32(0.0)
    return not (min(min(a, b), c) < zero and max(max(a, b), c) > zero)


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
        if not _beside(_of_patch(patch_boxes, p), whole, w):
            near[count] = p
            count += 1
    return count


@lean_kernel(inner=True)
def _near_box(columns, box, found):
    """Boxes that touch a box, into `found`; their number."""
    return boxes_near(
        *(columns, box[0], box[1], box[2], box[3], box[4], box[5], np.float32(0.0), found)
    )


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
    first, patch_boxes, whole, near = mesh.first, scratch.patches, scratch.whole, scratch.near
    patches = first.size - 1
    for p in range(patches):
        _box_of_patch(x, scratch, p)
    _join(patch_boxes, 0, split, whole, 0)
    _join(patch_boxes, split, patches, whole, 1)
    ones = _in_reach(patch_boxes, 0, split, whole, 1, near[0])
    others = _in_reach(patch_boxes, split, patches, whole, 0, near[1])
    for n in range(others):
        _columns_in_patch(x, mesh, near[1, n], scratch.triangles[n])
    width = (others + 3) // 4 * 4
    columns = scratch.columns[: 6 * width]
    columns[:] = np.float32(np.inf)
    for d in range(6):
        for n in range(others):
            columns[d * width + n] = patch_boxes[near[1, n], d]
    count = 0
    for m in range(ones):
        p = near[0, m]
        close = _near_box(columns, _of_patch(patch_boxes, p), scratch.found)
        for t in range(first[p], first[p + 1] if close > 0 else first[p]):
            box = _of_triangle(x, mesh.triangles, t)
            for c in range(close):
                n = scratch.found[c]
                if _beside(box, patch_boxes, near[1, n]):
                    continue
                meets = _near_box(scratch.triangles[n], box, scratch.meets)
                for k in range(meets):
                    u = first[near[1, n]] + scratch.meets[k]
                    if _on_one_side(x, mesh, t, u) or _on_one_side(x, mesh, u, t):
                        continue
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
