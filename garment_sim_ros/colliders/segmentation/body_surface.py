"""One connected surface out of what a body file holds, ready for geodesics.

Repairs are noted, never silent: seams are welded, parts that nearly touch are bridged, others left
out, small holes are closed.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import boundary_loops, edge_table
from garment_sim_ros.geometry.triangles import triangle_areas

_WELD = 1e-6
"""Vertices closer than this share of the body's size are one."""
_BRIDGE = 0.03
"""Parts closer than this share of the body's size belong together."""
_HOLE = 0.25
"""Longest rim of a hole that is closed, as a share of the body's size."""
_SECOND_BODY = 0.3
"""A separate part with this share of the largest one's area is another body."""
MIN_VERTICES = 60
MAX_VERTICES = 3_000_000


@dataclass(frozen=True)
class BodySurface:
    """A body's surface, repaired.

    Attributes:
        vertices: Positions [m]; the centres of closed holes come last, shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        bridges: Vertex pairs that join parts which do not touch, shape [b, 2].
        vertex: For each vertex of the file the one of this surface that stands for it, shape [n].
        notes: What was repaired, one sentence each.
    """

    vertices: FloatArray
    triangles: IntArray
    bridges: IntArray
    vertex: IntArray
    notes: tuple[str, ...]


def body_surface(vertices: FloatArray, triangles: IntArray) -> BodySurface:
    """Weld, join and close a mesh.

    Args:
        vertices: Positions [m], shape [n, 3].
        triangles: Vertex indices, shape [t, 3].

    Raises:
        GeometryError: Too few or too many vertices, not finite, or several bodies.
    """
    x = np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3)
    triangles = np.asarray(triangles, dtype=np.int32).reshape(-1, 3)
    if not MIN_VERTICES <= len(x) <= MAX_VERTICES:
        raise GeometryError(f"{len(x)} vertices; allowed: {MIN_VERTICES} to {MAX_VERTICES}")
    if not np.isfinite(x).all():
        raise GeometryError("vertices must be finite")
    if not len(triangles) or triangles.min() < 0 or triangles.max() >= len(x):
        raise GeometryError(f"triangles must be there and point into 0..{len(x) - 1}")
    notes: list[str] = []
    size = _size(x)
    number, x, triangles = _welded(x, triangles, size, notes)
    number, x, triangles, bridges = _joined(number, x, triangles, size, notes)
    bad, rim = _edge_faults(triangles, len(x))
    if bad:
        notes.append(f"{bad} edges are not manifold; geodesics pass over them")
    if rim:
        x, triangles = _closed(x, triangles, size, notes)
    return BodySurface(x, triangles, bridges, number, tuple(notes))


def _size(x: FloatArray) -> float:
    """How far apart points are, whichever way they are turned: up to twice as much [m]."""
    away = np.linalg.norm(x - x.mean(axis=0), axis=1)
    return float(np.linalg.norm(x - x[away.argmax()], axis=1).max())


