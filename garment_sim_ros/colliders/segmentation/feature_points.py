"""Where neck, armpits, elbows, crotch and knees are on a human surface (Gong et al., 2.1).

Elbow, knee and neck lie on iso-lines of the geodesic distance from an end. At which distance:

* ``anthropometry`` (default): elbow at the length of forearm and hand, 0.146 + 0.108 of the
  stature (Drillis & Contini 1966, "Body segment parameters", as in Winter, "Biomechanics and motor
  control of human movement"), 2 % longer over the skin; knee at a fixed share of the way from toes
  to crotch, which follows from the same source's heights of knee and crotch; neck where the girth
  starts to grow below its narrowest place, so that it needs no number. Armpit: where the girth of
  the arm leaps.
* ``table1``: the paper's linear functions of the stature. Two of its rows name the wrong place:
  the "forearm" of 0.38 statures reaches to the armpit, the "calf" of 0.59 above the crotch, where
  it is not used.
* with `joints` from a rig: on the iso-line whose middle is nearest to the joint.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.colliders.segmentation.body_surface import BodySurface
from garment_sim_ros.colliders.segmentation.extremities import Extremities, extremities, lowest
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.geodesics import (
    IsoLine,
    MeshGraph,
    iso_line,
    longest_loops,
    path_to,
    value_range,
)

SIDES = ("left", "right")
CONSTANTS = ("anthropometry", "table1")

TABLE_1: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "male": {
        "neck": (0.0836, 168.9137),
        "elbow": (0.5510, -283.1964),
        "knee": (0.7447, -257.6398),
        "waist": (0.8044, -243.0916),
        "chest": (0.9630, -311.3857),
    },
    "female": {
        "neck": (0.0994, 142.6445),
        "elbow": (0.5672, -307.5205),
        "knee": (0.7134, -207.8311),
        "waist": (0.7683, -170.2316),
        "chest": (0.9309, -245.0959),
    },
}
"""Table 1 of the paper: slope and offset [mm] over the stature [mm]."""

_ELBOW = 1.02 * (0.146 + 0.108)
"""Way from fingertip to elbow over the stature."""
_KNEE = 0.627
"""Way from toe tip to knee over that to the crotch."""
_LEVEL = 0.008
"""Differences of height within a crotch over the stature."""
_WAIST, _CHEST = 0.36, 0.70
"""Heights between crotch (0) and neck (1): navel and bust, 0.60 and 0.72 of the stature."""
_NECK_GROWTH = 1.10
"""Girth at the neck's base over that at its narrowest place."""
_SHOULDER_GROWTH = 1.35
_ARM_LEAP = 2.0
"""Growth of girth per way [m/m] that no arm has and every armpit."""
_USUAL_ARMPIT = 0.385
"""Way from fingertip to armpit over the stature, where no leap is found."""


@dataclass(frozen=True)
class FeaturePoints:
    """Feature points of a body.

    Attributes:
        ends: Its five ends.
        level: Way from its end to each feature [m]: ``neck``, ``left_elbow``, ``left_armpit``,
            ``left_knee``, ``left_crotch`` and the same of the right.
        point: ``crotch``, ``left_armpit``, ``right_armpit``: on the surface; ``neck``,
            ``left_elbow``, ...: the middle of the iso-line [m], shape [3] each.
        waist: Height of the waist along `ends.axes[2]` [m].
        chest: Height of the chest [m].
        mid_plane: Unit normal (to the left) and offset of the plane between the armpits.
        confidence: How sure each decision is, 0 to 1.
        notes: What was assumed.
    """

    ends: Extremities
    level: dict[str, float]
    point: dict[str, FloatArray]
    waist: float
    chest: float
    mid_plane: tuple[FloatArray, float]
    confidence: dict[str, float]
    notes: tuple[str, ...]


