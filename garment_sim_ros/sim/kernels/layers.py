"""Particles of one garment against the triangles of another, which lies under or over it."""

import numpy as np

from garment_sim_ros.geometry.jit import kernel
from garment_sim_ros.geometry.mesh_distance import closest_on_triangle

_WALK = 8
"""Triangles that a particle may pass in one step."""


@kernel(forceinline=True)
def _cell(ix, iy, iz, cells):
    """A cell of a hashed grid; primes after Teschner et al. 2003."""
    return ((ix * 73856093) ^ (iy * 19349663) ^ (iz * 83492791)) & (cells - 1)


@kernel(forceinline=True)
def _closest(x, triangles, t, px, py, pz):
    """Squared distance to triangle t, weights of its last two corners there, and the feature."""
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    b, c, feature = closest_on_triangle(x[i], x[j], x[k], px, py, pz)
    b = np.float32(b)
    c = np.float32(c)
    a = np.float32(1.0) - b - c
    dx = px - (a * x[i, 0] + b * x[j, 0] + c * x[k, 0])
    dy = py - (a * x[i, 1] + b * x[j, 1] + c * x[k, 1])
    dz = pz - (a * x[i, 2] + b * x[j, 2] + c * x[k, 2])
    return dx * dx + dy * dy + dz * dz, b, c, feature


@kernel()
def find_triangles(x, other, triangles, reach, start, entry, near):
    """The triangle nearest to each particle that has none, if it is in reach.

    Args:
        x: Positions of the particles [m], shape [n, 3].
        other: Positions of the other garment's particles [m], shape [m, 3].
        triangles: Its triangles as particles, shape [t, 3].
        reach: Triangles farther away are none of the particle's business [m].
        start: Scratch: where the entries of each cell start, for a number of cells that is a power
            of 2, shape [cells + 1].
        entry: Scratch: triangles by cell, shape [t].
        near: The triangle of each particle, -1 for none, changed in place, shape [n].
    """
    cells = start.size - 1
    # The first corner of a triangle in reach may itself be half as far again.
    far = np.float32(1.5) * reach
    scale = np.float32(1.0) / far
    # Counting sort of triangles by the cell of their first corner.
    start[:] = 0
    for t in range(triangles.shape[0]):
        i = triangles[t, 0]
        c = _cell(
            int(np.floor(other[i, 0] * scale)),
            int(np.floor(other[i, 1] * scale)),
            int(np.floor(other[i, 2] * scale)),
            cells,
        )
        start[c + 1] += 1
    for c in range(cells):
        start[c + 1] += start[c]
    for t in range(triangles.shape[0] - 1, -1, -1):
        i = triangles[t, 0]
        c = _cell(
            int(np.floor(other[i, 0] * scale)),
            int(np.floor(other[i, 1] * scale)),
            int(np.floor(other[i, 2] * scale)),
            cells,
        )
        start[c + 1] -= 1
        entry[start[c + 1]] = t
    x0 = y0 = z0 = np.float32(np.inf)
    x1 = y1 = z1 = np.float32(-np.inf)
    for i in range(other.shape[0]):
        x0 = min(x0, other[i, 0])
        x1 = max(x1, other[i, 0])
        y0 = min(y0, other[i, 1])
        y1 = max(y1, other[i, 1])
        z0 = min(z0, other[i, 2])
        z1 = max(z1, other[i, 2])
    # `start[c + 1]` is now the first entry of cell c; the next cell's first ends it.
    for p in range(x.shape[0]):
        if near[p] >= 0:
            continue
        px, py, pz = x[p, 0], x[p, 1], x[p, 2]
        # Most of a shirt is far above the skirt.
        if (
            max(x0 - px, px - x1) > reach
            or max(y0 - py, py - y1) > reach
            or max(z0 - pz, pz - z1) > reach
        ):
            continue
        ix = int(np.floor(px * scale))
        iy = int(np.floor(py * scale))
        iz = int(np.floor(pz * scale))
        best = reach * reach
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                for dz in range(-1, 2):
                    c = _cell(ix + dx, iy + dy, iz + dz, cells)
                    end = start[c + 2] if c + 2 <= cells else triangles.shape[0]
                    for e in range(start[c + 1], end):
                        i = triangles[entry[e], 0]
                        if (
                            abs(other[i, 0] - px) > far
                            or abs(other[i, 1] - py) > far
                            or abs(other[i, 2] - pz) > far
                        ):
                            continue
                        distance, _, _, _ = _closest(other, triangles, entry[e], px, py, pz)
                        if distance < best:
                            best = distance
                            near[p] = entry[e]


@kernel()
def take_from_neighbours(edges, near):
    """Gives particles without a triangle that of a neighbour to start from, one ring at a time.

    Args:
        edges: Pairs of particles, shape [e, 2].
        near: The triangle of each particle, -1 for none, changed in place, shape [n].
    """
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        # What is taken is marked until the end, else it would run through the whole garment.
        if near[i] == -1 and near[j] >= 0:
            near[i] = -2 - near[j]
        elif near[j] == -1 and near[i] >= 0:
            near[j] = -2 - near[i]
    for p in range(near.size):
        if near[p] < -1:
            near[p] = -2 - near[p]


