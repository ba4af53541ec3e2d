"""Parts of one mesh that can come near each other: a uniform grid over swept patches.

A patch is some connected triangles. Patches, and triangles of two patches, that are neighbours at
rest and still lie side by side with normals that agree cannot touch (Volino & Magnenat-Thalmann
1994): in cloth that is not folded that is nearly all of it. Every vertex and edge is looked after
by one triangle that has it ("representative triangles", Curtis et al. 2008), so that pairs of
triangles give every pair of a vertex and a triangle and of two edges once. Triangles with a corner
in common are neighbours by make: they meet only where their normals disagree, in a sharp fold.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.self_collision.gaps import crosses, edge_weights, height, point_gap
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


class Pairs(NamedTuple):
    """Pairs found, the first ones of each kind.

    Attributes:
        points: Particle and triangle of each pair, shape [any, 4].
        point_limit: The distance that the pair keeps, that at rest where it is less [m].
        edges: Both edges of each pair, shape [any, 4].
        edge_limit: The same for edges.
        crossings: Edges through triangles at the start: ends, the corners beside the edge (the
            second -1 at a border), and the triangle, shape [any, 7].
        counts: Numbers of pairs found of the three kinds, more than there is room for where some
            were left out, shape [3].
    """

    points: IntArray
    point_limit: SingleArray
    edges: IntArray
    edge_limit: SingleArray
    crossings: IntArray
    counts: NDArray[np.int64]

    @classmethod
    def room_for(cls, pairs: int, crossings: int) -> "Pairs":
        """Room for so many pairs of each of the first two kinds, and for crossings; none found."""
        return cls(
            points=np.zeros((pairs, 4), np.int32),
            point_limit=np.zeros(pairs, np.float32),
            edges=np.zeros((pairs, 4), np.int32),
            edge_limit=np.zeros(pairs, np.float32),
            crossings=np.zeros((crossings, 7), np.int32),
            counts=np.zeros(3, np.int64),
        )


class Near(NamedTuple):
    """How near two triangles can get [m].

    Attributes:
        distance: What is to be kept apart.
        least: The same and the margin: what particles that stray may come nearer by.
        reach: The same and how far the triangles' ways lead them to each other.
    """

    distance: np.float32
    least: np.float32
    reach: np.float32


@lean_kernel(inner=True)
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


@lean_kernel(inner=True)
def _side_by_side(centre, rest_centre, i, j, far):
    """Whether two rows are neighbours at rest, and no nearer now than half as far as then."""
    now = difference(centre, i, j)
    then = difference(rest_centre, i, j)
    return then < far * far and np.float32(4.0) * now > then


@lean_kernel(inner=True)
def _share_a_corner(triangles, t, u):
    """Whether two triangles have a corner in common."""
    for c in range(3):
        i = triangles[t, c]
        if i == triangles[u, 0] or i == triangles[u, 1] or i == triangles[u, 2]:
            return True
    return False


@lean_kernel(inner=True)
def _beyond(start, normal, triangles, t, u, reach):
    """Whether a triangle is farther than reach from the plane of triangle u."""
    i = triangles[u, 0]
    ha = height(start, normal, triangles[t, 0], i, u)
    hb = height(start, normal, triangles[t, 1], i, u)
    hc = height(start, normal, triangles[t, 2], i, u)
    return min(min(ha, hb), hc) > reach or max(max(ha, hb), hc) < -reach


@lean_kernel(inner=True)
def _lie_side_by_side(swept, triangles, t, u, apart):
    """Whether two triangles are neighbours in cloth that is not folded there: they cannot touch.

    Args:
        swept: `sim.self_collision.patches.Swept`.
        triangles: Triangles as particles, shape [t, 3].
        t: A triangle.
        u: Another one.
        apart: How far their ways lead them to or from each other, at most [m].
    """
    facing = dot(swept.normal, t, u)
    if not apart < swept.reach[2]:
        return False
    if facing > np.float32(0.25) and _side_by_side(
        swept.centre, swept.rest_centre, t, u, swept.reach[0]
    ):
        return True
    return facing > _ZERO and _share_a_corner(triangles, t, u)


@lean_kernel(inner=True)
def _patches_are_smooth(swept, a, b):
    """Whether no triangles of two patches, or of one, can touch, as there is no fold in them."""
    spread, flutter, calm = swept.spread, swept.flutter, swept.reach[2]
    right = np.float32(0.5 * np.pi)
    if a == b:
        return spread[a] < _HALF * right and flutter[a] < calm
    if not spread[a] + spread[b] < right or not _side_by_side(
        swept.patch_centre, swept.patch_rest_centre, a, b, swept.reach[1]
    ):
        return False
    between = np.arccos(min(max(dot(swept.axis, a, b), -_ONE), _ONE))
    apart = np.sqrt(difference(swept.patch_way, a, b)) + flutter[a] + flutter[b]
    return spread[a] + spread[b] + between < right and apart < np.float32(2.0) * calm


@lean_kernel(inner=True)
def _is_their_cell(boxes, a, b, cells, cell):
    """Whether two boxes, which may share several cells, meet in this one.

    They meet in the cell of their common low corner.

    Args:
        boxes: Boxes of patches, the last that of all [m], shape [p + 1, 6].
        a: A patch.
        b: Another one, or the same.
        cells: What `sort_into_cells` says of the cells.
        cell: The cell.
    """
    scale, ny, nz = cells
    low = boxes[boxes.shape[0] - 1]
    ix = int((max(boxes[a, 0], boxes[b, 0]) - low[0]) * scale)
    iy = int((max(boxes[a, 1], boxes[b, 1]) - low[1]) * scale)
    iz = int((max(boxes[a, 2], boxes[b, 2]) - low[2]) * scale)
    return (ix * ny + iy) * nz + iz == cell


@lean_kernel(inner=True)
def _add_points_and_crossings(start, way, mesh, normal, t, u, near, pairs):
    """Adds corners of triangle t that can get near to triangle u, and edges that pass through it.

    Args: as `_add_pairs`.
    """
    triangles, owned, wing = mesh.triangles, mesh.owned, mesh.wing
    points, crossings, counts = pairs.points, pairs.crossings, pairs.counts
    i, j, k = triangles[u, 0], triangles[u, 1], triangles[u, 2]
    for c in range(3):
        p, q = triangles[t, c], triangles[t, (c + 1) % 3]
        p_is_theirs = p in (i, j, k)
        mine = owned[t] >> c
        hp = height(start, normal, p, i, u)
        if mine & 1 and not p_is_theirs and abs(hp) < near.reach:
            strays = max(max(difference(way, p, i), difference(way, p, j)), difference(way, p, k))
            if point_gap(start, p, i, j, k) < (near.least + np.sqrt(strays)) ** 2:
                n = counts[0]
                counts[0] += 1
                if n < points.shape[0]:
                    points[n, 0], points[n, 1], points[n, 2], points[n, 3] = p, i, j, k
                    gap = point_gap(mesh.rest, p, i, j, k)
                    pairs.point_limit[n] = min(near.distance, np.sqrt(gap))
        if (
            mine & 8
            and hp * height(start, normal, q, i, u) < _ZERO
            and not (p_is_theirs or q in (i, j, k))
            and crosses(start, p, q, i, j, k)
        ):
            n = counts[2]
            counts[2] += 1
            if n < crossings.shape[0]:
                crossings[n, 0], crossings[n, 1] = p, q
                crossings[n, 2], crossings[n, 3] = triangles[t, (c + 2) % 3], wing[t, c]
                crossings[n, 4], crossings[n, 5], crossings[n, 6] = i, j, k


@lean_kernel(inner=True)
def _add_edges(start, way, mesh, t, u, near, pairs):
    """Adds edges of two triangles that can get near to each other.

    Args: as `_add_pairs`.
    """
    triangles, owned, edges, counts = mesh.triangles, mesh.owned, pairs.edges, pairs.counts
    for c in range(3):
        if not (owned[t] >> c) & 8:
            continue
        p, q = triangles[t, c], triangles[t, (c + 1) % 3]
        for o in range(3):
            a, b = triangles[u, o], triangles[u, (o + 1) % 3]
            if not (owned[u] >> o) & 8 or a in (p, q) or b in (p, q):
                continue
            strays = max(
                max(difference(way, p, a), difference(way, p, b)),
                max(difference(way, q, a), difference(way, q, b)),
            )
            if edge_weights(start, p, q, a, b)[2] < (near.least + np.sqrt(strays)) ** 2:
                n = counts[1]
                counts[1] += 1
                if n < edges.shape[0]:
                    edges[n, 0], edges[n, 1], edges[n, 2], edges[n, 3] = p, q, a, b
                    gap = edge_weights(mesh.rest, p, q, a, b)[2]
                    pairs.edge_limit[n] = min(near.distance, np.sqrt(gap))


@lean_kernel(inner=True)
def _add_pairs(start, way, mesh, normal, t, u, near, pairs):
    """Adds what two triangles have that can get near to each other.

    Args:
        start: Positions [m], shape [n, 3].
        way: Where each particle goes from there [m], shape [n, 3].
        mesh: `sim.self_collision.patches.Mesh`.
        normal: Unit normals of the triangles, shape [t, 3].
        t: A triangle.
        u: Another one.
        near: `Near`.
        pairs: `Pairs`, added to.
    """
    if _beyond(start, normal, mesh.triangles, t, u, near.reach):
        return
    if _beyond(start, normal, mesh.triangles, u, t, near.reach):
        return
    for turn in range(2):
        one, other = (u, t) if turn == 1 else (t, u)
        _add_points_and_crossings(start, way, mesh, normal, one, other, near, pairs)
    _add_edges(start, way, mesh, t, u, near, pairs)


@lean_kernel(inner=True)
def _look_in_patches(start, way, mesh, swept, a, b, distance, margin, pairs):
    """Adds what triangles of patch a and of patch b have; once where they are the same."""
    triangles, first, boxes, patch_boxes = (
        mesh.triangles,
        mesh.first,
        swept.boxes,
        swept.patch_boxes,
    )
    radius, sway = swept.radius, swept.sway
    for t in range(first[a], first[a + 1]):
        if not _meet(boxes, t, patch_boxes, b):
            continue
        for u in range(t + 1 if a == b else first[b], first[b + 1]):
            if not _meet(boxes, t, boxes, u):
                continue
            apart = np.sqrt(difference(swept.mean_way, t, u)) + sway[t] + sway[u]
            reach = distance + margin + apart
            far = radius[t] + radius[u] + reach
            if difference(swept.centre, t, u) > far * far:
                continue
            if _lie_side_by_side(swept, triangles, t, u, apart):
                continue
            near = Near(distance, distance + margin, reach)
            _add_pairs(start, way, mesh, swept.normal, t, u, near, pairs)


@lean_kernel()
def find_pairs(start, way, mesh, swept, grid, distance, margin, pairs):
    """All that can come nearer than `distance` while particles go their expected ways.

    Found is what gets nearer than `distance` even where particles stray from their ways by half
    of `margin` each.

    Args:
        start: Positions [m], shape [n, 3].
        way: Where each particle goes from there, in a straight line [m], shape [n, 3].
        mesh: `sim.self_collision.patches.Mesh`.
        swept: Scratch: `sim.self_collision.patches.Swept`.
        grid: Scratch: where the entries of each cell start, and entries, at least as many as
            patches.
        distance: What is to be kept apart [m].
        margin: Twice how far particles may stray [m].
        pairs: Output: `Pairs`.
    """
    pairs.counts[:] = 0
    sweep(start, way, mesh.triangles, _HALF * (distance + margin), swept)
    sweep_patches(mesh.first, swept)
    cell_start, entry = grid
    cells = sort_into_cells(swept.patch_boxes, cell_start, entry)
    for cell in range(cell_start.size - 2):
        for e in range(cell_start[cell], cell_start[cell + 1]):
            for o in range(e, cell_start[cell + 1]):
                a, b = entry[e], entry[o]
                if (
                    _meet(swept.patch_boxes, a, swept.patch_boxes, b)
                    and _is_their_cell(swept.patch_boxes, a, b, cells, cell)
                    and not _patches_are_smooth(swept, a, b)
                ):
                    _look_in_patches(start, way, mesh, swept, a, b, distance, margin, pairs)
