"""Pieces of garments for the upper body: trunk panels with armholes, and sleeves.

The construction is that of flat blocks, as Aldrich teaches it in "Metric Pattern Cutting" (the
easy-fitting and T-shirt blocks): a rectangle of half the bust with ease, an armhole from the
shoulder point down to a little below the armpit, a straight shoulder that falls as the body's
does, and a sleeve whose crown is as long as both armholes together. The formulas are our own:
what a table of sizes gives there, a measurement of this body gives here.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.constants import PERSON_HEIGHT
from garment_sim_ros.garment.patterns.curves import bezier, lengths
from garment_sim_ros.garment.patterns.pattern import Edge, Joint, Panel, Placement, loop
from garment_sim_ros.garment.patterns.tape import Tape
from garment_sim_ros.garment.patterns.tape_arms import Arm

HEM, SIDE_LEFT, ARM_LEFT, SHOULDER_LEFT, NECK, SHOULDER_RIGHT, ARM_RIGHT, SIDE_RIGHT = range(8)
"""Edges of a trunk panel; left and right are those of its own x: right is +x."""
CUFF, UNDER_PLUS, CROWN_PLUS, CROWN_MINUS, UNDER_MINUS = range(5)
"""Edges of a sleeve; plus and minus are those of its own x."""
_GAP = 0.06
"""Distance from the body at which panels are drawn, before they are moved clear [m]."""
_ROUND = 0.025
"""Distance of a rolled sleeve from its arm [m]."""
STAND_OFF = 0.02
"""Room that cloth of a few millimetres needs around a body, in the length of a girth [m]."""
_OPEN = 0.06
"""Part of the way round an arm that a sleeve leaves open until it is sewn."""


@dataclass(frozen=True, kw_only=True)
class Trunk:
    """Sizes of a trunk panel, half of it, heights over the ground [m].

    Attributes:
        hem: Height of the hem, and half its width.
        chest: Height of the underarm point, and half the width there.
        shoulder: Height of the shoulder's end, and half the width there.
        neck: Height of the shoulder at the neck, and half the neck's width.
        neck_depth: Depth of the neckline in the middle.
        hollow: How far the armhole cuts in behind the shoulder's end.
        waist: Height of the waist, and half the width there; None: the side is straight.
        hem_rise: How much higher the hem is at the sides than in the middle: slanting sides are
            longer.
    """

    hem: tuple[float, float]
    chest: tuple[float, float]
    shoulder: tuple[float, float]
    neck: tuple[float, float]
    neck_depth: float
    hollow: float
    waist: tuple[float, float] | None = None
    hem_rise: float = 0.0


def unit(tape: Tape) -> float:
    """A metre on a person of 1.65 m: eases scale with the wearer."""
    return tape.height / PERSON_HEIGHT


def facing(tape: Tape, forward: float, away: float) -> FloatArray:
    """A panel's plane in front of the body (forward 1) or behind it (-1), shape [4, 4].

    Its y is the height over the ground, its x across runs to the wearer's left in front.

    Args:
        tape: The body.
        forward: 1 or -1.
        away: The plane's x [m].
    """
    T = np.eye(4)
    T[:3, :3] = np.column_stack([[0.0, forward, 0.0], [0.0, 0.0, 1.0], [forward, 0.0, 0.0]])
    T[:3, 3] = [away, tape.waist.centre[1], tape.floor]
    return T


def front_and_back(tape: Tape, low: float, high: float) -> tuple[float, float]:
    """Where panels over a range of heights are drawn: an x in front, and one behind [m]."""
    levels = [v for v in tape.levels if low - 0.02 <= v.height <= high + 0.02] or [tape.waist]
    return max(v.front for v in levels) + _GAP, min(v.back for v in levels) - _GAP


def widest(tape: Tape, low: float, high: float) -> float:
    """Largest girth of the trunk between two heights [m]."""
    return max((v.girth for v in tape.levels if low <= v.height <= high), default=tape.hip.girth)


def trunk_panel(name: str, size: Trunk, T_world_panel: FloatArray) -> Panel:
    """A front or back, whole, symmetric about its x = 0."""
    h, c, s, n = size.hem, size.chest, size.shoulder, size.neck
    side_hem = h[0] + size.hem_rise
    below: tuple[tuple[float, float], ...] = ()
    if size.hem_rise > 0.0:
        below = ((0.0, h[0] - size.hem_rise),)
    corners = np.array(
        [
            *([-h[1], side_hem], [h[1], side_hem], [c[1], c[0]], [s[1], s[0]]),
            *([n[1], n[0]], [-n[1], n[0]], [-s[1], s[0]], [-c[1], c[0]]),
        ]
    )
    inner = s[1] - size.hollow
    down = s[0] - 0.6 * (s[0] - c[0])
    right = [(inner, c[0]), (inner, down)]
    left = [(-x, y) for x, y in reversed(right)]
    bottom = n[0] - 4.0 / 3.0 * size.neck_depth  # of a cubic: its middle is at neck_depth
    side_right: list[tuple[float, float]] = []
    side_left: list[tuple[float, float]] = []
    if size.waist is not None:
        z, w = size.waist
        through = (2.0 * w - 0.5 * (h[1] + c[1]), 2.0 * z - 0.5 * (h[0] + c[0]))
        side_right, side_left = [through], [(-through[0], through[1])]
    edges = loop(
        corners,
        e0={"controls": below, "label": "hem"},
        e1={"controls": tuple(side_right), "label": "side"},
        e2={"controls": tuple(right), "label": "armhole"},
        e3={"label": "shoulder"},
        e4={"controls": ((n[1] * 0.85, bottom), (-n[1] * 0.85, bottom)), "label": "neck"},
        e5={"label": "shoulder"},
        e6={"controls": tuple(left), "label": "armhole"},
        e7={"controls": tuple(side_left), "label": "side"},
    )
    return Panel(
        name=name,
        corners=corners,
        edges=edges,
        placement=Placement(T_world_panel=T_world_panel),
        label="body",
    )


def sleeve_panel(
    name: str, arm: Arm, crown: float, width: float, length: float, cuff: float
) -> Panel:
    """A sleeve in one piece, rolled about an arm, its seam below.

    Args:
        name: The panel's name.
        arm: The arm.
        crown: Length of the crown: of both armholes together [m].
        width: Width at the underarm [m].
        length: From the crown's top to the cuff [m].
        cuff: Width at the cuff [m].
    """
    rise = crown_height(crown, width)
    half, hem = 0.5 * width, 0.5 * cuff
    low = min(rise - length, -0.02)
    corners = np.array([[-hem, low], [hem, low], [half, 0.0], [0.0, rise], [-half, 0.0]])
    up = _crown_controls(half, rise)
    edges = loop(
        corners,
        e0={"label": "cuff"},
        e1={"label": "underarm"},
        e2={"controls": up, "label": "crown"},
        e3={"controls": tuple((-x, y) for x, y in reversed(up)), "label": "crown"},
        e4={"label": "underarm"},
    )
    radius = max(width / (2.0 * np.pi * (1.0 - _OPEN)), arm.upper / (2.0 * np.pi) + _ROUND)
    along = -arm.direction
    out = np.array([0.0, 0.0, 1.0]) - along[2] * along
    out /= np.linalg.norm(out)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([np.cross(along, out), along, out])
    T[:3, 3] = arm.shoulder + rise * arm.direction + radius * out
    return Panel(
        name=name,
        corners=corners,
        edges=edges,
        placement=Placement(T_world_panel=T, bend=radius, joint=_elbow(arm, rise, T[:3, :3])),
        label="arm",
    )


def _elbow(arm: Arm, rise: float, R_world_panel: FloatArray) -> Joint:
    """Where a sleeve turns, whose crown's top is at the shoulder, `rise` up its y."""
    turn = bent(arm)
    far = float(np.linalg.norm(arm.elbow - arm.shoulder))
    return Joint(y=rise - far, turn=R_world_panel.T @ turn)


