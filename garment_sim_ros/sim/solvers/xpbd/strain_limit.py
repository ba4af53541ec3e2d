"""Edges do not grow beyond a strain: cloth that is pulled harder moves.

A limb that takes cloth along, or presses it against another one, stretches single edges to many
times their length. After contact, in each search, edges that are longer than the limit, and have
grown since the search before, are drawn back to the larger of the two, along surfaces that their
ends touch and never into them (after Provot 1995, "Deformation constraints in a mass-spring
model"). Drawn back to the limit itself, cloth that is held longer would never rest. What shapes
hold, by friction at both ends or by pressing one of them, would stay as long as it once was: it is
eased down to the limit, a little in each search, where the shapes move. Where they rest, what
pulls there would pull it back again and again. The guard outranks all this: it comes after, and
what it keeps is left alone, as are edges at pins. Velocities stay as they are: pinched cloth,
which contact and this move to and fro, would be pumped.
"""

import numpy as np

from garment_sim_ros.contact.friction import moved_with
from garment_sim_ros.geometry.four import any_above, four_at, same_four, squares, three_at
from garment_sim_ros.geometry.vectors import along, dot, less, row
from garment_sim_ros.jit import kernel, lean_kernel

_THREE = np.uint64(3)
_PASSES = 10
_CREEP = 2.0
"""Edges that grow more slowly than this are left [1/s]: what contact moves against the limit would
never rest."""
_EASES = 2.0
"""How fast edges that are too long get shorter where shapes hold them and move [1/s]."""
SHAPES_MOVE = np.float32(0.005)
"""What is slower does not [m/s]."""


@lean_kernel(inner=True)
def _draw(own, planes, p, way):
    """Moves particle p by `way`, but not into the surface that it touches."""
    if planes.shape[p] >= 0:
        n = row(planes.normal, p)
        into = dot(way, n)
        if into < np.float32(0.0):
            way = along(way, n, -into)
    for axis in range(3):
        own.x[p, axis] += way[axis]
        own.x_predicted[p, axis] += way[axis]


@lean_kernel(inner=True)
def _stays(kept, p):
    """Whether something else has the last word on particle p: a pin, or the guard."""
    return p >= kept.size or kept[p] >= 0


@lean_kernel(inner=True)
def _span(x, particles, n):
    """From the second end of edge n to the first; flat arrays."""
    i = _THREE * np.uint64(particles[2 * n])
    j = _THREE * np.uint64(particles[2 * n + 1])
    return three_at(x, i) - three_at(x, j)


@lean_kernel(inner=True)
def _carried(own, planes, carry, p):
    """The square of how far the shape that particle p touches moves there [m^2], -1 for none."""
    if p >= planes.shape.size or planes.shape[p] < 0:
        return np.float32(-1.0)
    way = moved_with(carry, planes.shape[p], row(own.x_start, p))
    return dot(way, way)


@lean_kernel(inner=True)
def _is_eased(own, planes, carry, i, j, slow):
    """Whether shapes hold an edge and one of them moves: both ends touch, or two press one."""
    a, b = _carried(own, planes, carry, i), _carried(own, planes, carry, j)
    pressed, none = np.float32(np.inf), np.float32(0.0)
    held = a >= none and (b >= none or planes.depth[i] == pressed)
    held = held or (b >= none and planes.depth[j] == pressed)
    return held and max(a, b) > slow * slow


@lean_kernel(inner=True)
def _draw_together(own, edges, planes, carry, kept, e, most, grown, eased, slow):
    """Draws the ends of edge e together if it is longer than `most`, squared, and has grown.

    One that is eased is drawn to a part of what it was in any case.

    Returns:
        Whether it was.
    """
    particles, numbers = edges.particles, edges.numbers
    i, j = np.int64(particles[2 * e]), np.int64(particles[2 * e + 1])
    d = less(row(own.x, i), row(own.x, j))
    squared = dot(d, d)
    if not squared > most * numbers[0, e]:
        return False
    if _stays(kept, i) or _stays(kept, j):
        return False
    both = numbers[1, e] + numbers[2, e]
    before = less(row(own.x_search, i), row(own.x_search, j))
    part = eased if _is_eased(own, planes, carry, i, j, slow) else grown
    longest = max(most * numbers[0, e], part * part * dot(before, before))
    if not (both > np.float32(0.0) and squared > longest):
        return False
    share = (np.float32(1.0) - np.sqrt(longest / squared)) / both
    a, b = -share * numbers[1, e], share * numbers[2, e]
    _draw(own, planes, i, (a * d[0], a * d[1], a * d[2]))
    _draw(own, planes, j, (b * d[0], b * d[1], b * d[2]))
    return True


@kernel(forceinline=True)
def limit_strain(own, edges, planes, carry, kept, limit, time, slow):
    """Draws the ends of edges together that are too long and have grown.

    Args:
        own: `Particles`; `x` and `x_predicted`, from which contact has moved them to `x`, are
            changed alike: velocities stay.
        edges: `Edges`.
        planes: `Planes`; of them shapes, normals and depths that the search found.
        carry: How points move with the shapes in the sub-step, see `PosedShapes`.
        kept: What the guard keeps, see `Guard`: not moved, shape [n].
        limit: Strain that edges do not grow beyond.
        time: Since the last search [s].
        slow: What shapes move in a sub-step at least where edges are eased [m].
    """
    most = (np.float32(1.0) + limit) * (np.float32(1.0) + limit)
    grown = np.float32(1.0) + np.float32(_CREEP) * time
    eased = max(np.float32(1.0) - np.float32(_EASES) * time, np.float32(0.0))
    x, particles, rest = own.x.reshape(-1), edges.particles, edges.numbers[0]
    for _ in range(_PASSES):
        found = False
        for e in range(0, rest.size, 4):
            if e < edges.fours:
                a, b = _span(x, particles, e), _span(x, particles, e + 1)
                c, d = _span(x, particles, e + 2), _span(x, particles, e + 3)
                longest = same_four(most) * four_at(rest, np.uint64(e))
                if not any_above(squares(a, b, c, d), longest):
                    continue
            for k in range(e, min(e + 4, rest.size)):
                drawn = _draw_together(
                    own, edges, planes, carry, kept, k, most, grown, eased, slow
                )
                found = found or drawn
        if not found:
            break
