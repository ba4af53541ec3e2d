"""Where cores run through triangles of cloth and through the convex solids of other bones."""

import numpy as np

from garment_sim_ros.jit import exact_kernel

_BLOCK = 16
"""Triangles in a row that are first looked at as one box: the more compact, the faster."""


@exact_kernel()
def find_hits(ends, x, triangles, core, at):
    """Where segments run through triangles.

    Args:
        ends: Both ends of each segment [m], shape [c, 2, 3].
        x: Vertices [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        core: Receives the segments of the first hits, shape [h].
        at: Receives their places, 0 at the first end to 1 at the second, shape [h].

    Returns:
        How many hits there are; those beyond `h` are counted only.
    """
    count = 0
    near = np.empty(len(ends) + 1, np.int32)
    for first in range(0, len(triangles), _BLOCK):
        last = min(first + _BLOCK, len(triangles))
        a = triangles[first, 0]
        x_low = x_high = x[a, 0]
        y_low = y_high = x[a, 1]
        z_low = z_high = x[a, 2]
        for t in range(first, last):
            for k in range(3):
                v = triangles[t, k]
                x_low, x_high = min(x_low, x[v, 0]), max(x_high, x[v, 0])
                y_low, y_high = min(y_low, x[v, 1]), max(y_high, x[v, 1])
                z_low, z_high = min(z_low, x[v, 2]), max(z_high, x[v, 2])
        # Where something is not finite the box may be of any size, and hides no finite triangle.
        size = (x_high - x_low) + (y_high - y_low) + (z_high - z_low)
        whole = size < np.inf
        # All are written down, and those counted that are near: nobody can guess which those are,
        # and a wrong guess costs the processor more than the few numbers.
        found = 0
        for k in range(len(ends)):
            p, q = ends[k, 0], ends[k, 1]
            beside_x = ((p[0] < x_low) & (q[0] < x_low)) | ((p[0] > x_high) & (q[0] > x_high))
            beside_y = ((p[1] < y_low) & (q[1] < y_low)) | ((p[1] > y_high) & (q[1] > y_high))
            beside_z = ((p[2] < z_low) & (q[2] < z_low)) | ((p[2] > z_high) & (q[2] > z_high))
            near[found] = k
            found += 0 if whole & (beside_x | beside_y | beside_z) else 1
        for n in range(found):
            k = near[n]
            p, q = ends[k, 0], ends[k, 1]
            for t in range(first, last):
                s = _place(p, q, x, triangles[t, 0], triangles[t, 1], triangles[t, 2])
                if s >= 0.0:
                    if count < len(at):
                        core[count] = k
                        at[count] = s
                    count += 1
    return count


@exact_kernel(inner=True)
def _place(start, end, x, a, b, c):
    """Where a segment runs through one triangle, 0 to 1; -1 where it does not."""
    d0, d1, d2 = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    ax, ay, az = np.float64(x[a, 0]), np.float64(x[a, 1]), np.float64(x[a, 2])
    ux, uy, uz = x[b, 0] - ax, x[b, 1] - ay, x[b, 2] - az
    vx, vy, vz = x[c, 0] - ax, x[c, 1] - ay, x[c, 2] - az
    hx, hy, hz = d1 * vz - d2 * vy, d2 * vx - d0 * vz, d0 * vy - d1 * vx
    det = ux * hx + uy * hy + uz * hz
    if not abs(det) > 1e-14:
        return -1.0
    sx, sy, sz = start[0] - ax, start[1] - ay, start[2] - az
    u = (sx * hx + sy * hy + sz * hz) / det
    if not (u >= 0.0 and u <= 1.0):
        return -1.0
    wx, wy, wz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
    v = (d0 * wx + d1 * wy + d2 * wz) / det
    s = (vx * wx + vy * wy + vz * wz) / det
    return s if v >= 0.0 and u + v <= 1.0 and s >= 0.0 and s <= 1.0 else -1.0


@exact_kernel()
def overlaps(ends, position, rotation, planes, plane_start, same_bone, low, high):
    """From where to where every core runs inside every convex solid of another bone.

    Args:
        ends: Of the cores in the world [m], shape [c, 2, 3].
        position: Of the solids in the world [m], shape [s, 3].
        rotation: Rotation matrices of the solids, shape [s, 3, 3].
        planes: Outward normals and offsets of all solids, shape [p, 4].
        plane_start: First plane of each solid and the end, shape [s + 1].
        same_bone: Pairs to leave out, shape [c, s].
        low: Receives where each run begins, 0 to 1 along the core, shape [c, s].
        high: Receives where it ends; not above `low` where there is none, shape [c, s].
    """
    for s in range(len(position)):
        R = rotation[s]
        for k in range(len(ends)):
            low[k, s], high[k, s] = 0.0, 0.0
            if same_bone[k, s]:
                continue
            # In the solid's own frame: planes are many.
            px, py, pz = _turned_back(R, ends[k, 0], position[s])
            ex, ey, ez = _turned_back(R, ends[k, 1], ends[k, 0])
            first, last = 0.0, 1.0
            for j in range(plane_start[s], plane_start[s + 1]):
                above = planes[j, 0] * px + planes[j, 1] * py + planes[j, 2] * pz + planes[j, 3]
                rise = planes[j, 0] * ex + planes[j, 1] * ey + planes[j, 2] * ez
                if rise > 1e-12:
                    last = min(last, -above / rise)
                elif rise < -1e-12:
                    first = max(first, -above / rise)
                elif above > 0.0:
                    last = -1.0
                if first >= last:
                    break
            if first < last:
                low[k, s], high[k, s] = first, last


@exact_kernel(inner=True)
def _turned_back(R, end, start):
    """``R^T (end - start)``."""
    x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )
