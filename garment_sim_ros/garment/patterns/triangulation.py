"""Triangles of even size in a flat panel, with the vertices of its outline as they are given.

Points are thrown in at random with a seed, as many as triangles of the wanted size have, and push
each other apart like the bars of Persson & Strang 2004 ("A simple mesh generator in MATLAB"): an
even pattern without a direction of its own. The triangulation is Delaunay's, constrained to the
outline by flips of edges (Sloan 1993, "A fast algorithm for generating constrained Delaunay
triangulations"). Vertices inside that still have narrow triangles move to where the smallest angle
about them is the largest (Freitag & Ollivier-Gooch 1997, "Tetrahedral mesh improvement using
swapping and smoothing", in the plane).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError

SMALLEST_ANGLE = 25.0
"""Smallest angle inside of a panel [degrees]; narrower corners of its outline stay."""
_ROUNDS = 60
_PUSH = 1.15
"""Length that bars push to, in wanted lengths: a little pressure fills gaps."""
_STEP = 0.2
_OFF = 0.55
"""Distance that points keep from the outline, in wanted lengths."""
_GOOD = 32.0
"""Angle [degrees] from which on triangles are left alone."""
_STRAIGHT = 1e-8
"""Doubled area over squared edge below which a triangle has no shape."""
_SEARCH_ROUNDS = 12
_TRIES = 5


def triangulate(
    outline: FloatArray, edge_length: float, *, seed: int = 1
) -> tuple[FloatArray, IntArray]:
    """Triangles in a polygon.

    Args:
        outline: Its corners, counter-clockwise, which become the first vertices [m], shape [b, 2].
        edge_length: Wanted length of edges [m].
        seed: Of the random points.

    Returns:
        Vertices [m], shape [v, 2], and triangles, counter-clockwise, shape [t, 3].

    Raises:
        GeometryError: The outline crosses itself or has no area.
    """
    best: tuple[float, FloatArray, IntArray] | None = None
    for attempt in range(_TRIES):
        rng = np.random.default_rng([seed, attempt])
        inside = _relaxed(outline, _thrown(outline, edge_length, rng), edge_length)
        x = np.concatenate([outline, inside])
        triangles = constrained(x, len(outline))
        x, triangles = _improved(x, triangles, len(outline))
        worst = float(inner_angles(x, triangles, len(outline)).min(initial=180.0))
        if best is None or worst > best[0]:
            best = worst, x, triangles
        if worst >= SMALLEST_ANGLE:
            break
    assert best is not None
    return best[1], best[2]


def angles(x: FloatArray, triangles: IntArray) -> FloatArray:
    """Angles at the corners of triangles [degrees], shape [t, 3]."""
    result = np.empty(triangles.shape)
    for k in range(3):
        p, a, b = (x[triangles[:, (k + i) % 3]] for i in range(3))
        u, v = a - p, b - p
        cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        result[:, k] = np.degrees(np.arctan2(cross, (u * v).sum(axis=1)))
    return result


def inner_angles(x: FloatArray, triangles: IntArray, outer: int) -> FloatArray:
    """Smallest angle of each triangle that the outline leaves any choice [degrees], shape [n].

    Without those that the outline alone makes: all corners on it, or two edges of it.
    """
    on = triangles < outer
    return angles(x, triangles)[~on.all(axis=1)].min(axis=1)


def _within(points: FloatArray, polygon: FloatArray) -> NDArray[np.bool_]:
    """Whether points are inside of a polygon (even-odd rule)."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    y = points[:, 1, None]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    cut = a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return (spans & (points[:, 0, None] < cut)).sum(axis=1) % 2 == 1


def _to_outline(points: FloatArray, polygon: FloatArray) -> FloatArray:
    """Vectors from points to the nearest place on a polygon, shape [n, 2]."""
    (ax, ay), (dx, dy) = polygon.T, (np.roll(polygon, -1, axis=0) - polygon).T
    rx, ry = points[:, :1] - ax, points[:, 1:] - ay
    t = np.clip((rx * dx + ry * dy) / np.maximum(dx * dx + dy * dy, 1e-300), 0.0, 1.0)
    x, y = t * dx - rx, t * dy - ry
    nearest = np.arange(len(points)), (x * x + y * y).argmin(axis=1)
    return np.stack([x[nearest], y[nearest]], axis=1)


