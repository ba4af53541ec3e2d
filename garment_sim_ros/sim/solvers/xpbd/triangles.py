"""Extended position-based dynamics of triangles of constant strain with compliance.

The three strains of a triangle are one constraint with three components, whose multipliers are
found together (Macklin et al. 2016, "XPBD", equation 18 with a block of 3 by 3): Poisson's ratio
couples them in the compliance, and all move the same three corners. Taken one after the other each
would move what the one before it has put right.

With f = a1 e1 + a2 e2 and g = b1 e1 + b2 e2 (see `sim.membrane`), e1 and e2 the sides from the
first corner to the others, a correction moves the corners along f and g only: all that has to be
known of these are their lengths and their product.

Triangles are in fours without a common corner, solved at once; one that is in none is four times
the same.
"""

import numpy as np

from garment_sim_ros.geometry.four import (
    each_four_times,
    four_at,
    higher_four,
    products,
    put_four,
    put_three,
    roots,
    same_four,
    three_at,
    where_above,
)
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.membrane import FADING, PRESSED

NUMBERS = 11
"""How many there are of a triangle in `prepare_triangles`."""
_THREE, _FOUR, _EIGHT = np.uint64(3), np.uint64(4), np.uint64(8)
_TINY = np.float32(1e-20)
_HALF_ROOT = np.float32(np.sqrt(0.5))
_THIN = np.float32(1e-4)
"""Smallest part of the sum of both diagonals' squares that one of them counts as: in a triangle
that has collapsed to a line rounding is all that is known of its direction."""
_FIRM = np.float32(1.001)
"""Where corners are pinned the three strains depend on each other; so much more of each one's own
weight tells them apart."""


