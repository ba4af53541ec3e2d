"""Particles of one garment against the triangles of another, which lies under or over it."""

import numpy as np

from garment_sim_ros.geometry.vectors import cross, dot, length, less, row
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.layers.nearest import closest

_WALK = 8
"""Triangles that a particle may pass in one step."""
_MARGIN = np.float32(2.0)
"""Heights over the other garment, in thicknesses, at which particles may soon touch it."""
SEPARATING_SPEED = 0.1
"""How fast garments that are through each other come apart [m/s]."""
PATIENCE = np.float32(2.0)
"""Ways, in reaches, over which separating what is through gets weaker; then it is left."""
_RELIEF = np.float32(0.25)
"""Patience that comes back where a particle is on its side, as a share of what it cost."""
_ALIKE = np.float32(0.5)
"""Cosine of the angle between two garments above which neither is wrinkled where they meet."""
_STILL = np.float32(1e-24)
"""Square of a slip that is none [m^2/s^2]."""
_FAST = np.float32(5.0 * SEPARATING_SPEED)
"""Particles faster than this [m/s] may come free by themselves, and are parted anew."""


@lean_kernel(inner=True)
def _walk(meeting, p):
    """From the triangle that particle p was nearest to, over the mesh, to the nearest one.

    Returns:
        The triangle, the squared distance to it, the weights of its last two corners there, and
        whether the particle is past a border.
    """
    x, triangles = meeting.other_x, meeting.triangles
    place = row(meeting.x, p)
    t = meeting.near[p]
    distance, b, c, feature = closest(x, triangles, t, place)
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
            beyond = meeting.neighbour[t, edge]
            if beyond < 0:
                border = True
                continue
            d2, b2, c2, feature2 = closest(x, triangles, beyond, place)
            if d2 < distance:
                distance, b, c, feature = d2, b2, c2, feature2
                nearer = beyond
        if nearer == t:
            break
        t = nearer
    return t, distance, b, c, border and feature != 0


@lean_kernel(inner=True)
def _normal(x, triangle):
    """Normal of a triangle, twice as long as its area."""
    a = row(x, triangle[0])
    return cross(less(row(x, triangle[1]), a), less(row(x, triangle[2]), a))


@lean_kernel(inner=True)
def _height(meeting, p, t, b, c, normal):
    """How far particle p is from a place on triangle t along its unit normal [m].

    Args:
        meeting: `layers.pair.Meeting`.
        p: A particle.
        t: A triangle.
        b: Weight of its second corner in the place.
        c: That of its third one.
        normal: Unit normal.
    """
    x, other_x = meeting.x, meeting.other_x
    a = np.float32(1.0) - b - c
    i, j, k = meeting.triangles[t, 0], meeting.triangles[t, 1], meeting.triangles[t, 2]
    return (
        (x[p, 0] - a * other_x[i, 0] - b * other_x[j, 0] - c * other_x[k, 0]) * normal[0]
        + (x[p, 1] - a * other_x[i, 1] - b * other_x[j, 1] - c * other_x[k, 1]) * normal[1]
        + (x[p, 2] - a * other_x[i, 2] - b * other_x[j, 2] - c * other_x[k, 2]) * normal[2]
    )


@lean_kernel(inner=True)
def _is_tangled(meeting, p):
    """Whether particle p stays through the other garment: no push has helped, and it is slow."""
    v, pushed = meeting.v, meeting.pushed
    speed = v[p, 0] * v[p, 0] + v[p, 1] * v[p, 1] + v[p, 2] * v[p, 2]
    if speed > _FAST * _FAST:
        pushed[p] = np.float32(0.0)
    return pushed[p] >= PATIENCE * meeting.reach


@lean_kernel(inner=True)
def _meets(meeting, p, many):
    """Whether particle p, which has a triangle, may soon touch it; then it is the next `close`."""
    near, pushed, reach, zero = meeting.near, meeting.pushed, meeting.reach, np.float32(0.0)
    t, distance, b, c, outside = _walk(meeting, p)
    near[p] = t
    if distance > reach * reach:
        near[p] = -1
        pushed[p] = zero
        return False
    if outside:
        return False
    normal = _normal(meeting.other_x, meeting.triangles[t])
    own = _normal(meeting.x, meeting.own[p])
    size, alike = length(normal), dot(own, normal)
    if size < np.float32(1e-12):
        return False
    if alike < zero:
        # One of the two is folded over there: nobody knows the sides.
        return False
    turn = meeting.side / size
    normal = normal[0] * turn, normal[1] * turn, normal[2] * turn
    if not _height(meeting, p, t, b, c, normal) < _MARGIN * meeting.thickness:
        pushed[p] = zero
        return False
    meeting.close[many] = p
    plane = meeting.plane
    plane[many, 0], plane[many, 1], plane[many, 2] = normal
    plane[many, 3] = b
    plane[many, 4] = c
    plane[many, 5] = meeting.thickness if alike > _ALIKE * length(own) * size else zero
    return True


