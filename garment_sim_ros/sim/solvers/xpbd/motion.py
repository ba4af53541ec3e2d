"""What a sub-step of `xpbd` does to single particles: outer forces, and what edges moved."""

import numpy as np

from garment_sim_ros.geometry.four import four_at, put_three, same_four, three_at
from garment_sim_ros.jit import exact_kernel, kernel

_THREE = np.uint64(3)
_FOUR = np.uint64(4)


@kernel(inner=True)
def fall(x, v, x_start, x_predicted, push, keep, dt):
    """`motion.predict` over flat arrays, with `push` for every coordinate, shape [3 n]."""
    for i in range(v.size):
        x_start[i] = x[i]
        v[i] = keep * v[i] + push[i]
        x[i] += dt * v[i]
        x_predicted[i] = x[i]


@kernel(inner=True)
def share_out(bent, v, pull, share, push):
    """Velocity that outer forces and bending add in each sub-step.

    Args:
        bent: Velocities after bending, as fours, flat [m/s], shape [4 n] or more.
        v: Velocities before, flat [m/s], shape [3 n].
        pull: What outer forces add [m/s], shape [3].
        share: Part of what bending adds.
        push: Output, flat [m/s], shape [3 n].
    """
    for p in range(v.size // 3):
        for k in range(3):
            push[3 * p + k] = pull[k] + (bent[4 * p + k] - v[3 * p + k]) * share


@kernel(inner=True)
def gain(wide, x, v, x_predicted, rate):
    """Takes positions over, and adds to velocities what constraints moved, over the sub-step.

    Args:
        wide: Positions that constraints left, as fours, flat [m], shape [4 n] or more.
        x: Output, the same, flat [m], shape [3 n].
        v: Velocities, changed in place, flat [m/s], shape [3 n].
        x_predicted: Positions before constraints, flat [m], shape [3 n].
        rate: One over the sub-step [1/s].
    """
    per_step = same_four(rate)
    for p in range(v.size // 3):
        n = np.uint64(p)
        i = _THREE * n
        new = four_at(wide, _FOUR * n)
        put_three(v, i, three_at(v, i) + (new - three_at(x_predicted, i)) * per_step)
        put_three(x, i, new)


@exact_kernel()
def coast(x, v, x_start, moved, low, push, keep, dt):
    """The same as `fall`, but positions stay and the way is kept apart; flat arrays [3 n].

    Args:
        x: Positions [m].
        v: Velocities, changed in place [m/s].
        x_start: Output, the positions [m].
        moved: Output, the way of the sub-step and what positions were short of before it [m].
        low: That: what the last sub-step moved by less than positions can be rounded to [m].
        push: Velocity that is added [m/s].
        keep: Part of velocity that is kept.
        dt: Sub-step [s].
    """
    for i in range(v.size):
        x_start[i] = x[i]
        v[i] = keep * v[i] + push[i]
        moved[i] = dt * v[i] + low[i]


@exact_kernel()
def arrive(x, v, moved, low, dt, rate):
    """The end of a sub-step that began with `coast`: velocities, positions and what they lack."""
    for i in range(v.size):
        v[i] += (moved[i] - (dt * v[i] + low[i])) * rate
        rounded = x[i] + moved[i]
        low[i] = moved[i] - (rounded - x[i])
        x[i] = rounded
