"""Parts of one mesh kept apart: particles from triangles, and edges from edges."""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.geometry.mesh_distance import closest_on_triangle
from garment_sim_ros.geometry.vectors import dot, row
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.self_collision.gaps import edge_weights

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_TINY = np.float32(1e-12)
_PARALLEL = np.float32(1e-4)
"""Edges are parallel below this squared sine of their angle: their common normal is noise."""


LEAST_LEVER = np.float32(0.25)
"""Effective inverse masses are at least this share of the largest one of the particles."""


class Lying(NamedTuple):
    """What particles weigh, and which shapes they lie on.

    Attributes:
        inverse_mass: Inverse masses [1/kg], shape [n].
        shape: Shape that each free particle touches, -1 for none, shape [f], f at most n.
        normal: The shape's outward unit normal there, shape [f, 3].
    """

    inverse_mass: SingleArray
    shape: IntArray
    normal: SingleArray


@lean_kernel(inner=True)
def _over_triangle(x, p, i, j, k):
    """A triangle's unit normal, and the height of a particle over it; zeros if degenerate."""
    ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    fx, fy, fz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if not length > _TINY:
        return _ZERO, _ZERO, _ZERO, _ZERO
    scale = _ONE / length
    nx *= scale
    ny *= scale
    nz *= scale
    h = (x[p, 0] - x[i, 0]) * nx + (x[p, 1] - x[i, 1]) * ny + (x[p, 2] - x[i, 2]) * nz
    return nx, ny, nz, h


@lean_kernel(inner=True)
def _between_edges(x, a, b, c, d):
    """Common unit normal of edges ab and cd, and how far along it cd is; zeros if parallel."""
    ex, ey, ez = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    fx, fy, fz = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    squared = nx * nx + ny * ny + nz * nz
    both = (ex * ex + ey * ey + ez * ez) * (fx * fx + fy * fy + fz * fz)
    if not squared > _PARALLEL * both:
        return _ZERO, _ZERO, _ZERO, _ZERO
    scale = _ONE / np.sqrt(squared)
    nx *= scale
    ny *= scale
    nz *= scale
    h = (x[c, 0] - x[a, 0]) * nx + (x[c, 1] - x[a, 1]) * ny + (x[c, 2] - x[a, 2]) * nz
    return nx, ny, nz, h


@lean_kernel(inner=True)
def _on_the_way(before, x, i, j, s):
    """Particle i less particle j at the part s of a step."""
    r = _ONE - s
    return (
        r * (before[i, 0] - before[j, 0]) + s * (x[i, 0] - x[j, 0]),
        r * (before[i, 1] - before[j, 1]) + s * (x[i, 1] - x[j, 1]),
        r * (before[i, 2] - before[j, 2]) + s * (x[i, 2] - x[j, 2]),
    )


@lean_kernel(inner=True)
def point_contact(before, x, p, i, j, k, limit):
    """Whether a particle came too near to a triangle, or through it, in a step.

    Args:
        before: Positions when the step started [m], shape [n, 3].
        x: Positions now [m], shape [n, 3].
        p: The particle.
        i: First corner of the triangle.
        j: Its second corner.
        k: Its third corner.
        limit: Distance to keep [m].

    Returns:
        (depth, normal, b, c, through): how far the two must get apart along the unit normal, which
        points to the particle [m], not above 0 where they need not; weights of the second and
        third corner; whether the particle went through.
    """
    nx, ny, nz, h = _over_triangle(x, p, i, j, k)
    _, _, _, h0 = _over_triangle(before, p, i, j, k)
    if h0 * h < _ZERO:
        s = h0 / (h0 - h)
        px, py, pz = _on_the_way(before, x, p, i, s)
        ex, ey, ez = _on_the_way(before, x, j, i, s)
        fx, fy, fz = _on_the_way(before, x, k, i, s)
        ee = ex * ex + ey * ey + ez * ez
        ff = fx * fx + fy * fy + fz * fz
        ef = ex * fx + ey * fy + ez * fz
        pe = px * ex + py * ey + pz * ez
        pf = px * fx + py * fy + pz * fz
        area = ee * ff - ef * ef
        b = ff * pe - ef * pf
        c = ee * pf - ef * pe
        if b >= _ZERO and c >= _ZERO and b + c <= area and area > _ZERO:
            side = _ONE if h0 > _ZERO else -_ONE
            return limit + abs(h), (side * nx, side * ny, side * nz), b / area, c / area, True
    if abs(h) >= limit:
        return -_ONE, (nx, ny, nz), _ZERO, _ZERO, False
    b, c, feature = closest_on_triangle(x[i], x[j], x[k], x[p, 0], x[p, 1], x[p, 2])
    b = np.float32(b)
    c = np.float32(c)
    side = _ONE if h > _ZERO else -_ONE
    if feature == 0:
        return limit - abs(h), (side * nx, side * ny, side * nz), b, c, False
    a = _ONE - b - c
    dx = x[p, 0] - a * x[i, 0] - b * x[j, 0] - c * x[k, 0]
    dy = x[p, 1] - a * x[i, 1] - b * x[j, 1] - c * x[k, 1]
    dz = x[p, 2] - a * x[i, 2] - b * x[j, 2] - c * x[k, 2]
    gap = np.sqrt(dx * dx + dy * dy + dz * dz)
    if gap >= limit:
        return -_ONE, (nx, ny, nz), b, c, False
    if gap < np.float32(1e-7):
        return limit, (side * nx, side * ny, side * nz), b, c, False
    scale = _ONE / gap
    return limit - gap, (dx * scale, dy * scale, dz * scale), b, c, False