def _kept(points: FloatArray, polygon: FloatArray, off: float) -> FloatArray:
    """Those points that are inside, moved away from the outline where they are too near to it."""
    points = points[_within(points, polygon)]
    longest = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).max()
    corner = cKDTree(polygon).query(points)[0]
    near = np.flatnonzero(corner < off + 0.5 * longest)  # no other is within `off` of the outline
    for _ in range(2):
        way = _to_outline(points[near], polygon)
        apart = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
        points[near] -= np.where(apart < off, way / apart * (off - apart), 0.0)
    apart = np.linalg.norm(_to_outline(points[near], polygon), axis=1)
    inside = _within(points, polygon)
    inside[near] &= apart > 0.8 * off
    return points[inside]


def _thrown(outline: FloatArray, h: float, rng: np.random.Generator) -> FloatArray:
    """Random points, at least 0.7 of the wanted length from each other and from the outline."""
    low, size = outline.min(axis=0), np.ptp(outline, axis=0)
    row = np.sqrt(0.75) * h
    nx, ny = np.ceil(2.0 * size.max() / np.array([h, row])).astype(int) + 2
    i, j = np.meshgrid(np.arange(-nx, nx), np.arange(-ny, ny))
    grid = np.stack([(i + 0.5 * (j % 2)).ravel() * h, j.ravel() * row], axis=1)
    grid += rng.normal(scale=0.2 * h, size=grid.shape)
    a = rng.uniform(0.0, np.pi)
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    points = grid @ turn.T + low + 0.5 * size + rng.uniform(0.0, h, 2)
    near = (np.abs(points - low - 0.5 * size) < 0.5 * size + h).all(axis=1)
    return _kept(points[near], outline, _OFF * h)


def _relaxed(outline: FloatArray, points: FloatArray, h: float) -> FloatArray:
    """Points after they pushed each other apart."""
    outer = len(outline)
    for n in range(_ROUNDS):
        if not len(points):
            return points
        x = np.concatenate([outline, points])
        simplices = _delaunay(x)
        centre = x[simplices].mean(axis=1)
        simplices = simplices[_within(centre, outline)]
        pairs = np.sort(simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        pairs = np.unique(pairs, axis=0)
        way = x[pairs[:, 0]] - x[pairs[:, 1]]
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-12)
        push = np.maximum(_PUSH * h - length, 0.0)[:, None] * way / length[:, None]
        force = np.zeros_like(x)
        np.add.at(force, pairs[:, 0], push)
        np.add.at(force, pairs[:, 1], -push)
        points = _kept(points + _STEP * force[outer:], outline, _OFF * h)
        if n in (10, 25):  # where it is crowded, points go
            points = _thinned(points, 0.65 * h)
    return points


def _thinned(points: FloatArray, least: float) -> FloatArray:
    """Without points that have one before them nearer than `least`."""
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    crowded = np.triu(apart < least, 1).any(axis=0)
    return points[~crowded]


def _delaunay(x: FloatArray) -> IntArray:
    try:
        simplices = Delaunay(x).simplices.astype(np.int32)
    except QhullError:
        raise GeometryError("the outline has no area; allowed: a panel with some") from None
    d1, d2 = x[simplices[:, 1]] - x[simplices[:, 0]], x[simplices[:, 2]] - x[simplices[:, 0]]
    turned = d1[:, 0] * d2[:, 1] < d1[:, 1] * d2[:, 0]
    simplices[turned] = simplices[turned][:, ::-1]
    return simplices


def constrained(x: FloatArray, outer: int) -> IntArray:
    """Triangles inside of an outline, all of whose edges are edges of triangles, shape [t, 3].

    Args:
        x: Vertices, those of the outline first [m], shape [v, 2].
        outer: How many of them are on the outline.

    Raises:
        GeometryError: The outline crosses itself.
    """
    mesh = _Flips(x, _delaunay(x))
    for i in range(outer):
        mesh.insist(i, (i + 1) % outer)
    fixed = {(min(i, (i + 1) % outer), max(i, (i + 1) % outer)) for i in range(outer)}
    mesh.make_delaunay(fixed)
    triangles = mesh.triangles
    # Three vertices of a straight edge are no triangle, whatever rounding makes of them.
    size = ((x[triangles] - x[triangles[:, [1, 2, 0]]]) ** 2).sum(axis=2).max(axis=1)
    triangles = triangles[_doubled_areas(x, triangles) > _STRAIGHT * size]
    return triangles[_within(x[triangles].mean(axis=1), x[:outer])]