@lean_kernel(forceinline=True)
def find_close_one_way(meeting):
    """Which particles are close to the other garment, and in which planes they meet it.

    Each particle follows the triangle that it was nearest to over the mesh. Past the border of the
    other garment there is nothing to meet, nor where one of them is folded over, so that its
    outside faces the body: pushed to its side of the one, it would be on the wrong side of the
    other, and both would shake for ever. What is clear of the other garment, on its side, counts
    as never pushed.

    Args:
        meeting: `layers.pair.Meeting`; `near`, `close`, `plane`, `found` and `pushed` are changed
            in place.
    """
    many = 0
    tangled = 0
    for p in range(meeting.x.shape[0]):
        if meeting.near[p] >= 0:
            tangled += _is_tangled(meeting, p)
            many += _meets(meeting, p, many)
    meeting.found[0] = many
    meeting.found[2] = tangled


@lean_kernel(inner=True)
def _move(x, v, p, w, push, normal, impulse):
    """Moves particle p along a normal, and gives it an impulse, by its inverse mass w.

    What stays is not written to: nobody looks whether it is still good.
    """
    if w > np.float32(0.0):
        for k in range(3):
            x[p, k] += w * push * normal[k]
            v[p, k] += w * impulse[k]


@lean_kernel(inner=True)
def _part_firmly(meeting, n, depth):
    """Moves the outer garment away from the inner one, which the body holds, at what is close.

    It goes by what is left of the distance, and by no more than the height that it has: a tight
    one would be drawn through the inner one by more than `way`. The inner one stays: pushed into
    the body, contact would throw it out again.

    Args:
        meeting: `layers.pair.Meeting`; positions are changed in place.
        n: Number of the close particle.
        depth: What it is nearer than the thickness [m].
    """
    plane, zero = meeting.plane, np.float32(0.0)
    far = min(depth, plane[n, 5] - depth)
    if not far > zero:
        return
    p = meeting.close[n]
    if meeting.side > zero:
        if meeting.inverse_mass[p] > zero:
            for k in range(3):
                meeting.x[p, k] += far * plane[n, k]
        return
    triangle, b, c = meeting.triangles[meeting.near[p]], plane[n, 3], plane[n, 4]
    a = np.float32(1.0) - b - c
    w = meeting.other_inverse_mass
    wa, wb, wc = a * w[triangle[0]], b * w[triangle[1]], c * w[triangle[2]]
    total = a * wa + b * wb + c * wc
    if not total > zero:
        return
    for m, share in ((triangle[0], wa), (triangle[1], wb), (triangle[2], wc)):
        for k in range(3):
            meeting.other_x[m, k] -= share * far / total * plane[n, k]


@lean_kernel(forceinline=True)
def separate_one_way(meeting):
    """Moves particles to their side of another garment, and that garment away from them.

    Where one that is `close` is less than the thickness on its side, it and the triangle's corners
    move apart along the triangle's normal, by their inverse masses, `way` at most: what is deep
    on the wrong side comes back without being thrown. Where both face the same way, and what is
    close is on its side, the outer garment moves on (`_part_firmly`). What stays through, as cloth
    in an armhole, is pushed more and more weakly, and then left where it is: contradicting pushes
    would never let it rest. What is pressed to less than the thickness is on its side, and is
    parted for ever. What velocity brings them together is taken away, and slip as far as Coulomb's
    law allows.

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
        is_through = depth > thickness + way[0]
        so_far = pushed[p] if is_through else max(pushed[p] - _RELIEF * way[0], zero)
        left = np.float32(1.0) - so_far / (PATIENCE * reach)
        pushed[p] = so_far + way[0] if is_through and left > zero else so_far
        if not (left > zero and depth > zero):
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
        slip = np.sqrt(max(ux * ux + uy * uy + uz * uz, _STILL))
        closing = max(-along, zero)
        limit = friction * closing
        held = np.float32(1.0) if slip <= limit else limit / slip
        # Impulse over the effective mass, and push, shared out by inverse masses.
        jx = (closing * nx - held * ux) / total
        jy = (closing * ny - held * uy) / total
        jz = (closing * nz - held * uz) / total
        push = min(depth, left * way[0]) / total
        normal, impulse, back = (nx, ny, nz), (jx, jy, jz), (-jx, -jy, -jz)
        _move(x, v, p, wp, push, normal, impulse)
        for m, w in ((i, wa), (j, wb), (k, wc)):
            _move(other_x, other_v, m, w, -push, normal, back)
        _part_firmly(meeting, n, depth - push * total)
    found[1] = touched


@lean_kernel()
def keep_to_side(meeting, x, v):
    """Takes back what would move close particles away from their side.

    Args:
        meeting: `layers.pair.Meeting`, as it was before; what it tells stays.
        x: Positions of its particles after the movement, changed in place [m], shape [n, 3].
        v: Velocities likewise [m/s], shape [n, 3].
    """
    plane, zero = meeting.plane, np.float32(0.0)
    for n in range(meeting.found[0]):
        p = meeting.close[n]
        ux, uy, uz = less(row(x, p), row(meeting.x, p))
        if ux * plane[n, 0] + uy * plane[n, 1] + uz * plane[n, 2] < zero:
            for k in range(3):
                x[p, k], v[p, k] = meeting.x[p, k], meeting.v[p, k]


@lean_kernel()
def find_close(one_way, other_way):
    """`find_close_one_way` for both `layers.pair.Meeting` of a pair of garments."""
    find_close_one_way(one_way)
    find_close_one_way(other_way)


@lean_kernel()
def separate(one_way, other_way):
    """`separate_one_way` for both."""
    separate_one_way(one_way)
    separate_one_way(other_way)