@lean_kernel(inner=True)
def edge_contact(before, x, a, b, c, d, limit):
    """Whether an edge came too near to another one, or through it, in a step.

    Nearness counts where both are nearest between their ends; else it is that of a particle.

    Args:
        before: Positions when the step started [m], shape [n, 3].
        x: Positions now [m], shape [n, 3].
        a: First end of one edge.
        b: Its second end.
        c: First end of the other edge.
        d: Its second end.
        limit: Distance to keep [m].

    Returns:
        (depth, normal, s, t, through): as `point_contact`; the normal points to cd, s and t
        are the weights of b and d.
    """
    nx, ny, nz, h = _between_edges(x, a, b, c, d)
    _, _, _, h0 = _between_edges(before, a, b, c, d)
    crossed = h0 * h < _ZERO
    if not crossed and abs(h) >= limit:
        return -_ONE, (nx, ny, nz), _ZERO, _ZERO, False
    if crossed:
        part = h0 / (h0 - h)
        ex, ey, ez = _on_the_way(before, x, b, a, part)
        fx, fy, fz = _on_the_way(before, x, d, c, part)
        rx, ry, rz = _on_the_way(before, x, a, c, part)
        ee = ex * ex + ey * ey + ez * ez
        ff = fx * fx + fy * fy + fz * fz
        ef = ex * fx + ey * fy + ez * fz
        er = ex * rx + ey * ry + ez * rz
        fr = fx * rx + fy * ry + fz * rz
        area = ee * ff - ef * ef
        if area > _PARALLEL * ee * ff:
            s = (ef * fr - er * ff) / area
            t = (ee * fr - ef * er) / area
            dx = rx + s * ex - t * fx
            dy = ry + s * ey - t * fy
            dz = rz + s * ez - t * fz
            # Where they turned through parallel they were never as near as that.
            near = np.float32(0.25) * (abs(h) + abs(h0))
            if (
                _ZERO <= s <= _ONE
                and _ZERO <= t <= _ONE
                and dx * dx + dy * dy + dz * dz <= near * near
            ):
                side = _ONE if h0 > _ZERO else -_ONE
                return limit + abs(h), (side * nx, side * ny, side * nz), s, t, True
    if h == _ZERO or abs(h) >= limit:
        return -_ONE, (nx, ny, nz), _ZERO, _ZERO, False
    s, t, _ = edge_weights(x, a, b, c, d)
    if not (_ZERO < s < _ONE and _ZERO < t < _ONE):
        return -_ONE, (nx, ny, nz), s, t, False
    side = _ONE if h > _ZERO else -_ONE
    return limit - abs(h), (side * nx, side * ny, side * nz), s, t, False


@lean_kernel(inner=True)
def _ease(lying, p, share, normal):
    """Inverse mass of a particle for a push along `share` times a direction.

    It is less where the push goes into the shape that the particle lies on.
    """
    w = lying.inverse_mass[p]
    if p >= lying.shape.size or lying.shape[p] < 0:
        return w
    into = dot(row(lying.normal, p), normal)
    if share * into >= _ZERO:
        return w
    return w * max(_ONE - into * into, _ZERO)


