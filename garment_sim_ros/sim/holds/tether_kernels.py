"""Tethers to pins, and springs to places on the body."""

import numpy as np

from garment_sim_ros.geometry.transforms import rotate
from garment_sim_ros.jit import kernel


@kernel(forceinline=True)
def pull_tethers(x, v, pin, length, rate):
    """Brings particles back to their tethers' length.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        pin: Particles at the other ends, shape [f, k].
        length: Lengths [m], shape [f, k].
        rate: Velocity gained by what they move, over that [1/s].

    Returns:
        Number of particles held.
    """
    count = 0
    for p in range(pin.shape[0]):
        held = False
        for k in range(pin.shape[1]):
            q = pin[p, k]
            far = length[p, k]
            dx = x[p, 0] - x[q, 0]
            dy = x[p, 1] - x[q, 1]
            dz = x[p, 2] - x[q, 2]
            squared = dx * dx + dy * dy + dz * dz
            if squared > far * far:
                held = True
                over = np.float32(1.0) - far / np.sqrt(squared)
                x[p, 0] -= over * dx
                x[p, 1] -= over * dy
                x[p, 2] -= over * dz
                v[p, 0] -= over * dx * rate
                v[p, 1] -= over * dy * rate
                v[p, 2] -= over * dz * rate
        count += held
    return count


@kernel(inner=True)
def pull_springs(x, v, x_start, attached, position, orientation, origin, keep, dt, rate):
    """Springs of zero length between particles and places on colliders, implicit in time.

    With offset e from the place, way u beyond the place's own in this step, stiffness k, damping c
    and mass m, the particle moves by -(a e + b u) / (1 + a + b), a = k dt^2 / m, b = c dt / m:
    backward Euler, for which neither has an upper limit. An infinite stiffness leaves it at the
    place. Mass carries `keep`, as that of edges does, so that the force at rest is k e.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        x_start: Positions when the step began [m], shape [n, 3] or more.
        attached: `attached.Attached`; its `target` is changed in place.
        position: World positions of all colliders when the step ends [m], shape [c, 3].
        orientation: Their unit quaternions, shape [c, 4].
        origin: World position of the local origin [m], shape [3].
        keep: Part of velocity that damping leaves in the step.
        dt: Step [s].
        rate: Velocity gained by what they move, over that [1/s].
    """
    target = attached.target
    for s in range(attached.particle.size):
        p = attached.particle[s]
        q = orientation[attached.collider[s]]
        place = attached.place[s]
        turned = rotate(q[0], q[1], q[2], q[3], place[0], place[1], place[2])
        a = attached.rate[s, 0] * keep * dt * dt
        b = attached.rate[s, 1] * keep * dt
        known = target[s, 0] == target[s, 0]
        for k in range(3):
            goal = turned[k] + position[attached.collider[s], k] - origin[k]
            move = a * (x[p, k] - goal)
            if known:
                move += b * (x[p, k] - x_start[p, k] - (goal - target[s, k]))
            target[s, k] = goal
            move /= 1.0 + a + b
            x[p, k] -= move
            v[p, k] -= move * rate


@kernel(forceinline=True)
def pull_attached(x, v, x_start, attached, position, orientation, origin, keep, dt, rate):
    """All of them; arguments as `pull_springs`. Counts in `attached.held` whom tethers held."""
    attached.held[0] = pull_tethers(x, v, attached.pin, attached.length, rate)
    pull_springs(x, v, x_start, attached, position, orientation, origin, keep, dt, rate)
