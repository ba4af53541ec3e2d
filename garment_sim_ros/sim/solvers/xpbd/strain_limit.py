"""Edges do not grow beyond a strain: cloth that is pulled harder moves.

A limb that takes cloth along, or presses it against another one, stretches single edges to many
times their length. After contact, in each search, edges that are longer than the limit, and have
grown since the search before, are drawn back to the larger of the two, along surfaces that their
ends touch and never into them (after Provot 1995, "Deformation constraints in a mass-spring
model"). Drawn back to the limit itself, cloth that is held longer would never rest. What shapes
hold, by friction at both ends or by pressing one of them, would stay as long as it once was: it is
eased down to the limit, a little in each search, where the shapes move. Where they rest, what
pulls there would pull it back again and again. The guard outranks all this: it comes after, and
what it keeps is left alone, as are edges at pins, and ends that are caught deep between two
shapes: pulled along there, a whole hem would follow. Velocities stay as they are: pinched cloth,
which contact and this move to and fro, would be pumped.

Single edges, where body parts close on cloth, would still be stretched to several times their
length: each end is in the shape that the other one is pressed out of. To those that are longer
than `_LONGEST` shapes yield that press an end from two sides, and after a step, when all else has
acted, none is left longer, but what ends on surfaces and would have to be drawn through them, or
is caught: that is left with `_UTMOST`. Where many are too long, the cloth itself is pulled: the
guard, and `holds.letting_go`, tell how far.
"""

import numpy as np

from garment_sim_ros.contact.friction import moved_with
from garment_sim_ros.geometry.four import any_above, four_at, same_four, squares, three_at
from garment_sim_ros.geometry.vectors import along, dot, less, row
from garment_sim_ros.jit import kernel, lean_kernel

_THREE = np.uint64(3)
_PASSES, _LAST_PASSES, _UTMOST_PASSES = 10, 30, 10
_CREEP = 2.0
"""Edges that grow more slowly than this are left [1/s]: what contact moves against the limit would
never rest."""
_LONGEST = 0.9
"""Strain that no single edge is left with [1], unless it is longer only by ways into surfaces."""
_UTMOST = 0.97
"""Strain that it is not left with then, either [1]: the ends of an edge may touch a limb from two
sides. If surfaces yielded to shorter ones, cloth would not rest in creases."""
_SINGLE = np.float32(0.01)
"""Up to this share of all edges, those that are longer are single ones."""
_EASES = 2.0
"""How fast edges that are too long get shorter where shapes hold them and move [1/s]."""
SHAPES_MOVE = np.float32(0.005)
"""What is slower does not [m/s]."""


@lean_kernel(inner=True)
def _squared(strain):
    """The square of how many times as long as at rest an edge of some strain is."""
    return (np.float32(1.0) + strain) * (np.float32(1.0) + strain)


@lean_kernel(inner=True)
def _longest(limit):
    """The strain that no edge is left with."""
    return max(np.float32(_LONGEST), limit)


@lean_kernel(inner=True)
def _along_surface(planes, p, way, yields):
    """A way of particle p, less what leads into the surface that it touches.

    Args:
        planes: `Planes`.
        p: The particle.
        way: The way [m].
        yields: Whether shapes yield that press it from two sides.
    """
    if planes.shape[p] < 0:
        return way
    if yields and planes.depth[p] == np.float32(np.inf):
        return way
    n = row(planes.normal, p)
    return along(way, n, -min(dot(way, n), np.float32(0.0)))


@lean_kernel(inner=True)
def _is_caught(planes, p):
    """Whether particle p is deep between two shapes: it stays with them."""
    return p < planes.shape.size and planes.shape[p] >= 0 and planes.caught[p]


@lean_kernel(inner=True)
def _has_pin(edges, kept, e):
    """Whether an end of edge e is pinned: pins come last."""
    return max(edges.particles[2 * e], edges.particles[2 * e + 1]) >= kept.size


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
def _draw_together(own, edges, planes, carry, kept, e, most, longest, grown, eased, slow):
    """Draws the ends of edge e together if it is longer than `most`, squared, and has grown.

    One that is eased is drawn to a part of what it was in any case, one that is longer than
    `longest`, squared, to this.

    Returns:
        Whether it was.
    """
    particles, numbers = edges.particles, edges.numbers
    i, j = np.int64(particles[2 * e]), np.int64(particles[2 * e + 1])
    d = less(row(own.x, i), row(own.x, j))
    squared = dot(d, d)
    if not squared > most * numbers[0, e]:
        return False
    yields = squared > longest * numbers[0, e]
    if _has_pin(edges, kept, e) or not (yields or (kept[i] < 0 and kept[j] < 0)):
        return False
    stays = kept[i] >= 0 or _is_caught(planes, i), kept[j] >= 0 or _is_caught(planes, j)
    a = np.float32(0.0) if stays[0] else numbers[1, e]
    b = np.float32(0.0) if stays[1] else numbers[2, e]
    before = less(row(own.x_search, i), row(own.x_search, j))
    part = eased if _is_eased(own, planes, carry, i, j, slow) else grown
    to = max(most * numbers[0, e], part * part * dot(before, before))
    to = min(to, longest * numbers[0, e])
    if not (a + b > np.float32(0.0) and squared > to):
        return False
    share = (np.float32(1.0) - np.sqrt(to / squared)) / (a + b)
    a, b = -share * a, share * b
    for p, part in ((i, a), (j, b)):
        way = _along_surface(planes, p, (part * d[0], part * d[1], part * d[2]), yields)
        for axis in range(3):
            own.x[p, axis] += way[axis]
            own.x_predicted[p, axis] += way[axis]
    return True