def bent(arm: Arm) -> FloatArray:
    """The turn at the elbow: an axis as long as its angle [rad], shape [3]."""
    fore = arm.wrist_place - arm.elbow
    fore /= np.linalg.norm(fore)
    turn: FloatArray = np.cross(arm.direction, fore)
    sine = float(np.linalg.norm(turn))
    if sine > 0.0:
        turn *= np.arctan2(sine, float(arm.direction @ fore)) / sine
    return turn


def _crown_controls(half: float, rise: float) -> tuple[tuple[float, float], ...]:
    """Control points from the underarm point to the crown's top."""
    return ((0.6 * half, 0.02 * rise), (0.5 * half, rise))


def _crown_length(half: float, rise: float) -> float:
    points = np.array([[half, 0.0], *_crown_controls(half, rise), [0.0, rise]])
    return 2.0 * float(lengths(bezier(points))[-1])


def crown_height(crown: float, width: float) -> float:
    """Height of a crown of this length over this width [m]; a flat one where it is too short."""
    half = 0.5 * width
    low, high = 0.02 * width, 3.0 * crown
    if _crown_length(half, low) >= crown:
        return low
    return float(brentq(lambda rise: _crown_length(half, rise) - crown, low, high))


def armhole(panel: Panel) -> float:
    """Length of one armhole of a trunk panel [m]."""
    return float(panel.lengths[ARM_LEFT])


def edge_of(panel: Panel, label: str) -> tuple[Edge, ...]:
    """Edges of a panel with a label."""
    return tuple(edge for edge in panel.edges if edge.label == label)
