"""Particles that shapes press from two sides, as cloth in an armpit."""

import numpy as np

from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.friction import moved_with
from garment_sim_ros.contact.sides import LET_GO, PASSING
from garment_sim_ros.geometry.vectors import along, dot, length, less, plus, row
from garment_sim_ros.jit import lean_kernel

_ROUNDS = 6
_HOLDS = 0.003
"""What is pressed from two sides slips by what it is pulled farther in a step, as a share of the
longest shape: 1 mm on a human."""
_CAUGHT = 0.05
"""What is deeper in both sides than this share of the longest shape, 2 cm on a human, is caught:
it does not slip at all."""
_FARTHEST = 4.0
"""A crease that is farther away than this, in depths, is none: the shapes oppose each other."""
_CREASE = 0.025
"""Nor is one that is farther than this share of the longest shape, 1 cm on a human: cloth on the
way there would be stretched over the limb that closes on it."""


@lean_kernel(forceinline=True)
def stay_between(shapes, posed, side, p, x_start, asked, place, k, thickness, rounding):
    """Where particle p, which came out of more than one shape, is held between two of them.

    Moved out of one after the other, in each step from where its neighbours have pulled it, it
    would never come to rest. What two sides press stays where it moved to with shape k from the
    start of the step, but for a slip where its neighbours pull hard, see `pulled`. Deep between
    the two it is caught, and does not slip: where a thigh closes on the belly, a hem between them
    would be pulled along the crease, and out at its side. From there it is moved only as far as
    the two shapes, the nearest and the nearest that faces it, ask for: to the crease where they
    meet or, where that is too far away, to the middle between them. Where nothing has moved that
    is nowhere, whatever the order of shapes.

    Args:
        shapes: Packed shapes.
        posed: The same, posed.
        side: See `Sides`; passing shapes and those let go of press nothing.
        p: The particle.
        x_start: Positions at the start of the step [m], shape [n, 3].
        asked: Where it was to be before contact [m].
        place: Where it was moved to [m].
        k: The deepest shape.
        thickness: Distance to keep from the surfaces [m].
        rounding: What distances may be wrong by [m].

    Returns:
        The place where it is held, `place` as it was where no two shapes press it; whether they
        do; and whether it is caught between them.
    """
    rode = row(x_start, p)
    at = plus(rode, moved_with(posed.carry, k, rode))
    slip = length(less(place, at))
    reach = thickness + min(slip, thickness) + rounding
    caught = False
    for step in range(_ROUNDS):
        nearest, facing, a, b = _pressing(shapes, posed, side, p, at, reach)
        if step == 0:
            if not facing < np.float32(np.inf):
                return place, False, False
            caught = thickness - facing > np.float32(_CAUGHT) * shapes.longest
            slips = pulled(less(asked, at), less(a, b), np.float32(_HOLDS) * shapes.longest)
            if not caught and dot(slips, slips) > np.float32(0.0):
                at = plus(at, slips)
                continue
        first = thickness - nearest
        second = thickness - facing
        cosine = dot(a, b)
        if not first > rounding:
            break
        if not second - first * cosine > rounding:
            at = along(at, a, first)
            continue
        out_of_first, out_of_second = _to_crease(first, second, cosine, shapes.longest)
        at = along(along(at, a, out_of_first), b, out_of_second)
        if abs(out_of_first) + abs(out_of_second) < rounding:
            break
    return at, True, caught


@lean_kernel(forceinline=True)
def pulled(way, across, holds):
    """How far cloth slips that is pressed from two sides and pulled.

    Args:
        way: How far it is pulled [m].
        across: The direction from one side to the other, of any length.
        holds: As far as that it does not slip [m].
    """
    share = dot(way, across) / max(dot(across, across), np.float32(1e-12))
    along_gap = along(way, across, -share)
    far = length(along_gap)
    part = max(np.float32(0.0), far - holds) / max(far, np.float32(1e-12))
    return part * along_gap[0], part * along_gap[1], part * along_gap[2]


@lean_kernel(inner=True)
def _pressing(shapes, posed, side, p, place, reach):
    """The shape nearest to a place, and the nearest of those that face it.

    Returns:
        Distances of both [m], infinite above `reach`, and the unit directions out of them.
    """
    zero = np.float32(0.0)
    d1 = d2 = np.float32(np.inf)
    a = b = (zero, zero, zero)
    for turn in range(2):
        for m in range(posed.box.shape[0]):
            if side[m, p] == PASSING or side[m, p] == LET_GO:
                continue
            d, nx, ny, nz = shape_distance(shapes, posed, m, place[0], place[1], place[2], reach)
            n = (nx, ny, nz)
            if d > reach:  # Some kinds tell distances beyond it, too.
                continue
            if turn == 0:
                if d < d1:
                    d1, a = d, n
            elif d < d2 and dot(n, a) < zero:
                d2, b = d, n
    return d1, d2, a, b


@lean_kernel(inner=True)
def _to_crease(first, second, cosine, longest):
    """How far out of each of two shapes it is to where they meet, or to the middle between them.

    Args:
        first: Depth in the one [m].
        second: Depth in the other [m].
        cosine: Of the angle between the directions out of them.
        longest: Length of the longest shape [m].
    """
    square = max(np.float32(1.0) - cosine * cosine, np.float32(1e-6))
    a = (first - cosine * second) / square
    b = (second - cosine * first) / square
    farthest = min(np.float32(_FARTHEST) * first, np.float32(_CREASE) * longest)
    if a * a + b * b + np.float32(2.0) * a * b * cosine > farthest * farthest:
        a = (first - second) / (np.float32(2.0) - np.float32(2.0) * cosine)
        b = -a
    return a, b
