"""Panels around a body before they are sewn: none touches it, each faces outwards."""

from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.pattern import WAIST, Panel, Placement
from garment_sim_ros.garment.patterns.pieces import Pieces
from garment_sim_ros.garment.patterns.turning_over import INWARDS, facing
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import vertex_normals

CLEARANCE = 0.02
"""Distance that flat panels keep from the body at the start [m]."""
_ROLLED = 0.01
"""Distance that rolled ones keep, which are all around a limb [m]."""
_ON_WAY = 9
"""Places on the way between two sewn vertices that are looked at."""
_LEVEL = 0.03
"""Seams within this height are one level [m]."""
_HIGHEST, _LIFT_STEP = 0.12, 0.01
"""How far panels are lifted at most, and in which steps [m]."""
_OVER = 0.008
"""Distance from the skin that ways keep [m]."""
_STEPS = 60
_PUSHES = 3
_FARTHEST = 0.8
"""How far a panel is moved at most [m]."""
_FARTHEST_ALONG = 0.3
"""How far a rolled panel is moved along its limb at most [m]."""
_FARTHEST_BELT = 0.05
"""Likewise one with a waist, which is around the trunk [m]."""


def placed_clear(pieces: Pieces, body: MeshDistance, body_name: str) -> tuple[Pieces, FloatArray]:
    """The pieces with every panel moved out until it is clear of the body.

    A flat panel moves along its outside, a rolled one along the limb that it is rolled around,
    away from the trunk. All of them are then lifted as far as it takes for what is sewn to meet
    over the body, not through it: the shoulder seams of a front and a back come together above
    the shoulders.

    Args:
        pieces: The cut pattern.
        body: The skin that they must not touch.
        body_name: What messages call it.

    Returns:
        The pieces, and where their vertices start [m], shape [n, 3].

    Raises:
        GeometryError: A panel faces the body with the wrong side, or does not come clear of it;
            the message names it.
    """
    pattern = pieces.pattern
    panels = {}
    x = pieces.placed()
    for k, (name, panel) in enumerate(pattern.panels.items()):
        own = pieces.panel == k
        triangles = pieces.triangles[own[pieces.triangles[:, 0]]] - int(np.flatnonzero(own)[0])
        what = f"pattern {pattern.name!r}: panel {name!r}"
        if not panel.folded:
            _check_side(what, x[own], triangles, body, body_name)
        if panel.placement.rolled:
            place = _down_the_limb(what, panel, pieces.flat[own], body, body_name)
        else:
            place = panel.placement.moved(_way_out(what, panel, x[own], body, body_name))
        panels[name] = replace(panel, placement=place)
    clear = pieces.with_pattern(replace(pattern, panels=panels))
    clear = _raised(clear, _lift(clear, body))
    return clear, _pushed_out(clear.placed(), body)


def _pushed_out(x: FloatArray, body: MeshDistance) -> FloatArray:
    """Points, those that are still in the body or too near to it moved out [m], shape [n, 3].

    What is rolled around an arm may be too close for a thumb or the root of the arm.
    """
    for _ in range(_PUSHES):
        gap, closest, _ = body.signed_distance(x)
        near = gap < 0.5 * _ROLLED
        if not near.any():
            break
        out = (x[near] - closest[near]) * np.sign(gap[near])[:, None]
        out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
        x = x.copy()
        x[near] = closest[near] + _ROLLED * out
    return x


def _raised(pieces: Pieces, lift: float) -> Pieces:
    """The pieces so much higher [m]; what is rolled around a limb stays around it."""
    panels = {
        name: panel
        if panel.placement.rolled
        else replace(panel, placement=panel.placement.moved(np.array([0.0, 0.0, lift])))
        for name, panel in pieces.pattern.panels.items()
    }
    return pieces.with_pattern(replace(pieces.pattern, panels=panels))


