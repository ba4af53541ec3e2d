"""The point of an intersection of half-spaces that is nearest to a target, in three dimensions.

Incremental as in Seidel 1991, "Small-dimensional linear programming and convex hulls made easy",
which works for any problem whose optimum, when a new half-space cuts it off, lies on the new
plane: expected linear time for constraints in random order.
"""

import numpy as np

from garment_sim_ros.jit import exact_kernel


@exact_kernel()
def nearest_in_polyhedron(planes, count, target, tolerance, x):
    """Minimise ``|x - target|`` subject to ``n_i . x <= offset_i``.

    Args:
        planes: Rows (unit normal, offset), shape [at least count, 4].
        count: Number of half-spaces.
        target: Shape [3].
        tolerance: Violation that still counts as satisfied.
        x: Output, shape [3].

    Returns:
        False if there is no such point.
    """
    for k in range(3):
        x[k] = target[k]
    for i in range(count):
        n = planes[i]
        if n[0] * x[0] + n[1] * x[1] + n[2] * x[2] <= n[3] + tolerance:
            continue
        if not _nearest_on_plane(planes, i, target, tolerance, x):
            return False
    return True


@exact_kernel(inner=True)
def _nearest_on_plane(planes, i, target, tolerance, x):
    """The same on plane i, subject to the half-spaces before it."""
    n = planes[i]
    gap = n[3] - n[0] * target[0] - n[1] * target[1] - n[2] * target[2]
    px = target[0] + gap * n[0]
    py = target[1] + gap * n[1]
    pz = target[2] + gap * n[2]
    # In-plane basis (Duff et al. 2017, "Building an orthonormal basis, revisited").
    sign = 1.0 if n[2] >= 0.0 else -1.0
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    ux, uy, uz = 1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]
    vx, vy, vz = b, sign + n[1] * n[1] * a, -n[1]
    s = 0.0
    t = 0.0
    for j in range(i):
        m = planes[j]
        ms = m[0] * ux + m[1] * uy + m[2] * uz
        mt = m[0] * vx + m[1] * vy + m[2] * vz
        room = m[3] - m[0] * px - m[1] * py - m[2] * pz
        if ms * s + mt * t <= room + tolerance:
            continue
        size2 = ms * ms + mt * mt
        if size2 < 1e-16:
            return False
        # On the line where planes i and j meet: foot + q (-mt, ms) / |m|.
        size = np.sqrt(size2)
        fs, ft = room * ms / size2, room * mt / size2
        ds, dt = -mt / size, ms / size
        low = -np.inf
        high = np.inf
        for k in range(j):
            o = planes[k]
            os = o[0] * ux + o[1] * uy + o[2] * uz
            ot = o[0] * vx + o[1] * vy + o[2] * vz
            slope = os * ds + ot * dt
            left = o[3] - o[0] * px - o[1] * py - o[2] * pz - os * fs - ot * ft
            if slope > 1e-12:
                high = min(high, left / slope)
            elif slope < -1e-12:
                low = max(low, left / slope)
            elif left < -tolerance:
                return False
        if low > high + tolerance:
            return False
        q = min(max(0.0, low), high)
        s = fs + q * ds
        t = ft + q * dt
    x[0] = px + s * ux + t * vx
    x[1] = py + s * uy + t * vy
    x[2] = pz + s * uz + t * vz
    return True
