"""Where the particles of one mesh are expected, and how far they have strayed from there."""

import numpy as np

from garment_sim_ros.jit import kernel

_ZERO = np.float32(0.0)
_INFINITE = np.float32(np.inf)


@kernel()
def drift(x, place, speed, time):
    """How far particles are from where they were expected, common motion taken out.

    Args:
        x: Positions [m], shape [n, 3].
        place: Positions when that was said, less their mean [m], shape [n, 3].
        speed: Velocities then, less their mean [m/s], shape [n, 3].
        time: Time since then [s].

    Returns:
        The greatest distance [m]; not finite where a position is not.
    """
    n = x.shape[0]
    a = b = c = 0.0
    for p in range(n):
        a += x[p, 0]
        b += x[p, 1]
        c += x[p, 2]
    mx, my, mz = np.float32(a / n), np.float32(b / n), np.float32(c / n)
    farthest = _ZERO
    for p in range(n):
        dx = x[p, 0] - mx - place[p, 0] - time * speed[p, 0]
        dy = x[p, 1] - my - place[p, 1] - time * speed[p, 1]
        dz = x[p, 2] - mz - place[p, 2] - time * speed[p, 2]
        farthest = max(farthest, dx * dx + dy * dy + dz * dz)
    if not abs(mx + my + mz) < _INFINITE:
        return np.float32(np.nan)
    return np.sqrt(farthest)


@kernel()
def expect(x_before, x, v, dt, steps, far, start, place, speed, way):
    """Where particles were, and where they are expected to get, common motion taken out.

    Args:
        x_before: Positions at the end of the last step [m], shape [n, 3].
        x: Positions now [m], shape [n, 3].
        v: Velocities [m/s], shape [n, 3].
        dt: Step [s].
        steps: How many to look ahead at most.
        far: Fewer where particles would go farther than this together, RMS of all [m].
        start: Output: `x_before` less its mean [m], shape [n, 3].
        place: Output: `x` less its mean [m], shape [n, 3].
        speed: Output: `v` less its mean [m/s], shape [n, 3].
        way: Output: from `start` to where each is expected [m], shape [n, 3].

    Returns:
        How many steps were looked ahead; -1 where velocities are not finite.
    """
    n = x.shape[0]
    total = _ZERO
    for k in range(3):
        b = a = u = 0.0
        for p in range(n):
            b += x_before[p, k]
            a += x[p, k]
            u += v[p, k]
        mean_before, mean, mean_v = np.float32(b / n), np.float32(a / n), np.float32(u / n)
        for p in range(n):
            start[p, k] = x_before[p, k] - mean_before
            place[p, k] = x[p, k] - mean
            speed[p, k] = v[p, k] - mean_v
            total += speed[p, k] * speed[p, k]
    if not total < _INFINITE:
        return -1
    ahead = min(steps, int(far / (dt * np.sqrt(total / n) + np.float32(1e-9))))
    time = dt * np.float32(ahead)
    for p in range(n):
        for k in range(3):
            way[p, k] = place[p, k] + time * speed[p, k] - start[p, k]
    return ahead
