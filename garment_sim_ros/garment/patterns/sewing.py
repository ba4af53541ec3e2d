"""From placed panels to a garment at rest on a body, by the simulation that wears it later.

As Sun et al. 2007 have it: flat pieces are placed around the body and sewn by collision in
micro-gravity, then left to drape. Three phases, each a `Simulation` on the body's colliders:

1. all stitches close at an even pace (`sim.holds.stitching`), hardly any weight, air that brakes;
2. vertices that met are made one, so that a seam has no vertex of one side only; what is tucked
   into itself is laid smooth (`ironing`); the garment comes to rest in micro-gravity;
3. gravity acts, until the garment is at rest: by kinetic damping first, then with none but the
   fabric's own.
"""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.patterns.ironing import ironed, self_intersections
from garment_sim_ros.garment.patterns.pattern import WAIST
from garment_sim_ros.garment.patterns.pieces import Pieces
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import Material
from garment_sim_ros.sim.holds.stitching import CLOSING, LATEST
from garment_sim_ros.sim.self_collision.garment import own_distance
from garment_sim_ros.sim.simulation import Simulation

_MICRO = (0.0, 0.0, -0.5)
"""Gravity while it is sewn [m/s^2]."""
_DRAG = 3.0
"""Drag of the air meanwhile [kg/(m^2 s)]."""
_SLIP = 0.02
"""Friction meanwhile: whoever dresses somebody pulls the cloth straight."""
_STEP = 1 / 60
_NAME = "sewn"
_JOINING = 60
"""Steps in micro-gravity in which the sewn garment comes free of itself."""
_AFTER = 0.3
"""Time after the stitches have closed in which the cloth calms down [s]."""
_MEETS = 5e-4
"""Distance at which stitched vertices have met [m]."""
_LONGEST_SEWING = 4.0
_QUIET = 0.01
"""RMS speed of a garment at rest [m/s]."""
_FALLING = 0.5
"""Speed at which a panel has come off the body, or a garment will not come to rest [m/s]."""
_LONGEST_QUIET = 4.0
"""Longest time that a garment may take to come to rest after it was settled [s]."""
_WATCHED = 0.5
"""Time over which the rest is measured [s]."""
_ROUNDS = 3
"""How often it is laid smooth and settled at most."""
_MOST_TANGLED = 0.05
"""Share of edges that may run through the garment once it moved freely: more is no garment."""
_THIN = 5e-4
"""Distance that cloth keeps from itself while it drapes [m]: more makes pinched cloth quiver."""
DRAPING: Mapping[str, Any] = MappingProxyType({"preset": "accurate", "search_every": 3})
"""How garments drape. Fine steps let knits stretch by a sixth less: as much as they do. Contacts
are searched for often, which costs little here: wide dresses come to rest sooner."""

Tell = Callable[[str, float], None]
"""Is told the phase and how much of it is done, 0 to 1."""


def _silent(phase: str, share: float) -> None:
    """Tells nobody."""


@dataclass(frozen=True, kw_only=True)
class Sewn:
    """A garment that was sewn on a body.

    Attributes:
        vertices: At rest on the body [m], shape [v, 3].
        shown: The same over what of the body is between them [m], shape [v, 3].
        triangles: Shape [t, 3].
        flat: Weft and warp of the triangles' corners [m], shape [t, 3, 2].
        placed: The panels before, each with vertices of its own [m], shape [n, 3].
        closed: The same when the stitches had closed [m], shape [n, 3].
        gaps: Largest distance of vertices from their common place, of each of the pattern's
            stitches [m].
        rms_speed: At rest [m/s].
        max_speed: Likewise, of the fastest vertex [m/s].
    """

    vertices: FloatArray
    shown: FloatArray
    triangles: IntArray
    flat: FloatArray
    placed: FloatArray
    closed: FloatArray
    gaps: tuple[float, ...]
    rms_speed: float
    max_speed: float


class Wearer(Protocol):
    """The body, which stands still; see `making.Model`."""

    @property
    def colliders(self) -> ColliderSet:
        """What garments lie on."""

    @property
    def poses(self) -> ColliderPoses:
        """Where they are."""

    def garment(self, vertices: FloatArray, triangles: IntArray, material: Material) -> Garment:
        """A surface around it that follows it."""


