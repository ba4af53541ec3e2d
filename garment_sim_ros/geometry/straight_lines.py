"""Lengths of straight lines over a mesh, through strips of triangles laid out flat.

What is seen from a vertex, through the edges opposite to it and through those behind them, is laid
out in the plane as it comes: a vertex in sight is as far away as its image there. On a surface
that can be laid flat these are the shortest ways, except around holes; those are left to
`geodesics`. The windows are those of Mitchell, Mount & Papadimitriou 1987, without new sources.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.jit import exact_kernel

_ROUNDING = 1e-9
"""How far beside a window, over the length of its edge, a vertex may seem to be by rounding."""
_MOST_WINDOWS = 100_000
"""Windows from one source; a mesh of needles could have any number."""
_DEEPEST = 512
"""Windows that wait."""


class StraightLines:
    """Straight lines between the vertices of one mesh."""

    def __init__(self, vertices: FloatArray, triangles: IntArray) -> None:
        """Prepares a mesh: vertices [m], shape [v, 3]; triangles, shape [t, 3]."""
        self._vertices = np.ascontiguousarray(vertices, np.float64)
        self._triangles = np.ascontiguousarray(triangles, np.int32)
        self._across = _across(self._triangles)
        order = np.argsort(self._triangles.ravel(), kind="stable")
        self._corners = order.astype(np.int32)
        self._start = np.searchsorted(
            self._triangles.ravel()[order], np.arange(len(vertices) + 1)
        ).astype(np.int32)

    def shorten(self, source: int, limit: float, distance: FloatArray) -> None:
        """Replaces distances from a vertex by those along straight lines, where shorter.

        Args:
            source: The vertex.
            limit: How far to look [m].
            distance: Distances from it, changed in place [m], shape [v].
        """
        corners = self._corners[self._start[source] : self._start[source + 1]]
        _look(self._vertices, self._triangles, self._across, corners, limit, distance)


def _across(triangles: IntArray) -> IntArray:
    """The corner, as 3 t + k, across the edge opposite to each corner; -1 at a border, [3 t]."""
    a = np.stack([triangles[:, 1], triangles[:, 2], triangles[:, 0]], axis=1).ravel()
    b = np.stack([triangles[:, 2], triangles[:, 0], triangles[:, 1]], axis=1).ravel()
    low, high = np.minimum(a, b), np.maximum(a, b)
    order = np.lexsort((high, low))
    same = np.flatnonzero((np.diff(low[order]) == 0) & (np.diff(high[order]) == 0))
    across = np.full(len(a), -1, np.int32)
    across[order[same]] = order[same + 1]
    across[order[same + 1]] = order[same]
    return across


@exact_kernel()
def _look(vertices, triangles, across, corners, limit, distance):
    """Windows from the vertex at `corners`, depth first, each in an edge from a to b.

    The vertex is the origin of the plane, a on the right, b on the left; the window is between the
    directions r and l.
    """
    place = np.empty((_DEEPEST, 8))
    edge = np.empty((_DEEPEST, 3), np.int32)  # the corner beyond, a, b
    count = 0
    for first in corners:
        t, k = first // 3, first % 3
        s, a, b = triangles[t, k], triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]
        ax = np.sqrt(_squared(vertices, s, a))
        bx, by = _third(_squared(vertices, s, b), _squared(vertices, a, b), ax)
        distance[a] = min(distance[a], ax)
        distance[b] = min(distance[b], np.sqrt(bx * bx + by * by))
        place[0] = (ax, 0.0, bx, by, ax, 0.0, bx, by)
        edge[0] = (across[first], a, b)
        size = 1
        while size > 0 and count < _MOST_WINDOWS:
            size -= 1
            count += 1
            if edge[size, 0] < 0:
                continue
            ax, ay, bx, by, rx, ry, lx, ly = place[size]
            beyond, a, b = edge[size]
            n, m = beyond // 3, beyond % 3
            c = triangles[n, m]
            ex, ey = bx - ax, by - ay
            length = max(np.sqrt(ex * ex + ey * ey), 1e-30)
            u, v = _third(_squared(vertices, a, c), _squared(vertices, b, c), length)
            cx = ax + (u * ex + v * ey) / length
            cy = ay + (u * ey - v * ex) / length
            right, left = rx * cy - ry * cx, cx * ly - cy * lx
            way = np.sqrt(cx * cx + cy * cy)
            # A line through a vertex is just in sight.
            close = -_ROUNDING * length * length
            if right >= close and left >= close and way < distance[c]:
                distance[c] = way
            at_a = (m + 1) % 3 if triangles[n, (m + 1) % 3] == a else (m + 2) % 3
            at_b = 3 - m - at_a
            if size + 2 > _DEEPEST:
                continue
            if right > close and _near(ax, ay, cx, cy) < limit:
                if left > 0.0:
                    place[size] = (ax, ay, cx, cy, rx, ry, cx, cy)
                else:
                    place[size] = (ax, ay, cx, cy, rx, ry, lx, ly)
                edge[size] = (across[3 * n + at_b], a, c)
                size += 1
            if left > close and _near(cx, cy, bx, by) < limit:
                if right > 0.0:
                    place[size] = (cx, cy, bx, by, cx, cy, lx, ly)
                else:
                    place[size] = (cx, cy, bx, by, rx, ry, lx, ly)
                edge[size] = (across[3 * n + at_a], c, b)
                size += 1


@exact_kernel(inner=True)
def _squared(vertices, i, j):
    """Squared distance of two vertices."""
    x = vertices[i, 0] - vertices[j, 0]
    y = vertices[i, 1] - vertices[j, 1]
    z = vertices[i, 2] - vertices[j, 2]
    return x * x + y * y + z * z


@exact_kernel(inner=True)
def _third(from_start, from_end, length):
    """Along and away from a line, where a point lies of known squared distances from its ends."""
    along = (from_start - from_end + length * length) / (2.0 * max(length, 1e-30))
    return along, np.sqrt(max(from_start - along * along, 0.0))


@exact_kernel(inner=True)
def _near(ax, ay, bx, by):
    """How near a segment comes to the origin."""
    ex, ey = bx - ax, by - ay
    share = -(ax * ex + ay * ey) / max(ex * ex + ey * ey, 1e-30)
    share = min(1.0, max(0.0, share))
    x, y = ax + share * ex, ay + share * ey
    return np.sqrt(x * x + y * y)
