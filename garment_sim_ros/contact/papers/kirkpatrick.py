"""Which triangle of a planar triangulation holds a point: Kirkpatrick's hierarchy.

Kirkpatrick 1983, "Optimal search in planar subdivisions". The triangulation is set into one large
triangle. Then vertices of low degree, no two of them neighbours, are taken out and their holes
triangulated anew, again and again until only the large triangle is left. Each new triangle knows
the ones it covers in the finer level; a query goes down through one triangle per level.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.jit import exact_kernel

_DEGREE = 8
"""Largest degree of a vertex that is taken out; a planar graph always has enough of them."""
_ROUNDING = 1e-13
"""Rounding of an area, as a share of the squared size."""


class Hierarchy(NamedTuple):
    """Triangles of all levels, the large one last.

    Attributes:
        corner: Corners, counter-clockwise, shape [n, 3, 2].
        label: Index of the triangle in the input, -1 outside it, -2 if it is not of the finest
            level, shape [n].
        start: Where each triangle's finer ones start in `finer`, shape [n + 1].
        finer: Indices of triangles.
        tolerance: Twice the area by which a point may be outside a triangle that holds it.
        root: The large one.
    """

    corner: FloatArray
    label: IntArray
    start: IntArray
    finer: IntArray
    tolerance: float
    root: int


def hierarchy(points: FloatArray, triangles: IntArray) -> Hierarchy:
    """Build the search structure.

    Args:
        points: Vertices, shape [n, 2].
        triangles: Counter-clockwise triangles that fill a convex polygon, shape [t, 3].
    """
    size = float(np.ptp(points, axis=0).max())
    centre = points.mean(axis=0)
    large = centre + 20.0 * size * np.array([[-1.0, -1.0], [2.0, -1.0], [-1.0, 2.0]])
    x = np.vstack([points, large])
    n = len(points)
    corners = [tuple(int(v) for v in t) for t in triangles]
    labels = list(range(len(corners)))
    around = _surround(x, n, corners)
    corners += around
    labels += [-1] * len(around)
    finer: list[list[int]] = [[] for _ in corners]
    alive = set(range(len(corners)))
    inner = {int(v) for t in triangles for v in t}
    while inner:
        faces_of: dict[int, list[int]] = {}
        for t in alive:
            for v in corners[t]:
                faces_of.setdefault(v, []).append(t)
        blocked: set[int] = set()
        removed: list[int] = []
        for v in sorted(inner, key=lambda v: len(faces_of[v])):
            if v in blocked or (len(faces_of[v]) > _DEGREE and removed):
                continue
            removed.append(v)
            blocked.update(w for t in faces_of[v] for w in corners[t])
        for v in removed:
            star = faces_of[v]
            for triangle in _fill_hole(x, _outline(v, [corners[t] for t in star])):
                corners.append(triangle)
                labels.append(-2)
                finer.append([t for t in star if _overlap(x[[*triangle]], x[[*corners[t]]])])
                alive.add(len(corners) - 1)
            alive.difference_update(star)
            inner.remove(v)
    start = np.cumsum([0, *(len(f) for f in finer)])
    return Hierarchy(
        corner=np.ascontiguousarray(x[np.array(corners)]),
        label=np.array(labels, np.int32),
        start=start.astype(np.int32),
        finer=np.array([t for f in finer for t in f], np.int32),
        tolerance=_ROUNDING * size * size,
        root=len(corners) - 1,
    )


def _surround(x: FloatArray, n: int, corners: list[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Triangles between the polygon that `corners` fill and the large triangle n, n + 1, n + 2."""
    directed = {(t[k], t[(k + 1) % 3]) for t in corners for k in range(3)}
    following = {a: b for a, b in directed if (b, a) not in directed}
    first = next(iter(following))
    rim = [first]
    while following[rim[-1]] != first:
        rim.append(following[rim[-1]])
    made: list[tuple[int, ...]] = []
    farthest = []
    for a, b in zip(rim, [*rim[1:], rim[0]]):
        edge = x[b] - x[a]
        outwards = np.array([edge[1], -edge[0]])
        farthest.append(n + int(np.argmax(x[n:] @ outwards)))
        made.append((b, a, farthest[-1]))
    for k, vertex in enumerate(rim):  # where the corner of the large triangle that is seen changes
        last, now = farthest[k - 1], farthest[k]
        while last != now:
            after = n + (last - n + 1) % 3
            made.append((vertex, last, after))
            last = after
    return made


def _outline(v: int, star: list[tuple[int, ...]]) -> list[int]:
    """The polygon around v, counter-clockwise."""
    following = {}
    for t in star:
        k = t.index(v)
        following[t[(k + 1) % 3]] = t[(k + 2) % 3]
    loop = [next(iter(following))]
    while len(loop) < len(star):
        loop.append(following[loop[-1]])
    return loop


def _area(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _fill_hole(x: FloatArray, loop: list[int]) -> list[tuple[int, ...]]:
    """Triangles that fill a simple polygon, the fattest ear first."""
    loop = list(loop)
    made = []
    while len(loop) > 3:
        best, chosen = -np.inf, 0
        for k in range(len(loop)):
            a, b, c = loop[k - 1], loop[k], loop[(k + 1) % len(loop)]
            area = _area(x[a], x[b], x[c])
            longest = max(float(np.linalg.norm(x[p] - x[q])) for p, q in ((a, b), (b, c), (c, a)))
            others = (w for w in loop if w not in (a, b, c))
            if area <= 0.0 or any(_holds(x[[a, b, c]], x[w]) for w in others):
                continue
            if area / longest**2 > best:
                best, chosen = area / longest**2, k
        made.append((loop[chosen - 1], loop[chosen], loop[(chosen + 1) % len(loop)]))
        del loop[chosen]
    return [*made, tuple(loop)]


def _holds(triangle: FloatArray, point: FloatArray) -> bool:
    return all(_area(triangle[k], triangle[(k + 1) % 3], point) >= 0.0 for k in range(3))


def _overlap(a: FloatArray, b: FloatArray) -> bool:
    """Whether two counter-clockwise triangles share more than an edge; yes in case of doubt."""
    scale = 1e-12 * float(np.ptp(np.vstack([a, b]), axis=0).max()) ** 2
    for p, q in ((a, b), (b, a)):
        for k in range(3):
            if all(_area(p[k], p[(k + 1) % 3], v) <= -scale for v in q):
                return False
    return True


@exact_kernel()
def locate(tree, px, py):
    """Label of the triangle that holds a point, -1 outside the polygon."""
    t = np.int64(tree.root)
    while tree.label[t] == -2:
        best = -np.inf
        found = t
        for k in range(tree.start[t], tree.start[t + 1]):
            f = tree.finer[k]
            inside = _least_edge(tree.corner[f], px, py)
            if inside > best:
                best = inside
                found = f
                if inside >= 0.0:
                    break
        t = found
    return tree.label[t] if _least_edge(tree.corner[t], px, py) >= -tree.tolerance else -1


@exact_kernel(inner=True)
def _least_edge(corner, px, py):
    """Smallest of the three areas between a point and the edges; negative outside."""
    least = np.inf
    for k in range(3):
        a = corner[k]
        b = corner[(k + 1) % 3]
        area = (b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])
        least = min(least, area)
    return least
