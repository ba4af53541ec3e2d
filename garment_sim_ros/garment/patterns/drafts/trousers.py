"""Trousers: two fronts and two backs.

The construction is that of Aldrich's trouser block in "Metric Pattern Cutting": a quarter of the
hips and ease for each panel, drawn out at the crotch line by a sixteenth of the hips in front and
twice that behind, and a leg that narrows to the hem about its crease. The formulas are our own.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.garment.patterns.curves import bezier
from garment_sim_ros.garment.patterns.drafts.upper import (
    STAND_OFF,
    facing,
    front_and_back,
    unit,
    widest,
)
from garment_sim_ros.garment.patterns.pattern import Panel, Pattern, Placement, Seam, Stitch, loop
from garment_sim_ros.garment.patterns.tape import Tape
from garment_sim_ros.garment.patterns.tape_sections import Level, girth_of

HEM, SIDE, WAIST, CROTCH, INSEAM = range(5)
"""Edges of a panel whose side seam is at its +x; mirrored panels have them in reverse order."""
_MIRRORED = {HEM: 0, INSEAM: 1, CROTCH: 2, WAIST: 3, SIDE: 4}
_Points = tuple[tuple[float, float], ...]
_HIP_EASE = 0.09
_WAIST_EASE = 0.015
_LEAST_EASE = 0.03
"""Ease of all girths in between, at least."""
_BULGE = 0.02, 0.16, 0.005
"""How far the side seam's control point is outside of the hips: from, to, step [m], on a person of
1.65 m."""
_DROP = 0.025, 0.08, 0.005
"""How far the crotch is below the body's: from, to, step [m], on a person of 1.65 m."""
_RISE_EASE = 0.02
"""Ease of the seam around the crotch, as a share."""
_MOST = 0.58
"""Largest share of the front, or of the back, in a girth."""
_DRAWN_OUT = {"front": 1.0 / 20.0, "back": 1.0 / 10.0}
"""How far the crotch point is drawn out, as a share of the hips."""
_SLANT = {"front": 0.012, "back": 0.03}
"""How far the middle leans in at the waist [m] on a person of 1.65 m."""
_RISE = {"front": 0.0, "back": 0.04}
"""How much higher the middle is at the waist, likewise."""


def trousers(tape: Tape) -> Pattern:
    """Straight trousers from the waist to the ankles."""
    around = (1.0 + _RISE_EASE) * _around_the_crotch(tape)
    for drop in np.arange(*_DROP) * unit(tape):
        panels = _panels(tape, drop)
        seams = (("left_front", CROTCH), ("right_back", CROTCH))
        if sum(panels[name].lengths[edge] for name, edge in seams) >= around:
            break
    stitches = []
    for side in ("left", "right"):
        for edge in (SIDE, INSEAM):
            stitches.append(
                _sewn((f"{side}_front", edge, side), (f"{side}_back", edge, _other(side)))
            )
    stitches += [
        _sewn(("left_front", CROTCH, "left"), ("right_front", CROTCH, "right")),
        _sewn(("left_back", CROTCH, "right"), ("right_back", CROTCH, "left")),
    ]
    return Pattern(name="trousers", panels=panels, stitches=tuple(stitches))


def _panels(tape: Tape, drop: float) -> dict[str, Panel]:
    """All four, whose crotch is so far below the body's [m]."""
    x_front, x_back = front_and_back(tape, 0.3 * tape.crotch, tape.waist.height)
    panels = {}
    for half, forward, away in (("front", 1.0, x_front), ("back", -1.0, x_back)):
        for side in ("left", "right"):
            # A front's x runs to the wearer's left, a back's to the right.
            outward = (side == "left") == (half == "front")
            name = f"{side}_{half}"
            panels[name] = _panel(name, half, tape, drop, outward, forward, away)
    return panels


def _around_the_crotch(tape: Tape) -> float:
    """From the waist in front, between the legs and up to the waist behind, as a tape lies [m]."""
    levels = [v for v in tape.levels if tape.crotch <= v.height <= tape.waist.height]
    z = [v.height for v in levels]
    points = np.array([[v.front for v in levels] + [v.back for v in levels], z + z]).T
    return girth_of(points) - tape.waist.size[0]


