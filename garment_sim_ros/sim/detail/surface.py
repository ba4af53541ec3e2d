"""All vertices of a garment of which fewer are simulated.

Each vertex keeps its place beside a triangle of the coarser mesh: as far along its first edge,
across it and along the normal, which goes over evenly from triangle to triangle. At rest every
vertex is exactly where the garment has it, so that what is round at rest stays round.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.geometry.connectivity import adjacency
from garment_sim_ros.geometry.geodesics import mesh_graph
from garment_sim_ros.geometry.mesh_distance import closest_on_triangle
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.jit import exact_kernel, kernel

_FLAT = 1e-12
"""Squared lengths are above this [m^2]: a triangle may be flattened."""


@dataclass(frozen=True, kw_only=True)
class Places:
    """Places on a mesh.

    Attributes:
        corner: Vertices that each lies between, shape [n, 3].
        share: Its barycentric coordinates, shape [n, 3].
    """

    corner: IntArray
    share: FloatArray

    @property
    def nearest(self) -> IntArray:
        """The corner with the largest share, shape [n]."""
        rows = np.arange(len(self.corner))
        found: IntArray = self.corner[rows, self.share.argmax(axis=1)]
        return found

    def of(self, values: FloatArray) -> FloatArray:
        """What vertices have, shape [v, k], at the places, shape [n, k]."""
        found: FloatArray = np.einsum("nc,nck->nk", self.share, values[self.corner])
        return found


class Surface:
    """A garment's vertices over a coarser mesh.

    Args:
        vertices: At rest [m], shape [v, 3].
        triangles: Vertex indices of the garment, shape [t, 3].
        under: Where vertices of the coarser mesh are on it.
        coarse_triangles: Their triangles, shape [s, 3].

    Attributes:
        triangles: As given.
        under: As given.
        corner: Vertices of the coarser mesh that each vertex lies between, shape [v, 3].
        share: Its barycentric coordinates there, shape [v, 3].
        off: What it is off from there along the triangle's first edge, across it and along the
            normal [m], shape [v, 3].
    """

    def __init__(
        self,
        vertices: FloatArray,
        triangles: IntArray,
        under: Places,
        coarse_triangles: IntArray,
    ) -> None:
        self.triangles, self.under = _frozen(triangles), under
        coarse = under.of(vertices)
        self._coarse_triangles = _frozen(coarse_triangles)
        owner = _owners(vertices, triangles, under.nearest)
        self.corner, share = _over(vertices, coarse, coarse_triangles, owner)
        self.share = share.astype(np.float32)
        self._normal = np.zeros(coarse.shape, np.float32)
        x = np.ascontiguousarray(coarse, np.float32)
        vertex_normals(x, self._coarse_triangles, self._normal)
        self.off = np.zeros((len(vertices), 3), np.float32)
        place, across = frames_on(x, self._normal, self.corner, self.share)
        self.off[:] = np.einsum("vik,vi->vk", across, vertices - place)

    def __len__(self) -> int:
        return len(self.corner)

    def follow(self, x: SingleArray, origin: FloatArray, out: SingleArray) -> None:
        """World positions of all vertices.

        Args:
            x: The coarser mesh, relative to an origin near by [m], shape [c, 3].
            origin: World position of that origin [m], shape [3].
            out: Output [m], shape [v, 3].
        """
        vertex_normals(x, self._coarse_triangles, self._normal)
        _follow(x, self._normal, self.corner, self.share, self.off, origin, out)

    def between(self, values: SingleArray) -> SingleArray:
        """What vertices of the coarser mesh have, shape [c, k], between them, shape [v, k]."""
        found: SingleArray = np.einsum("vc,vck->vk", self.share, values[self.corner])
        return found


def itself(vertices: FloatArray, triangles: IntArray) -> Surface:
    """A garment's vertices over a mesh that is no coarser."""
    own = np.arange(len(vertices), dtype=np.int32)
    share = np.tile([1.0, 0.0, 0.0], (len(vertices), 1))
    return Surface(
        vertices, triangles, Places(corner=own.repeat(3).reshape(-1, 3), share=share), triangles
    )


def _frozen(triangles: IntArray) -> IntArray:
    own = np.array(triangles, np.int32)
    own.setflags(write=False)
    return own


def _owners(vertices: FloatArray, triangles: IntArray, near: IntArray) -> IntArray:
    """The coarse vertex that is nearest to each vertex on its way over the garment, shape [v].

    Straight ways would lead from a sleeve to the trunk.
    """
    sources, first = np.unique(near, return_index=True)
    graph = mesh_graph(vertices, triangles, paths="edges")
    _, before = graph.distances(sources.astype(np.int32))
    root = np.where(before < 0, np.arange(len(vertices), dtype=np.int32), before)
    while (root[root] != root).any():
        root = root[root]
    owner = np.zeros(len(vertices), np.int32)
    owner[sources] = first
    return owner[root]


