"""Particles of one garment against the triangles of another, which lies under or over it."""

import numpy as np

from garment_sim_ros.geometry.mesh_distance import closest_on_triangle
from garment_sim_ros.jit import kernel

_WALK = 8
"""Triangles that a particle may pass in one step."""
_MARGIN = np.float32(2.0)
"""Heights over the other garment, in thicknesses, at which particles may soon touch it."""
PARTING_SPEED = 0.1
"""How fast garments that are through each other come apart [m/s]."""
PATIENCE = np.float32(2.0)
"""Ways of parting, in reaches, over which it gets weaker; what is then still through is left."""
_RELIEF = np.float32(0.25)
"""Patience that comes back where a particle is on its side, as a share of what it cost."""
_FAST = np.float32(5.0 * PARTING_SPEED)
"""Particles faster than this [m/s] may come free by themselves, and are parted anew."""


@kernel(inner=True)
def _cell(ix, iy, iz, cells):
    """A cell of a hashed grid; primes after Teschner et al. 2003."""
    return ((ix * 73856093) ^ (iy * 19349663) ^ (iz * 83492791)) & (cells - 1)


@kernel(inner=True)
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


@kernel(forceinline=True)
def find_close_one_way(meeting):
    """Which particles are close to the other garment, and in which planes they meet it.

    Each particle follows the triangle that it was nearest to over the mesh. Past the border of the
    other garment there is nothing to meet, nor where one of them is folded over, so that its
    outside faces the body: pushed to its side of the one, it would be on the wrong side of the
    other, and both would shake for ever.

    What is parted there for a while already is left as it is: switched on and off, parting would
    never let it rest.

    Args:
        meeting: `layers.pair.Meeting`; `near`, `close`, `plane`, `found` and `pushed` are changed
            in place.
    """
    x, other_x, own = meeting.x, meeting.other_x, meeting.own
    triangles, neighbour, near = meeting.triangles, meeting.neighbour, meeting.near
    close, plane, pushed, v = meeting.close, meeting.plane, meeting.pushed, meeting.v
    side, thickness, reach = meeting.side, meeting.thickness, meeting.reach
    margin = _MARGIN * thickness
    zero = np.float32(0.0)
    many = 0
    tangled = 0
    for p in range(x.shape[0]):
        t = near[p]
        if t < 0:
            continue
        px, py, pz = x[p, 0], x[p, 1], x[p, 2]
        speed = v[p, 0] * v[p, 0] + v[p, 1] * v[p, 1] + v[p, 2] * v[p, 2]
        if speed > _FAST * _FAST:
            pushed[p] = zero
        tangled += 1 if pushed[p] >= PATIENCE * reach else 0
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
            pushed[p] = zero
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
        i, j, k = own[p, 0], own[p, 1], own[p, 2]
        ax, ay, az = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        bx, by, bz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        if (ay * bz - az * by) * nx + (az * bx - ax * bz) * ny + (ax * by - ay * bx) * nz < zero:
            # One of the two is folded over there: nobody knows the sides.
            if pushed[p] > zero:
                pushed[p] = np.float32(np.inf)
            continue
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        turn = side / length
        nx *= turn
        ny *= turn
        nz *= turn
        height = (
            (px - a * other_x[i, 0] - b * other_x[j, 0] - c * other_x[k, 0]) * nx
            + (py - a * other_x[i, 1] - b * other_x[j, 1] - c * other_x[k, 1]) * ny
            + (pz - a * other_x[i, 2] - b * other_x[j, 2] - c * other_x[k, 2]) * nz
        )
        if not height < margin:
            continue
        close[many] = p
        plane[many, 0] = nx
        plane[many, 1] = ny
        plane[many, 2] = nz
        plane[many, 3] = b
        plane[many, 4] = c
        many += 1
    meeting.found[0] = many
    meeting.found[2] = tangled


@kernel(forceinline=True)
def part_one_way(meeting):
    """Moves particles to their side of another garment, and that garment away from them.

    Where one that is `close` is less than the thickness on its side, it and the triangle's corners
    move apart along the triangle's normal, by their inverse masses, `way` at most: what is deep
    on the wrong side comes back without being thrown. What does not come back, as cloth that is
    through an armhole, is pushed more and more weakly, and then left where it is. What velocity
    brings them together is taken away, and slip as far as Coulomb's law allows.

    Args:
        meeting: `layers.pair.Meeting`; positions, velocities, `found` and `pushed` are changed in
            place.
    """
    x, v, inverse_mass = meeting.x, meeting.v, meeting.inverse_mass
    other_x, other_v, triangles = meeting.other_x, meeting.other_v, meeting.triangles
    other_inverse_mass, near, close = meeting.other_inverse_mass, meeting.near, meeting.close
    plane, pushed, way, found = meeting.plane, meeting.pushed, meeting.way, meeting.found
    thickness, friction, reach = meeting.thickness, meeting.friction, meeting.reach
    zero = np.float32(0.0)
    touched = 0
    for n in range(found[0]):
        p = close[n]
        t = near[p]
        nx, ny, nz = plane[n, 0], plane[n, 1], plane[n, 2]
        b, c = plane[n, 3], plane[n, 4]
        a = np.float32(1.0) - b - c
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        depth = thickness - (
            (x[p, 0] - a * other_x[i, 0] - b * other_x[j, 0] - c * other_x[k, 0]) * nx
            + (x[p, 1] - a * other_x[i, 1] - b * other_x[j, 1] - c * other_x[k, 1]) * ny
            + (x[p, 2] - a * other_x[i, 2] - b * other_x[j, 2] - c * other_x[k, 2]) * nz
        )
        left = np.float32(1.0) - pushed[p] / (PATIENCE * reach)
        if not left > zero:
            continue
        if depth > way[0]:
            pushed[p] += way[0]
        elif pushed[p] > zero:
            pushed[p] = max(pushed[p] - _RELIEF * way[0], zero)
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
        push = min(depth, left * way[0]) / total
        x[p, 0] += wp * push * nx
        x[p, 1] += wp * push * ny
        x[p, 2] += wp * push * nz
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
    found[1] = touched


@kernel()
def find_close(one_way, other_way):
    """`find_close_one_way` for both `layers.pair.Meeting` of a pair of garments."""
    find_close_one_way(one_way)
    find_close_one_way(other_way)


@kernel()
def part(one_way, other_way):
    """`part_one_way` for both."""
    part_one_way(one_way)
    part_one_way(other_way)
