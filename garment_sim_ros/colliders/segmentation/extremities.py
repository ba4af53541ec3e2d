"""The five ends of a human surface, told apart: head, hands and feet, left and right.

They are geodesic extremes, so that neither the pose nor the orientation of the body matters. Which
is which follows from the symmetry of their mutual distances: the head is as far from one hand as
from the other, and likewise for the feet. Up, left and front are the body's own: up from between
its shins to the top of its head, whichever way it lies. Choices among vertices that are equal but
for rounding take the one of lowest index.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.colliders.segmentation.body_surface import BodySurface
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.geodesics import MeshGraph, iso_line

ENDS = ("head", "left_hand", "right_hand", "left_foot", "right_foot")

_HEIGHTS = (0.4, 2.6)
"""Allowed stature [m]."""
_UPRIGHT = np.cos(np.radians(25.0))
_REACH = {"head": (0.65, 1.2), "hand": (0.8, 1.25), "foot": (0.8, 1.25)}
"""How far each end may be from the geodesic middle of the body, over the mean of the five."""
_ASYMMETRY = 0.25
"""Largest relative difference between the two sides."""
_SHIN = 0.20
"""Way from the toes to the middle of the shin, over the stature or nearly: the shins of who stands
upright are below the head."""
_CROWN = 0.25
"""The top of the head is this near to its extreme, over the way up to there."""
_ROUNDS = 3
"""How often up and the top of the head are found from each other."""
_TIE = 1e-6
"""Lengths that differ by less than this share of the body's are equal."""


@dataclass(frozen=True)
class Extremities:
    """The ends of a body.

    Attributes:
        vertex: Vertex of each end in the order of `ENDS`, shape [5].
        distance: Geodesic distance of every vertex from each end [m], shape [5, v].
        axes: Rows: unit vectors to the front, to the left and up in the mesh's frame, shape [3,
            3].
        height: Stature [m].
        confidence: How sure each decision is, 0 to 1.
        notes: What was assumed, one sentence each.
    """

    vertex: IntArray
    distance: FloatArray
    axes: FloatArray
    height: float
    confidence: dict[str, float]
    notes: tuple[str, ...]

    def of(self, end: str) -> FloatArray:
        """Distances from one end, shape [v]."""
        result: FloatArray = self.distance[ENDS.index(end)]
        return result


def extremities(surface: BodySurface, graph: MeshGraph) -> Extremities:
    """Find the five ends.

    Raises:
        GeometryError: The surface does not have the five ends of a human, or no human's size.
    """
    tips, reach, next_reach, distance = _extremes(surface, graph)
    head, hands, feet, asymmetry = _told_apart(distance[:, tips])
    x = surface.vertices
    notes: list[str] = []
    confidence = {
        # The sixth extreme (a thumb, a heel, the nose) must be clearly nearer than the fifth.
        "five_ends": float(np.clip(2.0 * (1.0 - next_reach / reach.min()), 0.0, 1.0)),
        "symmetry": float(np.clip(1.0 - asymmetry / _ASYMMETRY, 0.0, 1.0)),
    }
    kinds = {"head": [head], "hand": list(hands), "foot": list(feet)}
    mean = float(reach.mean())
    for kind, members in kinds.items():
        low, high = _REACH[kind]
        for m in members:
            if not low * mean < reach[m] < high * mean:
                raise GeometryError(
                    f"no human shape: a {kind} is {reach[m] / mean:.2f} times as far from the"
                    f" middle as the ends on average; allowed: {low} to {high}. Arms fused to it,"
                    " missing limbs or a skirt look like this"
                )
    if asymmetry > _ASYMMETRY:
        raise GeometryError(
            f"no human shape: the ends of its two sides differ by {100 * asymmetry:.0f} % in their"
            f" mutual distances; allowed: {100 * _ASYMMETRY:.0f} %"
        )
    if confidence["five_ends"] < 0.1:
        raise GeometryError(
            "no human shape: more than five ends (several bodies that touch, a tail, a chair)"
        )
    up, top = _up(surface, distance, tips, head, feet)
    confidence["upright"] = 1.0
    if up[2] <= _UPRIGHT:
        state = "upside down" if up[2] < -_UPRIGHT else "lying or leaning"
        notes.append(f"the body is {state}; up was taken from its feet to its head")
        confidence["upright"] = 0.6
    height = float(np.ptp(x @ up))
    if not _HEIGHTS[0] < height < _HEIGHTS[1]:
        raise GeometryError(
            f"the body is {height:.4g} m high; allowed: {_HEIGHTS[0]} to {_HEIGHTS[1]} m."
            " Is the unit right?"
        )
    front, front_confidence = _front(surface, distance, feet, up, height)
    confidence["front"] = front_confidence
    if front_confidence < 0.3:
        notes.append("the feet do not tell the front; taken as facing x")
        front = np.array([1.0, 0.0, 0.0])
        if abs(front @ up) > 0.9:
            front = np.array([0.0, 0.0, 1.0])
    front = front - (front @ up) * up
    front /= np.linalg.norm(front)
    axes = np.stack([front, np.cross(up, front), up])
    if front[0] < 0.5 and front_confidence >= 0.3:
        notes.append("the body does not face x; front was taken from its feet")
    hands, hand_side = _left_first(surface, distance, hands, axes[1], 0.40 * height)
    feet, foot_side = _left_first(surface, distance, feet, axes[1], 0.30 * height)
    confidence["sides"] = float(np.clip(min(hand_side, foot_side) / (0.04 * height), 0.0, 1.0))
    order = np.array([head, *hands, *feet])
    tips, distance = tips[order], distance[order]
    tips[0] = top
    distance[0] = graph.distances(int(tips[0]))[0]
    return Extremities(tips.astype(np.int32), distance, axes, height, confidence, tuple(notes))


