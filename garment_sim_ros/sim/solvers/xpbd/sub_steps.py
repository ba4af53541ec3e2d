"""Sub-steps of `xpbd` of one garment, compiled; the arguments are those of `xpbd.given`.

A search for contacts is three kernels, `meet`, `guard` and `stop`: it is most of what there is to
compile, which several processes do at once.
"""

import numpy as np

from garment_sim_ros.contact.collide import collide_particles
from garment_sim_ros.contact.guard.keep_out import keep_out
from garment_sim_ros.contact.sweep import sweep
from garment_sim_ros.geometry.copying import copy
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.holds.tether_kernels import pull_attached
from garment_sim_ros.sim.motion import glide, move_pins
from garment_sim_ros.sim.solvers.wide import widen
from garment_sim_ros.sim.solvers.xpbd.coarse_kernels import pull_cells
from garment_sim_ros.sim.solvers.xpbd.edges import solve_edges, solve_edges_apart
from garment_sim_ros.sim.solvers.xpbd.hinges import bend
from garment_sim_ros.sim.solvers.xpbd.motion import arrive, coast, fall, gain, share_out
from garment_sim_ros.sim.solvers.xpbd.planes import (
    follow_shapes,
    remember_planes,
    return_to_planes,
    stop_at_contacts,
    touch_planes,
)
from garment_sim_ros.sim.solvers.xpbd.second_planes import remember_second_planes
from garment_sim_ros.sim.solvers.xpbd.strain_limit import SHAPES_MOVE, limit_strain
from garment_sim_ros.sim.solvers.xpbd.triangles import solve_triangles, solve_triangles_apart

_FAST, _KNOWN = range(2)
"""Places in the `flags` of a step."""
_SHORT = np.float32(6e-4)
"""In a shorter sub-step [s] a coordinate's last place is too much velocity to round to."""


@kernel(inner=True)
def same(a, b):
    """Whether two arrays [n, 3] are equal, number for number; `np.array_equal` allocates."""
    for i in range(a.shape[0]):
        for k in range(3):
            if a[i, k] != b[i, k]:
                return False
    return True


@kernel()
def begin(own, rule, goes_on):
    """What is decided once in a step.

    Args:
        own: `Particles`.
        rule: `Rule`.
        goes_on: Whether the step begins with the poses that the last one ended with.

    Returns:
        Whether the contacts of the step before still hold: nothing was moved since.
    """
    free, flags = rule.free, own.flags
    # Written so that a motion that is not known counts as none.
    flags[_FAST] = (
        rule.iterations == 1 and rule.dt > _SHORT and own.motion[0] > free * rule.slow**2
    )
    flags[_KNOWN] = goes_on and same(own.x, own.x_end)
    if flags[_FAST] or not flags[_KNOWN]:
        own.low[:] = np.float32(0.0)
    copy(own.x, own.x_search)
    glide(own.x_search, own.v, rule.dt * np.float32(rule.search_every), own.x_coast)
    return flags[_KNOWN] != 0


@kernel(inner=True)
def _bend(own, ready, rule):
    """A pass over the hinges.

    Bending acts evenly over the sub-steps until its next pass: in one kick it would make the
    cloth quiver against its edges.
    """
    loose, every = 3 * rule.free, rule.bend_every
    widen(own.x.reshape(-1), own.wide_x)
    widen(own.v.reshape(-1), own.wide_v)
    between = rule.dt * np.float32(every)
    bend(own.wide_x, own.wide_v, ready.hinge_particles, ready.hinges, between)
    share_out(
        own.wide_v,
        own.v.reshape(-1)[:loose],
        rule.pull,
        np.float32(1.0 / every),
        own.push,
    )


@kernel(inner=True)
def _predict(own, rule, moved):
    """Where outer forces and bending lead; positions stay where edges are solved exactly."""
    loose, dt = 3 * rule.free, rule.dt
    x, v = own.x.reshape(-1)[:loose], own.v.reshape(-1)[:loose]
    x_start = own.x_start.reshape(-1)[:loose]
    if own.flags[_FAST]:
        fall(x, v, x_start, moved[:loose], own.push, rule.keep, dt)
    else:
        moved[loose:] = np.float32(0.0)
        coast(x, v, x_start, moved[:loose], own.low, own.push, rule.keep, dt)


@kernel(inner=True)
def _stretch(own, ready, rule, moved):
    """Passes over triangles and springs, and what they do to velocities.

    In a hurry, one pass on positions; else on ways, which are added to positions with what
    rounding left out before.
    """
    loose, dt = 3 * rule.free, rule.dt
    x, v = own.x.reshape(-1), own.v.reshape(-1)[:loose]
    rate = np.float32(1.0) / dt
    triangles, springs = ready.triangles, ready.springs
    if own.flags[_FAST]:
        widen(x, own.wide_x)
        solve_triangles(own.wide_x, triangles.particles, triangles.numbers, triangles.law)
        solve_edges(own.wide_x, springs.particles, springs.numbers, springs.fours)
        gain(own.wide_x, x[:loose], v, moved[:loose], rate)
        return
    springs.pull[:] = np.float32(0.0)
    triangles.stress[:] = np.float32(0.0)
    alone = rule.iterations == 1
    for _ in range(rule.iterations):
        solve_triangles_apart(
            x,
            moved,
            triangles.particles,
            triangles.numbers,
            triangles.law,
            triangles.stress,
            alone,
        )
        solve_edges_apart(x, moved, springs.particles, springs.numbers, springs.pull, alone)
    arrive(x[:loose], v, moved[:loose], own.low, dt, rate)


