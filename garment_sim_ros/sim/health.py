"""Counts and readings of one garment, for diagnostics."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(kw_only=True)
class Health:
    """What happened to one garment so far.

    Attributes:
        steps: Solver steps taken.
        resets: Times it was put back to its last good state because too much of it was not
            finite, or absurdly far away or fast.
        recovered: Particles that were, and were put back among their neighbours.
        rewound: Times it was no longer worn right and all of it was wound back, see `rewinding`.
        rewound_parts: Times it was so, and a part was enough.
        caught: Times it was to be wound back because a limb stayed in its cloth.
        came_off: Times because nothing was through an opening any more that something was through.
        rode_up: Times because it stayed rolled up where it would hang, see `riding_up`.
        entangled: Times it was wound back because it stayed through a garment worn under or over
            it, see `entangled`.
        not_rewound: Times of these that no state was found that is worn right; it stays as it is.
        held: Free particles that a limit held in the last step: tethers, or a distance from skin;
            and pairs of the garment's own parts that were kept apart.
        let_go: Free particles so stretched that what passes their garment by passes through them.
        tangled: Particles that stay through a garment worn under or over theirs.
        settling_steps: Steps that the last `reset` took to settle.
        contacts: Free particles in contact in the last step.
        rms_speed: RMS speed of free particles after the last step [m/s].
        max_speed: Highest speed after the last step [m/s].
    """

    steps: int = 0
    resets: int = 0
    recovered: int = 0
    rewound: int = 0
    rewound_parts: int = 0
    caught: int = 0
    came_off: int = 0
    rode_up: int = 0
    entangled: int = 0
    not_rewound: int = 0
    held: int = 0
    let_go: int = 0
    tangled: int = 0
    settling_steps: int = 0
    contacts: int = 0
    rms_speed: float = 0.0
    max_speed: float = 0.0


def totals(garments: Sequence[Health]) -> dict[str, int]:
    """What happened to all garments so far, by the names that diagnostics have."""
    names = {
        "garments_put_back": "resets",
        "garments_rewound": "rewound",
        "garment_parts_rewound": "rewound_parts",
        "garments_caught": "caught",
        "garments_came_off": "came_off",
        "garments_rode_up": "rode_up",
        "garments_entangled": "entangled",
        "garments_not_rewound": "not_rewound",
        "particles_recovered": "recovered",
        "particles_held": "held",
        "particles_let_go": "let_go",
        "particles_tangled": "tangled",
    }
    return {name: sum(getattr(h, of) for h in garments) for name, of in names.items()}