def sew(
    pieces: Pieces,
    placed: FloatArray,
    wearer: Wearer,
    material: Material,
    *,
    tell: Tell = _silent,
) -> Sewn:
    """Sews a pattern that is placed clear of the body, and lets it drape.

    Args:
        pieces: The cut pattern.
        placed: Where its vertices start, clear of the body [m], shape [n, 3].
        wearer: The body.
        material: The fabric.
        tell: Is told the phase and how far it is.

    Raises:
        GeometryError: A seam does not close, a panel falls off the body, or the garment does not
            come to rest or free of itself.
    """
    closed = _close(pieces, placed, wearer, material, tell)
    gaps = seam_gaps(pieces, closed)
    _check_closed(pieces, gaps)
    x = _joined(pieces, closed, wearer, material, tell)
    _check_free(pieces, x)
    x, shown, rms, fastest = _draped(pieces, x, wearer, material, tell)
    return Sewn(
        vertices=x,
        shown=shown,
        triangles=pieces.sewn_triangles,
        flat=pieces.corners,
        placed=placed,
        closed=closed,
        gaps=gaps,
        rms_speed=rms,
        max_speed=fastest,
    )


def _draped(
    pieces: Pieces, x: FloatArray, wearer: Wearer, material: Material, tell: Tell
) -> tuple[FloatArray, FloatArray, float, float]:
    """The garment at rest and as it is shown [m], shape [v, 3]; RMS and highest speed [m/s]."""
    shown, rms, fastest = x, np.inf, np.inf
    for n in range(_ROUNDS):
        tell("draping", n / _ROUNDS)
        x = ironed(x, pieces.sewn_triangles)
        whole = replace(_whole(pieces, x, wearer, material), self_collision=_THIN)
        simulation = Simulation(_banded(pieces, whole), wearer.colliders, **DRAPING)
        simulation.reset(wearer.poses)
        x, rms, fastest, sinking = _come_to_rest(simulation, wearer.poses)
        shown = simulation[_NAME].positions.astype(np.float64)
        _check_worn(pieces, rms, sinking)
        if not len(self_intersections(x, pieces.sewn_triangles)):
            break
    tell("draping", 1.0)
    return x, shown, rms, fastest


def _whole(pieces: Pieces, x: FloatArray, wearer: Wearer, material: Material) -> Garment:
    """The sewn garment, which does not pass through itself."""
    triangles = pieces.sewn_triangles
    apart = own_distance(x, triangles, material)
    return replace(
        wearer.garment(x, triangles, material),
        name=_NAME,
        flat=pieces.corners,
        self_collision=apart,
    )


def _waist(pieces: Pieces) -> IntArray:
    """Vertices of the sewn garment that a band holds, shape [n]."""
    labels = [[e.label for e in panel.edges] for panel in pieces.pattern.panels.values()]
    band = [
        n
        for n, (panel, edge) in enumerate(zip(pieces.panel, pieces.edge, strict=True))
        if edge >= 0 and labels[panel][edge] == WAIST
    ]
    return np.unique(pieces.welded[band]).astype(np.int32)


def _banded(pieces: Pieces, whole: Garment) -> Garment:
    """The garment with its waist held as a band holds it: where it was sewn around the body."""
    pins = _waist(pieces)
    return replace(whole, pins=pins, pin_frame=np.zeros(len(pins), np.int32))


def _joined(
    pieces: Pieces, closed: FloatArray, wearer: Wearer, material: Material, tell: Tell
) -> FloatArray:
    """The sewn garment after some time in micro-gravity [m], shape [v, 3]."""
    slow = replace(material, air_drag=_DRAG, friction=_SLIP)
    x = ironed(pieces.joined(closed), pieces.sewn_triangles)
    whole = _banded(pieces, _whole(pieces, x, wearer, slow))
    simulation = Simulation(whole, wearer.colliders, gravity=_MICRO)
    tell("joining", 0.0)
    simulation.reset(wearer.poses, settle=False)
    for n in range(_JOINING):
        simulation.advance(wearer.poses, wearer.poses, _STEP)
        tell("joining", (n + 1) / _JOINING)
    return _positions(simulation)


def _positions(simulation: Simulation) -> FloatArray:
    """Where its vertices are, not where they are shown: at a seam, one side farther out."""
    return simulation[_NAME].simulated.astype(np.float64)


def seam_gaps(pieces: Pieces, x: FloatArray) -> tuple[float, ...]:
    """Largest distance between vertices that are sewn to each other, for each stitch [m]."""
    return tuple(
        float(np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1).max(initial=0.0))
        for pairs in pieces.seams
    )


