"""A garment that came to rest on the floor, or far down the body, is not worn."""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.pattern import WAIST
from garment_sim_ros.garment.patterns.pieces import Pieces
from garment_sim_ros.garment.patterns.sewing import Sewn

_FALLEN = 1.0 / 3.0
"""How far a panel of a worn garment sinks at most, in heights of the body."""
_AT_FLOOR = 0.1
"""What reaches no higher, and sank by that, fell to the floor, likewise."""

_OFF_HIPS = 0.45
"""What was higher than this on the body, in its heights, and is not any more, is off the hips."""


def check_up(pieces: Pieces, sewn: Sewn, skin: FloatArray) -> None:
    """Sees whether what was put on is still there.

    Args:
        pieces: The cut pattern.
        sewn: The garment at rest.
        skin: The body's skin [m], shape [v, 3].

    Raises:
        GeometryError: A panel is not; the message names it.
    """
    floor, height = float(skin[:, 2].min()), float(np.ptp(skin[:, 2]))
    hips = floor + _OFF_HIPS * height
    at = int(sewn.placed[:, 2].argmax())
    was, now = float(sewn.placed[at, 2]), float(sewn.vertices[:, 2].max())
    slid = was - now
    if was > hips > now and slid > _AT_FLOOR * height:
        raise _slid(pieces, [*pieces.pattern.panels][pieces.panel[at]], slid)
    for k, name in enumerate(pieces.pattern.panels):
        own = pieces.panel == k
        z = sewn.vertices[pieces.welded[own], 2]
        way = float(sewn.placed[own, 2].mean() - z.mean())
        on_floor = z.max() - floor < _AT_FLOOR * height and way > _AT_FLOOR * height
        if on_floor or way > _FALLEN * height:
            raise _slid(pieces, name, way)


def _slid(pieces: Pieces, name: str, way: float) -> GeometryError:
    return GeometryError(
        f"pattern {pieces.pattern.name!r}: panel {name!r} slid down the body by {way:.2f} m and "
        f"rests there; allowed: what shoulders or hips hold, is sewn to that, or has edges "
        f"labelled {WAIST!r} (too wide, or another body?)"
    )
