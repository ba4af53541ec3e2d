"""Cloth in a plane on uneven meshes, as stiffness matrices in float64: springs, and a membrane."""

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial import Delaunay

from garment_sim_ros.constants import GRAVITY
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.sim.elasticity import edge_stiffness

SPACING = 0.02


def points(turned=0.0, jitter=0.0, half=25):
    """A square of a grid in a plane of weft and warp, turned [degrees] and jittered."""
    i, j = np.meshgrid(*[np.arange(-half, half + 1)] * 2, indexing="ij")
    p = SPACING * np.stack([i.ravel(), j.ravel()], axis=1)
    p += np.random.default_rng(1).uniform(-jitter, jitter, p.shape) * SPACING
    c, s = np.cos(np.radians(turned)), np.sin(np.radians(turned))
    return p @ np.array([[c, s], [-s, c]])


def rows(half=25):
    """Equilateral triangles in rows along the weft, as of a skirt."""
    i, j = np.meshgrid(*[np.arange(-half, half + 1)] * 2, indexing="ij")
    return SPACING * np.stack([(i + 0.5 * (j % 2)).ravel(), np.sqrt(0.75) * j.ravel()], axis=1)


def split(p):
    """Triangles between points of a turned grid, all split one way."""
    n = round(np.sqrt(len(p)))
    a = np.arange(n * n).reshape(n, n)[:-1, :-1].ravel()
    return np.concatenate([np.stack([a, a + n, a + n + 1], 1), np.stack([a, a + n + 1, a + 1], 1)])


MESHES = {
    "grid": lambda: (points(), split(points())),
    "turned by 20": lambda: (points(20.0), split(points(20.0))),
    "turned by 30": lambda: (points(30.0), split(points(30.0))),
    "turned by 45": lambda: (points(45.0), split(points(45.0))),
    "rows": lambda: (rows(), Delaunay(rows()).simplices),
    "random": lambda: (points(17.0, 0.35), Delaunay(points(17.0, 0.35)).simplices),
}


def doubled(a, b, c):
    """Twice the area of triangles, by their sense."""
    (x, y), (z, w) = (b - a).T, (c - a).T
    return x * w - y * z


def cut(p, triangles, width, height):
    """The triangles in a rectangle; those that are flatter than cloth is meshed left out."""
    a, b, c = (p[triangles[:, k]] for k in range(3))
    sides = [((v - u) ** 2).sum(axis=1) for u, v in ((a, b), (b, c), (c, a))]
    middle = np.abs(p[triangles].mean(axis=1))
    good = np.abs(doubled(a, b, c)) > 0.2 * np.max(sides, axis=0)
    triangles = triangles[good & (middle[:, 0] < width / 2) & (middle[:, 1] < height / 2)]
    used, index = np.unique(triangles, return_inverse=True)
    return p[used], index.reshape(-1, 3).astype(np.int32)


def gradients(p, triangles):
    """Of the strains (weft, warp, shear) by coordinates, shape [t, 3, 6]; areas, shape [t]."""
    a, b, c = (p[triangles[:, k]] for k in range(3))
    twice = doubled(a, b, c)
    slope = np.stack([b - c, c - a, a - b], axis=1)[:, :, ::-1] * [1.0, -1.0]
    slope /= twice[:, None, None]
    B = np.zeros((len(triangles), 3, 6))
    B[:, 0, 0::2] = B[:, 2, 1::2] = slope[:, :, 0]
    B[:, 1, 1::2] = B[:, 2, 0::2] = slope[:, :, 1]
    return B, np.abs(twice) / 2


def assembled(blocks, corners, n):
    """A sparse matrix of blocks between corners [m, k] in two coordinates each."""
    at = (2 * corners[..., None] + [0, 1]).reshape(len(corners), -1)
    i, j = (
        np.broadcast_to(at[:, :, None], blocks.shape),
        np.broadcast_to(at[:, None], blocks.shape),
    )
    return csc_matrix((blocks.ravel(), (i.ravel(), j.ravel())), shape=(2 * n, 2 * n))


def membrane(p, triangles, fabric):
    """Stiffness matrix of triangles of constant strain; warp and weft coupled as by springs."""
    warp, weft, shear = (
        fabric.stretch_stiffness_warp,
        fabric.stretch_stiffness_weft,
        fabric.shear_stiffness,
    )
    law = np.array([[weft, shear, 0.0], [shear, warp, 0.0], [0.0, 0.0, shear]])
    B, area = gradients(p, triangles)
    blocks = np.einsum("tia,ij,tjb,t->tab", B, law, B, area)
    return assembled(blocks, triangles, len(p))


def springs(p, triangles, fabric):
    """Stiffness matrix of the mesh's edges."""
    edges = mesh_topology(triangles).edges
    upright = np.stack([p[:, 0], 0.0 * p[:, 0], p[:, 1]], axis=1)
    k = edge_stiffness(upright, triangles, edges, fabric)
    along = p[edges[:, 0]] - p[edges[:, 1]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    pull = np.concatenate([along, -along], axis=1)
    return assembled(k[:, None, None] * pull[:, :, None] * pull[:, None, :], edges, len(p))


def stiffness(matrix, p, triangles):
    """Along warp, weft and both diagonals and in shear, all else free; the border is strained."""
    area = gradients(p, triangles)[1].sum()
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edge, count = np.unique(edges, axis=0, return_counts=True)
    free = np.ones(len(p), bool)
    free[edge[count == 1]] = False
    free = np.repeat(free, 2)
    u = np.zeros((2 * len(p), 3))
    u[0::2, 0], u[1::2, 1] = p[:, 0], p[:, 1]
    u[0::2, 2], u[1::2, 2] = p[:, 1] / 2, p[:, 0] / 2
    u[free] = spsolve(matrix[free][:, free], -matrix[free][:, ~free] @ u[~free])
    soft = np.linalg.inv(u.T @ (matrix @ u) / area)
    pulls = np.array([[0, 1, 0], [1, 0, 0], [0.5, 0.5, 0.5], [0.5, 0.5, -0.5], [0, 0, 1]])
    return 1.0 / np.einsum("ki,ij,kj->k", pulls, soft, pulls)


def sag(matrix, p, triangles, fabric, axis):
    """Mean way down of the lower end of a curtain hung along an axis by the upper one [m]."""
    area = gradients(p, triangles)[1]
    mass = np.bincount(triangles.ravel(), np.repeat(area, 3), len(p)) / 3 * fabric.areal_density
    force = np.zeros((len(p), 2))
    force[:, axis] = -mass * GRAVITY
    free = np.repeat(p[:, axis] < p[:, axis].max() - SPACING / 2, 2)
    u = np.zeros(2 * len(p))
    u[free] = spsolve(matrix[free][:, free], force.ravel()[free])
    return -u.reshape(-1, 2)[p[:, axis] < p[:, axis].min() + 1.5 * SPACING, axis].mean()
