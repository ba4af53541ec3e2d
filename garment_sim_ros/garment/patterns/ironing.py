"""Cloth that runs through itself is laid smooth there.

A garment that is sewn from panels can be tucked into itself where four seams meet, as under an
arm. What makes contours of intersection shorter does not help there: they end at the seams. So the
surroundings are laid as a soap film is that hangs in their rim, which passes through nothing; the
cloth, too short in it then, folds anew by itself.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.topology import mesh_topology

_RINGS = range(1, 7)
"""How many edges around what is tangled are laid smooth with it: as few as will do."""
_MOST = 0.05
"""Share of the edges that may be tangled for it to be laid smooth."""
_LARGE = 3.0
"""Size of triangles that are searched apart, in the median's."""


def ironed(x: FloatArray, triangles: IntArray) -> FloatArray:
    """Vertices of a garment with what runs through itself laid smooth [m], shape [v, 3].

    What is tangled all over is left as it is: no film hangs in its rim.

    Args:
        x: Vertices [m], shape [v, 3].
        triangles: Shape [t, 3].
    """
    edges = mesh_topology(triangles).edges
    best, fewest = x, len(self_intersections(x, triangles))
    if fewest > _MOST * len(edges):
        return x
    for rings in _RINGS:
        if fewest == 0:
            break
        smooth = x
        for _ in range(2):  # the film may meet what was in its way
            bad = self_intersections(smooth, triangles)
            smooth = _film(smooth, edges, _around(bad, edges, len(x), rings))
        left = len(self_intersections(smooth, triangles))
        if left < fewest:
            best, fewest = smooth, left
    return best


def _around(bad: IntArray, edges: IntArray, count: int, rings: int) -> NDArray[np.bool_]:
    """Which vertices are within so many edges of the ends of others, shape [v]."""
    near = np.zeros(count, bool)
    near[bad] = True
    for _ in range(rings):
        near[edges[near[edges].any(axis=1)]] = True
    return near


def _film(x: FloatArray, edges: IntArray, free: NDArray[np.bool_]) -> FloatArray:
    """Each free vertex in the middle of its neighbours, the others where they are [m], [v, 3]."""
    if not free.any() or free.all():
        return x
    n = len(x)
    both = np.concatenate([edges, edges[:, ::-1]])
    links = coo_matrix((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(n, n)).tocsr()
    laplacian = (diags(np.asarray(links.sum(axis=1)).ravel()) - links).tocsr()
    inside = np.flatnonzero(free)
    rim = np.flatnonzero(~free)
    result = x.copy()
    result[inside] = spsolve(
        laplacian[inside][:, inside].tocsc(), -laplacian[inside][:, rim] @ x[rim]
    )
    return result


def self_intersections(x: FloatArray, triangles: IntArray) -> IntArray:
    """Edges that run through a triangle that they have no vertex in common with, shape [k, 2]."""
    edges = mesh_topology(triangles).edges
    e, t = _near(x, triangles, edges)
    apart = (edges[e][:, :, None] != triangles[t][:, None, :]).all(axis=(1, 2))
    e, t = e[apart], t[apart]
    hit = _passes(x[edges[e, 0]], x[edges[e, 1]], *(x[triangles[t, k]] for k in range(3)))
    return edges[np.unique(e[hit])]


def _near(x: FloatArray, triangles: IntArray, edges: IntArray) -> tuple[IntArray, IntArray]:
    """Edges and triangles that can meet, in pairs: numbers of both, shape [k].

    Triangles that are far larger than most are searched apart: all the others would have their
    reach.
    """
    centre = x[triangles].mean(axis=1)
    reach = np.linalg.norm(x[triangles] - centre[:, None], axis=2).max(axis=1)
    middle = x[edges].mean(axis=1)
    half = 0.5 * np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)
    large = reach > _LARGE * np.median(reach)
    pairs = []
    for own in (np.flatnonzero(~large), np.flatnonzero(large)):
        if not len(own):
            continue
        found = cKDTree(centre[own]).query_ball_point(middle, reach[own].max() + half)
        e = np.repeat(np.arange(len(edges)), [len(f) for f in found])
        t = own[np.concatenate(found).astype(np.int64)]
        close = np.linalg.norm(middle[e] - centre[t], axis=1) <= reach[t] + half[e]
        pairs.append(np.stack([e[close], t[close]]))
    e, t = np.concatenate(pairs, axis=1)
    return e, t


def _passes(
    p: FloatArray, q: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray
) -> np.ndarray:
    """Whether segments pq run through triangles abc."""
    u, v, d = b - a, c - a, q - p
    normal = np.cross(u, v)
    slope = (normal * d).sum(axis=1)
    steep = np.abs(slope) > 1e-18
    s = ((a - p) * normal).sum(axis=1) / np.where(steep, slope, 1.0)
    w = p + s[:, None] * d - a
    squared = np.maximum((normal**2).sum(axis=1), 1e-30)
    beta = (np.cross(w, v) * normal).sum(axis=1) / squared
    gamma = (np.cross(u, w) * normal).sum(axis=1) / squared
    return steep & (s > 0.0) & (s < 1.0) & (beta > 0.0) & (gamma > 0.0) & (beta + gamma < 1.0)
