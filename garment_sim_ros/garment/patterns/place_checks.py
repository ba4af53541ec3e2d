"""Whether a pattern is for a body, by where its pieces start: before anything is sewn."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.pattern import WAIST, Pattern
from garment_sim_ros.garment.patterns.pieces import Pieces
from garment_sim_ros.garment.patterns.tape_sections import girth_of, loops_at, trunk_of
from garment_sim_ros.geometry.mesh_distance import MeshDistance

_TOO_FAR = 1.0
"""Distance from the body at which a panel is not beside it [m]."""
_OVER_HEAD = 0.25
"""How far a panel may reach over the head, in heights of the body."""
_LOOSEST = 1.3
"""Longest band that holds, in girths of the body where it starts: others stand off all around."""
_SECTIONS = 32
"""Places at which the way of a stitch is looked at."""
_IN_SKIN = 0.005
"""Depth from which such a place is in the body [m]."""
_MOST_IN_BODY = 0.2
"""Share of the ways of a seam that may be in the body, the median of its stitches."""
_ASKEW = 0.5
"""Sine of the angle between such a way and the way out of the panel from which it leads aside."""


def check_near(pattern: Pattern, body: MeshDistance, skin: FloatArray, body_name: str) -> None:
    """Sees whether all panels start beside the body.

    Args:
        pattern: A pattern that was checked.
        body: The skin.
        skin: Its vertices [m], shape [v, 3].
        body_name: What messages call it.

    Raises:
        GeometryError: A panel is far away, or far over the head; the message names it.
    """
    floor, height = float(skin[:, 2].min()), float(np.ptp(skin[:, 2]))
    for name, panel in pattern.panels.items():
        what = f"pattern {pattern.name!r}: panel {name!r}"
        x = panel.placement.placed(panel.outline)
        away = float(np.abs(body.signed_distance(x)[0]).min())
        if away > _TOO_FAR:
            raise GeometryError(
                f"{what} is {away:.3g} m away from {body_name}; allowed: a pattern around it "
                "(another unit of length, or another body?)"
            )
        top = float(x[:, 2].max()) - floor
        if top > (1.0 + _OVER_HEAD) * height:
            raise GeometryError(
                f"{what} reaches up to {top:.3g} m, {body_name} is {height:.3g} m high; allowed: "
                f"up to {(1.0 + _OVER_HEAD) * height:.3g} m (another unit of length, or another "
                "body?)"
            )


def check_ways(pieces: Pieces, placed: FloatArray, body: MeshDistance, body_name: str) -> None:
    """Sees whether what is sewn to each other can meet beside the body.

    Stitches draw their ends to each other on a straight line. Where front and back are narrower
    than the body such lines pass through its rim, straight from one to the other; sides that are
    not beside each other are drawn through the body and aside.

    Args:
        pieces: The cut pattern.
        placed: Where its vertices start, clear of the body [m], shape [n, 3].
        body: The skin.
        body_name: What messages call it.

    Raises:
        GeometryError: A seam would be drawn through the body; the message names it.
    """
    panels = [*pieces.pattern.panels.values()]
    shares = np.linspace(0.0, 1.0, _SECTIONS + 1)[1:-1, None, None]
    worst, found = _MOST_IN_BODY, None
    for stitch, pairs in zip(pieces.pattern.stitches, pieces.seams, strict=True):
        if not len(pairs):
            continue
        place = panels[pieces.panel[pairs[0, 0]]].placement
        if place.rolled and (pieces.panel[pairs] == pieces.panel[pairs[0, 0]]).all():
            continue  # around a limb already
        way = placed[pairs[:, 1]] - placed[pairs[:, 0]]
        points = placed[pairs[:, 0]] + shares * way
        depth = -body.signed_distance(points.reshape(-1, 3))[0].reshape(len(shares), -1)
        inside = float(np.median((depth > _IN_SKIN).mean(axis=0)))
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
        outwards = np.median(np.abs(way @ place.T_world_panel[:3, 2]) / length)
        if inside > worst and outwards < np.sqrt(1.0 - _ASKEW**2):
            worst, found = inside, stitch
    if found is not None:
        raise GeometryError(
            f"pattern {pieces.pattern.name!r}: the seam {found} would be drawn through "
            f"{body_name}, {100.0 * worst:.0f} % of its way; allowed: sides that lie beside each "
            f"other, up to {100.0 * _MOST_IN_BODY:.0f} % (sides of two stitches swapped?)"
        )


def check_band(
    pieces: Pieces, placed: FloatArray, skin: FloatArray, triangles: IntArray, body_name: str
) -> None:
    """Sees whether a waist band fits: it is held where it starts, as wide as it is.

    Args:
        pieces: The cut pattern.
        placed: Where its vertices start [m], shape [n, 3].
        skin: The body's skin [m], shape [v, 3].
        triangles: Shape [t, 3].
        body_name: What messages call it.

    Raises:
        GeometryError: It is much wider than the body, or not at its trunk; the message names a
            panel of it.
    """
    pattern = pieces.pattern
    sides = [seam for stitch in pattern.stitches for side in stitch.sides for seam in side]
    sewn = {(seam.panel, e) for seam in sides for e in seam.edges}
    band = [
        (k, name, e)
        for k, (name, panel) in enumerate(pattern.panels.items())
        for e, edge in enumerate(panel.edges)
        if edge.label == WAIST and (name, e) not in sewn
    ]
    if not band:
        return
    length = sum(float(pattern.panels[name].lengths[e]) for _, name, e in band)
    on = np.any([(pieces.panel == k) & (pieces.edge == e) for k, _, e in band], axis=0)
    height = float(placed[on, 2].mean())
    mid = float(np.median(skin[:, 1]))
    trunk = trunk_of(loops_at(skin, triangles, height, 2), mid)
    if trunk is None:
        raise GeometryError(
            f"pattern {pattern.name!r}: the edges labelled {WAIST!r} of panel {band[0][1]!r} "
            f"start {height - float(skin[:, 2].min()):.2g} m over the floor, where {body_name} "
            "has no trunk; allowed: around it (another unit of length, or another place?)"
        )
    girth = girth_of(trunk)
    if length > _LOOSEST * girth:
        raise GeometryError(
            f"pattern {pattern.name!r}: the edges labelled {WAIST!r} of panel {band[0][1]!r} and "
            f"others are {length:.3g} m around, {body_name} is {girth:.3g} m there; allowed: up "
            f"to {_LOOSEST * girth:.3g} m (too wide, or another body?)"
        )
