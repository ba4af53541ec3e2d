"""Panels cut to triangles, and what is one vertex once they are sewn."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError, ParameterError
from garment_sim_ros.garment.patterns.pattern import Pattern
from garment_sim_ros.garment.patterns.seams import Outlines, outlines
from garment_sim_ros.garment.patterns.triangulation import triangulate
from garment_sim_ros.geometry.topology import non_manifold_edges

MOST_VERTICES = 100_000
_ROUNDS = 4


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """A pattern that was cut: triangles of its panels, each panel with vertices of its own.

    Attributes:
        pattern: The pattern.
        flat: Where vertices lie in their panels [m], shape [n, 2].
        panel: Number of the panel of each, in the pattern's order, shape [n].
        triangles: Counter-clockwise seen from the right side, shape [t, 3].
        boundary: Whether each vertex is on its panel's outline, shape [n].
        edge: Its edge there, -1 inside, shape [n].
        welded: The vertex of the sewn garment that each becomes, shape [n].
        seams: For each stitch, pairs of vertices that become one, shape [k, 2].
    """

    pattern: Pattern
    flat: FloatArray
    panel: IntArray
    triangles: IntArray
    edge: IntArray
    welded: IntArray
    seams: tuple[IntArray, ...]

    @property
    def corners(self) -> FloatArray:
        """Weft and warp of each triangle's corners [m], shape [t, 3, 2]."""
        grain = np.array([panel.grain for panel in self.pattern.panels.values()])
        grain /= np.linalg.norm(grain, axis=1, keepdims=True)
        warp = grain[self.panel]
        weft = np.stack([warp[:, 1], -warp[:, 0]], axis=1)
        threads = np.stack(
            [(self.flat * weft).sum(axis=1), (self.flat * warp).sum(axis=1)], axis=1
        )
        return threads[self.triangles]

    @property
    def sewn_triangles(self) -> IntArray:
        """Triangles of the sewn garment, in the same order, shape [t, 3]."""
        return self.welded[self.triangles].astype(np.int32)

    @property
    def sewn_count(self) -> int:
        """Number of vertices of the sewn garment."""
        return int(self.welded.max()) + 1

    @property
    def stitches(self) -> IntArray:
        """Number of the stitch of each vertex, -1 where nothing is sewn, shape [n]."""
        several = np.bincount(self.welded) > 1
        return np.where(several[self.welded], self.welded, -1).astype(np.int32)

    def placed(self) -> FloatArray:
        """Where the pattern places the vertices [m], shape [n, 3]."""
        x = np.zeros((len(self.flat), 3))
        for k, panel in enumerate(self.pattern.panels.values()):
            x[self.panel == k] = panel.placement.placed(self.flat[self.panel == k])
        return x

    def joined(self, x: FloatArray) -> FloatArray:
        """Vertices of the sewn garment: the mean of those that become one [m], shape [v, 3]."""
        count = np.bincount(self.welded)
        return np.stack([np.bincount(self.welded, c) / count for c in x.T], axis=1)

    def with_pattern(self, pattern: Pattern) -> "Pieces":
        """The same with panels that are placed elsewhere."""
        return replace(self, pattern=pattern)


def cut(pattern: Pattern, edge_length: float, *, seed: int = 1) -> Pieces:
    """Cuts a pattern.

    Args:
        pattern: A pattern that was checked.
        edge_length: Length of edges, about [m].
        seed: Of the points inside.

    Raises:
        ParameterError: An edge length that is larger than a panel, or too many vertices.
        GeometryError: Stitches that make no surface.
    """
    _check_length(pattern, edge_length)
    made = outlines(pattern, edge_length)
    meshes = []
    for k, name in enumerate(pattern.panels):
        try:
            meshes.append(triangulate(made.of_panel[name].points, edge_length, seed=seed + k))
        except GeometryError as error:
            raise GeometryError(f"pattern {pattern.name!r}: panel {name!r}: {error}") from None
    pieces = _put_together(pattern, made, meshes)
    for _ in range(_ROUNDS):
        doubled = _doubled_chords(pieces)
        if not doubled:
            break
        start = np.searchsorted(pieces.panel, np.arange(len(meshes)))
        for k, a, b in doubled:
            meshes[k] = _split(*meshes[k], a - start[k], b - start[k])
        pieces = _put_together(pattern, made, meshes)
    _check_surface(pieces)
    return pieces


def _put_together(
    pattern: Pattern, made: Outlines, meshes: list[tuple[FloatArray, IntArray]]
) -> Pieces:
    """All panels as one list of vertices and triangles."""
    first = dict(zip(pattern.panels, np.cumsum([0, *(len(x) for x, _ in meshes)]), strict=False))
    seams = _seams(made, first)
    count = sum(len(x) for x, _ in meshes)
    edge = np.full(count, -1, np.int32)
    for name, outline in made.of_panel.items():
        edge[first[name] : first[name] + len(outline.edge)] = outline.edge
    return Pieces(
        pattern=pattern,
        flat=np.concatenate([x for x, _ in meshes]),
        panel=np.repeat(np.arange(len(meshes)), [len(x) for x, _ in meshes]).astype(np.int32),
        triangles=np.concatenate(
            [t + first[name] for name, (_, t) in zip(pattern.panels, meshes, strict=True)]
        ).astype(np.int32),
        edge=edge,
        welded=_welded(count, seams),
        seams=seams,
    )