def _panel(
    name: str, half: str, tape: Tape, drop: float, outward: bool, forward: float, away: float
) -> Panel:
    u = unit(tape)
    top, low = tape.waist.height, tape.crotch - drop
    hem = 0.05 * tape.height
    hips = widest(tape, tape.crotch - 0.01, top)
    levels = [v for v in tape.levels if tape.crotch - 0.01 <= v.height <= top] or [tape.hip]
    hip = (1.0 + _HIP_EASE) * max(_part(tape, v, half) for v in levels) / 2.0
    waist = (1.0 + _WAIST_EASE) * _part(tape, tape.waist, half) / 2.0 + STAND_OFF / 4.0
    waist = min(waist, hip)
    out = _DRAWN_OUT[half] * hips
    out = max(out, (1.05 * tape.thigh + 0.03 * u) * (0.5 if half == "front" else 0.56) - hip)
    slant = min(_SLANT[half] * u, hip - waist)
    leg = 0.5 * max(1.25 * tape.ankle + 0.05 * u, 1.0 * tape.knee)
    crease = max(tape.foot_out, 0.5 * (hip - out))
    hip_height = max(tape.hip.height, tape.crotch + 0.3 * (top - tape.crotch))
    corners = np.array(
        [
            [crease - 0.5 * leg, hem],
            [crease + 0.5 * leg, hem],
            [slant + waist, top],
            [slant, top + _RISE[half] * u],
            [-out, low],
        ]
    )
    knee = 0.55 * tape.crotch
    inner: _Points = ((-out + 0.45 * (out + crease - 0.5 * leg), low - 0.25 * (low - knee)),)
    outer = crease + 0.5 * leg
    bend: _Points = ((0.0, low + 0.25 * (top - low)), (0.1 * out, low))
    middle = bezier(np.array([corners[3], *bend, corners[4]]))
    for bulge in np.arange(*_BULGE) * u:
        side: _Points = ((outer + 0.02 * u, knee), (hip + bulge, hip_height + 0.02 * u))
        if _has_room(tape, half, top, middle, bezier(np.array([corners[1], *side, corners[2]]))):
            break
    curves = {SIDE: side, CROTCH: bend, INSEAM: inner}
    labels = ("hem", "side", "waist", "crotch", "inseam")
    if not outward:
        corners = corners[[1, 0, 4, 3, 2]] * [-1.0, 1.0]
        curves = {
            _MIRRORED[e]: tuple((-x, y) for x, y in reversed(points))
            for e, points in curves.items()
        }
        labels = ("hem", "inseam", "crotch", "waist", "side")
    edges = loop(
        corners,
        **{f"e{k}": {"controls": curves.get(k, ()), "label": labels[k]} for k in range(5)},
    )
    T = facing(tape, forward, away + (0.008 * forward if outward else 0.0))
    return Panel(
        name=name,
        corners=corners,
        edges=edges,
        placement=Placement(T_world_panel=T),
        label="leg",
    )


def _part(tape: Tape, level: Level, half: str) -> float:
    """Length of the front or back of a girth, before or behind the middle of the hips [m]."""
    ahead = level.before(tape.hip.centre[0]) / level.girth
    ahead = float(np.clip(ahead, 1.0 - _MOST, _MOST))
    return level.girth * (ahead if half == "front" else 1.0 - ahead)


def _has_room(tape: Tape, half: str, top: float, middle: FloatArray, side: FloatArray) -> bool:
    """Whether a panel is as wide as half of the front or back from the crotch to the waist.

    Args:
        tape: The body.
        half: "front" or "back".
        top: Height of the waist [m].
        middle: The crotch seam from the waist down [m], shape [n, 2].
        side: The side seam from the hem up, likewise.
    """
    levels = [v for v in tape.levels if tape.crotch < v.height < top]
    z = np.array([v.height for v in levels])
    inner = np.interp(z, middle[::-1, 1], middle[::-1, 0])
    width = np.interp(z, side[:, 1], side[:, 0]) - np.maximum(inner, 0.0)
    least = 0.5 * (1.0 + _LEAST_EASE) * np.array([_part(tape, v, half) for v in levels])
    return bool((width[z < top - 0.02] >= least[z < top - 0.02]).all())


def _other(side: str) -> str:
    return "right" if side == "left" else "left"


def _sewn(a: tuple[str, int, str], b: tuple[str, int, str]) -> Stitch:
    """A stitch of panels whose side seams are at +x ("left") or at -x ("right")."""
    one, other = (
        (Seam(panel=name, edges=(edge if side == "left" else _MIRRORED[edge],)),)
        for name, edge, side in (a, b)
    )
    return Stitch(sides=(one, other))
