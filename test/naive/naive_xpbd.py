"""The kernels of `xpbd` again, in float64 and one constraint at a time, for tests to compare."""

import dataclasses

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


@dataclasses.dataclass(frozen=True)
class Strained:
    """Edges that may be too long, and what holds their ends.

    Attributes:
        edges: Ends, shape [e, 2].
        rest_length: Lengths at rest [m], shape [e].
        inverse_mass: Of particles [1/kg], shape [n].
        normal: Outward normals of surfaces that particles touch, NaN where none, shape [n, 3].
        pressed: Which are pressed from two sides, shape [n].
        caught: Which of these are deep between them, shape [n].
        kept: Which the guard keeps, shape [n].
        free: How many are not pinned: the first ones.
        longest: Strain that no single edge is left with, if no way to it leads into surfaces.
        utmost: Strain that it is not left with then, either.
    """

    edges: IntArray
    rest_length: FloatArray
    inverse_mass: FloatArray
    normal: FloatArray
    pressed: NDArray[np.bool_]
    caught: NDArray[np.bool_]
    kept: NDArray[np.bool_]
    free: int
    longest: float
    utmost: float

    def length(self, x: FloatArray) -> FloatArray:
        """Of each edge [m], shape [e]."""
        return np.linalg.norm(x[self.edges[:, 0]] - x[self.edges[:, 1]], axis=1)

    def are_single(self, x: FloatArray) -> bool:
        """Whether up to 1 % of the edges are too long."""
        return bool(np.mean(self.length(x) > (1.0 + self.longest) * self.rest_length) <= 0.01)

    def draw(self, x: FloatArray, e: int, to: float, weights: list[float], yields: bool) -> None:
        """Draws the ends of edge e to a length, by weights, along surfaces that do not yield."""
        if not sum(weights) > 0.0:
            return
        i, j = self.edges[e]
        apart = x[i] - x[j]
        pull = (1.0 - to / float(np.linalg.norm(apart))) * apart / sum(weights)
        for p, way in ((i, -weights[0] * pull), (j, weights[1] * pull)):
            into = float(way @ self.normal[p])
            stays_out = into < 0.0 and not (yields and self.pressed[p])
            x[p] += way - into * self.normal[p] if stays_out else way


def limit_strain(
    x: FloatArray,
    x_before: FloatArray,
    strained: Strained,
    limit: float,
    grown: NDArray[np.float64],
) -> FloatArray:
    """Positions [n, 3] after passes over edges that are too long, and have grown by a share, [e].

    Edges at pins are left alone, and those at particles that the guard keeps, unless they are
    among few that are longer than `longest`.
    """
    x = np.array(x, dtype=np.float64)
    longest = strained.longest if strained.are_single(x) else np.inf
    for _ in range(10):
        for e, (i, j) in enumerate(strained.edges):
            rest = strained.rest_length[e]
            length = float(np.linalg.norm(x[i] - x[j]))
            before = float(np.linalg.norm(np.float64(x_before[i]) - x_before[j]))
            to = min(max((1.0 + limit) * rest, (1.0 + grown[e]) * before), (1.0 + longest) * rest)
            yields = length > (1.0 + longest) * rest
            kept = strained.kept[i], strained.kept[j]
            if length <= to or max(i, j) >= strained.free or all(kept):
                continue
            if yields or not any(kept):
                weights = [
                    0.0 if kept[k] or strained.caught[p] else strained.inverse_mass[p]
                    for k, p in ((0, i), (1, j))
                ]
                strained.draw(x, e, to, weights, yields)
    return x


def shorten_longest(x: FloatArray, strained: Strained) -> FloatArray:
    """Positions [n, 3] after passes over edges that are longer than `longest`, if they are few.

    The guard yields, and shapes that press a particle from two sides, unless it is caught between
    them; in the last ten passes, over edges whose ends both touch and that are still longer than
    `utmost`, all do. Of edges at pins those are left alone whose other end is in the air.
    """
    x = np.array(x, dtype=np.float64)
    yielding = dataclasses.replace(strained, pressed=strained.pressed | strained.kept)
    if not strained.are_single(x):
        return x
    longest = strained.longest
    for n in range(40):
        if n == 30:
            yielding = dataclasses.replace(yielding, pressed=np.ones_like(strained.pressed))
            longest = strained.utmost
        for e, (i, j) in enumerate(strained.edges):
            to = (1.0 + longest) * strained.rest_length[e]
            touch = [p < strained.free and not np.isnan(strained.normal[p]).any() for p in (i, j)]
            at_pin = max(i, j) >= strained.free
            moves = any(touch) or not at_pin if n < 30 else all(touch)
            if np.linalg.norm(x[i] - x[j]) > to and moves:
                weights = [
                    0.0 if n < 30 and strained.caught[p] else strained.inverse_mass[p]
                    for p in (i, j)
                ]
                yielding.draw(x, e, to, weights, True)
    return x
