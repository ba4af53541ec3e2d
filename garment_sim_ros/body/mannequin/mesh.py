"""A closed, mirror-symmetric triangle mesh of a wanted size on a surface symmetric in y.

Only the half y >= 0 is meshed: an iso-surface on a fine grid (`marching_tetrahedra`), then the
shortest edges collapse until the wanted number of vertices is left, then rounds of edge flips,
tangential smoothing and projection make the triangles even. The mirrored half is welded on at
y = 0. Edge lengths are measured relative to a size field, so that hands get smaller triangles.

After: Botsch and Kobbelt, "A remeshing approach to multiresolution modeling",
2004; Dey, Edelsbrunner, Guha and Nekhayev, "Topology preserving edge contraction", 1999.
"""

from collections.abc import Callable

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.marching_tetrahedra import marching_tetrahedra, normal_of
from garment_sim_ros.jit import exact_kernel


def symmetric_mesh(
    sample: Callable[[FloatArray, float, tuple[int, ...]], FloatArray],
    project: Callable[[FloatArray], FloatArray],
    size: Callable[[FloatArray], FloatArray],
    lower: FloatArray,
    upper: FloatArray,
    spacing: float,
    vertices: int,
    rounds: int = 12,
) -> tuple[FloatArray, IntArray]:
    """Meshes the zero level of a field that is even in y.

    Args:
        sample: Field on a grid from origin [m], spacing [m] and node counts.
        project: Moves points [n, 3] by one Newton step towards the surface.
        size: Relative edge length wanted at points [n, 3], shape [n].
        lower: Lower corner of a box around the surface [m]; its y is ignored.
        upper: Upper corner of the box [m].
        spacing: Grid spacing [m].
        vertices: Wanted number of vertices; reached up to one.
        rounds: Rounds of smoothing.

    Returns:
        Vertices [v, 3] and outward triangles [t, 3]; vertex order: middle plane, left, right.

    Raises:
        GeometryError: The grid is too coarse to give that many vertices.
    """
    origin = np.array([lower[0], 0.0, lower[2]])
    shape = tuple(int(n) for n in np.ceil((upper - origin) / spacing).astype(int) + 1)
    x, triangles = marching_tetrahedra(sample(origin, spacing, shape), origin, spacing)
    if 2 * len(x) - (x[:, 1] == 0.0).sum() < vertices:
        raise GeometryError(f"{spacing} m of grid spacing is too coarse for {vertices} vertices")
    x, triangles = _compacted(x, triangles, *_collapse(x, triangles, size(x), vertices))
    for i in range(rounds):
        if i % 2 == 0:
            triangles = _flip(x, triangles, *_edges(triangles))
        x = project(_smooth(x, triangles, size(x), _edges(triangles)[0]))
    for _ in range(3):
        x = project(x)
    return _mirrored(x, triangles)


