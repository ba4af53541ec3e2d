"""Geodesic distance over a triangle mesh, and its iso-lines.

Gong et al., "Cloth-body collision detection method based on ellipsoid fitting", 2.1: shortest
paths over the edges (Dijkstra), iso-lines cut on the edges by equation (2). Paths over edges
zigzag and come out several percent too long, differently in different directions; straight lines
across pairs of unfolded triangles (the default) bring that to a few percent.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.jit import exact_kernel


@dataclass(frozen=True)
class MeshGraph:
    """Straight lines between vertices of a mesh, both ways, in compressed rows.

    Attributes:
        start: Where the lines from each vertex begin in `end` and `length`, shape [v + 1].
        end: The vertex at the other end, shape [m].
        length: Lengths [m], shape [m].
    """

    start: IntArray
    end: IntArray
    length: FloatArray

    def distances(
        self, source: int | IntArray, *, limit: float = np.inf
    ) -> tuple[FloatArray, IntArray]:
        """Geodesic distance of every vertex to the nearest of the sources.

        Args:
            source: One vertex, or several.
            limit: Vertices farther away than this [m] are as if there were no way.

        Returns:
            Distances [m], infinite where there is no way, shape [v]; the vertex before each on its
            path, -1 at the sources, shape [v].
        """
        v = len(self.start) - 1
        distance = np.full(v, np.inf)
        before = np.full(v, -1, dtype=np.int32)
        sources = np.atleast_1d(np.asarray(source, dtype=np.int32))
        _dijkstra(self.start, self.end, self.length, sources, float(limit), distance, before)
        return distance, before

    def parts(self) -> tuple[int, IntArray]:
        """Number of connected parts, and the part of each vertex."""
        v = len(self.start) - 1
        row = np.repeat(np.arange(v), np.diff(self.start))
        links = coo_matrix((np.ones(len(row), np.int8), (row, self.end)), shape=(v, v))
        count, label = connected_components(links, directed=False)
        return int(count), label.astype(np.int32)


def path_to(before: IntArray, vertex: int) -> IntArray:
    """The path from the source to a vertex, as `MeshGraph.distances` found it."""
    path = [vertex]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1], dtype=np.int32)


def mesh_graph(
    vertices: FloatArray,
    triangles: IntArray,
    *,
    paths: str = "unfolded",
    bridges: IntArray | None = None,
) -> MeshGraph:
    """The lines that paths over a mesh may take.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        paths: ``edges``, as in the paper, or ``unfolded``: also straight across pairs of
            triangles.
        bridges: Further vertex pairs, between parts that do not touch, shape [b, 2].

    Raises:
        GeometryError: An unknown kind of path.
    """
    if paths not in ("edges", "unfolded"):
        raise GeometryError(f"paths {paths!r}; allowed: edges, unfolded")
    pairs = edge_table(triangles)[0]
    if bridges is not None and len(bridges):
        pairs = np.concatenate([pairs, bridges.astype(np.int32)])
    length = np.linalg.norm(vertices[pairs[:, 1]] - vertices[pairs[:, 0]], axis=1)
    if paths == "unfolded":
        across, across_length = _unfolded(vertices, triangles)
        pairs = np.concatenate([pairs, across])
        length = np.concatenate([length, across_length])
    v = len(vertices)
    both = coo_matrix(
        (
            np.tile(length, 2),
            (
                np.concatenate([pairs[:, 0], pairs[:, 1]]),
                np.concatenate([pairs[:, 1], pairs[:, 0]]),
            ),
        ),
        shape=(v, v),
    )
    # In order of the rows; a line given twice stays twice, which does no harm.
    order = np.argsort(both.row, kind="stable")
    start = np.searchsorted(both.row[order], np.arange(v + 1)).astype(np.int32)
    return MeshGraph(start, both.col[order].astype(np.int32), both.data[order])


def _unfolded(vertices: FloatArray, triangles: IntArray) -> tuple[IntArray, FloatArray]:
    """Lines from corner to corner across an edge, where they are straight in the unfolded pair."""
    corner = np.concatenate(
        [triangles[:, [0, 1, 2]], triangles[:, [1, 2, 0]], triangles[:, [2, 0, 1]]]
    )
    low, high = corner[:, :2].min(axis=1), corner[:, :2].max(axis=1)
    order = np.lexsort((high, low))
    low, high, apex = low[order], high[order], corner[order, 2]
    same = np.flatnonzero((low[1:] == low[:-1]) & (high[1:] == high[:-1]))
    a, along = vertices[low[same]], vertices[high[same]] - vertices[low[same]]
    length = np.linalg.norm(along, axis=1)
    unit = along / np.maximum(length, 1e-30)[:, None]
    flat = []
    for tip in (apex[same], apex[same + 1]):
        x = ((vertices[tip] - a) * unit).sum(axis=1)
        y = np.linalg.norm(vertices[tip] - a - x[:, None] * unit, axis=1)
        flat.append((x, y))
    (cx, cy), (dx, dy) = flat
    crossing = cx + (dx - cx) * cy / np.maximum(cy + dy, 1e-30)
    good = (crossing > 0.0) & (crossing < length) & (apex[same] != apex[same + 1])
    pairs = np.stack([apex[same], apex[same + 1]], axis=1)[good].astype(np.int32)
    return pairs, np.hypot(dx - cx, cy + dy)[good]


@exact_kernel()
def _dijkstra(start, end, length, sources, limit, distance, before):
    """Dijkstra's algorithm with a binary heap; stale entries are skipped when they come up."""
    heap_key = np.empty(end.shape[0] + sources.shape[0] + 1)
    heap_vertex = np.empty(end.shape[0] + sources.shape[0] + 1, dtype=np.int32)
    size = 0
    for s in sources:
        distance[s] = 0.0
        heap_key[size] = 0.0
        heap_vertex[size] = s
        size += 1
    while size > 0:
        key = heap_key[0]
        vertex = heap_vertex[0]
        size -= 1
        last_key = heap_key[size]
        last_vertex = heap_vertex[size]
        i = 0
        while True:
            child = 2 * i + 1
            if child >= size:
                break
            if child + 1 < size and heap_key[child + 1] < heap_key[child]:
                child += 1
            if heap_key[child] >= last_key:
                break
            heap_key[i] = heap_key[child]
            heap_vertex[i] = heap_vertex[child]
            i = child
        heap_key[i] = last_key
        heap_vertex[i] = last_vertex
        if key > distance[vertex]:
            continue
        for e in range(start[vertex], start[vertex + 1]):
            other = end[e]
            candidate = key + length[e]
            if candidate < distance[other] and candidate <= limit:
                distance[other] = candidate
                before[other] = vertex
                i = size
                size += 1
                while i > 0 and heap_key[(i - 1) // 2] > candidate:
                    heap_key[i] = heap_key[(i - 1) // 2]
                    heap_vertex[i] = heap_vertex[(i - 1) // 2]
                    i = (i - 1) // 2
                heap_key[i] = candidate
                heap_vertex[i] = other


def cut(
    value_a: FloatArray, value_b: FloatArray, a: FloatArray, b: FloatArray, level: float
) -> FloatArray:
    """Equation (2): where the value reaches `level` between a and b, linearly, shape [n, 3]."""
    share = (level - value_a) / (value_b - value_a)
    result: FloatArray = a + share[:, None] * (b - a)
    return result


@dataclass(frozen=True)
class IsoLine:
    """Where a value on a mesh reaches one level.

    Attributes:
        segments: One straight piece per triangle that is cut [m], shape [k, 2, 3].
        loop: Number of the connected line that each piece belongs to, shape [k].
    """

    segments: FloatArray
    loop: IntArray

    @property
    def lengths(self) -> FloatArray:
        """Length of each piece [m], shape [k]."""
        result: FloatArray = np.linalg.norm(self.segments[:, 1] - self.segments[:, 0], axis=1)
        return result

    def centre(self) -> FloatArray:
        """Mean over the line's length [m], shape [3]; NaN where there is no line."""
        weight = self.lengths + 1e-12
        if not len(weight):
            return np.full(3, np.nan)
        result: FloatArray = weight @ self.segments.mean(axis=1) / weight.sum()
        return result

    def parts(self) -> list["IsoLine"]:
        """The connected lines, longest first."""
        count = int(self.loop.max(initial=-1)) + 1
        order = np.argsort(-np.bincount(self.loop, self.lengths, count), kind="stable")
        return [
            IsoLine(self.segments[self.loop == i], self.loop[self.loop == i] * 0) for i in order
        ]


def value_range(triangles: IntArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest value at the corners of each triangle, shape [t] each."""
    a, b, c = value[triangles[:, 0]], value[triangles[:, 1]], value[triangles[:, 2]]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def iso_line(
    vertices: FloatArray, triangles: IntArray, value: FloatArray, level: float
) -> IsoLine:
    """The line on a mesh on which a value given at the vertices reaches `level`.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        value: Any value at the vertices, linear between; infinite ones are left out, shape [v].
        level: The level.
    """
    low, high = value_range(triangles, value)
    t = triangles[(low < level) & (high >= level) & np.isfinite(high)]
    if not len(t):
        return IsoLine(np.zeros((0, 2, 3)), np.zeros(0, np.int32))
    # Turn each so that its first corner is alone on its side.
    side = (value >= level)[t]
    odd = np.argmax(side == (side.sum(axis=1) == 1)[:, None], axis=1)
    rows = np.arange(len(t))
    a, b, c = (t[rows, (odd + k) % 3] for k in range(3))
    x = vertices
    segments = np.stack(
        [
            cut(value[a], value[b], x[a], x[b], level),
            cut(value[a], value[c], x[a], x[c], level),
        ],
        axis=1,
    )
    edge = np.sort(np.stack([np.stack([a, b], 1), np.stack([a, c], 1)], axis=1), axis=-1)
    key = edge[..., 0].astype(np.int64) * len(vertices) + edge[..., 1]
    _, number = np.unique(key, return_inverse=True)
    number = number.reshape(-1, 2)
    size = int(number.max()) + 1
    links = coo_matrix(
        (np.ones(len(t), np.int8), (number[:, 0], number[:, 1])), shape=(size, size)
    )
    _, label = connected_components(links, directed=False)
    _, loop = np.unique(label[number[:, 0]], return_inverse=True)
    return IsoLine(segments, loop.astype(np.int32))


def longest_loops(
    vertices: FloatArray, triangles: IntArray, value: FloatArray, levels: FloatArray
) -> FloatArray:
    """Length of the longest connected part of the iso-line at each level [m], NaN where none.

    The same as ``iso_line(...).parts()[0].lengths.sum()``, for many levels at once.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        value: Any value at the vertices, shape [v].
        levels: The levels, shape [n].
    """
    low, high = value_range(triangles, value)
    t = triangles[(low < levels.max()) & (high >= levels.min()) & np.isfinite(high)]
    if not len(t):
        return np.full(len(levels), np.nan)
    key = np.stack(
        [
            np.minimum(t[:, k], t[:, (k + 1) % 3]).astype(np.int64) * len(vertices)
            + np.maximum(t[:, k], t[:, (k + 1) % 3])
            for k in range(3)
        ],
        axis=1,
    )
    unique, edge = np.unique(key, return_inverse=True)
    result = np.empty(len(levels))
    _longest_loops(vertices, t, edge.reshape(-1, 3), len(unique), value, levels, result)
    return result


@exact_kernel()
def _longest_loops(vertices, triangles, edge, edges, value, levels, result):
    """Joins the cut edges of each triangle; sums lengths over what is joined."""
    above = np.empty(edges, dtype=np.int64)
    total = np.empty(edges)
    ends = np.empty((2, 3))
    for i in range(levels.size):
        level = levels[i]
        above[:] = np.arange(edges)
        total[:] = 0.0
        found = False
        for t in range(triangles.shape[0]):
            cut_edges = 0
            first = second = 0
            for k in range(3):
                a = triangles[t, k]
                b = triangles[t, (k + 1) % 3]
                if (value[a] >= level) == (value[b] >= level):
                    continue
                share = (level - value[a]) / (value[b] - value[a])
                for r in range(3):
                    ends[cut_edges, r] = vertices[a, r] + share * (vertices[b, r] - vertices[a, r])
                if cut_edges == 0:
                    first = edge[t, k]
                else:
                    second = edge[t, k]
                cut_edges += 1
            if cut_edges != 2:
                continue
            found = True
            while above[first] != first:
                above[first] = above[above[first]]
                first = above[first]
            while above[second] != second:
                above[second] = above[above[second]]
                second = above[second]
            if first != second:
                above[second] = first
                total[first] += total[second]
            for r in range(3):
                ends[0, r] -= ends[1, r]
            total[first] += np.sqrt(ends[0, 0] ** 2 + ends[0, 1] ** 2 + ends[0, 2] ** 2)
        result[i] = np.nan
        if found:
            result[i] = 0.0
            for e in range(edges):
                if above[e] == e and total[e] > result[i]:
                    result[i] = total[e]
