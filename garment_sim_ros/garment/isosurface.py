"""Triangles of a field's zero level, and cutting a mesh along another field's zero level.

Surface nets: one vertex in every grid cell that the surface crosses, at the mean of the crossings
of the cell's edges, and one quad around every crossed grid edge (Gibson 1998, "Constrained elastic
surface nets"). Vertices are spaced evenly, which suits remeshing.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.garment.mesh_repair import triangulate
from garment_sim_ros.geometry.topology import edge_table


def surface_net(
    field: FloatArray, origin: FloatArray, spacing: float
) -> tuple[FloatArray, IntArray]:
    """The zero level of a sampled field; it stays open where it leaves the grid.

    Args:
        field: Values at grid nodes, negative inside, shape [nx, ny, nz].
        origin: Position of node (0, 0, 0) [m], shape [3].
        spacing: Distance of nodes [m].

    Returns:
        Vertices [m], shape [v, 3], and triangles, outward, shape [t, 3].
    """
    cells = np.array(field.shape) - 1
    total = np.zeros((*cells, 3))
    count = np.zeros(cells, dtype=np.int64)
    crossed = []
    for axis in range(3):
        low = np.moveaxis(field, axis, 0)[:-1]
        high = np.moveaxis(field, axis, 0)[1:]
        cross = (low < 0.0) != (high < 0.0)
        s = np.divide(low, low - high, out=np.zeros_like(low), where=cross)
        cross, s = np.moveaxis(cross, 0, axis), np.moveaxis(s, 0, axis)
        crossed.append(cross)
        place = np.moveaxis(np.indices(cross.shape), 0, -1).astype(np.float64)
        place[..., axis] += s
        place[~cross] = 0.0
        b, c = (k for k in range(3) if k != axis)
        for db in (0, 1):
            for dc in (0, 1):
                part: list[slice] = [slice(None)] * 3
                part[b] = slice(db, db + cells[b])
                part[c] = slice(dc, dc + cells[c])
                total += place[tuple(part)]
                count += cross[tuple(part)]
    mixed = count > 0
    vertices = origin + spacing * (total[mixed] / count[mixed][:, None])
    number = np.full(cells, -1, dtype=np.int64)
    number[mixed] = np.arange(len(vertices))

    quads = []
    for axis, cross in enumerate(crossed):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        node = np.argwhere(cross)
        inner = (node[:, b] > 0) & (node[:, b] < cells[b]) & (node[:, c] > 0)
        node = node[inner & (node[:, c] < cells[c])]
        corners = []
        for db, dc in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            cell = node.copy()
            cell[:, b] += db
            cell[:, c] += dc
            corners.append(number[tuple(cell.T)])
        quad = np.stack(corners, axis=1)
        # Counter-clockwise around +axis as it stands: outward where the field grows along it.
        falls = field[tuple(node.T)] >= 0.0
        quad[falls] = quad[falls][:, ::-1]
        quads.append(quad)
    flat = np.concatenate(quads)
    triangles = triangulate(vertices, flat.ravel(), np.full(len(flat), 4))
    return _compacted(vertices, triangles)


def clipped(
    vertices: FloatArray, triangles: IntArray, value: FloatArray
) -> tuple[FloatArray, IntArray, IntArray]:
    """The part of a mesh on which a value given at its vertices is negative.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        value: Value at each vertex, linear between, shape [v].

    Returns:
        Vertices, triangles, and for each vertex the one it was, or -1 on the cut, shape [v'].
    """
    value = np.where(value == 0.0, np.finfo(np.float64).tiny, value)
    edges, side_edge, _ = edge_table(triangles)
    a, b = edges.T
    cut = (value[a] < 0.0) != (value[b] < 0.0)
    s = value[a[cut]] / (value[a[cut]] - value[b[cut]])
    x = np.concatenate(
        [vertices, vertices[a[cut]] + s[:, None] * (vertices[b[cut]] - vertices[a[cut]])]
    )
    new = np.full(len(edges), -1)
    new[cut] = len(vertices) + np.arange(cut.sum())
    inside = value[triangles] < 0.0
    kept = [triangles[inside.all(axis=1)]]
    for only in (True, False):
        # Triangles with one corner inside (outside): turned so that this corner comes first.
        which = (inside.sum(axis=1) == 1) if only else (inside.sum(axis=1) == 2)
        first = np.argmax(inside[which] == only, axis=1)
        turn = (first[:, None] + np.arange(3)) % 3
        p, q, r = np.take_along_axis(triangles[which], turn, axis=1).T
        pq, _, rp = np.take_along_axis(new[side_edge[which]], turn, axis=1).T
        if only:
            kept.append(np.stack([p, pq, rp], axis=1))
        else:
            kept += [np.stack([pq, q, r], axis=1), np.stack([pq, r, rp], axis=1)]
    origin = np.concatenate([np.arange(len(vertices)), np.full(cut.sum(), -1)])
    used, compact = np.unique(np.concatenate(kept), return_inverse=True)
    return x[used], compact.reshape(-1, 3).astype(np.int32), origin[used].astype(np.int32)


def _compacted(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    used, compact = np.unique(triangles, return_inverse=True)
    return vertices[used], compact.reshape(-1, 3).astype(np.int32)