def _mirrored(x: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """The half mesh with its mirror image, welded at y = 0."""
    middle = x[:, 1] == 0.0
    order = np.argsort(~middle, kind="stable")
    rank = np.empty(len(x), dtype=np.int32)
    rank[order] = np.arange(len(x))
    half, left = x[order], rank[triangles]
    m = int(middle.sum())
    right = np.where(left < m, left, left + (len(x) - m))[:, ::-1]
    twin = half[m:] * np.array([1.0, -1.0, 1.0])
    return np.concatenate([half, twin]), np.concatenate([left, right]).astype(np.int32)


@exact_kernel(inner=True)
def _is_link(x, triangles, kept, first, following, mark, stamp, a, b):
    """Whether exactly the opposite corners of an edge are common neighbours of its ends.

    Edges between vertices of the middle plane have one such corner, others two.

    Args:
        x: Positions [m], shape [v, 3].
        triangles: Shape [t, 3].
        kept: Which triangles are left, shape [t].
        first: First corner of each vertex, shape [v].
        following: Next corner of the same vertex, -1 at the end, shape [3 t].
        mark: Scratch, shape [v].
        stamp: Larger by 2 than at the last call.
        a: An end; in the middle plane if one of the two is.
        b: The other end.
    """
    a_middle, b_middle = x[a, 1] == 0.0, x[b, 1] == 0.0
    corner = first[a]
    while corner >= 0:
        f = corner // 3
        if kept[f]:
            for m in range(3):
                mark[triangles[f, m]] = stamp
        corner = following[corner]
    common = 0
    shared = 0
    crossing = False  # an edge between vertices of the middle plane that leaves it
    corner = first[b]
    while corner >= 0:
        f = corner // 3
        if kept[f]:
            for m in range(3):
                w = triangles[f, m]
                if w != a and w != b and mark[w] == stamp:
                    mark[w] = stamp + 1
                    common += 1
                if mark[w] < stamp and x[w, 1] == 0.0:
                    crossing = crossing or (a_middle and not b_middle)
                if w == a:
                    shared += 1
        corner = following[corner]
    return not crossing and common == shared == (1 if a_middle and b_middle else 2)


@exact_kernel(inner=True)
def _move_corners(triangles, kept, first, following, a, b):
    """Makes the corners of vertex b those of vertex a; triangles at both go."""
    corner = first[b]
    while corner >= 0:
        f = corner // 3
        if kept[f]:
            if triangles[f, 0] == a or triangles[f, 1] == a or triangles[f, 2] == a:
                kept[f] = False
            else:
                triangles[f, corner % 3] = a
        corner = following[corner]


@exact_kernel()
def _collapse(x, triangles, size, wanted):
    """Collapses short edges in place until the whole (mirrored) mesh has `wanted` vertices.

    Passes over all edges with a slowly growing limit of relative length.

    Returns:
        Which vertices and which triangles are left.
    """
    nv, nt = x.shape[0], triangles.shape[0]
    alive = np.ones(nv, np.bool_)
    kept = np.ones(nt, np.bool_)
    # Corners of each vertex as linked lists, so that two lists join in constant time.
    following = np.full(3 * nt, -1, np.int32)
    first = np.full(nv, -1, np.int32)
    final = np.full(nv, -1, np.int32)
    for corner in range(3 * nt):
        v = triangles[corner // 3, corner % 3]
        if first[v] < 0:
            first[v] = corner
        else:
            following[final[v]] = corner
        final[v] = corner
    mark = np.full(nv, -1, np.int64)
    stamp = 0
    count = 0
    for v in range(nv):
        count += 1 if x[v, 1] == 0.0 else 2
    limit = 0.0
    for t in range(nt):
        for c in range(3):
            a, b = triangles[t, c], triangles[t, (c + 1) % 3]
            limit += np.sqrt(_squared_length(x, a, b)) / (size[a] + size[b])
    limit *= 0.5 / (3 * nt)
    for _ in range(400):
        for t in range(nt):
            for c in range(3):
                if not kept[t] or count <= wanted:
                    break
                a, b = triangles[t, c], triangles[t, (c + 1) % 3]
                reach = limit * (size[a] + size[b])
                if _squared_length(x, a, b) > reach * reach:
                    continue
                a_middle, b_middle = x[a, 1] == 0.0, x[b, 1] == 0.0
                if b_middle and not a_middle:
                    a, b = b, a
                    a_middle, b_middle = True, False
                stamp += 2
                if not _is_link(x, triangles, kept, first, following, mark, stamp, a, b):
                    continue
                share = 0.0 if a_middle and not b_middle else 0.5
                px = x[a, 0] + share * (x[b, 0] - x[a, 0])
                py = x[a, 1] + share * (x[b, 1] - x[a, 1])
                pz = x[a, 2] + share * (x[b, 2] - x[a, 2])
                if _turns(x, triangles, kept, first, following, a, b, px, py, pz) or _turns(
                    x, triangles, kept, first, following, b, a, px, py, pz
                ):
                    continue
                x[a, 0], x[a, 1], x[a, 2] = px, py, pz
                _move_corners(triangles, kept, first, following, a, b)
                following[final[a]] = first[b]
                final[a] = final[b]
                alive[b] = False
                count -= 1 if b_middle else 2
        if count <= wanted:
            break
        limit *= 1.03
    return alive, kept


@exact_kernel(inner=True)
def _squared_length(x, a, b):
    return (x[a, 0] - x[b, 0]) ** 2 + (x[a, 1] - x[b, 1]) ** 2 + (x[a, 2] - x[b, 2]) ** 2


@exact_kernel()
def _turns(x, triangles, kept, first, following, moved, gone, px, py, pz):
    """Whether moving a vertex turns one of its triangles by over 60 degrees or into y = 0.

    Triangles that also hold the vertex `gone` are left out; of slivers the direction means
    nothing.
    """
    corner = first[moved]
    while corner >= 0:
        f = corner // 3
        b, c = triangles[f, (corner % 3 + 1) % 3], triangles[f, (corner % 3 + 2) % 3]
        if kept[f] and b != gone and c != gone:
            if py == 0.0 and x[b, 1] == 0.0 and x[c, 1] == 0.0:
                return True
            before = normal_of(x, moved, b, c)
            ux, uy, uz = x[b, 0] - px, x[b, 1] - py, x[b, 2] - pz
            vx, vy, vz = x[c, 0] - px, x[c, 1] - py, x[c, 2] - pz
            n0, n1, n2 = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            area_before = np.sqrt(before[0] ** 2 + before[1] ** 2 + before[2] ** 2)
            area = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
            longest = max(
                ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, _squared_length(x, b, c)
            )
            dot = before[0] * n0 + before[1] * n1 + before[2] * n2
            if area_before > 0.05 * longest and dot < 0.5 * area_before * area:
                return True
            if area_before > 0.05 * longest and area < 0.1 * longest:
                return True
        corner = following[corner]
    return False


def _compacted(x, triangles, alive, kept) -> tuple[FloatArray, IntArray]:
    """The arrays without removed vertices and triangles."""
    number = np.cumsum(alive, dtype=np.int32) - 1
    return x[alive], number[triangles[kept]].astype(np.int32)


def _edges(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Edges [e, 2] (lower vertex first) and their triangles [e, 2], -1 where there is none."""
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    owner = np.tile(np.arange(len(triangles), dtype=np.int32), 3)
    sides = np.sort(sides, axis=1)
    order = np.lexsort((sides[:, 1], sides[:, 0]))
    sides, owner = sides[order], owner[order]
    second = np.append((sides[1:] == sides[:-1]).all(axis=1), False)
    start = ~np.insert(second[:-1], 0, False)
    other = np.where(second, np.append(owner[1:], -1), -1)
    return sides[start].astype(np.int32), np.stack([owner, other], axis=1)[start].astype(np.int32)


@exact_kernel()
def _flip(x, triangles, edges, faces):
    """Flips edges whose opposite angles sum to over 180 degrees, each triangle at most once."""
    triangles = triangles.copy()
    nv = x.shape[0]
    valence = np.zeros(nv, np.int32)
    for e in range(edges.shape[0]):
        valence[edges[e, 0]] += 1
        valence[edges[e, 1]] += 1
    start = np.zeros(nv + 1, np.int32)
    for v in range(nv):
        start[v + 1] = start[v] + valence[v]
    fill = start.copy()
    neighbour = np.empty(start[nv], np.int32)
    for e in range(edges.shape[0]):
        a, b = edges[e]
        neighbour[fill[a]] = b
        neighbour[fill[b]] = a
        fill[a] += 1
        fill[b] += 1
    used = np.zeros(triangles.shape[0], np.bool_)
    touched = np.zeros(nv, np.bool_)
    for e in range(edges.shape[0]):
        f, g = faces[e]
        if g < 0 or used[f] or used[g]:
            continue
        a, b = edges[e]
        c = triangles[f].sum() - a - b
        d = triangles[g].sum() - a - b
        if touched[c] or touched[d] or valence[a] <= 3 or valence[b] <= 3:
            continue
        if x[c, 1] == 0.0 and x[d, 1] == 0.0:
            continue
        if _angle(x, c, a, b) + _angle(x, d, a, b) < np.pi + 1e-3:
            continue
        exists = False
        for m in range(start[c], start[c + 1]):
            exists = exists or neighbour[m] == d
        if exists:
            continue
        for m in range(3):
            if triangles[f, m] == a and triangles[f, (m + 1) % 3] != b:
                a, b = b, a
                break
        # Triangle f now runs a, b, c; triangle g runs b, a, d.
        n = normal_of(x, a, b, c)
        m = normal_of(x, b, a, d)
        p = normal_of(x, c, a, d)
        q = normal_of(x, d, b, c)
        if (n[0] + m[0]) * p[0] + (n[1] + m[1]) * p[1] + (n[2] + m[2]) * p[2] <= 0.0:
            continue
        if (n[0] + m[0]) * q[0] + (n[1] + m[1]) * q[1] + (n[2] + m[2]) * q[2] <= 0.0:
            continue
        triangles[f, 0], triangles[f, 1], triangles[f, 2] = c, a, d
        triangles[g, 0], triangles[g, 1], triangles[g, 2] = d, b, c
        used[f] = used[g] = True
        touched[a] = touched[b] = touched[c] = touched[d] = True
    return triangles


@exact_kernel()
def _angle(x, apex, a, b):
    """Angle of a triangle at `apex` [rad]."""
    n = normal_of(x, apex, a, b)
    dot = 0.0
    for k in range(3):
        dot += (x[a, k] - x[apex, k]) * (x[b, k] - x[apex, k])
    return np.arctan2(np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]), dot)


@exact_kernel()
def _smooth(x, triangles, size, edges):
    """Moves vertices in their tangent plane towards the mean of their neighbours.

    Neighbours count more where smaller triangles are wanted beyond them. Vertices of the middle
    plane look at their neighbours in it only.
    """
    nv = x.shape[0]
    goal = np.zeros((nv, 3))
    total = np.zeros(nv)
    normal = np.zeros((nv, 3))
    for t in range(triangles.shape[0]):
        n = normal_of(x, triangles[t, 0], triangles[t, 1], triangles[t, 2])
        for m in range(3):
            for k in range(3):
                normal[triangles[t, m], k] += n[k]
    for e in range(edges.shape[0]):
        a, b = edges[e]
        a_middle, b_middle = x[a, 1] == 0.0, x[b, 1] == 0.0
        w = np.sqrt(_squared_length(x, a, b)) / (size[a] + size[b])
        for i, j, used in ((a, b, b_middle or not a_middle), (b, a, a_middle or not b_middle)):
            if used:
                total[i] += w
                for k in range(3):
                    goal[i, k] += w * x[j, k]
    out = x.copy()
    for v in range(nv):
        if x[v, 1] == 0.0:
            normal[v, 1] = 0.0
        squared = normal[v, 0] ** 2 + normal[v, 1] ** 2 + normal[v, 2] ** 2
        if total[v] == 0.0 or squared == 0.0:
            continue
        along = 0.0
        for k in range(3):
            along += (goal[v, k] / total[v] - x[v, k]) * normal[v, k]
        for k in range(3):
            move = goal[v, k] / total[v] - x[v, k] - along / squared * normal[v, k]
            out[v, k] = x[v, k] + 0.35 * move
    return out