@kernel()
def prepare_triangles(particles, along, area, stiffness, inverse_mass, keep, dt, triangles):
    """What a sub-step of dt needs of each triangle.

    Args:
        particles: Corners, flat, shape [3 t].
        along: See `Membrane`, shape [t, 2, 2].
        area: Areas [m^2], shape [t].
        stiffness: Along the warp [N/m].
        inverse_mass: Inverse masses [1/kg], shape [n].
        keep: Part of velocity that damping leaves in a sub-step; of what forces add, too.
        dt: Sub-step [s].
        triangles: Output, in fours: a1, a2, b1, b2; inverse masses of the corners; how much f
            moves for a pull of its own, g for one of f, g for its own; compliance of the warp.
            Flat, shape [11 t].
    """
    for t in range(area.size):
        w0 = keep * inverse_mass[particles[3 * t]]
        w1 = keep * inverse_mass[particles[3 * t + 1]]
        w2 = keep * inverse_mass[particles[3 * t + 2]]
        a1, a2 = along[t, 0, 0], along[t, 0, 1]
        b1, b2 = along[t, 1, 0], along[t, 1, 1]
        a0, b0 = -a1 - a2, -b1 - b2
        numbers = (
            *(a1, a2, b1, b2, w0, w1, w2),
            w0 * a0 * a0 + w1 * a1 * a1 + w2 * a2 * a2,
            w0 * a0 * b0 + w1 * a1 * b1 + w2 * a2 * b2,
            w0 * b0 * b0 + w1 * b1 * b1 + w2 * b2 * b2,
            1.0 / (stiffness * area[t] * dt * dt),
        )
        first = 4 * NUMBERS * (t // 4) + t % 4
        for k in range(NUMBERS):
            triangles[first + 4 * k] = numbers[k]


@kernel(inner=True)
def _number(triangles, at, k):
    """Number k of the four triangles whose numbers begin at `at`."""
    return four_at(triangles, at + _FOUR * np.uint64(k))


@kernel(inner=True)
def _pressed(e, d, coupling):
    """How much softer a thread is than under tension: its stress has the sign of this sum."""
    part = same_four(np.float32(PRESSED))
    one = same_four(np.float32(1.0))
    stress = e + coupling * where_above(same_four(np.float32(0.0)), d, part * d, d)
    return where_above(same_four(np.float32(0.0)), stress, one / part, one)


@kernel(inner=True)
def _laid_along(d, e, first, second):
    """The vectors first * d + second * e of four triangles, from fours of numbers."""
    s0, s1, s2, s3 = each_four_times(first)
    t0, t1, t2, t3 = each_four_times(second)
    return (
        s0 * d[0] + t0 * e[0],
        s1 * d[1] + t1 * e[1],
        s2 * d[2] + t2 * e[2],
        s3 * d[3] + t3 * e[3],
    )


@kernel(inner=True)
def _threads(triangles, at, d, e):
    """F and g of four triangles whose sides are d and e and whose numbers begin at `at`."""
    return (
        _laid_along(d, e, _number(triangles, at, 0), _number(triangles, at, 1)),
        _laid_along(d, e, _number(triangles, at, 2), _number(triangles, at, 3)),
    )


@kernel(inner=True)
def _products(f, g):
    """Scalar products f f, f g and g g."""
    tiny = same_four(_TINY)
    return products(f, f) + tiny, products(f, g), products(g, g) + tiny


@kernel(inner=True)
def _shear(ff, fg, gg):
    """Shear of four triangles from the scalar products of f and g, and how it grows.

    Returns:
        The shear; it grows by turn * g + grow * f for each metre that f gets longer, and by
        turn * f + grow * g for each that g does: turn and grow.
    """
    both, two = ff + gg, fg + fg
    least = same_four(_THIN) * both
    a, b = roots(higher_four(both + two, least)), roots(higher_four(both - two, least))
    half = same_four(_HALF_ROOT)
    p, q = half / a, half / b
    return half * (a - b), p + q, p - q


@kernel(inner=True)
def _multipliers(triangles, at, law, squared, stress):
    """Multipliers of four triangles, and how far f and g go by them.

    Args:
        triangles: From `prepare_triangles`, flat.
        at: Where the numbers of the four begin.
        law: See `solve_triangles`.
        squared: Scalar products f f, f g and g g.
        stress: Multipliers that they have: warp, weft and shear.

    Returns:
        What is added to those, three fours; what pulls f along f, f along g and g along f, and
        g along g, three fours.
    """
    ff, fg, gg = squared
    f, g = roots(ff), roots(gg)
    one, firm = same_four(np.float32(1.0)), same_four(_FIRM)
    e, d = f - one, g - one
    s, turn, grow = _shear(ff, fg, gg)
    warp = _number(triangles, at, 10)
    weft, shear = warp * same_four(law[0]), warp * same_four(law[1])
    small = one / (one + same_four(np.float32(FADING)) * (e * e + d * d))
    by_weft, by_warp = small * same_four(law[2]), small * same_four(law[3])
    both = warp * by_warp
    warp = warp * _pressed(e, d, by_weft)
    weft = weft * _pressed(d, e, by_warp)
    p, q, r = _number(triangles, at, 7), _number(triangles, at, 8), _number(triangles, at, 9)
    # Scalar products of what f and g get by a shear, s and t, with f, g and each other.
    sf, sg = grow * ff + turn * fg, grow * fg + turn * gg
    tf, tg = turn * ff + grow * fg, turn * fg + grow * gg
    i, j = one / f, one / g
    m11, m22 = p * firm + warp, r * firm + weft
    m12 = q * fg * i * j - both
    m13, m23 = i * (p * sf + q * tf), j * (q * sg + r * tg)
    ss, tt, st = grow * sf + turn * sg, turn * tf + grow * tg, turn * sf + grow * sg
    m33 = (p * ss + r * tt + (q + q) * st) * firm + shear
    c1 = e - warp * stress[0] + both * stress[1]
    c2 = d - weft * stress[1] + both * stress[0]
    c3 = s - shear * stress[2]
    # Cholesky without roots.
    i1 = one / m11
    l2, l3 = m12 * i1, m13 * i1
    i2 = one / (m22 - l2 * m12)
    n = m23 - l2 * m13
    l4 = n * i2
    i3 = one / (m33 - l3 * m13 - l4 * n)
    c2 = c2 - l2 * c1
    z = (c3 - l3 * c1 - l4 * c2) * i3
    y = c2 * i2 - l4 * z
    x = c1 * i1 - l2 * y - l3 * z
    return (x, y, z), (x * i + z * grow, z * turn, y * j + z * grow)


@kernel(inner=True)
def _moves(triangles, at, threads, pulled):
    """How far the first, second and third corners of four triangles go."""
    f, g = threads
    u, s, v = pulled
    a1, a2 = _number(triangles, at, 0), _number(triangles, at, 1)
    b1, b2 = _number(triangles, at, 2), _number(triangles, at, 3)
    w0, w1, w2 = _number(triangles, at, 4), _number(triangles, at, 5), _number(triangles, at, 6)
    p1, q1 = a1 * u + b1 * s, a1 * s + b1 * v
    p2, q2 = a2 * u + b2 * s, a2 * s + b2 * v
    none = same_four(np.float32(0.0))
    return (
        _laid_along(f, g, w0 * (p1 + p2), w0 * (q1 + q2)),
        _laid_along(f, g, none - w1 * p1, none - w1 * q1),
        _laid_along(f, g, none - w2 * p2, none - w2 * q2),
    )


@kernel(inner=True)
def _corner(particles, i, width):
    """Where one corner of each of four triangles is, the first one's at i of `particles`."""
    return (
        width * np.uint64(particles[i]),
        width * np.uint64(particles[i + 3]),
        width * np.uint64(particles[i + 6]),
        width * np.uint64(particles[i + 9]),
    )


@kernel(inner=True)
def _corners(particles, n, width):
    """First, second and third corners of four triangles from n on, with so many numbers each."""
    i = np.int64(3 * n)
    return (
        _corner(particles, i, width),
        _corner(particles, i + 1, width),
        _corner(particles, i + 2, width),
    )


@kernel(inner=True)
def _fours_at(x, at):
    """Four fours."""
    return four_at(x, at[0]), four_at(x, at[1]), four_at(x, at[2]), four_at(x, at[3])


@kernel(inner=True)
def _threes_at(x, at):
    """Four vectors of three numbers."""
    return three_at(x, at[0]), three_at(x, at[1]), three_at(x, at[2]), three_at(x, at[3])


@kernel(inner=True)
def _less(a, b):
    """Differences of four vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]


@kernel(inner=True)
def _plus(a, b):
    """Sums of four vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]


