"""Vertices along the outlines of panels, so that what is sewn together matches vertex to vertex.

Both sides of a stitch are cut into the same parts at the ends of all edges of either side, in
shares of the side's length; each part has as many segments on one side as on the other, of the
wanted length on their mean. A longer side is eased in evenly: its segments are longer.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.garment.patterns.curves import at_shares
from garment_sim_ros.garment.patterns.pattern import Pattern, Seam

_SAME = 1e-6
"""Shares of a side's length nearer to each other than this are one place."""
_NODE = tuple[str, int]


@dataclass(frozen=True, kw_only=True)
class Outline:
    """The boundary of one panel as it is triangulated.

    Attributes:
        points: Its vertices in order [m], shape [n, 2].
        edge: The edge of the panel on which each one lies, its first one included, shape [n].
    """

    points: FloatArray
    edge: IntArray


@dataclass(frozen=True, kw_only=True)
class Outlines:
    """Boundaries of all panels, and which of their vertices are one.

    Attributes:
        of_panel: By the panel's name.
        pairs: Sewn vertices as (panel, vertex of its outline), each stitch one list.
    """

    of_panel: dict[str, Outline]
    pairs: tuple[tuple[tuple[_NODE, _NODE], ...], ...]


def outlines(pattern: Pattern, edge_length: float) -> Outlines:
    """Vertices on all boundaries.

    Args:
        pattern: A pattern that was checked.
        edge_length: Length of segments, about [m].
    """
    cuts: dict[tuple[str, int], list[float]] = {
        (name, e): [0.0, 1.0]
        for name, panel in pattern.panels.items()
        for e in range(len(panel.edges))
    }
    parts = []
    for stitch in pattern.stitches:
        sides = [_in_line(pattern, side) for side in stitch.sides]
        if not stitch.turned:
            sides[1] = [(key, b, a) for key, a, b in reversed(sides[1])]
        parts.append(_common(pattern, sides[0], sides[1]))
        for pair in parts[-1]:
            for key, a, b in pair:
                cuts[key] += [a, b]
    counts: dict[tuple[str, int, float], int] = {}
    for common in parts:
        for pair in common:
            longest = [abs(b - a) * _length(pattern, key) for key, a, b in pair]
            n = max(1, round(float(np.mean(longest)) / edge_length))
            for key, a, b in pair:
                counts[(*key, _rounded(min(a, b)))] = n
    of_panel: dict[str, Outline] = {}
    first: dict[tuple[str, int, float], int] = {}
    for name, panel in pattern.panels.items():
        points: list[FloatArray] = []
        edge: list[int] = []
        for e in range(len(panel.edges)):
            places = _unique(cuts[name, e])
            shares: list[FloatArray] = []
            for a, b in pairwise(places):
                length = (b - a) * panel.lengths[e]
                part = (name, e, _rounded(a))
                n = counts.get(part, max(1, round(float(length) / edge_length)))
                first[part] = len(edge) + sum(len(places) for places in shares)
                shares.append(np.linspace(a, b, n + 1)[:-1])
            on_edge = at_shares(panel.curves[e], np.concatenate(shares))
            points.append(on_edge)
            edge += [e] * len(on_edge)
        of_panel[name] = Outline(points=np.concatenate(points), edge=np.array(edge, np.int32))
    pairs = tuple(tuple(_pairs(common, counts, first, of_panel)) for common in parts)
    return Outlines(of_panel=of_panel, pairs=pairs)


_Part = tuple[tuple[str, int], float, float]
"""Panel and edge, and the shares of its length where a part of it starts and ends."""


def _in_line(pattern: Pattern, side: Sequence[Seam]) -> list[_Part]:
    """The edges of one side in order, each whole."""
    return [((seam.panel, e), 0.0, 1.0) for seam in side for e in seam.edges]


def _length(pattern: Pattern, key: tuple[str, int]) -> float:
    return float(pattern.panels[key[0]].lengths[key[1]])


def _common(pattern: Pattern, one: list[_Part], other: list[_Part]) -> list[tuple[_Part, _Part]]:
    """Parts of both sides that lie on each other."""
    ends = []
    for side in (one, other):
        way = np.cumsum([_length(pattern, key) for key, _, _ in side])
        ends.append(np.concatenate([[0.0], way / way[-1]]))
    places = _unique([*ends[0], *ends[1]])
    result = []
    for a, b in pairwise(places):
        pair = []
        for side, end in zip((one, other), ends, strict=True):
            k = int(np.clip(np.searchsorted(end, 0.5 * (a + b)) - 1, 0, len(side) - 1))
            key, start, stop = side[k]
            span = end[k + 1] - end[k]
            s, t = ((x - end[k]) / span * (stop - start) + start for x in (a, b))
            pair.append((key, _snapped(s), _snapped(t)))
        result.append((pair[0], pair[1]))
    return result


def _snapped(share: float) -> float:
    for end in (0.0, 1.0):
        if abs(share - end) < _SAME:
            return end
    return share


def _rounded(share: float) -> float:
    return round(share / _SAME) * _SAME


def _unique(shares: Sequence[float]) -> list[float]:
    result: list[float] = []
    for share in sorted(shares):
        if not result or share - result[-1] > _SAME:
            result.append(share)
    return result


def _pairs(
    common: Sequence[tuple[_Part, _Part]],
    counts: dict[tuple[str, int, float], int],
    first: dict[tuple[str, int, float], int],
    of_panel: dict[str, Outline],
) -> list[tuple[_NODE, _NODE]]:
    """Vertices of two sides that lie on each other, each pair once."""
    result: list[tuple[_NODE, _NODE]] = []
    for pair in common:
        sides = []
        for key, a, b in pair:
            at = (*key, _rounded(min(a, b)))
            n = counts[at]
            outline = of_panel[key[0]]
            nodes = [(key[0], (first[at] + i) % len(outline.points)) for i in range(n + 1)]
            sides.append(nodes if a < b else nodes[::-1])
        for both in zip(*sides, strict=True):
            if not result or result[-1] != both:
                result.append((both[0], both[1]))
    return result
