"""Telling a body that jumped from one that moves fast."""

import numpy as np

from garment_sim_ros.contact.shapes import ColliderPoses

_DISTANCE = 0.3
"""A collider that moves less between two poses has not jumped, however fast it was [m]."""
_ANGLE = np.pi / 3
"""Nor has one that turns less [rad]."""


def has_jumped(
    before: ColliderPoses,
    after: ColliderPoses,
    time: float,
    *,
    root: int,
    speed: float,
    turn_rate: float,
) -> bool:
    """Whether any collider moved, or the root turned, faster than bodies do.

    Only the root is looked at for turning: limbs may spin.

    Args:
        before: Poses of a set.
        after: The next ones.
        time: Time between them [s].
        root: The collider that moves as the body as a whole does.
        speed: Colliders that move faster have jumped [m/s].
        turn_rate: A root that turns faster has jumped [rad/s].
    """
    if not len(before.position):
        return False
    moved = float(np.abs(after.position - before.position).max())
    if moved > _DISTANCE and moved > speed * time:
        return True
    cosine = min(abs(float(before.orientation[root] @ after.orientation[root])), 1.0)
    turned = 2.0 * float(np.arccos(cosine))
    return turned > _ANGLE and turned > turn_rate * time
