"""Parts of one mesh that can come near each other: a uniform grid over swept patches.

A patch is some connected triangles. Patches, and triangles of two patches, that are neighbours at
rest and still lie side by side with normals that agree cannot touch (Volino & Magnenat-Thalmann
1994): in cloth that is not folded that is nearly all of it. Every vertex and edge is looked after
by one triangle that has it ("representative triangles", Curtis et al. 2008), so that pairs of
triangles give every pair of a vertex and a triangle and of two edges once. Triangles with a corner
in common are neighbours by make: they meet only where their normals disagree, in a sharp fold.
"""

import numpy as np

from garment_sim_ros.geometry.mesh_distance import closest_on_triangle
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.self_collision.swept_patches import (
    difference,
    dot,
    sort_into_cells,
    sweep,
    sweep_patches,
)

_HALF = np.float32(0.5)
_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)


@kernel(inner=True)
def edge_weights(x, a, b, c, d):
    """Where two edges are nearest to each other: weights of b on ab and of d on cd, squared gap.

    Ericson 2005, Real-Time Collision Detection, 5.1.9.
    """
    ex, ey, ez = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    fx, fy, fz = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
    rx, ry, rz = x[a, 0] - x[c, 0], x[a, 1] - x[c, 1], x[a, 2] - x[c, 2]
    tiny = np.float32(1e-20)
    ee = ex * ex + ey * ey + ez * ez + tiny
    ff = fx * fx + fy * fy + fz * fz + tiny
    ef = ex * fx + ey * fy + ez * fz
    er = ex * rx + ey * ry + ez * rz
    fr = fx * rx + fy * ry + fz * rz
    area = ee * ff - ef * ef
    s = _HALF
    if area > np.float32(1e-6) * ee * ff:
        s = min(max((ef * fr - er * ff) / area, _ZERO), _ONE)
    t = (ef * s + fr) / ff
    if t < _ZERO:
        t = _ZERO
        s = min(max(-er / ee, _ZERO), _ONE)
    elif t > _ONE:
        t = _ONE
        s = min(max((ef - er) / ee, _ZERO), _ONE)
    dx = rx + s * ex - t * fx
    dy = ry + s * ey - t * fy
    dz = rz + s * ez - t * fz
    return s, t, dx * dx + dy * dy + dz * dz


@kernel(inner=True)
def point_gap(x, p, i, j, k):
    """Squared distance of a particle to a triangle."""
    b, c, _ = closest_on_triangle(x[i], x[j], x[k], x[p, 0], x[p, 1], x[p, 2])
    b = np.float32(b)
    c = np.float32(c)
    a = _ONE - b - c
    dx = x[p, 0] - a * x[i, 0] - b * x[j, 0] - c * x[k, 0]
    dy = x[p, 1] - a * x[i, 1] - b * x[j, 1] - c * x[k, 1]
    dz = x[p, 2] - a * x[i, 2] - b * x[j, 2] - c * x[k, 2]
    return dx * dx + dy * dy + dz * dz


@kernel(inner=True)
def _height(x, normal, p, i, u):
    """Height of particle p over the plane of triangle u, whose first corner is i."""
    return (
        (x[p, 0] - x[i, 0]) * normal[u, 0]
        + (x[p, 1] - x[i, 1]) * normal[u, 1]
        + (x[p, 2] - x[i, 2]) * normal[u, 2]
    )


@kernel(inner=True)
def _crosses(x, a, b, i, j, k):
    """Whether the edge ab passes through a triangle."""
    ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    fx, fy, fz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    ax, ay, az = x[a, 0] - x[i, 0], x[a, 1] - x[i, 1], x[a, 2] - x[i, 2]
    bx, by, bz = x[b, 0] - x[i, 0], x[b, 1] - x[i, 1], x[b, 2] - x[i, 2]
    ha = ax * nx + ay * ny + az * nz
    hb = bx * nx + by * ny + bz * nz
    if not ha * hb < _ZERO:
        return False
    s = ha / (ha - hb)
    px, py, pz = ax + s * (bx - ax), ay + s * (by - ay), az + s * (bz - az)
    # Weights times twice the triangle's area squared.
    u = nx * (py * fz - pz * fy) + ny * (pz * fx - px * fz) + nz * (px * fy - py * fx)
    w = nx * (ey * pz - ez * py) + ny * (ez * px - ex * pz) + nz * (ex * py - ey * px)
    return u >= _ZERO and w >= _ZERO and u + w <= nx * nx + ny * ny + nz * nz


