"""Signed distance to a deforming triangle mesh through a refitted bounding volume hierarchy.

The hierarchy is an implicit complete binary tree (children of node i: 2 i + 1 and 2 i + 2) over
triangles ordered once, at construction; `refit` only recomputes boxes and normals. The sign comes
from angle-weighted pseudo-normals (Baerentzen & Aanaes 2005, "Signed distance computation using
the angle weighted pseudonormal"), which is exact at edges and vertices of a closed mesh.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.geometry.winding_number import insides, refit_dipoles
from garment_sim_ros.jit import exact_kernel, kernel

_LEAF_SIZE = 4


class MeshDistance:
    """Distance queries against one mesh whose vertices may move.

    The mesh should be closed, manifold and welded, triangles counter-clockwise seen from outside.
    Elsewhere (holes, parts that cut each other) the sign is that of the nearest surface's side.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3], at least one.

    Raises:
        GeometryError: No triangle, an index out of range, or positions that are not finite.
    """

    def __init__(self, vertices: FloatArray, triangles: IntArray) -> None:
        x = np.array(vertices, dtype=np.float64, order="C")
        triangles = np.ascontiguousarray(triangles, dtype=np.int32)
        if triangles.ndim != 2 or triangles.shape[1:] != (3,) or len(triangles) == 0:
            raise GeometryError(f"triangles have shape {triangles.shape}; allowed: [1 or more, 3]")
        if x.ndim != 2 or x.shape[1] != 3 or not np.isfinite(x).all():
            raise GeometryError("vertices must be finite, shape [v, 3]")
        if triangles.min() < 0 or triangles.max() >= len(x):
            raise GeometryError(f"triangle indices must lie in 0..{len(x) - 1}")
        depth = 0
        while len(triangles) > _LEAF_SIZE << depth:
            depth += 1
        self._depth = depth
        self._order = np.arange(len(triangles), dtype=np.int32)
        sort_triangles(x[triangles].mean(axis=1), self._order, depth)
        self._triangles = np.ascontiguousarray(triangles[self._order])
        edges, self._edge, _ = edge_table(self._triangles)
        self._edge_count = len(edges)
        self._x = x
        self._boxes = np.empty((2 ** (depth + 1) - 1, 6))
        self._face_normal = np.empty((len(triangles), 3))
        self._edge_normal = np.empty((self._edge_count, 3))
        self._vertex_normal = np.empty((len(x), 3))
        self._update()

    def refit(self, vertices: FloatArray) -> None:
        """Move the mesh.

        Args:
            vertices: New positions in the constructor's order [m], shape [v, 3].
        """
        self._x[:] = vertices
        self._update()

    def signed_distance(self, points: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Distance of every point to the surface.

        Args:
            points: Query points [m], shape [n, 3]; neighbours in memory should be neighbours in
                space, as each search starts from the previous one's triangle.

        Returns:
            Distances, positive outside [m], shape [n]; closest surface points [m], shape [n, 3];
            the triangle of each, shape [n]. A point that is not finite gets NaN and triangle -1.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        distance = np.empty(len(points))
        closest = np.empty((len(points), 3))
        triangle = np.empty(len(points), dtype=np.int32)
        surface = _Surface(
            self._x,
            self._triangles,
            self._edge,
            self._boxes,
            self._face_normal,
            self._edge_normal,
            self._vertex_normal,
        )
        _signed_distance(surface, self._depth, points, distance, closest, triangle)
        triangle[triangle >= 0] = self._order[triangle[triangle >= 0]]
        return distance, closest, triangle

    def is_inside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Which points [n, 3] the mesh goes around, by the winding number; it may have holes."""
        dipoles = np.zeros((len(self._boxes), 7))
        refit_dipoles(self._x, self._triangles, self._depth, self._boxes, dipoles)
        inside = np.empty(len(points), np.bool_)
        points = np.ascontiguousarray(points, dtype=np.float64)
        insides(self._x, self._triangles, self._depth, dipoles, points, inside)
        return inside

    def _update(self) -> None:
        _pseudo_normals(
            self._x,
            self._triangles,
            self._edge,
            self._face_normal,
            self._edge_normal,
            self._vertex_normal,
        )
        refit_boxes(self._x, self._triangles, self._boxes, self._depth)


