"""The kernels of `xpbd` again, in float64 and one constraint at a time, for tests to compare."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

BENT = 0.002


def excess(length: float, rest: float, has_roots: bool) -> float:
    """How much longer an edge is than at rest, or what `kernels.edges` has for that [m]."""
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


def pull_links(
    x: FloatArray,
    free: int,
    cell: IntArray,
    mass: FloatArray,
    links: IntArray,
    length: FloatArray,
    give: FloatArray,
) -> FloatArray:
    """Positions [n, 3] after one pass over links [m, 2] between cells of particles.

    A link joins the centres of mass of two cells; each gives way by `give` [m, 2] for each metre
    that it is too long, and the cell's free particles, the first ones, with it. If it is too short
    it pushes the less, the more it is, and not at all from a part `BENT` on.
    """
    x = np.array(x, dtype=np.float64)
    cells = range(int(cell.max()) + 1)
    centre = np.array([np.average(x[cell == c], axis=0, weights=mass[cell == c]) for c in cells])
    start = centre.copy()
    for (a, b), rest, (give_a, give_b) in zip(links, length, give):
        apart = centre[a] - centre[b]
        distance = float(np.linalg.norm(apart))
        over = distance - rest
        if over < 0.0:
            over *= max(0.0, 1.0 + over / distance / BENT)
        centre[a] -= give_a * over * apart / distance
        centre[b] += give_b * over * apart / distance
    x[:free] += (centre - start)[cell[:free]]
    return x
