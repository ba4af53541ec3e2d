"""What a sub-step of `xpbd` does to single particles: outer forces, and what edges moved."""

from garment_sim_ros.jit import exact_kernel, kernel


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
    """Velocity that outer forces and bending add in each sub-step; flat arrays [3 n], pull [3]."""
    for p in range(v.size // 3):
        for k in range(3):
            i = 3 * p + k
            push[i] = pull[k] + (bent[i] - v[i]) * share


@kernel(inner=True)
def gain(x, v, x_predicted, rate):
    """Adds to velocities what constraints moved, over the sub-step; flat arrays [3 n]."""
    for i in range(v.size):
        v[i] += (x[i] - x_predicted[i]) * rate


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