def _over(
    vertices: FloatArray, coarse: FloatArray, triangles: IntArray, owner: IntArray
) -> tuple[IntArray, FloatArray]:
    """The nearest triangle around each vertex's owner: its corners and their shares, [v, 3]."""
    count = len(coarse)
    ones = np.ones(triangles.size, np.int8)
    index = np.repeat(np.arange(len(triangles)), 3)
    at = sp.csr_matrix((ones, (triangles.ravel(), index)), shape=(count, len(triangles)))
    around = (adjacency(triangles, count) + sp.identity(count)) @ at
    around.sort_indices()
    chosen = np.zeros(len(vertices), np.int32)
    share = np.zeros((len(vertices), 3))
    start, candidate = around.indptr.astype(np.int32), around.indices.astype(np.int32)
    x, points = (np.ascontiguousarray(a, np.float64) for a in (coarse, vertices))
    _nearest(points, x, np.asarray(triangles, np.int32), owner, start, candidate, chosen, share)
    return np.ascontiguousarray(triangles[chosen], np.int32), share


@exact_kernel()
def _nearest(points, x, triangles, owner, start, candidate, chosen, share):
    """The nearest of the candidate triangles of each point's owner, and shares of its corners."""
    for i in range(points.shape[0]):
        least = np.inf
        for k in range(start[owner[i]], start[owner[i] + 1]):
            t = candidate[k]
            a, b, c = x[triangles[t, 0]], x[triangles[t, 1]], x[triangles[t, 2]]
            v, w, _ = closest_on_triangle(a, b, c, points[i, 0], points[i, 1], points[i, 2])
            squared = 0.0
            for j in range(3):
                off = a[j] + v * (b[j] - a[j]) + w * (c[j] - a[j]) - points[i, j]
                squared += off * off
            if squared < least:
                least = squared
                chosen[i] = t
                share[i, 0], share[i, 1], share[i, 2] = max(0.0, 1.0 - v - w), v, w


def frames_on(
    x: SingleArray, normal: SingleArray, corner: IntArray, share: SingleArray
) -> tuple[FloatArray, FloatArray]:
    """Places on triangles and the directions there, in double precision.

    Args:
        x: The coarser mesh [m], shape [c, 3].
        normal: Its unit normals, shape [c, 3].
        corner: Vertices that each place lies between, shape [v, 3].
        share: Its barycentric coordinates, shape [v, 3].

    Returns:
        Places [m], shape [v, 3]; as columns the directions along the first edge, across it and
        along the normal there, shape [v, 3, 3].
    """
    at, w = x.astype(np.float64)[corner], share.astype(np.float64)[:, :, None]
    place = (w * at).sum(axis=1)
    up = (w * normal.astype(np.float64)[corner]).sum(axis=1)
    up /= np.sqrt((up * up).sum(axis=1, keepdims=True) + _FLAT)
    along = at[:, 1] - at[:, 0]
    along -= (along * up).sum(axis=1, keepdims=True) * up
    along /= np.sqrt((along * along).sum(axis=1, keepdims=True) + _FLAT)
    return place, np.stack([along, np.cross(up, along), up], axis=2)


@kernel()
def _follow(x, normal, corner, share, off, origin, out):
    """As `frames_on`, and what each vertex is off from there, in single precision."""
    flat, one = np.float32(_FLAT), np.float32(1.0)
    for v in range(corner.shape[0]):
        a, b, c = corner[v, 0], corner[v, 1], corner[v, 2]
        u, s, w = share[v, 0], share[v, 1], share[v, 2]
        nx = u * normal[a, 0] + s * normal[b, 0] + w * normal[c, 0]
        ny = u * normal[a, 1] + s * normal[b, 1] + w * normal[c, 1]
        nz = u * normal[a, 2] + s * normal[b, 2] + w * normal[c, 2]
        scale = one / np.sqrt(nx * nx + ny * ny + nz * nz + flat)
        nx, ny, nz = nx * scale, ny * scale, nz * scale
        ex, ey, ez = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        along = ex * nx + ey * ny + ez * nz
        ex, ey, ez = ex - along * nx, ey - along * ny, ez - along * nz
        scale = one / np.sqrt(ex * ex + ey * ey + ez * ez + flat)
        ex, ey, ez = ex * scale, ey * scale, ez * scale
        fx, fy, fz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
        o, p, q = off[v, 0], off[v, 1], off[v, 2]
        px = u * x[a, 0] + s * x[b, 0] + w * x[c, 0] + o * ex + p * fx + q * nx
        py = u * x[a, 1] + s * x[b, 1] + w * x[c, 1] + o * ey + p * fy + q * ny
        pz = u * x[a, 2] + s * x[b, 2] + w * x[c, 2] + o * ez + p * fz + q * nz
        out[v, 0], out[v, 1], out[v, 2] = px + origin[0], py + origin[1], pz + origin[2]
