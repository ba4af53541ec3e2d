"""The primitive shapes of URDF as triangles, with vertices all over them: fitting needs them.

A body may have thousands of shapes, so that what depends on the numbers of divisions only is made
once and then scaled.
"""

from functools import lru_cache

import numpy as np

from garment_sim_ros.arrays import FloatArray, LongArray

MOST_DIVISIONS = 12
"""Edges along a shape's longest side."""

_SEGMENTS = 32
_VERTICES_IN_ALL = 250_000


def divisions_for(count: int) -> int:
    """Edges along the longest side of each of `count` shapes: fewer where they are many."""
    share = np.sqrt(_VERTICES_IN_ALL / (6.0 * max(count, 1)))
    return int(np.clip(share, 1, MOST_DIVISIONS))


def box(extents: FloatArray, divisions: int) -> tuple[FloatArray, LongArray]:
    """Vertices [v, 3] and triangles [t, 3] of a box about the origin with these extents."""
    counts = np.clip(np.ceil(divisions * extents / extents.max()), 1, divisions).astype(int)
    lattice, triangles = _box(*map(int, counts))
    return (lattice / counts - 0.5) * extents, triangles


def cylinder(radius: float, length: float, divisions: int) -> tuple[FloatArray, LongArray]:
    """Vertices and triangles of a cylinder along z about the origin."""
    edge = max(2.0 * radius, length) / divisions
    rings = int(np.clip(np.ceil(radius / edge), 1, divisions))
    rows = int(np.clip(np.ceil(length / edge), 1, divisions))
    cap = radius * np.arange(rings + 1) / rings
    side = length * (np.arange(rows + 1) / rows - 0.5)
    r = np.concatenate([cap[:-1], np.full(rows + 1, radius), cap[-2::-1]])
    z = np.concatenate([np.full(rings, side[0]), side, np.full(rings, side[-1])])
    return _turned(r, z)


def capsule(radius: float, length: float, divisions: int) -> tuple[FloatArray, LongArray]:
    """Vertices and triangles of a capsule along z whose half spheres' centres are `length` apart.

    It lies about the origin.
    """
    edge = (2.0 * radius + length) / divisions
    rings = int(np.clip(np.ceil(0.5 * np.pi * radius / edge), 4, divisions + 4))
    rows = int(np.clip(np.ceil(length / edge), 1, divisions))
    angle = 0.5 * np.pi * np.arange(rings) / rings
    r = radius * np.concatenate([np.sin(angle), np.ones(rows + 1), np.sin(angle)[::-1]])
    side = length * (np.arange(rows + 1) / rows - 0.5)
    below = side[0] - radius * np.cos(angle)
    return _turned(r, np.concatenate([below, side, -below[::-1]]))


def sphere(radius: float) -> tuple[FloatArray, LongArray]:
    """Vertices and triangles of a sphere about the origin."""
    vertices, triangles = _sphere()
    return radius * vertices, triangles


@lru_cache(maxsize=1)
def _sphere() -> tuple[FloatArray, LongArray]:
    import trimesh  # takes most of a second, which URDFs without spheres need not wait

    ball = trimesh.creation.icosphere(subdivisions=2)
    return np.array(ball.vertices), np.array(ball.faces, np.int64)


@lru_cache(maxsize=MOST_DIVISIONS**3)
def _box(nx: int, ny: int, nz: int) -> tuple[LongArray, LongArray]:
    """Lattice points on the surface of a box of nx by ny by nz cells, and outward triangles."""
    counts = np.array([nx, ny, nz])
    corners = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        cell = np.stack(np.meshgrid(np.arange(counts[u]), np.arange(counts[v])), -1).reshape(-1, 2)
        for top in (False, True):
            quad = np.zeros((len(cell), 4, 3), np.int64)
            quad[:, :, axis] = counts[axis] if top else 0
            quad[:, :, u] = cell[:, :1] + [0, 1, 1, 0]
            quad[:, :, v] = cell[:, 1:] + [0, 0, 1, 1]
            corners.append(quad if top else quad[:, ::-1])
    quads = np.concatenate(corners)
    number = (quads[..., 0] * (ny + 1) + quads[..., 1]) * (nz + 1) + quads[..., 2]
    _, first, q = np.unique(number, return_index=True, return_inverse=True)
    q = q.reshape(-1, 4)
    triangles = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])
    return quads.reshape(-1, 3)[first], triangles


def _turned(r: FloatArray, z: FloatArray) -> tuple[FloatArray, LongArray]:
    """The surface that a line of points (r, z), upwards from the axis to the axis, sweeps."""
    inner = len(r) - 2
    angle = 2.0 * np.pi * np.arange(_SEGMENTS) / _SEGMENTS
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.zeros((inner * _SEGMENTS + 2, 3))
    vertices[1:-1, :2] = (r[1:-1, None, None] * ring).reshape(-1, 2)
    vertices[1:-1, 2] = np.repeat(z[1:-1], _SEGMENTS)
    vertices[0, 2], vertices[-1, 2] = z[0], z[-1]
    return vertices, _turned_triangles(inner)


@lru_cache(maxsize=64)
def _turned_triangles(inner: int) -> LongArray:
    """Outward triangles between the rings of `_turned`."""
    here = np.arange(_SEGMENTS)
    after = (here + 1) % _SEGMENTS
    top = inner * _SEGMENTS + 1
    low = 1 + _SEGMENTS * np.arange(inner - 1)[:, None]
    a, b = (low + here).ravel(), (low + after).ravel()
    c, d = b + _SEGMENTS, a + _SEGMENTS
    last = 1 + (inner - 1) * _SEGMENTS
    return np.concatenate(
        [
            np.stack([np.zeros_like(here), 1 + after, 1 + here], axis=1),
            np.stack([a, b, c], axis=1),
            np.stack([a, c, d], axis=1),
            np.stack([last + here, last + after, np.full_like(here, top)], axis=1),
        ]
    )
