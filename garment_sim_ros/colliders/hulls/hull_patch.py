"""A closed triangle mesh in which a patch of faces is replaced by a fan around one vertex.

Faces know their neighbours: ``neighbours[f, i]`` lies across the edge from corner i to corner
i + 1. Everything is compiled, on flat arrays; a dead face has ``faces[f, 0] == -1``.
"""

import numpy as np

from garment_sim_ros.arrays import IntArray
from garment_sim_ros.jit import exact_kernel

MAX_PATCH = 512
"""Most faces that one patch may have."""


def face_neighbours(faces: IntArray) -> IntArray:
    """Neighbour of each face across the edge from each corner to the next, shape [f, 3]."""
    first = faces.astype(np.int64)
    second = np.roll(first, -1, axis=1)
    size = int(faces.max()) + 1
    forward = (first * size + second).ravel()
    backward = (second * size + first).ravel()
    order = np.argsort(forward)
    at = order[np.searchsorted(forward, backward, sorter=order)]
    return np.ascontiguousarray((at // 3).reshape(-1, 3), dtype=np.int32)


@exact_kernel()
def gather_patch(faces, neighbours, seed, removed, patch):
    """Faces that touch one of the vertices `removed` [3] (padded by repeating one).

    Args:
        faces: Triangles, shape [f, 3].
        neighbours: See `face_neighbours`.
        seed: A face that touches one of them.
        removed: Connected vertices, shape [3].
        patch: Output faces, shape [MAX_PATCH].

    Returns:
        The number of faces, -1 if there are too many.
    """
    patch[0] = seed
    count = 1
    done = 0
    while done < count:
        f = patch[done]
        done += 1
        for i in range(3):
            g = neighbours[f, i]
            touches = False
            for c in range(3):
                v = faces[g, c]
                if v == removed[0] or v == removed[1] or v == removed[2]:
                    touches = True
            if not touches:
                continue
            known = False
            for k in range(count):
                if patch[k] == g:
                    known = True
                    break
            if not known:
                if count == patch.shape[0]:
                    return -1
                patch[count] = g
                count += 1
    return count


@exact_kernel()
def gather_link(faces, neighbours, removed, patch, count, link, outer):
    """The patch's outline in order, counter-clockwise, and what is outside its edges.

    Args:
        faces: Triangles, shape [f, 3].
        neighbours: See `face_neighbours`.
        removed: Vertices inside the patch, shape [3].
        patch: Faces of the patch, from `gather_patch`.
        count: Their number.
        link: Output vertices; edge k runs from link[k] to link[k + 1], shape [MAX_PATCH].
        outer: Output 3 f + i, where edge k is that of face f from corner i, shape [MAX_PATCH].

    Returns:
        The number of edges, 0 if the outline is not one simple loop around a disk.
    """
    edges = 0
    for k in range(count):
        f = patch[k]
        for i in range(3):
            a = faces[f, i]
            b = faces[f, (i + 1) % 3]
            a_inside = a == removed[0] or a == removed[1] or a == removed[2]
            b_inside = b == removed[0] or b == removed[1] or b == removed[2]
            if not a_inside and not b_inside:
                if edges == link.shape[0] - 1:
                    return 0
                link[edges] = a
                outer[edges] = neighbours[f, i] * 3 + _corner(faces, neighbours[f, i], b)
                edges += 1
    if edges < 3:
        return 0
    for k in range(edges - 1):  # sort: the edge that starts where edge k ends comes next
        f = outer[k] // 3
        end = faces[f, outer[k] % 3]
        at = -1
        for j in range(edges):
            if link[j] == end:
                if at >= 0:
                    return 0
                at = j
        if at <= k:
            return 0
        link[k + 1], link[at] = link[at], link[k + 1]
        outer[k + 1], outer[at] = outer[at], outer[k + 1]
    inside = 1
    inside += removed[1] != removed[0]
    inside += removed[2] != removed[0] and removed[2] != removed[1]
    return edges if count == edges + 2 * inside - 2 else 0


@exact_kernel(inner=True)
def _corner(faces, f, v):
    """Which corner of face f is vertex v."""
    if faces[f, 0] == v:
        return 0
    return 1 if faces[f, 1] == v else 2


@exact_kernel()
def replace_patch(faces, neighbours, patch, count, link, outer, edges, vertex):
    """Put the fan of `vertex` over the outline in the patch's place."""
    for k in range(edges):
        f = patch[k]
        faces[f, 0] = link[k]
        faces[f, 1] = link[(k + 1) % edges]
        faces[f, 2] = vertex
        neighbours[f, 0] = outer[k] // 3
        neighbours[f, 1] = patch[(k + 1) % edges]
        neighbours[f, 2] = patch[(k - 1) % edges]
        neighbours[outer[k] // 3, outer[k] % 3] = f
    for k in range(edges, count):
        faces[patch[k], 0] = -1