class _Flips:
    """Triangles whose edges can be flipped."""

    def __init__(self, x: FloatArray, triangles: IntArray) -> None:
        self.x = x
        self._t = [tuple(map(int, t)) for t in triangles]
        self._of_edge: dict[tuple[int, int], int] = {}
        for n, t in enumerate(self._t):
            self._enter(n, t)

    @property
    def triangles(self) -> IntArray:
        return np.array(self._t, dtype=np.int32)

    def _enter(self, n: int, t: tuple[int, ...]) -> None:
        for k in range(3):
            self._of_edge[t[k], t[(k + 1) % 3]] = n

    def _opposite(self, a: int, b: int) -> int:
        """The third corner of the triangle to the left of a way from a to b; -1: none."""
        n = self._of_edge.get((a, b), -1)
        return -1 if n < 0 else next(c for c in self._t[n] if c not in (a, b))

    def _side(self, a: int, b: int, c: int) -> float:
        p, q, r = self.x[a], self.x[b], self.x[c]
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    def flip(self, a: int, b: int) -> tuple[int, int] | None:
        """Replaces an edge by the other diagonal of its two triangles, where they are convex."""
        c, d = self._opposite(a, b), self._opposite(b, a)
        if c < 0 or d < 0 or self._side(d, b, c) <= 0.0 or self._side(c, a, d) <= 0.0:
            return None
        m, n = self._of_edge.pop((a, b)), self._of_edge.pop((b, a))
        self._t[m], self._t[n] = (c, d, b), (d, c, a)
        self._enter(m, self._t[m])
        self._enter(n, self._t[n])
        return c, d

    def insist(self, a: int, b: int) -> None:
        """Flips edges until there is one from a to b."""
        if (a, b) in self._of_edge or (b, a) in self._of_edge:
            return
        queue = self._crossing(a, b)
        for _ in range(50 * len(queue) + 50):
            if not queue:
                break
            i, j = queue.pop(0)
            made = self.flip(i, j)
            if made is None:
                queue.append((i, j))
                continue
            c, d = made
            ends = {c, d} & {a, b}
            if not ends and self._side(a, b, c) * self._side(a, b, d) < 0.0:
                queue.append((c, d))
        if (a, b) not in self._of_edge and (b, a) not in self._of_edge:
            raise GeometryError("the outline crosses itself; allowed: one that does not")

    def _crossing(self, a: int, b: int) -> list[tuple[int, int]]:
        """Edges that the straight way from a to b crosses."""
        found = []
        for (i, j), _ in self._of_edge.items():
            if i < j or (j, i) not in self._of_edge:
                if {i, j} & {a, b}:
                    continue
                if (
                    self._side(a, b, i) * self._side(a, b, j) < 0.0
                    and self._side(i, j, a) * self._side(i, j, b) < 0.0
                ):
                    found.append((i, j))
        return found

    def make_delaunay(self, fixed: set[tuple[int, int]]) -> None:
        """Flips edges that are not Delaunay's, but for fixed ones."""
        stack = [edge for edge in self._of_edge if edge[0] < edge[1]]
        for _ in range(40 * len(stack) + 40):
            if not stack:
                return
            a, b = stack.pop()
            if (min(a, b), max(a, b)) in fixed:
                continue
            c, d = self._opposite(a, b), self._opposite(b, a)
            if c < 0 or d < 0 or not self._in_circle(a, b, c, d):
                continue
            if self.flip(a, b) is not None:
                stack += [(a, d), (d, b), (b, c), (c, a)]

    def _in_circle(self, a: int, b: int, c: int, d: int) -> bool:
        """Whether d is clearly inside of the circle through a, b and c, counter-clockwise."""
        rows = self.x[[a, b, c]] - self.x[d]
        square = (rows**2).sum(axis=1)
        det = float(np.linalg.det(np.column_stack([rows, square])))
        return det > 1e-10 * float(square.max()) ** 2


def _improved(x: FloatArray, triangles: IntArray, outer: int) -> tuple[FloatArray, IntArray]:
    """Vertices inside moved to where the smallest angle about them is the largest."""
    x = x.copy()
    turns = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    directions = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    for _ in range(_SEARCH_ROUNDS):
        smallest = angles(x, triangles).min(axis=1)
        bad = np.unique(triangles[smallest < _GOOD])
        bad = bad[bad >= outer]
        if not len(bad):
            break
        for v in bad:
            star = triangles[(triangles == v).any(axis=1)]
            size = np.sqrt(np.abs(_doubled_areas(x, star)).mean())
            best, step = angles(x, star).min(), 0.25 * size
            for _ in range(5):
                here, moved = x[v].copy(), False
                for direction in directions:
                    x[v] = here + step * direction
                    value = angles(x, star).min()
                    if value > best + 1e-3:
                        best, kept, moved = value, x[v].copy(), True
                x[v] = kept if moved else here
                step *= 1.0 if moved else 0.5
        triangles = constrained(x, outer)
    return x, triangles


def _doubled_areas(x: FloatArray, triangles: IntArray) -> FloatArray:
    a, b, c = (x[triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
