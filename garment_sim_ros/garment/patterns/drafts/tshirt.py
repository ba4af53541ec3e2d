"""A T-shirt, and a shirt with long sleeves: two trunk panels and two sleeves.

Drafted as `upper` has it: Aldrich's flat T-shirt block.
"""

from dataclasses import replace

import numpy as np

from garment_sim_ros.garment.patterns.drafts.upper import (
    ARM_LEFT,
    ARM_RIGHT,
    CROWN_MINUS,
    CROWN_PLUS,
    SHOULDER_LEFT,
    SHOULDER_RIGHT,
    SIDE_LEFT,
    SIDE_RIGHT,
    UNDER_MINUS,
    UNDER_PLUS,
    Trunk,
    armhole,
    bent,
    crown_height,
    facing,
    front_and_back,
    sleeve_panel,
    trunk_panel,
    unit,
    widest,
)
from garment_sim_ros.garment.patterns.pattern import Panel, Pattern, Seam, Stitch
from garment_sim_ros.garment.patterns.tape import Tape

_EASE = 0.11
"""Ease of the bust, as a share of it."""
_HEM_EASE = 0.05
"""The same of the widest girth above the hem."""
_MOST_AHEAD = 0.6
"""Largest share of the front in the girth."""
_ARM_EASE = 0.085
"""Ease of the sleeve [m] on a person of 1.65 m."""
_BELOW_ARMPIT = 0.05, 0.1
"""How far the underarm point is below the armpit, at least and at most [m], likewise."""
_CROWN = 0.27
"""Height of the sleeve's crown, as a share of its width: so a tube is cut that leaves the trunk at
40 degrees below the horizontal."""
_ELBOW = 0.6
"""Sleeves longer than this share of the arm cover the elbow."""
_SLEEVE = 0.44
"""Where a short sleeve ends, as a share of the arm."""


def tshirt(tape: Tape) -> Pattern:
    """A T-shirt with sleeves to the middle of the upper arms."""
    return _shirt("tshirt", tape, sleeve=_SLEEVE)


def long_sleeved_shirt(tape: Tape) -> Pattern:
    """A shirt with sleeves to the wrists."""
    return _shirt("long_sleeved_shirt", tape, sleeve=0.97)


def _shirt(name: str, tape: Tape, sleeve: float) -> Pattern:
    u = unit(tape)
    width = max(arm.upper for arm in tape.arms) + _ARM_EASE * u
    # As deep an armhole as the crown is long.
    for below in np.linspace(*_BELOW_ARMPIT, 11) * u:
        size = _fitted(tape, trunk_sizes(tape, below=below))
        x_front, x_back = front_and_back(tape, size["front"].hem[0], size["front"].neck[0])
        front = trunk_panel("front", size["front"], facing(tape, 1.0, x_front))
        back = trunk_panel("back", size["back"], facing(tape, -1.0, x_back))
        if crown_height(armhole(front) + armhole(back), width) >= _CROWN * width:
            break
    panels = {
        "front": front,
        "back": back,
        **sleeves(tape, armhole(front) + armhole(back), sleeve, size["front"].shoulder[1]),
    }
    return Pattern(name=name, panels=panels, stitches=shirt_stitches())


def trunk_sizes(
    tape: Tape, hem: float | None = None, below: float | None = None
) -> dict[str, Trunk]:
    """Sizes of front and back.

    Args:
        tape: The body.
        hem: Height of the hem [m]; None: a little above the hips.
        below: How far the underarm point is below the armpit [m]; None: as little as it may.
    """
    u = unit(tape)
    if hem is None:
        hem = tape.waist.height - 0.8 * (tape.waist.height - tape.crotch)
    underarm = tape.armpit - (_BELOW_ARMPIT[0] * u if below is None else below)
    chest = (1.0 + _EASE) * max(tape.bust.girth, widest(tape, tape.waist.height, underarm)) / 4.0
    hips = (1.0 + _HEM_EASE) * widest(tape, hem, tape.waist.height) / 4.0
    neck = 0.5 * tape.neck_base.size[1] + 0.012 * u
    shoulder = max(0.5 * tape.shoulder + 0.025 * u, neck + 0.06 * u)
    chest = max(chest, shoulder + 0.02 * u)
    top = max(tape.neck_base.height, tape.shoulder_height + 0.01 * u)
    front = Trunk(
        hem=(hem, max(hips, chest)),
        chest=(underarm, chest),
        shoulder=(tape.shoulder_height + 0.005 * u, shoulder),
        neck=(top + 0.01 * u, neck),
        neck_depth=0.075 * u,
        hollow=0.012 * u,
    )
    return {"front": front, "back": replace(front, neck_depth=0.02 * u, hollow=0.004 * u)}