@lean_kernel(inner=True)
def _separate(x, v, lying, four, share, normal, depth, friction):
    """Moves four particles apart along a direction.

    The push keeps the centre of mass; closing velocity is taken away, and slip as far as
    Coulomb's law allows.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        lying: `Lying`.
        four: The particles.
        share: How much of the direction each of them goes, with sum 0.
        normal: Unit direction.
        depth: How far they must get apart [m].
        friction: Coulomb coefficient.

    Returns:
        Whether any of them can move.
    """
    i, j, k, m = four
    ci, cj, ck, cm = share
    wi = _ease(lying, i, ci, normal)
    wj = _ease(lying, j, cj, normal)
    wk = _ease(lying, k, ck, normal)
    wm = _ease(lying, m, cm, normal)
    most = max(max(wi, wj), max(wk, wm))
    if not most > _ZERO:
        return False
    total = ci * ci * wi + cj * cj * wj + ck * ck * wk + cm * cm * wm
    # Where all that can move is far from the contact it would have to fly to part the rest.
    total = max(total, LEAST_LEVER * most)
    nx, ny, nz = normal
    ux = ci * v[i, 0] + cj * v[j, 0] + ck * v[k, 0] + cm * v[m, 0]
    uy = ci * v[i, 1] + cj * v[j, 1] + ck * v[k, 1] + cm * v[m, 1]
    uz = ci * v[i, 2] + cj * v[j, 2] + ck * v[k, 2] + cm * v[m, 2]
    along = ux * nx + uy * ny + uz * nz
    ux -= along * nx
    uy -= along * ny
    uz -= along * nz
    slip = np.sqrt(ux * ux + uy * uy + uz * uz)
    limit = friction * max(-along, _ZERO)
    held = _ONE if slip <= limit else limit / slip
    jx = -(along * nx + held * ux) / total
    jy = -(along * ny + held * uy) / total
    jz = -(along * nz + held * uz) / total
    push = depth / total
    for q, wq in ((i, wi * ci), (j, wj * cj), (k, wk * ck), (m, wm * cm)):
        x[q, 0] += wq * push * nx
        x[q, 1] += wq * push * ny
        x[q, 2] += wq * push * nz
        v[q, 0] += wq * jx
        v[q, 1] += wq * jy
        v[q, 2] += wq * jz
    return True


@lean_kernel(inner=True)
def _four(table, e):
    """Row e of a table of particles, shape [any, 4]."""
    return table[e, 0], table[e, 1], table[e, 2], table[e, 3]


@lean_kernel(inner=True)
def _part_points(before, x, v, lying, tangled, pairs, friction):
    """Moves particles and triangles apart: how many pairs touched, and how many went through."""
    touched = through = 0
    for e in range(pairs.counts[0]):
        p, i, j, k = _four(pairs.points, e)
        limit = pairs.point_limit[e]
        depth, normal, b, c, passed = point_contact(before, x, p, i, j, k, limit)
        if not depth > _ZERO or (tangled[p] and (tangled[i] or tangled[j] or tangled[k])):
            continue
        share = _ONE, b + c - _ONE, -b, -c
        if _separate(x, v, lying, (p, i, j, k), share, normal, depth, friction):
            touched += 1
            through += passed
    return touched, through


@lean_kernel(inner=True)
def _part_edges(before, x, v, lying, tangled, pairs, friction):
    """The same of edges."""
    touched = through = 0
    for e in range(pairs.counts[1]):
        a, b, c, d = _four(pairs.edges, e)
        depth, normal, s, t, passed = edge_contact(before, x, a, b, c, d, pairs.edge_limit[e])
        if not depth > _ZERO or ((tangled[a] or tangled[b]) and (tangled[c] or tangled[d])):
            continue
        share = s - _ONE, -s, _ONE - t, t
        if _separate(x, v, lying, (a, b, c, d), share, normal, depth, friction):
            touched += 1
            through += passed
    return touched, through


@lean_kernel()
def keep_apart(before, x, v, lying, tangled, pairs, friction, passes):
    """Moves pairs apart that came too near, and back those that went through each other.

    A pass over all pairs in order (Gauss-Seidel); more passes as long as something went through.
    Pairs that are tangled are left alone, see `self_collision.untangling`.

    Args:
        before: Positions when the step started, free of what is not `tangled` [m], shape [n, 3].
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        lying: `Lying`.
        tangled: Whether a particle is where the mesh passes through itself, shape [n].
        pairs: `near_pairs.Pairs`.
        friction: Coulomb coefficient.
        passes: Most passes.

    Returns:
        Number of pairs that touched in the first pass, and that went through in the last.
    """
    touched = 0
    through = 0
    for n in range(passes):
        points, passed = _part_points(before, x, v, lying, tangled, pairs, friction)
        edges, crossed = _part_edges(before, x, v, lying, tangled, pairs, friction)
        through = passed + crossed
        if n == 0:
            touched = points + edges
        if through == 0:
            break
    return touched, through
