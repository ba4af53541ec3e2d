"""The kernels of `xpbd` again, in float64 and one constraint at a time, for tests to compare."""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray

BENT = 0.002


def excess(length: float, rest: float, has_roots: bool) -> float:
    """How much longer an edge is than at rest, or what `solvers.xpbd.edges` has for that [m]."""
    if has_roots:
        return length - rest
    return 2.0 * (length**2 - rest**2) / (rest**2 + 3.0 * length**2) * length


def solve_edges(
    x: FloatArray,
    edges: IntArray,
    rest_length: FloatArray,
    stiffness: FloatArray,
    inverse_mass: FloatArray,
    dt: float,
    iterations: int,
    has_roots: bool = True,
) -> FloatArray:
    """Positions [n, 3] after passes over edges [m, 2]: Macklin et al. 2016, equations 17 and 18.

    With the distance itself, or with the quotient near it that the kernel has.
    """
    x = np.array(x, dtype=np.float64)
    multiplier = np.zeros(len(edges))
    for _ in range(iterations):
        for e, (i, j) in enumerate(edges):
            apart = x[i] - x[j]
            length = float(np.linalg.norm(apart))
            over = excess(length, rest_length[e], has_roots)
            compliance = 1.0 / (stiffness[e] * dt**2)
            total = inverse_mass[i] + inverse_mass[j] + compliance
            change = -(over + compliance * multiplier[e]) / total
            multiplier[e] += change
            x[i] += inverse_mass[i] * change * apart / length
            x[j] -= inverse_mass[j] * change * apart / length
    return x


def bend(
    x: FloatArray,
    v: FloatArray,
    hinges: IntArray,
    weight: FloatArray,
    stiffness: FloatArray,
    inverse_mass: FloatArray,
    dt: float,
) -> FloatArray:
    """Velocities [n, 3] after one pass over hinges [h, 4] with the given weights [h, 4]."""
    v = np.array(v, dtype=np.float64)
    for particles, w, k in zip(hinges, weight, stiffness):
        curvature = w @ (x[particles] + dt * v[particles])
        total = float(inverse_mass[particles] @ w**2) + 1.0 / (k * dt**2)
        for p, share in zip(particles, w):
            v[p] -= inverse_mass[p] * share * curvature / total / dt
    return v


def pull_cells(
    x: FloatArray,
    free: int,
    cell: IntArray,
    mass: FloatArray,
    corners: IntArray,
    strains: FloatArray,
    sides: FloatArray,
) -> FloatArray:
    """Positions [n, 3] after one pass over triangles [t, 3] between cells of particles.

    Along warp and weft a metre of cloth is laid from a triangle's first corner, so much along one
    side and so much along the other; what it is too long by moves corners, as `strains` [t, 2, 5]
    say, and the free particles of those cells, the first ones, with them. If it is too short it
    pushes the less, the more it is, and not at all from a part `BENT` on. The less, too, the
    shorter its longest side is for one laid flat; `sides` [t, 3] are one over their squares.
    """
    x = np.array(x, dtype=np.float64)
    cells = range(int(cell.max()) + 1)
    centre = np.array([np.average(x[cell == c], axis=0, weights=mass[cell == c]) for c in cells])
    start = centre.copy()
    for triangle, both, flat in zip(corners, strains, sides):
        a, b, c = centre[triangle]
        longest = max([np.sum((a - b) ** 2), np.sum((a - c) ** 2), np.sum((b - c) ** 2)] * flat)
        taut = min(1.0, max(0.0, 1.0 + (longest - 1.0) / (2.0 * BENT)))
        for u, v, *give in both:
            a, b, c = centre[triangle]
            metre = u * (b - a) + v * (c - a)
            length = float(np.linalg.norm(metre))
            over = taut * (length - 1.0)
            if over < 0.0:
                over *= max(0.0, 1.0 + over / length / BENT)
            centre[triangle] -= np.outer(give, over * metre / length)
    x[:free] += (centre - start)[cell[:free]]
    return x


def limit_strain(
    x: FloatArray,
    x_before: FloatArray,
    edges: IntArray,
    rest_length: FloatArray,
    inverse_mass: FloatArray,
    normal: FloatArray,
    stays: NDArray[np.bool_],
    limit: float,
    grown: NDArray[np.float64],
) -> FloatArray:
    """Positions [n, 3] after passes over edges that are too long, and have grown by a share, [e].

    Particles touch a surface with the given outward normals, NaN where they touch none, [n, 3].
    Those that stay, [n], and all edges at them are left alone.
    """
    x = np.array(x, dtype=np.float64)
    for _ in range(10):
        for e, (i, j) in enumerate(edges):
            apart = x[i] - x[j]
            before = float(np.linalg.norm(np.float64(x_before[i]) - x_before[j]))
            longest = max((1.0 + limit) * rest_length[e], (1.0 + grown[e]) * before)
            over = float(np.linalg.norm(apart)) - longest
            total = inverse_mass[i] + inverse_mass[j]
            if over <= 0.0 or stays[i] or stays[j]:
                continue
            pull = over * apart / float(np.linalg.norm(apart)) / total
            for p, way in ((i, -inverse_mass[i] * pull), (j, inverse_mass[j] * pull)):
                into = float(way @ normal[p])
                x[p] += way - into * normal[p] if into < 0.0 else way
    return x
