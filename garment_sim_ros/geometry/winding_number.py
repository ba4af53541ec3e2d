"""Generalized winding number of triangle meshes: how often a surface goes around a point.

Jacobson et al. 2013, "Robust inside-outside segmentation using generalized winding numbers";
groups of triangles that are far away count as one dipole (Barill et al. 2018, "Fast winding
numbers for soups and clouds"). It does not mind holes, folds, or parts that cut each other. The
hierarchy is that of `mesh_distance`.
"""

import numpy as np

from garment_sim_ros.jit import exact_kernel

INSIDE = 0.5
"""The winding number from which a point is inside."""
UNKNOWN, OUTER, BURIED, MIXED = 0, 1, 2, 3
_FAR = 2.5
"""A group of triangles this many of its radii away counts as one dipole."""
_BESIDE = 1e-4
"""A triangle is buried if the place this far in front of it is inside [m]."""


@exact_kernel()
def refit_dipoles(x, triangles, depth, boxes, dipoles):
    """Centre, sum of area normals and radius of every node's triangles."""
    n = triangles.shape[0]
    first_leaf = (1 << depth) - 1
    weight = np.zeros(dipoles.shape[0])
    dipoles[:] = 0.0
    for node in range(dipoles.shape[0] - 1, -1, -1):
        own = dipoles[node]
        if node < first_leaf:
            for child in (2 * node + 1, 2 * node + 2):
                weight[node] += weight[child]
                for k in range(3):
                    own[k] += weight[child] * dipoles[child, k]
                    own[3 + k] += dipoles[child, 3 + k]
        else:
            leaf = node - first_leaf
            for t in range((leaf * n) >> depth, ((leaf + 1) * n) >> depth):
                a, b, c = x[triangles[t, 0]], x[triangles[t, 1]], x[triangles[t, 2]]
                area = 0.5 * np.cross(b - a, c - a)
                size = np.sqrt((area * area).sum())
                weight[node] += size
                own[:3] += size * (a + b + c) / 3.0
                own[3:6] += area
        if weight[node] > 0.0:
            own[:3] /= weight[node]
        else:
            own[:3] = 0.5 * (boxes[node, :3] + boxes[node, 3:])
        radius2 = 0.0
        for k in range(3):
            radius2 += max(boxes[node, 3 + k] - own[k], own[k] - boxes[node, k]) ** 2
        own[6] = np.sqrt(radius2)


@exact_kernel(inner=True)
def _solid_angle(a, b, c, px, py, pz):
    """Signed solid angle of a triangle (Van Oosterom & Strackee 1983), half of it [sr]."""
    ax, ay, az = a[0] - px, a[1] - py, a[2] - pz
    bx, by, bz = b[0] - px, b[1] - py, b[2] - pz
    cx, cy, cz = c[0] - px, c[1] - py, c[2] - pz
    la = np.sqrt(ax * ax + ay * ay + az * az)
    lb = np.sqrt(bx * bx + by * by + bz * bz)
    lc = np.sqrt(cx * cx + cy * cy + cz * cz)
    volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    dots = (
        la * lb * lc
        + (ax * bx + ay * by + az * bz) * lc
        + (bx * cx + by * cy + bz * cz) * la
        + (cx * ax + cy * ay + cz * az) * lb
    )
    return np.arctan2(volume, dots)


@exact_kernel(inner=True)
def winding(x, triangles, depth, dipoles, px, py, pz):
    """How often the surface goes around a point; 1 inside a simple body."""
    n = triangles.shape[0]
    first_leaf = (1 << depth) - 1
    stack = np.empty(depth + 2, np.int32)
    stack[0] = 0
    top = 1
    total = 0.0
    while top > 0:
        top -= 1
        node = stack[top]
        d = dipoles[node]
        rx, ry, rz = d[0] - px, d[1] - py, d[2] - pz
        far2 = rx * rx + ry * ry + rz * rz
        if far2 > (_FAR * d[6]) ** 2:
            total += (rx * d[3] + ry * d[4] + rz * d[5]) / (far2 * np.sqrt(far2))
        elif node < first_leaf:
            stack[top] = 2 * node + 1
            stack[top + 1] = 2 * node + 2
            top += 2
        else:
            leaf = node - first_leaf
            for t in range((leaf * n) >> depth, ((leaf + 1) * n) >> depth):
                corner = triangles[t]
                total += 2.0 * _solid_angle(x[corner[0]], x[corner[1]], x[corner[2]], px, py, pz)
    return total / (4.0 * np.pi)


@exact_kernel()
def insides(x, triangles, depth, dipoles, points, result):
    """Which points are inside."""
    for i in range(points.shape[0]):
        p = points[i]
        result[i] = winding(x, triangles, depth, dipoles, p[0], p[1], p[2]) > INSIDE


@exact_kernel()
def inside_of(x, triangles, points, result):
    """The same for a surface that moves, triangle by triangle.

    Args:
        x: Its vertices, shape [v, 3].
        triangles: Shape [t, 3].
        points: Shape [p, 3].
        result: Output, shape [p].
    """
    for i in range(points.shape[0]):
        total = 0.0
        for t in range(triangles.shape[0]):
            a, b, c = x[triangles[t, 0]], x[triangles[t, 1]], x[triangles[t, 2]]
            total += 2.0 * _solid_angle(a, b, c, points[i, 0], points[i, 1], points[i, 2])
        result[i] = total > INSIDE * 4.0 * np.pi


@exact_kernel(inner=True)
def face_normal(x, triangle):
    """Unit normal of a triangle, zero where it has no area."""
    a, b, c = x[triangle[0]], x[triangle[1]], x[triangle[2]]
    normal = np.cross(b - a, c - a)
    length = np.sqrt((normal * normal).sum())
    return normal / length if length > 0.0 else normal


@exact_kernel(inner=True)
def is_buried(x, triangles, depth, dipoles, triangle, at):
    """Whether a place on a triangle is inside the body, in a fold or in another part."""
    p = at + _BESIDE * face_normal(x, triangle)
    return winding(x, triangles, depth, dipoles, p[0], p[1], p[2]) > INSIDE


@exact_kernel(inner=True)
def burial(x, triangles, depth, dipoles, state, t):
    """Whether triangle t is `OUTER`, `BURIED` or `MIXED`, by its middle and corners; kept."""
    if state[t] == UNKNOWN:
        middle = (x[triangles[t, 0]] + x[triangles[t, 1]] + x[triangles[t, 2]]) / 3.0
        buried = is_buried(x, triangles, depth, dipoles, triangles[t], middle)
        state[t] = BURIED if buried else OUTER
        for corner in range(3):
            at = 0.05 * middle + 0.95 * x[triangles[t, corner]]
            if is_buried(x, triangles, depth, dipoles, triangles[t], at) != buried:
                state[t] = MIXED
                break
    return state[t]