def _welded(
    x: FloatArray, triangles: IntArray, size: float, notes: list[str]
) -> tuple[IntArray, FloatArray, IntArray]:
    """One vertex per place; degenerate triangles are dropped."""
    v = len(x)
    pairs = cKDTree(x).query_pairs(_WELD * size, output_type="ndarray").reshape(-1, 2)
    number = np.arange(v, dtype=np.int32)
    if len(pairs):
        links = coo_matrix(
            (np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(v, v)
        )
        _, label = connected_components(links, directed=False)
        _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
        number = inverse.astype(np.int32)
        notes.append(f"{v - len(first)} vertices at seams were welded")
        x = x[first]
    t = number[triangles]
    good = (t[:, 0] != t[:, 1]) & (t[:, 1] != t[:, 2]) & (t[:, 2] != t[:, 0])
    if not good.any():
        raise GeometryError("all triangles are degenerate")
    return number, x, np.ascontiguousarray(t[good])


def _joined(
    number: IntArray, x: FloatArray, triangles: IntArray, size: float, notes: list[str]
) -> tuple[IntArray, FloatArray, IntArray, IntArray]:
    """Keep the largest part and what nearly touches it."""
    v = len(x)
    edges = edge_table(triangles)[0]
    links = coo_matrix((np.ones(len(edges), np.int8), (edges[:, 0], edges[:, 1])), shape=(v, v))
    _, label = connected_components(links, directed=False)
    area = triangle_areas(x, triangles)
    part_area = np.bincount(label[triangles[:, 0]], area, minlength=int(label.max()) + 1)
    main = int(part_area.argmax())
    held = label == main
    waiting = set(np.flatnonzero(part_area > 0.0).tolist()) - {main}
    bridges = np.zeros((0, 2), np.int32)
    found = len(waiting)
    while waiting:
        tree, at = cKDTree(x[held]), np.flatnonzero(held)
        rest = np.flatnonzero(np.isin(label, list(waiting)))
        gap, nearest = tree.query(x[rest], distance_upper_bound=_BRIDGE * size)
        closest = np.full(len(part_area), np.inf)
        np.minimum.at(closest, label[rest], gap)
        near = [p for p in waiting if np.isfinite(closest[p])]
        if not near:
            break
        touching = np.isfinite(gap) & (gap <= 1.5 * closest[label[rest]] + 1e-3 * size)
        new = np.stack([rest[touching], at[nearest[touching]]], axis=1)
        bridges = np.concatenate([bridges, new.astype(np.int32)])
        held |= np.isin(label, near)
        waiting -= set(near)
    if found > len(waiting):
        notes.append(f"{found - len(waiting)} parts that nearly touch were joined to the largest")
    for part in sorted(waiting, key=lambda p: -part_area[p])[:1]:
        if part_area[part] > _SECOND_BODY * part_area[main]:
            raise GeometryError(
                "the mesh holds several bodies apart from each other; allowed: one"
            )
        notes.append(f"{len(waiting)} separate parts were left out")
    kept = triangles[held[triangles[:, 0]]]
    used = np.unique(kept)
    compact = np.full(v, -1, dtype=np.int32)
    compact[used] = np.arange(len(used))
    # What is left out is carried by what is next to it.
    lost = np.flatnonzero(compact < 0)
    if len(lost):
        compact[lost] = cKDTree(x[used]).query(x[lost])[1]
    return compact[number], x[used], compact[kept], compact[bridges]


def _edge_faults(triangles: IntArray, count: int) -> tuple[int, int]:
    """Number of edges with more than two triangles or inconsistent winding, and of rim edges."""
    a = triangles.ravel().astype(np.int64)
    b = triangles[:, [1, 2, 0]].ravel().astype(np.int64)
    key = np.minimum(a, b) * count + np.maximum(a, b)
    order = np.argsort(key)
    key, forward = key[order], (a < b)[order]
    first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    uses = np.diff(first, append=len(key))
    ahead = np.add.reduceat(forward.astype(np.int64), first)
    bad = (uses > 2) | ((uses == 2) & (ahead != 1))
    return int(bad.sum()), int((uses == 1).sum())


def _closed(
    x: FloatArray, triangles: IntArray, size: float, notes: list[str]
) -> tuple[FloatArray, IntArray]:
    """Close small holes by a fan around their middle."""
    try:
        loops = boundary_loops(triangles)
    except GeometryError as error:
        notes.append(f"holes were left open: {error}")
        return x, triangles
    closed = 0
    for loop in loops:
        following = np.roll(loop, -1)
        if np.linalg.norm(x[following] - x[loop], axis=1).sum() > _HOLE * size:
            continue
        middle = np.full(len(loop), len(x), dtype=np.int32)
        x = np.concatenate([x, x[loop].mean(axis=0, keepdims=True)])
        triangles = np.concatenate([triangles, np.stack([following, loop, middle], axis=1)])
        closed += 1
    if closed:
        notes.append(f"{closed} small holes were closed")
    if len(loops) > closed:
        notes.append(f"{len(loops) - closed} large holes stay open")
    return x, np.ascontiguousarray(triangles)
