"""Cloth that passes through itself comes free: its intersection contours are made shorter.

Volino & Magnenat-Thalmann 2006, "Resolving surface collisions through intersection contour
minimization": where an edge passes through a triangle, the two are displaced so that the contour,
along which the surfaces cut each other, gets shorter. Nothing need be known of how it came about
or of what is inside and outside.
"""

import numpy as np

from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.self_collision.self_contact import LEAST_LEVER

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_INFINITE = np.float32(np.inf)
_TINY = np.float32(1e-12)


@kernel(inner=True)
def _passing(x, a, b, i, j, k):
    """Where the edge ab passes through a triangle.

    Returns:
        (yes, s, u, w, nx, ny, nz): whether it does, the weights of b, j and k there, the unit
        normal.
    """
    ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    fx, fy, fz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    area = nx * nx + ny * ny + nz * nz
    ax, ay, az = x[a, 0] - x[i, 0], x[a, 1] - x[i, 1], x[a, 2] - x[i, 2]
    bx, by, bz = x[b, 0] - x[i, 0], x[b, 1] - x[i, 1], x[b, 2] - x[i, 2]
    ha = ax * nx + ay * ny + az * nz
    hb = bx * nx + by * ny + bz * nz
    if not ha * hb < _ZERO or not area > _TINY * _TINY:
        return False, _ZERO, _ZERO, _ZERO, nx, ny, nz
    s = ha / (ha - hb)
    px, py, pz = ax + s * (bx - ax), ay + s * (by - ay), az + s * (bz - az)
    u = (nx * (py * fz - pz * fy) + ny * (pz * fx - px * fz) + nz * (px * fy - py * fx)) / area
    w = (nx * (ey * pz - ez * py) + ny * (ez * px - ex * pz) + nz * (ex * py - ey * px)) / area
    scale = _ONE / np.sqrt(area)
    yes = u >= _ZERO and w >= _ZERO and u + w <= _ONE
    return yes, s, u, w, nx * scale, ny * scale, nz * scale


@kernel(inner=True)
def _into(x, a, b, o, nx, ny, nz):
    """Unit direction of the contour from the edge ab into its triangle with the corner o."""
    ex, ey, ez = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    fx, fy, fz = x[o, 0] - x[a, 0], x[o, 1] - x[a, 1], x[o, 2] - x[a, 2]
    mx = ey * fz - ez * fy
    my = ez * fx - ex * fz
    mz = ex * fy - ey * fx
    rx = my * nz - mz * ny
    ry = mz * nx - mx * nz
    rz = mx * ny - my * nx
    length = np.sqrt(rx * rx + ry * ry + rz * rz)
    if not length > _TINY:
        return _ZERO, _ZERO, _ZERO
    # What is across the edge, on the side of o: m x e.
    inward = rx * (my * ez - mz * ey) + ry * (mz * ex - mx * ez) + rz * (mx * ey - my * ex)
    scale = _ONE / length if inward > _ZERO else -_ONE / length
    return rx * scale, ry * scale, rz * scale


@kernel()
def mark_tangled(x, crossings, crossing_count, tangled):
    """Marks particles of edges and triangles that pass through each other.

    Args:
        x: Positions [m], shape [n, 3].
        crossings: As `near_pairs.find_pairs` finds them, shape [any, 7].
        crossing_count: Number of them.
        tangled: Output, shape [n].

    Returns:
        How many still pass through each other.
    """
    tangled[:] = False
    still = 0
    for e in range(crossing_count):
        a, b = crossings[e, 0], crossings[e, 1]
        i, j, k = crossings[e, 4], crossings[e, 5], crossings[e, 6]
        if _passing(x, a, b, i, j, k)[0]:
            still += 1
            for p in (a, b, i, j, k):
                tangled[p] = True
    return still


@kernel()
def spread(triangles, tangled, rings, scratch):
    """Marks the neighbours of what is tangled, too; ends where there are no more of them.

    Args:
        triangles: Particles, shape [t, 3].
        tangled: Marks, changed in place, shape [n].
        rings: How many edges away.
        scratch: Shape [n].
    """
    for _ in range(rings):
        scratch[:] = tangled
        more = False
        for t in range(triangles.shape[0]):
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            if scratch[i] or scratch[j] or scratch[k]:
                more |= not (tangled[i] and tangled[j] and tangled[k])
                tangled[i] = tangled[j] = tangled[k] = True
        if not more:
            break


@kernel()
def untangle(x, v, inverse_mass, crossings, crossing_count, far, softness):
    """Displaces edges and the triangles that they pass through so that contours get shorter.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        inverse_mass: Inverse masses [1/kg], shape [n].
        crossings: As `near_pairs.find_pairs` finds them, shape [any, 7].
        crossing_count: Number of them.
        far: Displacement where the contour's way out is clear [m].
        softness: Gradients of the contour's length below this displace by less; a border's is 1.

    Returns:
        How many edges were displaced.
    """
    moved = 0
    for n in range(crossing_count):
        a, b = crossings[n, 0], crossings[n, 1]
        i, j, k = crossings[n, 4], crossings[n, 5], crossings[n, 6]
        yes, s, u, w, nx, ny, nz = _passing(x, a, b, i, j, k)
        if not yes:
            continue
        rx, ry, rz = _into(x, a, b, crossings[n, 2], nx, ny, nz)
        if crossings[n, 3] >= 0:
            qx, qy, qz = _into(x, a, b, crossings[n, 3], nx, ny, nz)
            rx += qx
            ry += qy
            rz += qz
        ex, ey, ez = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        across = ex * nx + ey * ny + ez * nz
        slope = np.float32(2.0) * (ex * rx + ey * ry + ez * rz) / across
        gx = rx - slope * nx
        gy = ry - slope * ny
        gz = rz - slope * nz
        squared = gx * gx + gy * gy + gz * gz
        if not _ZERO < squared < _INFINITE:
            continue
        ca, cb, ci, cj, ck = _ONE - s, s, u + w - _ONE, -u, -w
        wa, wb = inverse_mass[a] * ca, inverse_mass[b] * cb
        wi, wj, wk = inverse_mass[i] * ci, inverse_mass[j] * cj, inverse_mass[k] * ck
        most = max(inverse_mass[a], inverse_mass[b])
        most = max(max(most, inverse_mass[i]), max(inverse_mass[j], inverse_mass[k]))
        if not most > _ZERO:
            continue
        total = ca * wa + cb * wb + ci * wi + cj * wj + ck * wk
        total = max(total, LEAST_LEVER * most)
        moved += 1
        push = far / (np.sqrt(squared + softness * softness) * total)
        # Velocity that leads deeper is taken away.
        away = _ZERO
        for q, c in ((a, ca), (b, cb), (i, ci), (j, cj), (k, ck)):
            away += c * (v[q, 0] * gx + v[q, 1] * gy + v[q, 2] * gz)
        stop = max(-away, _ZERO) / (squared * total)
        for q, wq in ((a, wa), (b, wb), (i, wi), (j, wj), (k, wk)):
            x[q, 0] += wq * push * gx
            x[q, 1] += wq * push * gy
            x[q, 2] += wq * push * gz
            v[q, 0] += wq * stop * gx
            v[q, 1] += wq * stop * gy
            v[q, 2] += wq * stop * gz
    return moved