def _seams(made: Outlines, first: dict[str, int]) -> tuple[IntArray, ...]:
    """Pairs of vertices of each stitch, where each panel's vertices start at its `first`."""
    return tuple(
        np.array([[first[n] + i for n, i in pair] for pair in pairs], np.int32)
        for pairs in made.pairs
    )


def _doubled_chords(pieces: Pieces) -> list[tuple[int, int, int]]:
    """Edges across a panel's corner that another panel has as well, once they are sewn.

    Returns:
        The panel's number and the ends of each.
    """
    ends = pieces.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    ends = ends[(pieces.edge[ends] >= 0).all(axis=1)]
    own, times = np.unique(np.sort(ends, axis=1), axis=0, return_counts=True)
    sewn = np.sort(pieces.welded[own], axis=1)
    _, index, sides = np.unique(sewn, axis=0, return_inverse=True, return_counts=True)
    total = np.bincount(index.ravel(), times)[index.ravel()]
    wrong = (total > 2) & (times == 2) & (sides[index.ravel()] > 1)
    return [(int(pieces.panel[a]), int(a), int(b)) for a, b in own[wrong]]


def _split(x: FloatArray, t: IntArray, a: int, b: int) -> tuple[FloatArray, IntArray]:
    """A panel's triangles with a new vertex in the middle of the edge from a to b."""
    middle = len(x)
    at = np.isin(t, (a, b)).sum(axis=1) == 2
    halves = []
    for replaced in (a, b):
        half = t[at].copy()
        half[half == replaced] = middle
        halves.append(half)
    return np.vstack([x, 0.5 * (x[a] + x[b])]), np.concatenate([t[~at], *halves])


def edge_length_for(pattern: Pattern, vertices: int) -> float:
    """The edge length with which a sewn pattern has about so many vertices [m].

    Triangles of edge h have an area of sqrt(3)/4 h^2, and each vertex inside has two of them.
    """

    def excess(log_length: float) -> float:
        h = float(np.exp(log_length))
        inside = pattern.area / (np.sqrt(0.75) * h**2)
        made = outlines(pattern, h)
        return inside + _boundary_count(made) - vertices

    high = np.sqrt(pattern.area / (np.sqrt(0.75) * max(vertices, 4))) * 4.0
    return float(np.exp(brentq(excess, np.log(high / 20.0), np.log(high), xtol=1e-3)))


def _boundary_count(made: Outlines) -> int:
    """Vertices on outlines of the sewn garment."""
    first, count = {}, 0
    for name, outline in made.of_panel.items():
        first[name] = count
        count += len(outline.points)
    return int(_welded(count, _seams(made, first)).max()) + 1


def _check_length(pattern: Pattern, edge_length: float) -> None:
    for panel in pattern.panels.values():
        extent = np.ptp(panel.outline, axis=0).min()
        if not 0.0 < edge_length <= extent:
            larger = f", larger than panel {panel.name!r}" if edge_length > extent else ""
            raise ParameterError(
                "edge_length",
                f"found {edge_length:.4g} m{larger}",
                f"allowed: above 0, up to {extent:.4g} m",
            )
    if pattern.area / edge_length**2 > MOST_VERTICES:
        least = np.sqrt(pattern.area / MOST_VERTICES)
        raise ParameterError(
            "edge_length",
            f"found {edge_length:.3g} m: over {MOST_VERTICES} vertices",
            f"allowed: {least:.3g} m on",
        )


def _welded(count: int, seams: tuple[IntArray, ...]) -> IntArray:
    """The common number of vertices that are sewn together, in the order of the first of each."""
    pairs = np.concatenate([np.zeros((0, 2), np.int32), *seams])
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, label = connected_components(links, directed=False)
    _, first, index = np.unique(label, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int32)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first))
    return rank[index.ravel()]


def _check_surface(pieces: Pieces) -> None:
    """The sewn garment is a surface: no triangle collapses, no edge has three of them."""
    t = pieces.sewn_triangles
    names = list(pieces.pattern.panels)
    collapsed = (t[:, 0] == t[:, 1]) | (t[:, 1] == t[:, 2]) | (t[:, 2] == t[:, 0])
    if collapsed.any():
        name = names[pieces.panel[pieces.triangles[collapsed][0, 0]]]
        raise GeometryError(
            f"pattern {pieces.pattern.name!r}: panel {name!r}: its stitches sew neighbouring "
            "places to each other, in a cycle; allowed: seams that meet at corners only"
        )
    wrong = non_manifold_edges(t)
    if len(wrong):
        at = np.isin(pieces.welded, wrong[0])
        found = Counter(names[k] for k in pieces.panel[at])
        raise GeometryError(
            f"pattern {pieces.pattern.name!r}: panels {', '.join(map(repr, found))} are sewn to "
            "no surface with one outside (a mirrored panel, or a seam turned over); allowed: "
            "edges that are sewn against each other"
        )