def lowest(value: FloatArray) -> int:
    """Index of the least value; of those equal to it but for rounding the first.

    Args:
        value: Lengths of about the body's size [m], shape [n].
    """
    least = float(value.min())
    span = max(abs(least), float(np.abs(value[np.isfinite(value)]).max(initial=0.0)))
    return int(np.argmax(value <= least + _TIE * span))


def _up(
    surface: BodySurface,
    distance: FloatArray,
    tips: IntArray,
    head: int,
    feet: tuple[int, int],
) -> tuple[FloatArray, int]:
    """The body's own unit vector up, and the vertex at the top of its head."""
    x = surface.vertices
    low = x[tips[list(feet)]].mean(axis=0)
    top = int(tips[head])
    for _ in range(_ROUNDS):
        up = x[top] - low
        length = float(np.linalg.norm(up))
        up = up / max(length, 1e-12)
        # The extreme may be the nose or the inside of the mouth: the head's end is its top.
        near = np.flatnonzero(distance[head] < _CROWN * length)
        top = int(near[lowest(-((x[near] - low) @ up))])
        shins = [
            iso_line(x, surface.triangles, distance[foot], _SHIN * length).centre()
            for foot in feet
        ]
        if np.isfinite(shins).all():
            low = np.mean(shins, axis=0)
    return up, top


def _extremes(
    surface: BodySurface, graph: MeshGraph
) -> tuple[IntArray, FloatArray, float, FloatArray]:
    """Farthest points from the geodesic middle and from each other.

    Returns:
        Five vertices; how far each is from the middle; how far a sixth is from those five and the
        middle; distances from the five, shape [5, v].
    """
    from_mean = np.linalg.norm(surface.vertices - surface.vertices.mean(axis=0), axis=1)
    start = lowest(from_mean)
    farthest = np.zeros(len(surface.vertices))
    nearest, _ = graph.distances(start)
    if not np.isfinite(nearest).all():
        raise GeometryError("the surface is not connected")
    for k in range(5):
        tip = lowest(-nearest)
        distance, _ = graph.distances(tip)
        farthest = np.maximum(farthest, distance)
        nearest = distance if k == 0 else np.minimum(nearest, distance)
    middle = lowest(farthest)
    from_middle, _ = graph.distances(middle)
    nearest = from_middle.copy()
    tips, rows, gaps = [], [], []
    for _ in range(5):
        tip = lowest(-nearest)
        distance, _ = graph.distances(tip)
        tips.append(tip)
        rows.append(distance)
        gaps.append(nearest[tip])
        nearest = np.minimum(nearest, distance)
    vertex = np.array(tips, dtype=np.int32)
    return vertex, from_middle[vertex], float(nearest.max()), np.stack(rows)


def _told_apart(D: FloatArray) -> tuple[int, tuple[int, int], tuple[int, int], float]:
    """Head, hands and feet among five ends from their mutual distances, shape [5, 5]."""
    best = (np.inf, 0, (0, 0), (0, 0))
    for head in range(5):
        others = [i for i in range(5) if i != head]
        for pair in combinations(others, 2):
            rest = tuple(i for i in others if i not in pair)
            # A hand is nearer to the head than a foot is.
            if D[head, list(pair)].sum() >= D[head, list(rest)].sum():
                continue
            (h, i), (f, g) = pair, rest
            differences = [
                abs(D[head, h] - D[head, i]),
                abs(D[head, f] - D[head, g]),
                min(
                    max(abs(D[h, f] - D[i, g]), abs(D[h, g] - D[i, f])),
                    max(abs(D[h, g] - D[i, f]), abs(D[h, f] - D[i, g])),
                ),
            ]
            score = max(differences) / D.mean()
            if score < best[0]:
                best = (score, head, pair, (f, g))
    return best[1], best[2], best[3], float(best[0])


def _front(
    surface: BodySurface,
    distance: FloatArray,
    feet: tuple[int, int],
    up: FloatArray,
    height: float,
) -> tuple[FloatArray, float]:
    """The way the feet point, and how sure that is."""
    ways = []
    for foot in feet:
        tip = surface.vertices[int(distance[foot].argmin())]
        line = iso_line(surface.vertices, surface.triangles, distance[foot], _SHIN * height)
        way = tip - line.centre()
        way -= (way @ up) * up
        ways.append(way if np.isfinite(way).all() else np.zeros(3))
    total = ways[0] + ways[1]
    length = float(np.linalg.norm(total))
    if length < 0.04 * height:
        return np.array([1.0, 0.0, 0.0]), 0.0
    agree = length / max(float(np.linalg.norm(ways[0]) + np.linalg.norm(ways[1])), 1e-9)
    return total / length, float(np.clip(2.0 * agree - 1.0, 0.0, 1.0))


def _left_first(
    surface: BodySurface,
    distance: FloatArray,
    pair: tuple[int, int],
    left: FloatArray,
    level: float,
) -> tuple[tuple[int, int], float]:
    """A pair ordered left, right by where the limbs are at some distance from their ends."""
    side = [
        float(iso_line(surface.vertices, surface.triangles, distance[i], level).centre() @ left)
        for i in pair
    ]
    ordered = pair if side[0] >= side[1] else (pair[1], pair[0])
    return ordered, abs(side[0] - side[1])