def feature_points(
    surface: BodySurface,
    graph: MeshGraph,
    *,
    constants: str = "anthropometry",
    sex: str = "female",
    joints: Mapping[str, FloatArray] | None = None,
) -> FeaturePoints:
    """Find the feature points of a human surface.

    Args:
        surface: The surface.
        graph: Its paths.
        constants: One of `CONSTANTS`.
        sex: Which column of Table 1: ``male`` or ``female``.
        joints: Positions of ``neck``, ``left_elbow``, ``left_knee`` and so on, where a rig tells.

    Raises:
        ParameterError: Unknown constants or sex.
        GeometryError: The surface is not that of a human; see `extremities`.
    """
    if constants not in CONSTANTS:
        raise ParameterError("constants", f"found {constants!r}", f"allowed: {CONSTANTS}")
    if sex not in TABLE_1:
        raise ParameterError("sex", f"found {sex!r}", f"allowed: {tuple(TABLE_1)}")
    ends = extremities(surface, graph)
    H, up = ends.height, ends.axes[2]
    x = surface.vertices
    confidence = dict(ends.confidence)
    notes = list(ends.notes)
    level: dict[str, float] = {}
    point: dict[str, FloatArray] = {}

    def line(end: str, at: float) -> IsoLine:
        return iso_line(x, surface.triangles, ends.of(end), at)

    crotch = _crotch(surface, graph, ends, constants)
    point["crotch"] = x[crotch]
    for side in SIDES:
        level[f"{side}_crotch"] = float(ends.of(f"{side}_foot")[crotch])
    share = np.mean([level[f"{side}_crotch"] for side in SIDES]) / H
    confidence["crotch"] = float(np.clip(1.0 - abs(share - 0.54) / 0.12, 0.0, 1.0))

    table: dict[str, float] = {}
    if constants == "table1":
        table = {k: (a * 1e3 * H + b) * 1e-3 for k, (a, b) in TABLE_1[sex].items()}
    neck, confidence["neck"] = _neck(surface, ends)
    level["neck"] = table.get("neck", neck)
    _set_limbs(level, table, H, notes)
    for name, joint in (joints or {}).items():
        level[name] = _level_at(surface, ends.of(_end_of(name)), joint, level[name], H)
    if joints:
        notes.append("joints of the rig were used: " + ", ".join(sorted(joints)))
    for name in ("neck", *(f"{side}_{part}" for side in SIDES for part in ("elbow", "knee"))):
        point[name] = line(_end_of(name), level[name]).centre()

    confidence["armpits"] = min(
        _set_armpit(surface, graph, ends, side, table, crotch, level, point) for side in SIDES
    )
    if confidence["armpits"] == 0.0:
        notes.append("no leap of girth at an armpit; taken at the usual share of the stature")

    low, high = float(point["crotch"] @ up), float(point["neck"] @ up)
    waist, chest = low + _WAIST * (high - low), low + _CHEST * (high - low)
    if table:
        waist = _height_of(line("right_foot", table["waist"]), up, low, high)
        chest = _height_of(line("right_foot", table["chest"]), up, waist, high)
    return FeaturePoints(
        ends, level, point, waist, chest, _mid_plane(point, ends), confidence, tuple(notes)
    )


_END_OF = {"neck": "head", "elbow": "hand", "knee": "foot"}


def _end_of(name: str) -> str:
    """The end that a feature's way is counted from."""
    end = _END_OF[name.split("_")[-1]]
    return end if end == "head" else f"{name.split('_')[0]}_{end}"


def _set_limbs(
    level: dict[str, float], table: Mapping[str, float], H: float, notes: list[str]
) -> None:
    """Ways to elbows and knees, by the stature alone or, where it is given, by Table 1.

    Args:
        level: Ways [m], changed in place; those to the crotch are in it.
        table: Ways by Table 1 [m].
        H: The stature [m].
        notes: What was assumed, added to.
    """
    for side in SIDES:
        level[f"{side}_elbow"] = table.get("elbow", _ELBOW * H)
        knee = level[f"{side}_knee"] = _KNEE * level[f"{side}_crotch"]
        of_table = table.get("knee", knee)
        if of_table < 0.95 * level[f"{side}_crotch"]:
            level[f"{side}_knee"] = of_table
        else:
            notes.append(
                f"Table 1's {side} knee is {of_table:.2f} m from the toes, above the"
                f" crotch; {_KNEE} of the way there was taken instead"
            )


