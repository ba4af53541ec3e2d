"""Rules of contact again, in float64 and one particle at a time; nothing but tests runs this.

`contact.sweep.sweep`, `contact.pinch.stay_between` and `solvers.xpbd.planes`. Shapes are spheres
and capsules, see `naive.signed_distance`.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from naive.naive import Shape, signed_distance

HOLDS = 0.003
CAUGHT = 0.05


def moved_with(carry: FloatArray, place: FloatArray) -> FloatArray:
    """How far a point fixed to a shape moves, from the shape's carry [3, 4]."""
    return np.asarray(carry[:, :3] @ place + carry[:, 3])


def entry(
    shape: Shape, start: FloatArray, way: FloatArray, inner: float, thickness: float
) -> tuple[float, FloatArray] | None:
    """The part of a way at which it enters an inflated shape, and the direction out there.

    In steps as long as the distance; not shorter than a fifth of `inner` or a 64th of the way.
    """
    length = float(np.linalg.norm(way))
    shortest = max(0.2 * inner, length / 64)
    gone = 0.0
    while gone == 0.0 or gone < length:
        distance, normal = signed_distance(shape, start + gone / length * way)
        distance -= thickness
        if gone == 0.0 and distance < -0.5 * inner:
            return None
        if distance <= 0.0 and way @ normal < 0.0:
            return gone / length, normal
        gone += max(distance, shortest)
    return None


def sweep(
    shapes: Sequence[Shape],
    carry: FloatArray,
    inscribed_radius: FloatArray,
    is_under: NDArray[np.bool_],
    x: FloatArray,
    x_start: FloatArray,
    x_coast: FloatArray,
    thickness: float,
) -> FloatArray:
    """Positions [n, 3] of particles that no shape under them [m, n] has passed.

    Nothing is said of pairs where neither the shape nor the particle, by itself, is fast.
    """
    x = np.array(x, dtype=np.float64)
    for p, start in enumerate(np.asarray(x_start, np.float64)):
        last = -1
        for _ in range(4):
            entries = []
            for k, shape in enumerate(shapes):
                begin = start + moved_with(carry[k], start)
                way = x[p] - begin
                length = float(np.linalg.norm(way))
                inner = float(inscribed_radius[k]) + thickness
                rode, coasted = np.linalg.norm([begin - start, x_coast[p] - begin], axis=1)
                if (
                    k == last
                    or not is_under[k, p]
                    or min(length, max(rode, coasted)) <= 0.5 * inner
                ):
                    continue
                found = entry(shape, begin, way, inner, thickness)
                if found and (1.0 - found[0]) * length > 0.5 * inner:
                    entries.append((found[0], k, found[1], begin, way, inner))
            if not entries:
                break
            t, last, normal, begin, way, inner = min(entries, key=lambda e: e[0])
            deep = max(float((1.0 - t) * way @ normal), -0.25 * inner)
            x[p] = begin + t * way + deep * normal
    return x


def pulled(way: FloatArray, across: FloatArray, holds: float) -> FloatArray:
    """How far cloth slips that is pressed across a direction and pulled [m]."""
    n = across / np.linalg.norm(across)
    along_gap = way - (way @ n) * n
    far = float(np.linalg.norm(along_gap))
    return along_gap * (max(0.0, far - holds) / max(far, 1e-12))


def stay_between(
    shapes: Sequence[Shape],
    asked: FloatArray,
    place: FloatArray,
    start: FloatArray,
    thickness: float,
    rounding: float,
    longest: float,
) -> tuple[FloatArray, bool, bool]:
    """Where a particle stays that shapes press from two sides, whether they do, and catch it.

    Args:
        shapes: Those that press.
        asked: Where it was to be before contact [m], shape [3].
        place: Where contact left it [m], shape [3].
        start: Where it would be, had it moved_with the deepest shape [m], shape [3].
        thickness: Distance to keep from the surfaces [m].
        rounding: What distances may be wrong by [m].
        longest: Length of the longest shape [m].
    """
    reach = thickness + min(float(np.linalg.norm(place - start)), thickness) + rounding
    at = np.array(start, dtype=np.float64)
    for attempt in range(6):
        found = [signed_distance(shape, at) for shape in shapes]
        d1, a = min(found, key=lambda f: f[0])
        facing = [f for f in found if f[1] @ a < 0.0 and f[0] <= reach]
        if not facing and attempt == 0:
            return np.asarray(place), False, False
        if attempt == 0:
            d2, b = min(facing, key=lambda f: f[0])
            caught = thickness - d2 > CAUGHT * longest
            slips = pulled(asked - at, a - b, HOLDS * longest)
            if not caught and slips.any():
                at += slips
                continue
        first = thickness - d1
        if first <= rounding:
            break
        if not facing:
            at += first * a
            continue
        d2, b = min(facing, key=lambda f: f[0])
        second, cosine = thickness - d2, float(a @ b)
        if second - first * cosine <= rounding:
            at += first * a
            continue
        # The crease: both planes at once; nowhere near where they are almost parallel.
        square = max(1.0 - cosine**2, 1e-6)
        s, t = (first - cosine * second) / square, (second - cosine * first) / square
        if np.linalg.norm(s * a + t * b) > min(4.0 * first, longest / 40.0):
            s = (first - second) / (2.0 - 2.0 * cosine)
            t = -s
        at += s * a + t * b
        if abs(s) + abs(t) < rounding:
            break
    return at, True, caught


