"""Skirts: a front and a back with a dart in each half, flared from the hips.

The construction is that of Aldrich's A-line skirt in "Metric Pattern Cutting": a quarter of the
hips with ease and a quarter of the waist, the difference taken out at the side and in a dart, and
the side seam let out towards the hem. The formulas are our own.
"""

import numpy as np

from garment_sim_ros.garment.patterns.drafts.upper import (
    STAND_OFF,
    facing,
    front_and_back,
    unit,
    widest,
)
from garment_sim_ros.garment.patterns.pattern import Edge, Panel, Pattern, Placement, Seam, Stitch
from garment_sim_ros.garment.patterns.tape import Tape

_HIP_EASE = 0.04
"""Ease of the hips, as a share."""
_WAIST_EASE = 0.01
"""Likewise of the waist."""
_AT_SIDE = 0.45
"""Part of what waist and hips differ by that the side seam takes; the darts take the rest."""
_DART = {"front": 0.45, "back": 0.6}
"""Length of the darts, as a share of the way from waist to hips."""


def short_skirt(tape: Tape) -> Pattern:
    """An A-line skirt that ends above the knees."""
    return _skirt("short_skirt", tape, hem=0.7 * tape.crotch, flare=0.35)


def long_skirt(tape: Tape) -> Pattern:
    """An A-line skirt that ends above the feet."""
    return _skirt("long_skirt", tape, hem=0.085 * tape.height, flare=0.15)


def _skirt(name: str, tape: Tape, hem: float, flare: float) -> Pattern:
    x_front, x_back = front_and_back(tape, tape.crotch, tape.waist.height)
    panels = {
        "front": _panel("front", tape, hem, flare, 1.0, x_front),
        "back": _panel("back", tape, hem, flare, -1.0, x_back),
    }
    left, right = _SIDES
    stitches = [
        _sewn(("front", left), ("back", right)),
        _sewn(("front", right), ("back", left)),
    ]
    for panel in panels:
        stitches += [_sewn((panel, a), (panel, b)) for a, b in _DART_EDGES]
    return Pattern(name=name, panels=panels, stitches=tuple(stitches))


_SIDES = (1, 9)
"""Edges on the panel's +x and -x."""
_DART_EDGES = ((3, 4), (6, 7))


def _panel(name: str, tape: Tape, hem: float, flare: float, forward: float, away: float) -> Panel:
    u = unit(tape)
    top = tape.waist.height
    hip_height = tape.hip.height
    low = min(hip_height, top - 0.12 * u)
    hip = (1.0 + _HIP_EASE) * widest(tape, low - 0.02, top) / 4.0
    waist = ((1.0 + _WAIST_EASE) * tape.waist.girth + STAND_OFF) / 4.0
    spare = max(hip - waist, 0.0)
    dart = (1.0 - _AT_SIDE) * spare
    side = waist + dart
    fall = top - low
    wide = hip + flare * (low - hem)
    slant = np.arctan(flare)
    rise = (low - hem) * (1.0 - np.cos(slant))
    tip = top - _DART[name] * fall
    at, half = 0.5 * waist, 0.5 * dart
    lift = min(0.008 * u, 0.2 * fall)
    corners = np.array(
        [
            *([-wide, hem + rise], [wide, hem + rise], [side, top + lift]),
            *([at + half * 2.0, top + 0.5 * lift], [at + half, tip], [at, top + 0.4 * lift]),
            *([-at, top + 0.4 * lift], [-at - half, tip], [-at - half * 2.0, top + 0.5 * lift]),
            [-side, top + lift],
        ]
    )
    # Both sides of a dart are as long as each other.
    for inner, point, outer in ((5, 4, 3), (6, 7, 8)):
        length = np.linalg.norm(corners[outer] - corners[point])
        way = corners[inner] - corners[point]
        corners[inner] = corners[point] + way * length / np.linalg.norm(way)
    bulge = (hip + 0.25 * (hip - side), low + 0.45 * fall)
    labels = ("hem", "side", "waist", "dart", "dart", "waist", "dart", "dart", "waist", "side")
    curves = {
        0: ((0.0, hem - rise),),
        1: (_past(wide, hem + rise, hip, low), bulge),
        9: (
            (-bulge[0], bulge[1]),
            (-_past(wide, hem, hip, low)[0], _past(wide, hem, hip, low)[1]),
        ),
    }
    edges = tuple(
        Edge(start=i, end=(i + 1) % 10, controls=curves.get(i, ()), label=labels[i])
        for i in range(10)
    )
    return Panel(
        name=name,
        corners=corners,
        edges=edges,
        placement=Placement(T_world_panel=facing(tape, forward, away)),
        label="leg",
    )


def _past(wide: float, hem: float, hip: float, low: float) -> tuple[float, float]:
    """The control point on the side's straight lower part."""
    return (wide + 0.75 * (hip - wide), hem + 0.75 * (low - hem))


def _sewn(a: tuple[str, int], b: tuple[str, int]) -> Stitch:
    return Stitch(sides=((Seam(panel=a[0], edges=(a[1],)),), (Seam(panel=b[0], edges=(b[1],)),)))