@kernel(inner=True)
def _put_fours(x, at, a):
    """Writes four fours."""
    put_four(x, at[0], a[0])
    put_four(x, at[1], a[1])
    put_four(x, at[2], a[2])
    put_four(x, at[3], a[3])


@kernel(inner=True)
def _put_threes(x, at, a):
    """Writes four vectors of three numbers."""
    put_three(x, at[0], a[0])
    put_three(x, at[1], a[1])
    put_three(x, at[2], a[2])
    put_three(x, at[3], a[3])


@kernel(forceinline=True)
def solve_triangles(x, particles, triangles, law):
    """One Gauss-Seidel pass from multipliers of zero.

    Args:
        x: Positions, four numbers each of which the last one does not count, changed in place,
            flat [m], shape [4 n].
        particles: Corners, flat, unsigned, in fours without a common one, shape [3 t].
        triangles: From `prepare_triangles`, flat.
        law: Stiffness of the warp over those of weft and shear; Poisson's ratio of either thread,
            by the other one's strain: n sqrt(D / E), n sqrt(E / D). Shape [4].
    """
    none = same_four(np.float32(0.0))
    for n in range(0, particles.size // 3, 4):
        at = np.uint64(n) * np.uint64(NUMBERS)
        i, j, k = _corners(particles, n, _FOUR)
        o, p, q = _fours_at(x, i), _fours_at(x, j), _fours_at(x, k)
        threads = _threads(triangles, at, _less(p, o), _less(q, o))
        squared = _products(threads[0], threads[1])
        _, pulled = _multipliers(triangles, at, law, squared, (none, none, none))
        a, b, c = _moves(triangles, at, threads, pulled)
        _put_fours(x, i, _plus(o, a))
        _put_fours(x, j, _plus(p, b))
        _put_fours(x, k, _plus(q, c))


@kernel(forceinline=True)
def solve_triangles_apart(x, moved, particles, triangles, law, stress, alone):
    """A pass that is more exact, and one of several that add up; see `edges.solve_edges_apart`.

    Args:
        x: Positions before the first pass, flat [m], shape [3 n].
        moved: What has moved since, zero before the first pass, changed in place, [3 n].
        particles: As in `solve_triangles`, as the next two.
        triangles: Likewise.
        law: Likewise.
        stress: Multipliers in fours, zero before the first pass, changed in place, flat,
            shape [3 t].
        alone: Whether there is one pass only; it needs no multipliers.
    """
    none = same_four(np.float32(0.0))
    for n in range(0, particles.size // 3, 4):
        at, to = np.uint64(n) * np.uint64(NUMBERS), _THREE * np.uint64(n)
        i, j, k = _corners(particles, n, _THREE)
        o, p, q = _threes_at(moved, i), _threes_at(moved, j), _threes_at(moved, k)
        first = _threes_at(x, i)
        d = _plus(_less(_threes_at(x, j), first), _less(p, o))
        e = _plus(_less(_threes_at(x, k), first), _less(q, o))
        threads = _threads(triangles, at, d, e)
        squared = _products(threads[0], threads[1])
        if alone:
            _, pulled = _multipliers(triangles, at, law, squared, (none, none, none))
        else:
            had = (four_at(stress, to), four_at(stress, to + _FOUR), four_at(stress, to + _EIGHT))
            added, pulled = _multipliers(triangles, at, law, squared, had)
            put_four(stress, to, had[0] + added[0])
            put_four(stress, to + _FOUR, had[1] + added[1])
            put_four(stress, to + _EIGHT, had[2] + added[2])
        a, b, c = _moves(triangles, at, threads, pulled)
        _put_threes(moved, i, _plus(o, a))
        _put_threes(moved, j, _plus(p, b))
        _put_threes(moved, k, _plus(q, c))