@kernel()
def separate(
    x,
    v,
    inverse_mass,
    other_x,
    other_v,
    other_inverse_mass,
    triangles,
    neighbour,
    near,
    side,
    thickness,
    friction,
    reach,
):
    """Moves particles to their side of another garment, and that garment away from them.

    Each particle follows the triangle that it was nearest to over the mesh. Where it is less than
    `thickness` on its side, it and the triangle's corners move apart along the triangle's normal,
    by their inverse masses; what velocity brings them together is taken away, and slip as far as
    Coulomb's law allows. Past the border of the other garment there is nothing to meet.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        inverse_mass: Inverse masses [1/kg], shape [n].
        other_x: Positions of the other garment, changed in place [m], shape [m, 3].
        other_v: Its velocities, changed in place [m/s], shape [m, 3].
        other_inverse_mass: Its inverse masses [1/kg], shape [m].
        triangles: Its triangles as particles, counter-clockwise from outside, shape [t, 3].
        neighbour: Triangles across their edges ab, bc, ca, -1 at a border, shape [t, 3].
        near: Triangle of each particle, -1 for none, changed in place, shape [n].
        side: 1 where the particles belong outside the other garment, -1 where inside.
        thickness: Distance to keep [m].
        friction: Coulomb coefficient.
        reach: Particles farther away lose their triangle [m].

    Returns:
        Number of particles that touched.
    """
    zero = np.float32(0.0)
    touched = 0
    for p in range(x.shape[0]):
        t = near[p]
        if t < 0:
            continue
        px, py, pz = x[p, 0], x[p, 1], x[p, 2]
        distance, b, c, feature = _closest(other_x, triangles, t, px, py, pz)
        border = False
        for _ in range(_WALK):
            if feature == 0:
                break
            border = False
            nearer = t
            for edge in range(3):
                # Feature 1 to 3 is an edge, 4 to 6 a corner with the edges before and after it.
                if feature != edge + 1 and feature != edge + 4 and feature != (edge + 1) % 3 + 4:
                    continue
                beyond = neighbour[t, edge]
                if beyond < 0:
                    border = True
                    continue
                d2, b2, c2, feature2 = _closest(other_x, triangles, beyond, px, py, pz)
                if d2 < distance:
                    distance, b, c, feature = d2, b2, c2, feature2
                    nearer = beyond
            if nearer == t:
                break
            t = nearer
        near[p] = t
        if distance > reach * reach:
            near[p] = -1
            continue
        if border and feature != 0:
            continue
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        a = np.float32(1.0) - b - c
        ex = other_x[j, 0] - other_x[i, 0]
        ey = other_x[j, 1] - other_x[i, 1]
        ez = other_x[j, 2] - other_x[i, 2]
        fx = other_x[k, 0] - other_x[i, 0]
        fy = other_x[k, 1] - other_x[i, 1]
        fz = other_x[k, 2] - other_x[i, 2]
        nx = ey * fz - ez * fy
        ny = ez * fx - ex * fz
        nz = ex * fy - ey * fx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if length < np.float32(1e-12):
            continue
        turn = np.float32(side) / length
        nx *= turn
        ny *= turn
        nz *= turn
        depth = thickness - (
            (px - a * other_x[i, 0] - b * other_x[j, 0] - c * other_x[k, 0]) * nx
            + (py - a * other_x[i, 1] - b * other_x[j, 1] - c * other_x[k, 1]) * ny
            + (pz - a * other_x[i, 2] - b * other_x[j, 2] - c * other_x[k, 2]) * nz
        )
        if not depth > zero:
            continue
        wp = inverse_mass[p]
        wa = a * other_inverse_mass[i]
        wb = b * other_inverse_mass[j]
        wc = c * other_inverse_mass[k]
        total = wp + a * wa + b * wb + c * wc
        if not total > zero:
            continue
        touched += 1
        ux = v[p, 0] - a * other_v[i, 0] - b * other_v[j, 0] - c * other_v[k, 0]
        uy = v[p, 1] - a * other_v[i, 1] - b * other_v[j, 1] - c * other_v[k, 1]
        uz = v[p, 2] - a * other_v[i, 2] - b * other_v[j, 2] - c * other_v[k, 2]
        along = ux * nx + uy * ny + uz * nz
        ux -= along * nx
        uy -= along * ny
        uz -= along * nz
        slip = np.sqrt(ux * ux + uy * uy + uz * uz)
        closing = max(-along, zero)
        limit = friction * closing
        held = np.float32(1.0) if slip <= limit else limit / slip
        # Impulse over the effective mass, and push, shared out by inverse masses.
        jx = (closing * nx - held * ux) / total
        jy = (closing * ny - held * uy) / total
        jz = (closing * nz - held * uz) / total
        push = depth / total
        x[p, 0] = px + wp * push * nx
        x[p, 1] = py + wp * push * ny
        x[p, 2] = pz + wp * push * nz
        v[p, 0] += wp * jx
        v[p, 1] += wp * jy
        v[p, 2] += wp * jz
        for m, w in ((i, wa), (j, wb), (k, wc)):
            other_x[m, 0] -= w * push * nx
            other_x[m, 1] -= w * push * ny
            other_x[m, 2] -= w * push * nz
            other_v[m, 0] -= w * jx
            other_v[m, 1] -= w * jy
            other_v[m, 2] -= w * jz
    return touched


@kernel()
def measure_motion(v, motion):
    """Sum and maximum of squared speeds [m^2/s^2] of particles [n, 3], written to motion [2]."""
    total = 0.0
    fastest = np.float32(0.0)
    for p in range(v.shape[0]):
        speed = v[p, 0] * v[p, 0] + v[p, 1] * v[p, 1] + v[p, 2] * v[p, 2]
        total += speed
        fastest = max(fastest, speed)
    motion[0] = total
    motion[1] = fastest