def _close(
    pieces: Pieces, placed: FloatArray, wearer: Wearer, material: Material, tell: Tell
) -> FloatArray:
    """The panels when all their stitches have closed [m], shape [n, 3]."""
    slow = replace(material, air_drag=_DRAG)
    if not len(_waist(pieces)):  # what has one would slip off it before it is a band
        slow = replace(slow, friction=_SLIP)
    panels = replace(
        wearer.garment(placed, pieces.triangles, slow),
        name=_NAME,
        flat=pieces.corners,
        stitches=pieces.stitches,
    )
    simulation = Simulation(panels, wearer.colliders, gravity=_MICRO)
    tell("sewing", 0.0)
    simulation.reset(wearer.poses, settle=False)
    least = round((CLOSING + LATEST + _AFTER) / _STEP)
    x = placed
    for n in range(round(_LONGEST_SEWING / _STEP)):
        simulation.advance(wearer.poses, wearer.poses, _STEP)
        tell("sewing", min(1.0, (n + 1) / least))
        if n + 1 < least:
            continue
        x = _positions(simulation)
        if max(seam_gaps(pieces, x), default=0.0) < _MEETS:
            break
    return x


def _check_closed(pieces: Pieces, gaps: tuple[float, ...]) -> None:
    worst = int(np.argmax(gaps)) if gaps else -1
    if worst >= 0 and not gaps[worst] < 10.0 * _MEETS:
        raise GeometryError(
            f"pattern {pieces.pattern.name!r}: the seam {pieces.pattern.stitches[worst]} does not "
            f"close: {1e3 * gaps[worst]:.1f} mm are left; allowed: panels wide enough to meet "
            "around the body"
        )


def _check_free(pieces: Pieces, x: FloatArray) -> None:
    """What is sewn the wrong way round is twisted, and does not come free of itself."""
    triangles = pieces.sewn_triangles
    tangled = self_intersections(x, triangles)
    count = len(mesh_topology(triangles).edges)
    if len(tangled) <= _MOST_TANGLED * count:
        return
    own = pieces.panel[np.isin(pieces.welded, tangled)]
    most = np.argsort(-np.bincount(own), kind="stable")[:2]
    names = " and ".join(repr([*pieces.pattern.panels][k]) for k in most if (own == k).any())
    raise GeometryError(
        f"pattern {pieces.pattern.name!r} runs through itself where it is sewn, at "
        f"{len(tangled)} of {count} edges, most of them of panel {names}; allowed: up to "
        f"{100.0 * _MOST_TANGLED:.0f} % (sides of stitches swapped, too "
        "narrow for the body, or another unit of length?)"
    )


def _check_worn(pieces: Pieces, rms: float, sinking: FloatArray) -> None:
    name = f"pattern {pieces.pattern.name!r}"
    panels = [*pieces.pattern.panels]
    speeds = [sinking[pieces.welded[pieces.panel == k]].mean() for k in range(len(panels))]
    first = int(np.argmax(speeds))
    if speeds[first] > _FALLING:
        raise GeometryError(
            f"{name}: panel {panels[first]!r} falls off the body at {speeds[first]:.1f} m/s; "
            "allowed: what shoulders or hips hold, is sewn to that, or has edges labelled "
            f"{WAIST!r} (another unit of length, or another body?)"
        )
    if rms > _FALLING:
        raise GeometryError(
            f"{name} does not come to rest: it moves at {rms:.1f} m/s; allowed: sides of stitches "
            "of about the same length, panels that fit the body"
        )


def _come_to_rest(
    simulation: Simulation, poses: ColliderPoses
) -> tuple[FloatArray, float, float, FloatArray]:
    """Lets the garment move as it will until it does not.

    Returns:
        Where it is then [m], shape [v, 3]; its highest RMS speed in the last while, from frame to
        frame, and that of the fastest vertex [m/s]; how fast each vertex sank meanwhile [m/s],
        shape [v].
    """
    watched = round(_WATCHED / _STEP)
    speeds: list[tuple[float, float]] = []
    path = deque([_positions(simulation)], maxlen=watched + 1)
    for _ in range(round(_LONGEST_QUIET / _STEP)):
        simulation.advance(poses, poses, _STEP)
        path.append(_positions(simulation))
        # What quivers within a step, pinched, and stays where it is, is at rest.
        speed = np.linalg.norm(path[-1] - path[-2], axis=1) / _STEP
        speeds.append((float(np.sqrt((speed**2).mean())), float(speed.max())))
        if len(speeds) >= watched and max(rms for rms, _ in speeds[-watched:]) < _QUIET:
            break
    rms, fastest = np.max(speeds[-watched:], axis=0)
    sinking = (path[0] - path[-1])[:, 2] / _WATCHED
    return path[-1], float(rms), float(fastest), sinking