def _set_armpit(
    surface: BodySurface,
    graph: MeshGraph,
    ends: Extremities,
    side: str,
    table: Mapping[str, float],
    crotch: int,
    level: dict[str, float],
    point: dict[str, FloatArray],
) -> float:
    """Sets one armpit's way and point, by Table 1 where it is given; how sure it is, 0 to 1."""
    x = surface.vertices
    hand = ends.of(f"{side}_hand")
    at, sure = _armpit_level(surface, ends, f"{side}_hand")
    if table:
        vertex = _armpit_of_paper(surface, graph, ends, side, level, table, crotch)
        at = float(hand[vertex])
        point[f"{side}_armpit"] = x[vertex]
    else:
        ring = iso_line(x, surface.triangles, hand, at).segments.reshape(-1, 3)
        nearest = np.linalg.norm(ring - x[crotch], axis=1)
        point[f"{side}_armpit"] = ring[lowest(nearest)] if len(ring) else np.full(3, np.nan)
    level[f"{side}_armpit"] = max(at, 1.05 * level[f"{side}_elbow"])
    return sure


def _mid_plane(point: Mapping[str, FloatArray], ends: Extremities) -> tuple[FloatArray, float]:
    """The plane between the armpits: unit normal to the left, and offset."""
    up = ends.axes[2]
    across = point["left_armpit"] - point["right_armpit"]
    across -= (across @ up) * up
    width = float(np.linalg.norm(across))
    normal = across / width if width > 0.02 * ends.height else ends.axes[1]
    middle = 0.5 * (point["left_armpit"] + point["right_armpit"])
    return normal, float(normal @ (middle if np.isfinite(middle).all() else point["crotch"]))


def _crotch(surface: BodySurface, graph: MeshGraph, ends: Extremities, constants: str) -> int:
    """The crotch's vertex.

    As printed: halfway along the path between the toe tips. That runs a little in front of the
    crotch, so the default is the lowest part of the line that is as far from either toe.
    """
    left, right = ends.of("left_foot"), ends.of("right_foot")
    if constants == "table1":
        _, before = graph.distances(int(ends.vertex[3]))
        path = path_to(before, int(ends.vertex[4]))
        return int(path[lowest(np.abs(left[path] - right[path]))])
    line = iso_line(surface.vertices, surface.triangles, left - right, 0.0)
    points, weight = line.segments.mean(axis=1), line.lengths
    height = points @ ends.axes[2]
    # From front to back it is nearly level: its middle is taken.
    weight = np.where(height < height.min() + _LEVEL * ends.height, weight + 1e-12, 0.0)
    middle = weight @ points / weight.sum()
    return lowest(np.linalg.norm(surface.vertices - middle, axis=1))


def _neck(surface: BodySurface, ends: Extremities) -> tuple[float, float]:
    """Way from the head's top to the base of the neck, and how sure that is."""
    levels = np.linspace(0.06, 0.46, 33) * ends.height
    girth = longest_loops(surface.vertices, surface.triangles, ends.of("head"), levels)
    widest, narrowest, at = girth[0], np.inf, 0
    for i, g in enumerate(girth):
        if np.isfinite(narrowest) and g > _SHOULDER_GROWTH * narrowest:
            break
        if g > widest and narrowest > 0.97 * widest:
            widest, narrowest = g, np.inf
        elif g < narrowest:
            narrowest, at = g, i
    base = at
    while base + 1 < len(girth) and girth[base + 1] <= _NECK_GROWTH * narrowest:
        base += 1
    if base + 1 == len(girth) or not np.isfinite(narrowest):
        return 0.20 * ends.height, 0.0
    share = (_NECK_GROWTH * narrowest - girth[base]) / (girth[base + 1] - girth[base])
    sure = float(np.clip(10.0 * (1.0 - narrowest / widest), 0.2, 1.0))
    return float(levels[base] + share * (levels[base + 1] - levels[base])), sure