@lean_kernel(inner=True)
def _are_short(x, edges, e, most):
    """Whether edges e to e + 3 are known to be no longer than `most`, squared."""
    if e >= edges.fours:
        return False
    particles, rest = edges.particles, edges.numbers[0]
    a, b = _span(x, particles, e), _span(x, particles, e + 1)
    c, d = _span(x, particles, e + 2), _span(x, particles, e + 3)
    return not any_above(squares(a, b, c, d), same_four(most) * four_at(rest, np.uint64(e)))


@lean_kernel(inner=True)
def _count_longer(x, edges, longest):
    """How many edges are longer than `longest`, squared."""
    flat, particles, rest = x.reshape(-1), edges.particles, edges.numbers[0]
    found = 0
    for e in range(0, rest.size, 4):
        if _are_short(flat, edges, e, longest):
            continue
        for k in range(e, min(e + 4, rest.size)):
            d = less(row(x, particles[2 * k]), row(x, particles[2 * k + 1]))
            found += dot(d, d) > longest * rest[k]
    return found


@lean_kernel(inner=True)
def _are_single(found, edges):
    """Whether so many edges are few of all."""
    return np.float32(found) <= _SINGLE * np.float32(edges.numbers.shape[1])


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
    most, longest = _squared(limit), _squared(_longest(limit))
    grown = np.float32(1.0) + np.float32(_CREEP) * time
    eased = max(np.float32(1.0) - np.float32(_EASES) * time, np.float32(0.0))
    x, count = own.x.reshape(-1), edges.numbers.shape[1]
    if not _are_single(_count_longer(own.x, edges, longest), edges):
        longest = np.float32(np.inf)
    for _ in range(_PASSES):
        found = False
        for e in range(0, count, 4):
            if _are_short(x, edges, e, most):
                continue
            for k in range(e, min(e + 4, count)):
                drawn = _draw_together(
                    own, edges, planes, carry, kept, k, most, longest, grown, eased, slow
                )
                found = found or drawn
        if not found:
            break


@lean_kernel(inner=True)
def _touches(planes, kept, p):
    """Whether particle p is free and touches a shape."""
    return p < kept.size and planes.shape[p] >= 0


@lean_kernel(inner=True)
def _shorten(x, edges, planes, kept, e, longest, on_surfaces):
    """Draws the ends of edge e together where it is longer than `longest`, squared.

    Where `on_surfaces`, they go along those that they touch; else into them, if both touch one.

    Returns:
        Whether it was. An edge at a pin is not, where its other end is in the air.
    """
    particles, numbers = edges.particles, edges.numbers
    i, j = np.int64(particles[2 * e]), np.int64(particles[2 * e + 1])
    d = less(row(x, i), row(x, j))
    squared = dot(d, d)
    to = longest * numbers[0, e]
    a = np.float32(0.0) if on_surfaces and _is_caught(planes, i) else numbers[1, e]
    b = np.float32(0.0) if on_surfaces and _is_caught(planes, j) else numbers[2, e]
    # An edge without stiffness has no weights.
    if not (a + b > np.float32(0.0) and squared > to):
        return False
    if max(i, j) >= kept.size and not _touches(planes, kept, min(i, j)):
        return False
    if not (on_surfaces or (_touches(planes, kept, i) and _touches(planes, kept, j))):
        return False
    share = (np.float32(1.0) - np.sqrt(to / squared)) / (a + b)
    for p, part in ((i, -share * a), (j, share * b)):
        if p >= kept.size:
            continue
        way = (part * d[0], part * d[1], part * d[2])
        if on_surfaces and kept[p] < 0:
            way = _along_surface(planes, p, way, True)
        for axis in range(3):
            x[p, axis] += way[axis]
    return True


@lean_kernel(inner=True)
def _shorten_all(x, flat, edges, planes, kept, longest, on_surfaces):
    """A pass of `_shorten` over all edges; returns whether there was one."""
    found, count = False, edges.numbers.shape[1]
    for e in range(0, count, 4):
        if _are_short(flat, edges, e, longest):
            continue
        for k in range(e, min(e + 4, count)):
            drawn = _shorten(x, edges, planes, kept, k, longest, on_surfaces)
            found = found or drawn
    return found


@kernel()
def shorten_longest(x, edges, planes, kept, limit):
    """After a step: no single edge is left longer than `_LONGEST`.

    Args:
        x: Positions, changed in place [m], shape [n, 3]; velocities stay.
        edges: `Edges`.
        planes: `Planes`; of them shapes, normals and depths that the last search found.
        kept: What the guard keeps, which yields: shape [free].
        limit: Strain that edges do not grow beyond.
    """
    longest = _squared(_longest(limit))
    utmost = max(_squared(np.float32(_UTMOST)), longest)
    flat = x.reshape(-1)
    too_long = _count_longer(x, edges, longest)
    if too_long == 0 or not _are_single(too_long, edges):
        return
    for _ in range(_LAST_PASSES):
        # An edge whose ends are both caught is left to the passes after these.
        if not _shorten_all(x, flat, edges, planes, kept, longest, True):
            break
    for _ in range(_UTMOST_PASSES):
        if not _shorten_all(x, flat, edges, planes, kept, utmost, False):
            return
