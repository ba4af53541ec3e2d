"""Dresses without sleeves: one front and one back from shoulders to hem.

The construction is that of Aldrich's shift dress in "Metric Pattern Cutting": the trunk of a shirt
block, its side seams let out from the underarm in a straight line that clears the hips, with
narrower shoulders and a higher armhole than with a sleeve. The formulas are our own.
"""

from dataclasses import replace

import numpy as np

from garment_sim_ros.garment.patterns.drafts.tshirt import (
    shoulder_and_side_seams,
    trunk_sizes,
)
from garment_sim_ros.garment.patterns.drafts.upper import (
    Trunk,
    facing,
    front_and_back,
    trunk_panel,
    unit,
)
from garment_sim_ros.garment.patterns.pattern import Pattern
from garment_sim_ros.garment.patterns.tape import Tape

_HIP_EASE = 0.05
"""Ease of every girth below the chest, as a share."""


def sleeveless_dress(tape: Tape) -> Pattern:
    """A dress to above the knees, as narrow as the hips let it be."""
    return _dress("sleeveless_dress", tape, hem=0.62 * tape.crotch, flare=0.06)


def wide_dress(tape: Tape) -> Pattern:
    """A dress to below the knees that flares from the underarm."""
    return _dress("wide_dress", tape, hem=0.42 * tape.crotch, flare=0.32)


def _dress(name: str, tape: Tape, hem: float, flare: float) -> Pattern:
    u = unit(tape)
    sizes = {side: _narrowed(size, u) for side, size in trunk_sizes(tape, hem).items()}
    underarm, chest = sizes["front"].chest
    for level in tape.levels:
        if level.height < underarm - 0.1 * u:
            room = (1.0 + _HIP_EASE) * level.girth / 4.0
            flare = max(flare, (room - chest) / (underarm - level.height))
    width = chest + flare * (underarm - hem)
    rise = (underarm - hem) * (np.hypot(1.0, flare) - 1.0)
    x_front, x_back = front_and_back(tape, tape.crotch, sizes["front"].neck[0])
    panels = {
        side: trunk_panel(
            side, replace(size, hem=(hem, width), hem_rise=rise), facing(tape, forward, x)
        )
        for (side, size), forward, x in zip(
            sizes.items(), (1.0, -1.0), (x_front, x_back), strict=True
        )
    }
    return Pattern(name=name, panels=panels, stitches=shoulder_and_side_seams())


def _narrowed(size: Trunk, u: float) -> Trunk:
    """Sizes of a trunk that no sleeve is sewn to."""
    height, half = size.shoulder
    narrow = max(half - 0.035 * u, size.neck[1] + 0.04 * u)
    return replace(
        size,
        shoulder=(height + 0.004 * u, narrow),
        chest=(size.chest[0] + 0.02 * u, size.chest[1]),
    )