@kernel(inner=True)
def _meet(boxes, t, others, u):
    """Whether two boxes overlap."""
    return not (
        boxes[t, 0] > others[u, 3]
        or others[u, 0] > boxes[t, 3]
        or boxes[t, 1] > others[u, 4]
        or others[u, 1] > boxes[t, 4]
        or boxes[t, 2] > others[u, 5]
        or others[u, 2] > boxes[t, 5]
    )


@kernel(inner=True)
def _side_by_side(centre, rest_centre, i, j, far):
    """Whether two rows are neighbours at rest, and no nearer now than half as far as then."""
    now = difference(centre, i, j)
    then = difference(rest_centre, i, j)
    return then < far * far and np.float32(4.0) * now > then


@kernel(inner=True)
def _share_a_corner(triangles, t, u):
    """Whether two triangles have a corner in common."""
    for c in range(3):
        i = triangles[t, c]
        if i == triangles[u, 0] or i == triangles[u, 1] or i == triangles[u, 2]:
            return True
    return False


@kernel(inner=True)
def _beyond(start, normal, triangles, t, u, reach):
    """Whether a triangle is farther than reach from the plane of triangle u."""
    i = triangles[u, 0]
    ha = _height(start, normal, triangles[t, 0], i, u)
    hb = _height(start, normal, triangles[t, 1], i, u)
    hc = _height(start, normal, triangles[t, 2], i, u)
    return min(min(ha, hb), hc) > reach or max(max(ha, hb), hc) < -reach


@kernel(inner=True)
def _pair(
    t, u, start, way, rest, triangles, wing, owned, normal, distance, least, reach,
    points, point_limit, edges, edge_limit, crossings, counts,
):  # fmt: skip
    """Adds what two triangles, within reach of each other, have that can get nearer than least."""
    if _beyond(start, normal, triangles, t, u, reach):
        return
    if _beyond(start, normal, triangles, u, t, reach):
        return
    for turn in range(2):
        if turn == 1:
            t, u = u, t
        i, j, k = triangles[u, 0], triangles[u, 1], triangles[u, 2]
        for c in range(3):
            p, q = triangles[t, c], triangles[t, (c + 1) % 3]
            p_is_theirs = p in (i, j, k)
            mine = owned[t] >> c
            hp = _height(start, normal, p, i, u)
            if (
                mine & 1
                and not p_is_theirs
                and abs(hp) < reach
                and point_gap(start, p, i, j, k)
                < (
                    least
                    + np.sqrt(
                        max(
                            max(difference(way, p, i), difference(way, p, j)),
                            difference(way, p, k),
                        )
                    )
                )
                ** 2
            ):
                n = counts[0]
                counts[0] += 1
                if n < points.shape[0]:
                    points[n, 0], points[n, 1], points[n, 2], points[n, 3] = p, i, j, k
                    point_limit[n] = min(distance, np.sqrt(point_gap(rest, p, i, j, k)))
            if not mine & 8:
                continue
            if (
                hp * _height(start, normal, q, i, u) < _ZERO
                and not (p_is_theirs or q in (i, j, k))
                and _crosses(start, p, q, i, j, k)
            ):
                n = counts[2]
                counts[2] += 1
                if n < crossings.shape[0]:
                    crossings[n, 0], crossings[n, 1] = p, q
                    crossings[n, 2], crossings[n, 3] = triangles[t, (c + 2) % 3], wing[t, c]
                    crossings[n, 4], crossings[n, 5], crossings[n, 6] = i, j, k
            if turn == 1:
                continue
            for o in range(3):
                a, b = triangles[u, o], triangles[u, (o + 1) % 3]
                if not (owned[u] >> o) & 8 or a in (p, q) or b in (p, q):
                    continue
                apart = max(
                    max(difference(way, p, a), difference(way, p, b)),
                    max(difference(way, q, a), difference(way, q, b)),
                )
                if edge_weights(start, p, q, a, b)[2] < (least + np.sqrt(apart)) ** 2:
                    n = counts[1]
                    counts[1] += 1
                    if n < edges.shape[0]:
                        edges[n, 0], edges[n, 1], edges[n, 2], edges[n, 3] = p, q, a, b
                        gap = edge_weights(rest, p, q, a, b)[2]
                        edge_limit[n] = min(distance, np.sqrt(gap))