def held_back(slip: FloatArray, most: float) -> FloatArray:
    """As much of a slip as friction takes away, which is `most` at most."""
    length = float(np.linalg.norm(slip))
    return slip if length <= most else slip * (most / length)


def touch_plane(
    x: FloatArray,
    v: FloatArray,
    x_start: FloatArray,
    place: FloatArray,
    shift: FloatArray,
    normal: FloatArray,
    is_pressed: bool,
    friction: float,
    dt: float,
) -> tuple[FloatArray, FloatArray]:
    """Position and velocity of a particle after contact with a plane that moved to `place`."""
    if is_pressed:
        return x_start + shift, shift / dt
    depth = float((place - x) @ normal)
    if depth <= 0.0:
        return x, v
    slip = x - x_start - shift
    slip = slip - (slip @ normal) * normal
    move = depth * normal - held_back(slip, friction * depth)
    v = v + move / dt
    leaving = max(float((v - shift / dt) @ normal), 0.0)
    return x + move, v - leaving * normal


def return_to_plane(
    x: FloatArray,
    v: FloatArray,
    x_start: FloatArray,
    place: FloatArray,
    shift: FloatArray,
    normal: FloatArray,
    inscribed_radius: float,
    friction: float,
    dt: float,
) -> tuple[FloatArray, FloatArray]:
    """The same before a search, to 2 % of the shape's inscribed radius below the plane."""
    below = place - 0.02 * inscribed_radius * normal
    return touch_plane(x, v, x_start, below, shift, normal, False, friction, dt)


def stop_at_contact(
    v: FloatArray,
    way_out: FloatArray,
    surface: FloatArray,
    normal: FloatArray,
    depth: float,
    friction: float,
) -> FloatArray:
    """Velocity of a particle that a search moved by `way_out`, at a surface of that velocity."""
    if way_out @ normal < 0.5 * depth:
        return surface
    relative = v - surface
    along = float(relative @ normal)
    if along >= 0.0:
        return v
    slip = relative - along * normal
    return v - along * normal - held_back(slip, -friction * along)


def leave_sphere(
    x: FloatArray,
    x_start: FloatArray,
    shift: FloatArray,
    sphere: Shape,
    gap: float,
    friction: float,
) -> tuple[FloatArray, FloatArray, float]:
    """Position after contact with one sphere, the direction out, and how deep it was.

    Slip is taken away first, by Coulomb's law with how far the particle came towards the surface
    in the step; then it goes the short way out.
    """
    distance, normal = signed_distance(sphere, x)
    depth = gap - distance
    if depth <= 0.0:
        return x, normal, depth
    relative = x - x_start - shift
    along = float(relative @ normal)
    x = x - held_back(relative - along * normal, friction * min(depth, max(-along, 0.0)))
    distance, out = signed_distance(sphere, x)
    return x + max(gap - distance, 0.0) * out, normal, depth


def stay_near(
    x: FloatArray,
    v: FloatArray,
    x_start: FloatArray,
    shift: FloatArray,
    inscribed_radius: float,
    dt: float,
) -> tuple[FloatArray, FloatArray]:
    """The same of what shapes press from two sides: it is pulled by a quarter of that radius."""
    way = x - x_start - shift
    length = float(np.linalg.norm(way))
    farthest = 0.25 * inscribed_radius
    move = min(0.0, farthest / length - 1.0) * way
    return x + move, v + move / dt


def second_plane(
    shapes: Sequence[Shape],
    place: FloatArray,
    touched: tuple[int, int, int],
    reach: FloatArray,
    thickness: float,
) -> tuple[int, FloatArray, FloatArray]:
    """The shape of a particle's second plane, -1 for none, its normal and a point of it.

    Args:
        shapes: All shapes.
        place: Where the particle is [m].
        touched: Shapes that it touches now, touched before, had a second plane of; -1 for none.
        reach: How far off each shape may be [m], shape [m].
        thickness: Distance to keep from surfaces [m].
    """
    now, before, second = touched
    for k in (before, second):
        if k in (-1, now):
            continue
        distance, normal = signed_distance(shapes[k], place)
        if not distance - thickness < reach[k]:
            break
        return k, normal, place - max(distance - thickness, 0.0) * normal
    return -1, np.zeros(3), np.zeros(3)