def _armpit_level(surface: BodySurface, ends: Extremities, end: str) -> tuple[float, float]:
    """Way from a fingertip to the armpit, where the girth leaps, and how sure that is."""
    H = ends.height
    levels = np.linspace(0.29, 0.49, 21) * H
    girth = longest_loops(surface.vertices, surface.triangles, ends.of(end), levels)
    slope = np.diff(girth) / np.diff(levels)
    steep = slope > _ARM_LEAP
    leaps = np.flatnonzero(steep[:-1] & steep[1:])
    if not len(leaps):
        return _USUAL_ARMPIT * H, 0.0
    i = int(leaps[0])
    # The leap begins within the step before: follow it back to the arm's girth.
    back = (girth[i] - girth[max(i - 1, 0)]) / slope[i]
    sure = 1.0 if 0.30 * H < levels[i] < 0.46 * H else 0.4
    return float(levels[i] - min(max(back, 0.0), levels[1] - levels[0])), sure


def _armpit_of_paper(
    surface: BodySurface,
    graph: MeshGraph,
    ends: Extremities,
    side: str,
    level: Mapping[str, float],
    linear: Mapping[str, float],
    crotch: int,
) -> int:
    """The vertex farthest from the straight line on the path from waist to elbow."""
    x = surface.vertices
    ring = iso_line(x, surface.triangles, ends.of(f"{side}_hand"), level[f"{side}_elbow"])
    v3 = _nearest_vertex(x, ring, x[crotch], farthest=False)
    ring = iso_line(x, surface.triangles, ends.of(f"{side}_foot"), linear["waist"])
    v2 = _nearest_vertex(x, ring, x[crotch], farthest=True)
    _, before = graph.distances(v2)
    path = path_to(before, v3)
    along = x[v3] - x[v2]
    along /= max(float(np.linalg.norm(along)), 1e-12)
    offset = x[path] - x[v2]
    away = np.linalg.norm(offset - (offset @ along)[:, None] * along, axis=1)
    return int(path[lowest(-away)])


def _nearest_vertex(x: FloatArray, ring: IsoLine, place: FloatArray, *, farthest: bool) -> int:
    """The vertex at the point of an iso-line that is nearest to, or farthest from, a place."""
    points = ring.segments.reshape(-1, 3)
    if not len(points):
        return lowest(np.linalg.norm(x - place, axis=1))
    distance = np.linalg.norm(points - place, axis=1)
    point = points[lowest(-distance if farthest else distance)]
    return lowest(np.linalg.norm(x - point, axis=1))


def _level_at(
    surface: BodySurface, value: FloatArray, joint: FloatArray, guess: float, height: float
) -> float:
    """The level whose iso-line's middle is nearest to a joint."""
    levels = guess + np.linspace(-0.12, 0.12, 17) * height
    levels = levels[levels > 0.02 * height]
    low, high = value_range(surface.triangles, value)
    near = surface.triangles[(low < levels[-1]) & (high > levels[0])]
    away = [
        np.linalg.norm(iso_line(surface.vertices, near, value, level).centre() - joint)
        for level in levels
    ]
    return float(levels[np.nanargmin(away)])


def _height_of(line: IsoLine, up: FloatArray, low: float, high: float) -> float:
    """Mean height of an iso-line, kept between two heights."""
    middle = float(line.centre() @ up) if len(line.segments) else np.nan
    if not np.isfinite(middle):
        middle = 0.5 * (low + high)
    return float(np.clip(middle, low + 0.1 * (high - low), high - 0.1 * (high - low)))