@kernel()
def solve(own, elastic, frames, planes, second, rule, first, last, searches):
    """Sub-steps `first` to `last` of a step, see `xpbd.step.solve`.

    Args:
        own: `Particles`.
        elastic: `Elastic`.
        frames: `Frames`.
        planes: `Planes`.
        second: Those of shapes that were touched before, see `second_planes`.
        rule: `Rule`.
        first: The first sub-step, from 0; 0 is taken alone.
        last: The one to stop before.
        searches: Whether `meet` follows; then the last one does without contact.
    """
    free, dt = rule.free, rule.dt
    flat, moved = own.x.reshape(-1), own.x_predicted.reshape(-1)
    if first == 0 and own.flags[_KNOWN]:
        follow_shapes(own.x_search, planes.shape, frames.carry, planes.shift)
        follow_shapes(own.x_search, second.shape, frames.carry, second.shift)
    for s in range(first, last):
        slot = s % rule.search_every
        if s % rule.bend_every == 0:
            _bend(own, elastic.ready, rule)
        position, orientation = frames.position[slot], frames.orientation[slot]
        _predict(own, rule, moved)
        move_pins(
            own.x[free:],
            own.v[free:],
            elastic.pin_collider,
            elastic.pin_place,
            elastic.pin_step,
            position,
            orientation,
            frames.origin,
            dt,
        )
        fast = own.flags[_FAST] != 0
        pull_cells(flat, flat if fast else moved, not fast, elastic.coarse)
        _stretch(own, elastic.ready, rule, moved)
        pull_attached(
            own.x,
            own.v,
            own.x_start,
            elastic.attached,
            position,
            orientation,
            frames.origin,
            rule.keep,
            dt,
            np.float32(1.0) / dt,
        )
        if s + 1 < last or not searches:
            touch_planes(own.x[:free], own.v[:free], own.x_start[:free], planes, rule.friction, dt)
            touch_planes(own.x[:free], own.v[:free], own.x_start[:free], second, rule.friction, dt)


@kernel(inner=True)
def _leave_to_guard(shape, kept):
    """What the guard holds is where the edges want it before the guard looks at it again.

    Otherwise it would go on from search to search, as far as the core goes.
    """
    for q in range(kept.size):
        if kept[q] >= 0:
            shape[q] = -1


@kernel()
def meet(own, bodies, ready, planes, second, before, rule, has_planes):
    """A search for contacts at the end of a sub-step, and contact; `guard` and `stop` follow.

    Args:
        own: `Particles`.
        bodies: `Bodies`.
        ready: `Prepared`.
        planes: `Planes`, output.
        second: Those of shapes that were touched before; none are kept without `has_planes`.
        before: Output, the shapes of these until now, -1 for none, shape [f].
        rule: `Rule`.
        has_planes: Whether there are those of the last search; what is deep below them gets back
            to them first.

    Returns:
        Number of particles in contact.
    """
    free, dt = rule.free, rule.dt
    x, v, x_start = own.x[:free], own.v[:free], own.x_start[:free]
    if has_planes:
        _leave_to_guard(planes.shape, bodies.guard.kept)
        before[:] = planes.shape
        return_to_planes(
            x, v, x_start, planes, bodies.way.inscribed_radius, rule.held_friction, dt
        )
    else:
        before[:] = -1
        second.shape[:] = -1
    sweep(
        bodies.shapes,
        bodies.since,
        bodies.sides.side,
        bodies.way,
        x,
        own.x_search[:free],
        own.x_coast[:free],
        rule.thickness,
    )
    copy(own.x, own.x_predicted)
    count = collide_particles(
        bodies.shapes,
        bodies.posed,
        bodies.sides,
        x,
        x_start,
        rule.thickness,
        rule.friction,
        bodies.contacts,
    )
    if rule.strain_limit > 0.0:
        time = dt * np.float32(rule.search_every) if has_planes else dt
        limit_strain(
            own,
            ready.edges,
            planes,
            bodies.posed.carry,
            bodies.guard.kept,
            rule.strain_limit,
            time,
            SHAPES_MOVE * dt,
        )
    return count


@kernel()
def guard(own, bodies, rule, has_planes):
    """Keeps the cores of body parts out of the cloth after `meet`, with the same arguments."""
    time = rule.dt * np.float32(rule.search_every) if has_planes else rule.dt
    keep_out(
        bodies.guard,
        bodies,
        own.x_search,
        own.x_predicted,
        own.x,
        own.v,
        rule.thickness,
        time,
    )


@kernel()
def stop(own, bodies, planes, second, before, rule):
    """Velocities after a search, and what is kept of it until the next one.

    Args:
        own: `Particles`.
        bodies: `Bodies`.
        planes: `Planes`, output.
        second: Those of shapes that were touched before, output.
        before: Shapes that were touched before the search, shape [f].
        rule: `Rule`.
    """
    free, dt = rule.free, rule.dt
    x, v, x_start = own.x[:free], own.v[:free], own.x_start[:free]
    stop_at_contacts(
        *(x, v, x_start, own.x_predicted[:free], planes, bodies.posed.carry),
        *(rule.friction, dt, own.motion),
    )
    remember_planes(x, x_start, planes, bodies.posed.carry)
    remember_second_planes(x, x_start, bodies, planes, second, before, rule.thickness)
    copy(own.x, own.x_search)
    glide(own.x_search, own.v, dt * np.float32(rule.search_every), own.x_coast)
