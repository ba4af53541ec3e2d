"""Where a sewn garment is most taut, and by how much it is too narrow or too short there."""

import numpy as np

from garment_sim_ros.garment.patterns.pieces import Pieces
from garment_sim_ros.garment.patterns.sewing import Sewn

_BAND = 0.03
"""Height of the row of a panel whose width is told [m]."""


def tautest(pieces: Pieces, sewn: Sewn, floor: float) -> str:
    """The panel that is stretched most across or along its grain, in words.

    Args:
        pieces: The cut pattern.
        sewn: The garment at rest.
        floor: Height of the floor [m].
    """
    corners, flat = sewn.vertices[sewn.triangles], sewn.flat
    flat_sides = np.swapaxes(flat[:, 1:] - flat[:, :1], 1, 2)
    sides = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    gradient = sides @ np.linalg.pinv(flat_sides)
    strain = np.linalg.norm(gradient, axis=1) - 1.0  # of weft and warp, shape [t, 2]
    of_panel = pieces.panel[pieces.triangles[:, 0]]
    count = len(pieces.pattern.panels)
    high = np.array([np.percentile(strain[of_panel == k], 95.0, axis=0) for k in range(count)])
    k, thread = np.unravel_index(int(high.argmax()), high.shape)
    own = of_panel == k
    taut = own & (strain[:, thread] >= high[k, thread])
    height = float(np.median(corners[taut, :, 2].mean(axis=1))) - floor
    middle = flat.mean(axis=1)[:, 1 - thread]
    row = own & (np.abs(middle - np.median(middle[taut])) < 0.5 * _BAND)
    long = 100.0 * float(np.ptp(flat[row, :, thread]))
    # What hangs in folds beside it gives nothing.
    short = long * float(np.maximum(strain[row, thread], 0.0).mean())
    return (
        f"most in panel {[*pieces.pattern.panels][k]!r}, {height:.2f} m over the floor, "
        f"{('across', 'along')[thread]} the grain: its {long:.0f} cm are {short:.1f} cm too "
        f"{('narrow', 'short')[thread]} there"
    )