def _down_the_limb(
    what: str, panel: Panel, flat: FloatArray, body: MeshDistance, body_name: str
) -> Placement:
    """Where a rolled panel is clear of the trunk, as near to it as it can be.

    Where a hand or foot is wider than the roll no place is clear: then the one where the fewest
    points are in the body. What has a waist stays at the waist.

    Raises:
        GeometryError: A waist that would have to be moved down.
    """
    place = panel.placement
    ways = np.arange(0.0, _FARTHEST_ALONG, _LIFT_STEP)
    blocked = [
        int((body.signed_distance(place.along(way).placed(flat))[0] < _ROLLED).sum())
        for way in ways
    ]
    way = float(ways[int(np.argmin(blocked))])
    if way > _FARTHEST_BELT and any(e.label == WAIST for e in panel.edges):
        raise GeometryError(
            f"{what}, rolled to {2.0 * np.pi * place.bend:.3g} m around, comes clear of "
            f"{body_name} only {way:.2g} m lower, and has edges labelled {WAIST!r}; allowed: "
            "wider than what it is placed around"
        )
    return place.along(way)


def _lift(pieces: Pieces, body: MeshDistance) -> float:
    """The least height at which the highest seams of fronts to backs meet over the body [m].

    Of the heights at which as few of their ways as can be are in the body, the least.
    """
    pairs = _on_top(pieces)
    if not len(pairs):
        return 0.0
    shares = np.linspace(0.0, 1.0, _ON_WAY + 2)[1:-1, None, None]
    lifts = np.arange(0.0, _HIGHEST + 1e-9, _LIFT_STEP)
    blocked = []
    for lift in lifts:
        x = _raised(pieces, lift).placed()
        a, b = x[pairs[:, 0]], x[pairs[:, 1]]
        ways = ((1.0 - shares) * a + shares * b).reshape(-1, 3)
        inside = body.signed_distance(ways)[0].reshape(_ON_WAY, -1) < _OVER
        blocked.append(int(inside.any(axis=0).sum()))
    return float(lifts[int(np.argmin(blocked))])


def _on_top(pieces: Pieces) -> IntArray:
    """Pairs of sewn vertices of the highest seams between panels that face opposite ways."""
    normal = [p.outwards for p in pieces.pattern.panels.values()]
    x = pieces.placed()
    found = []
    for pairs in pieces.seams:
        a, b = (normal[pieces.panel[pairs[0, side]]] for side in (0, 1))
        if a @ b < -0.5:
            found.append((float(x[pairs, 2].mean()), pairs))
    if not found:
        return np.zeros((0, 2), np.int32)
    top = max(height for height, _ in found)
    return np.concatenate([pairs for height, pairs in found if height > top - _LEVEL])


def _check_side(
    what: str, x: FloatArray, triangles: FloatArray, body: MeshDistance, body_name: str
) -> None:
    normal = np.zeros_like(x)
    vertex_normals(x, np.ascontiguousarray(triangles, np.int32), normal)
    if facing(x, normal, body) < INWARDS:
        raise GeometryError(
            f"{what} is mirrored: its right side faces {body_name}; allowed: right sides outwards "
            "(before the body drawn counter-clockwise; behind it clockwise, or turned by 180 "
            "degrees about the vertical)"
        )


def _way_out(
    what: str, panel: Panel, x: FloatArray, body: MeshDistance, body_name: str
) -> FloatArray:
    """How far to move a panel [m], shape [3]."""
    direction, clear = panel.outwards, CLEARANCE
    # What is farther away than it need be has a longer way to go as it is sewn.
    moved = min(0.0, clear - float(body.signed_distance(x)[0].min()))
    for _ in range(_STEPS):
        gap = float(body.signed_distance(x + moved * direction)[0].min())
        if gap >= clear:
            return moved * direction
        moved += max(clear - gap, 0.005)
        if moved > _FARTHEST:
            break
    raise GeometryError(
        f"{what} does not come clear of {body_name} within {_FARTHEST:g} m; allowed: a place "
        "beside the body"
    )
