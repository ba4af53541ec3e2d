"""Iso-surface of a field on a grid by marching tetrahedra; the result is always manifold.

After: Doi and Koide, "An efficient method of triangulating equi-valued surfaces by using
tetrahedral cells", 1991.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.jit import exact_kernel

# The six tetrahedra of a cube around its main diagonal, as corner numbers 4 i + 2 j + k.
_TETRAHEDRA = np.array(
    [[0, 4, 6, 7], [0, 6, 2, 7], [0, 2, 3, 7], [0, 3, 1, 7], [0, 1, 5, 7], [0, 5, 4, 7]]
)


def marching_tetrahedra(
    field: FloatArray, origin: FloatArray, spacing: float
) -> tuple[FloatArray, IntArray]:
    """Vertices and outward triangles where a field changes sign.

    Args:
        field: Values at the grid's nodes, negative inside, shape [nx, ny, nz].
        origin: Position of node (0, 0, 0), shape [3].
        spacing: Distance of the nodes.

    Returns:
        Vertices [v, 3] and triangles [t, 3]. The surface is open only where it leaves the grid,
        and there its border lies in the grid's faces.
    """
    inside = field < 0.0
    corners = [inside[i:, j:, k:] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    nx, ny, nz = (n - 1 for n in field.shape)
    count = sum(c[:nx, :ny, :nz].astype(np.int8) for c in corners)
    cubes = np.argwhere((count > 0) & (count < 8)).astype(np.int32)
    # A cube and its diagonals have 19 edges; its 6 tetrahedra give up to 2 triangles each.
    x = np.empty((19 * len(cubes), 3))
    triangles = np.empty((12 * len(cubes), 3), dtype=np.int32)
    edge_vertex = np.full((*field.shape, 8), -1, dtype=np.int32)
    nv, nt = _march(field, cubes, edge_vertex, x, triangles)
    return origin + spacing * x[:nv], triangles[:nt].copy()


@exact_kernel()
def _march(field, cubes, edge_vertex, x, triangles):
    """Fills vertices (in grid steps) and triangles; returns how many there are."""
    nv = 0
    nt = 0
    corner = np.empty(8)
    ring = np.empty(4, dtype=np.int32)
    inside = np.empty(4, dtype=np.int32)
    outside = np.empty(4, dtype=np.int32)
    for cube in range(cubes.shape[0]):
        i, j, k = cubes[cube, 0], cubes[cube, 1], cubes[cube, 2]
        for c in range(8):
            corner[c] = field[i + (c >> 2), j + ((c >> 1) & 1), k + (c & 1)]
        for tet in range(6):
            a = 0
            b = 0
            for m in range(4):
                c = _TETRAHEDRA[tet, m]
                if corner[c] < 0.0:
                    inside[a] = c
                    a += 1
                else:
                    outside[b] = c
                    b += 1
            if a == 0 or b == 0:
                continue
            # Crossed edges in cyclic order: a triangle, or a quadrilateral for 2 and 2.
            corners = a * b
            for e in range(corners):
                if corners == 3:
                    p = inside[e % a]
                    q = outside[e % b]
                else:
                    p = inside[e >> 1]
                    q = outside[(e >> 1) ^ (e & 1)]
                low, high = min(p, q), max(p, q)
                bits = high ^ low
                gi, gj, gk = i + (low >> 2), j + ((low >> 1) & 1), k + (low & 1)
                v = edge_vertex[gi, gj, gk, bits]
                if v < 0:
                    v = nv
                    nv += 1
                    edge_vertex[gi, gj, gk, bits] = v
                    s = corner[low] / (corner[low] - corner[high])
                    s = min(max(s, 0.02), 0.98)
                    x[v, 0] = gi + s * (bits >> 2)
                    x[v, 1] = gj + s * ((bits >> 1) & 1)
                    x[v, 2] = gk + s * (bits & 1)
                ring[e] = v
            # Outward is from the inner corners to the outer ones.
            ox = oy = oz = 0.0
            for m in range(a):
                c = inside[m]
                ox -= (c >> 2) / a
                oy -= ((c >> 1) & 1) / a
                oz -= (c & 1) / a
            for m in range(b):
                c = outside[m]
                ox += (c >> 2) / b
                oy += ((c >> 1) & 1) / b
                oz += (c & 1) / b
            n = normal_of(x, ring[0], ring[1], ring[2])
            turned = n[0] * ox + n[1] * oy + n[2] * oz < 0.0
            for m in range(corners - 2):
                triangles[nt, 0] = ring[0]
                triangles[nt, 1] = ring[m + 2] if turned else ring[m + 1]
                triangles[nt, 2] = ring[m + 1] if turned else ring[m + 2]
                nt += 1
    return nv, nt


@exact_kernel(inner=True)
def normal_of(x, a, b, c):
    """Normal of the triangle a, b, c of vertices x, as long as twice its area."""
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