def _fitted(tape: Tape, sizes: dict[str, Trunk]) -> dict[str, Trunk]:
    """The same sizes, with as much of the girth in front as the body has there.

    Side seams hang straight below the shoulders, and more than half of a chest lies before these.
    The back stays wider than the shoulders are.
    """
    plane = 0.5 * float(tape.arms[0].shoulder[0] + tape.arms[1].shoulder[0])
    (low, hem), (underarm, chest) = sizes["front"].hem, sizes["front"].chest
    levels = [v for v in tape.levels if tape.waist.height <= v.height <= underarm]
    levels = levels or [tape.bust]
    share = max(v.before(plane) for v in levels) / max(v.girth for v in levels)
    spare = chest - sizes["back"].shoulder[1] - 0.02 * unit(tape)
    most = min(max(spare, 0.0), (2.0 * _MOST_AHEAD - 1.0) * chest)
    wider = float(np.clip((2.0 * share - 1.0) * chest, 0.0, most))
    return {
        side: replace(size, hem=(low, hem + more), chest=(underarm, chest + more))
        for (side, size), more in zip(sizes.items(), (wider, -wider), strict=True)
    }


def sleeves(tape: Tape, crown: float, length: float, shoulder: float) -> dict[str, Panel]:
    """Both sleeves.

    Args:
        tape: The body.
        crown: Length of front and back armhole together [m].
        length: Where they end, as a share of the arm.
        shoulder: Half the width of the trunk's shoulders, from which they hang [m].
    """
    u = unit(tape)
    dropped = shoulder - 0.5 * tape.shoulder
    made = {}
    for side, arm in zip(("left", "right"), tape.arms, strict=True):
        width = min(arm.upper + _ARM_EASE * u, 0.94 * crown)
        k = int(np.clip(length * len(arm.girths), 0, len(arm.girths) - 1))
        cuff = min(float(arm.girths[k:].max()) + (0.07 if length < _ELBOW else 0.05) * u, width)
        name = f"{side}_sleeve"
        down = length * arm.length - dropped
        if length > _ELBOW:  # around the outside of a bent elbow it is farther than inside
            down += float(np.linalg.norm(bent(arm))) * arm.upper / (2.0 * np.pi)
        made[name] = sleeve_panel(name, arm, crown, width, down, cuff)
    return made


def shoulder_and_side_seams() -> tuple[Stitch, ...]:
    """Those of a front and a back."""
    return (
        _sewn("front", SHOULDER_LEFT, "back", SHOULDER_RIGHT),
        _sewn("front", SHOULDER_RIGHT, "back", SHOULDER_LEFT),
        _sewn("front", SIDE_LEFT, "back", SIDE_RIGHT),
        _sewn("front", SIDE_RIGHT, "back", SIDE_LEFT),
    )


def shirt_stitches() -> tuple[Stitch, ...]:
    """Shoulders, sides, armholes and underarm seams of a shirt.

    A front's x runs to the wearer's left, a back's to the right; a left sleeve's to the back.
    """
    return (
        *shoulder_and_side_seams(),
        _sewn("front", ARM_LEFT, "left_sleeve", CROWN_MINUS),
        _sewn("back", ARM_RIGHT, "left_sleeve", CROWN_PLUS),
        _sewn("front", ARM_RIGHT, "right_sleeve", CROWN_PLUS),
        _sewn("back", ARM_LEFT, "right_sleeve", CROWN_MINUS),
        _sewn("left_sleeve", UNDER_PLUS, "left_sleeve", UNDER_MINUS),
        _sewn("right_sleeve", UNDER_PLUS, "right_sleeve", UNDER_MINUS),
    )


def _sewn(a: str, edge_a: int, b: str, edge_b: int) -> Stitch:
    return Stitch(sides=((Seam(panel=a, edges=(edge_a,)),), (Seam(panel=b, edges=(edge_b,)),)))
