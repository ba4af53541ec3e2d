"""What holds garments beside pins and contact, again in float64; nothing but tests runs this."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray


def pull_tethers(
    x: FloatArray, v: FloatArray, pin: IntArray, length: FloatArray, rate: float
) -> int:
    """Puts particles that are farther from their pins [f, k] than allowed there; counts them.

    Changes positions and velocities [n, 3] in place.
    """
    held = set()
    for p in range(len(pin)):
        for q, longest in zip(pin[p], length[p]):
            apart = x[p] - x[q]
            distance = float(np.linalg.norm(apart))
            if distance > longest:
                held.add(p)
                move = apart / distance * longest - apart
                x[p] += move
                v[p] += rate * move
    return len(held)


def spring_end(
    x: FloatArray,
    x_start: FloatArray,
    goal: FloatArray,
    before: FloatArray,
    stiffness: float,
    damping: float,
    keep: float,
    dt: float,
) -> FloatArray:
    """Where a particle of mass 1 ends that a spring and a damper pull for one implicit step.

    The balance of inertia, spring and damper at the end, solved for it: each pulls it somewhere,
    the damper to where it would be, had it gone along with its place.

    Args:
        x: Where it would be without them [m], shape [3].
        x_start: Where it was [m], shape [3].
        goal: Where its place is [m], shape [3].
        before: Where that was [m], NaN where not known: then the damper holds it at x. Shape [3].
        stiffness: Of the spring [1/s^2].
        damping: Of the damper [1/s].
        keep: Part of velocity that damping leaves in the step.
        dt: Step [s].
    """
    if np.isinf(stiffness):
        return goal
    along = x if np.isnan(before).any() else x_start + goal - before
    inertia, damper = 1.0 / (keep * dt**2), damping / dt
    total = inertia + stiffness + damper
    return np.asarray((inertia * x + stiffness * goal + damper * along) / total)