@kernel()
def find_pairs(
    start,
    way,
    rest,
    triangles,
    wing,
    owned,
    first,
    swept,
    grid,
    distance,
    margin,
    points,
    point_limit,
    edges,
    edge_limit,
    crossings,
    counts,
):
    """All that can come nearer than `distance` while particles go their expected ways.

    Found is what gets nearer than `distance` even where particles stray from their ways by half
    of `margin` each.

    Args:
        start: Positions [m], shape [n, 3].
        way: Where each particle goes from there, in a straight line [m], shape [n, 3].
        rest: Rest positions [m], shape [n, 3].
        triangles: Triangles as particles, shape [t, 3].
        wing: The corner on the far side of edges ab, bc, ca, -1 at a border, shape [t, 3].
        owned: Bits 0 to 2: corners that a triangle looks after; 3 to 5: edges, shape [t].
        first: The first triangle of each patch, shape [p + 1].
        swept: Scratch: `sim.self_collision.garment.Swept`.
        grid: Scratch: where the entries of each cell start, and entries, at least as many as
            patches.
        distance: What is to be kept apart [m].
        margin: Twice how far particles may stray [m].
        points: Output: particle and triangle of each pair, shape [any, 4].
        point_limit: Output: the distance that the pair keeps, that at rest where it is less [m].
        edges: Output: both edges of each pair, shape [any, 4].
        edge_limit: Output: the same for edges.
        crossings: Output: edges through triangles at the start: ends, the corners beside the edge
            (the second -1 at a border), and the triangle, shape [any, 7].
        counts: Output: numbers of pairs found of the three kinds, more than there is room for
            where some were left out, shape [3].
    """
    counts[:] = 0
    boxes, normal, centre, rest_centre = swept.boxes, swept.normal, swept.centre, swept.rest_centre
    patch_boxes, axis, spread = swept.patch_boxes, swept.axis, swept.spread
    flutter, near, patch_near, calm = swept.flutter, swept.reach[0], swept.reach[1], swept.reach[2]
    radius, mean_way, sway = swept.radius, swept.mean_way, swept.sway
    slack = _HALF * (distance + margin)
    sweep(start, way, triangles, slack, boxes, normal, centre, radius, mean_way, sway)
    sweep_patches(first, swept)
    cell_start, entry = grid
    scale, ny, nz = sort_into_cells(patch_boxes, cell_start, entry)
    low = patch_boxes[first.size - 1]
    right = np.float32(0.5 * np.pi)
    for cell in range(cell_start.size - 2):
        for e in range(cell_start[cell], cell_start[cell + 1]):
            for o in range(e, cell_start[cell + 1]):
                a, b = entry[e], entry[o]
                if not _meet(patch_boxes, a, patch_boxes, b):
                    continue
                # Boxes that share several cells meet in that of their common low corner.
                ix = int((max(patch_boxes[a, 0], patch_boxes[b, 0]) - low[0]) * scale)
                iy = int((max(patch_boxes[a, 1], patch_boxes[b, 1]) - low[1]) * scale)
                iz = int((max(patch_boxes[a, 2], patch_boxes[b, 2]) - low[2]) * scale)
                if (ix * ny + iy) * nz + iz != cell:
                    continue
                if a == b:
                    if spread[a] < _HALF * right and flutter[a] < calm:
                        continue
                elif spread[a] + spread[b] < right and _side_by_side(
                    swept.patch_centre, swept.patch_rest_centre, a, b, patch_near
                ):
                    between = np.arccos(min(max(dot(axis, a, b), -_ONE), _ONE))
                    apart = np.sqrt(difference(swept.patch_way, a, b)) + flutter[a] + flutter[b]
                    if spread[a] + spread[b] + between < right and apart < np.float32(2.0) * calm:
                        continue
                for t in range(first[a], first[a + 1]):
                    if not _meet(boxes, t, patch_boxes, b):
                        continue
                    for u in range(t + 1 if a == b else first[b], first[b + 1]):
                        if not _meet(boxes, t, boxes, u):
                            continue
                        apart = np.sqrt(difference(mean_way, t, u)) + sway[t] + sway[u]
                        reach = distance + margin + apart
                        far = radius[t] + radius[u] + reach
                        if difference(centre, t, u) > far * far:
                            continue
                        facing = dot(normal, t, u)
                        if (
                            facing > np.float32(0.25)
                            and apart < calm
                            and _side_by_side(centre, rest_centre, t, u, near)
                        ):
                            continue
                        if facing > _ZERO and apart < calm and _share_a_corner(triangles, t, u):
                            continue
                        _pair(
                            t, u, start, way, rest, triangles, wing, owned, normal,
                            distance, distance + margin, reach,
                            points, point_limit, edges, edge_limit, crossings, counts,
                        )  # fmt: skip