@exact_kernel()
def sort_triangles(centroids, order, depth):
    """Order triangles so that every node's range is split in half along its longest axis."""
    n = order.shape[0]
    for level in range(depth):
        for j in range(1 << level):
            begin = (j * n) >> level
            end = ((j + 1) * n) >> level
            middle = ((2 * j + 1) * n) >> (level + 1)
            axis = 0
            widest = -1.0
            for k in range(3):
                low = np.inf
                high = -np.inf
                for i in range(begin, end):
                    low = min(low, centroids[order[i], k])
                    high = max(high, centroids[order[i], k])
                if high - low > widest:
                    widest = high - low
                    axis = k
            left = begin
            right = end - 1
            while left < right:  # Hoare's selection of the middle element
                pivot = centroids[order[(left + right) >> 1], axis]
                i = left
                j2 = right
                while i <= j2:
                    while centroids[order[i], axis] < pivot:
                        i += 1
                    while centroids[order[j2], axis] > pivot:
                        j2 -= 1
                    if i <= j2:
                        order[i], order[j2] = order[j2], order[i]
                        i += 1
                        j2 -= 1
                if middle <= j2:
                    right = j2
                elif middle >= i:
                    left = i
                else:
                    break


@kernel()
def refit_boxes(x, triangles, boxes, depth):
    """Boxes (low xyz, high xyz) of all nodes, leaves first."""
    n = triangles.shape[0]
    first_leaf = (1 << depth) - 1
    for leaf in range(1 << depth):
        box = boxes[first_leaf + leaf]
        for k in range(3):
            low = np.inf
            high = -np.inf
            for t in range((leaf * n) >> depth, ((leaf + 1) * n) >> depth):
                for c in range(3):
                    value = x[triangles[t, c], k]
                    low = min(low, value)
                    high = max(high, value)
            box[k] = low
            box[3 + k] = high
    for node in range(first_leaf - 1, -1, -1):
        for k in range(3):
            boxes[node, k] = min(boxes[2 * node + 1, k], boxes[2 * node + 2, k])
            boxes[node, 3 + k] = max(boxes[2 * node + 1, 3 + k], boxes[2 * node + 2, 3 + k])


@kernel()
def _pseudo_normals(x, triangles, edge, face_normal, edge_normal, vertex_normal):
    """Unit face normals, their sums at edges, and their angle-weighted sums at vertices."""
    edge_normal[:] = 0.0
    vertex_normal[:] = 0.0
    for t in range(triangles.shape[0]):
        a = x[triangles[t, 0]]
        b = x[triangles[t, 1]]
        c = x[triangles[t, 2]]
        nx = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
        ny = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        nz = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        scale = 1.0 / length if length > 0.0 else 0.0
        face_normal[t, 0] = nx * scale
        face_normal[t, 1] = ny * scale
        face_normal[t, 2] = nz * scale
        for corner in range(3):
            p = x[triangles[t, corner]]
            q = x[triangles[t, (corner + 1) % 3]]
            r = x[triangles[t, (corner + 2) % 3]]
            dot = 0.0
            for k in range(3):
                dot += (q[k] - p[k]) * (r[k] - p[k])
            angle = np.arctan2(length, dot)  # |u x v| is the same at all three corners
            for k in range(3):
                edge_normal[edge[t, corner], k] += face_normal[t, k]
                vertex_normal[triangles[t, corner], k] += angle * face_normal[t, k]


@kernel(inner=True)
def box_distance2(box, px, py, pz):
    """Squared distance of a point to a box, 0 inside."""
    dx = max(box[0] - px, 0.0, px - box[3])
    dy = max(box[1] - py, 0.0, py - box[4])
    dz = max(box[2] - pz, 0.0, pz - box[5])
    return dx * dx + dy * dy + dz * dz


@exact_kernel(inner=True)
def closest_on_triangle(a, b, c, px, py, pz):
    """Barycentric coordinates of b and c of the closest point, and its feature.

    Voronoi regions as in Ericson 2005, Real-Time Collision Detection, 5.1.5.

    Returns:
        (v, w, feature): 0 face, 1 to 3 edges ab, bc, ca, 4 to 6 vertices a, b, c.
    """
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    acx, acy, acz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    apx, apy, apz = px - a[0], py - a[1], pz - a[2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return 0.0, 0.0, 4
    bpx, bpy, bpz = px - b[0], py - b[1], pz - b[2]
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return 1.0, 0.0, 5
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return d1 / (d1 - d3), 0.0, 1
    cpx, cpy, cpz = px - c[0], py - c[1], pz - c[2]
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 1.0, 6
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return 0.0, d2 / (d2 - d6), 3
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 1.0 - w, w, 2
    total = va + vb + vc
    return vb / total, vc / total, 0


@exact_kernel(inner=True)
def closest_point(x, triangle, px, py, pz):
    """Squared distance, closest point and feature of one triangle."""
    a = x[triangle[0]]
    b = x[triangle[1]]
    c = x[triangle[2]]
    v, w, feature = closest_on_triangle(a, b, c, px, py, pz)
    cx = a[0] + v * (b[0] - a[0]) + w * (c[0] - a[0])
    cy = a[1] + v * (b[1] - a[1]) + w * (c[1] - a[1])
    cz = a[2] + v * (b[2] - a[2]) + w * (c[2] - a[2])
    return (px - cx) ** 2 + (py - cy) ** 2 + (pz - cz) ** 2, cx, cy, cz, feature


class _Surface(NamedTuple):
    """A mesh with its hierarchy of boxes and its pseudo-normals, as `MeshDistance` keeps them."""

    x: FloatArray
    triangles: IntArray
    edge: IntArray
    boxes: FloatArray
    face_normal: FloatArray
    edge_normal: FloatArray
    vertex_normal: FloatArray


@exact_kernel()
def _signed_distance(surface, depth, points, distance, closest, triangle):
    """Nearest triangle by depth-first search, nearer child first; see `MeshDistance`."""
    x, triangles, boxes = surface.x, surface.triangles, surface.boxes
    n = triangles.shape[0]
    first_leaf = (1 << depth) - 1
    stack = np.empty(depth + 1, dtype=np.int32)
    stack_distance2 = np.empty(depth + 1)
    best = 0
    for i in range(points.shape[0]):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        if not np.isfinite(px + py + pz):
            distance[i] = np.nan
            closest[i, :] = np.nan
            triangle[i] = -1
            continue
        # The previous point's triangle bounds the search from the start.
        best_distance2, best_x, best_y, best_z, best_feature = closest_point(
            x, triangles[best], px, py, pz
        )
        stack[0] = 0
        stack_distance2[0] = 0.0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            reachable = stack_distance2[top] < best_distance2
            while reachable and node < first_leaf:
                left = 2 * node + 1
                d_left = box_distance2(boxes[left], px, py, pz)
                d_right = box_distance2(boxes[left + 1], px, py, pz)
                near, far, d_near, d_far = left, left + 1, d_left, d_right
                if d_right < d_left:
                    near, far, d_near, d_far = left + 1, left, d_right, d_left
                if d_far < best_distance2:
                    stack[top] = far
                    stack_distance2[top] = d_far
                    top += 1
                reachable = d_near < best_distance2
                node = near
            if not reachable:
                continue
            leaf = node - first_leaf
            for t in range((leaf * n) >> depth, ((leaf + 1) * n) >> depth):
                d2, cx, cy, cz, feature = closest_point(x, triangles[t], px, py, pz)
                if d2 < best_distance2:
                    best_distance2, best_x, best_y, best_z = d2, cx, cy, cz
                    best_feature = feature
                    best = t
        normal = surface.face_normal[best]
        if best_feature > 3:
            normal = surface.vertex_normal[triangles[best, best_feature - 4]]
        elif best_feature > 0:
            normal = surface.edge_normal[surface.edge[best, best_feature - 1]]
        side = (px - best_x) * normal[0] + (py - best_y) * normal[1] + (pz - best_z) * normal[2]
        length = np.sqrt(best_distance2)
        distance[i] = -length if side < 0.0 else length
        closest[i, 0] = best_x
        closest[i, 1] = best_y
        closest[i, 2] = best_z
        triangle[i] = best
