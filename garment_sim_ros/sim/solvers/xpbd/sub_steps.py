"""Sub-steps of an `xpbd` step in one compiled loop."""

import numpy as np

from garment_sim_ros.contact.collide import collide_particles
from garment_sim_ros.contact.packed import pose_shapes
from garment_sim_ros.contact.sweep import sweep
from garment_sim_ros.geometry.transforms import interpolate_poses
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.holds.tether_kernels import pull_attached
from garment_sim_ros.sim.motion import carry_pins, glide
from garment_sim_ros.sim.solvers.xpbd.coarse_kernels import pull_cells
from garment_sim_ros.sim.solvers.xpbd.edges import solve_edges, solve_edges_apart
from garment_sim_ros.sim.solvers.xpbd.hinges import bend
from garment_sim_ros.sim.solvers.xpbd.motion import arrive, coast, fall, gain, share_out
from garment_sim_ros.sim.solvers.xpbd.planes import (
    remember_planes,
    return_to_planes,
    ride_on,
    stop_at_contacts,
    touch_planes,
)

_HURRIED, _STILL, _KNOWN, _TOUCHING = range(4)
"""Places in the `flags` of a step."""
_SHORT = np.float32(6e-4)
"""In a shorter sub-step [s] a coordinate's last place is too much velocity to round to."""


@kernel(forceinline=True)
def same_poses(position_a, orientation_a, position_b, orientation_b):
    """Whether two sets of poses are equal, number for number."""
    for i in range(position_a.shape[0]):
        for k in range(3):
            if position_a[i, k] != position_b[i, k]:
                return False
        for k in range(4):
            if orientation_a[i, k] != orientation_b[i, k]:
                return False
    return True


@kernel(forceinline=True)
def same(a, b):
    """Whether two arrays [n, 3] are equal, number for number; `np.array_equal` allocates."""
    for i in range(a.shape[0]):
        for k in range(3):
            if a[i, k] != b[i, k]:
                return False
    return True


@kernel()
def run_sub_steps(
    x,
    v,
    free,
    x_start,
    x_predicted,
    low,
    cloth,
    coarse,
    attached,
    pin_collider,
    pin_position,
    shapes,
    start,
    end,
    between,
    last_search,
    x_end,
    origin,
    posed,
    way,
    sides,
    contacts,
    place,
    ride,
    thickness,
    friction,
    grip,
    pull,
    push,
    keep,
    dt,
    count,
    iterations,
    bending_every,
    search_every,
    slow,
    motion,
    flags,
    first,
    last,
):
    """Advances one garment by sub-steps `first` to `last` of `count`; see `xpbd.step.step`.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        free: Number of free particles, the first ones.
        x_start: Scratch, shape [n, 3].
        x_predicted: Scratch, shape [n, 3].
        low: What positions are short of by rounding [m], shape [3 free].
        cloth: `solvers.xpbd.step.Prepared` edges and hinges.
        coarse: `solvers.xpbd.coarse.CoarseLevel` of them.
        attached: `attached.Attached`.
        pin_collider: Collider that each pin rides on, shape [p].
        pin_position: Its place in that collider's frame [m], shape [p, 3].
        shapes: Packed shapes.
        start: Positions and orientations of all colliders at the start.
        end: The same at the end.
        between: Scratch, two such pairs and a [3, 3, 3] array; the second pair is still that of
            the end of the last step.
        last_search: Scratch: positions of all particles at the last search for contacts, and those
            that they coast to until the next one, shape [n, 3]; poses of all colliders then, and
            shapes posed for the time since then.
        x_end: Positions at the end of the last step, changed in place [m], shape [n, 3].
        origin: World position of the local origin [m], shape [3].
        posed: Scratch: shapes posed for a sub-step.
        way: See `contact.sweep.Sweep`.
        sides: Which shapes are on the outer side of which particle.
        contacts: Contacts of the last search.
        place: Scratch: points of tangent planes [m], shape [free, 3].
        ride: Scratch: their motion in a sub-step [m], shape [free, 3].
        thickness: Distance to keep from surfaces [m].
        friction: Coulomb coefficient.
        grip: The same in cloth that something else holds, 0 in loose cloth; see `xpbd.planes`.
        pull: Velocity that outer forces add in a sub-step [m/s], shape [3].
        push: Scratch: the same with bending, for every coordinate [m/s], shape [3 free].
        keep: Part of velocity kept in a sub-step.
        dt: Sub-step [s].
        count: Number of sub-steps in a step.
        iterations: Passes over the edges in each.
        bending_every: Sub-steps for each pass over the hinges.
        search_every: Sub-steps for each search for contacts.
        slow: RMS speed below which edges are solved more exactly [m/s].
        motion: Output, sum and maximum of squared speeds [m^2/s^2], shape [2].
        flags: Scratch of a step: whether it is fast enough for the quick pass over edges, whether
            shapes stand still, whether the contacts of the step before still hold, and how many
            particles touch, shape [4].
        first: The first sub-step, from 0; nothing else may change what is scratch in a step.
        last: The sub-step to stop before.

    Returns:
        Number of particles in contact in the last search.
    """
    from_position, from_orientation, to_position, to_orientation, scratch = between
    flat = x.reshape(-1)
    moved = x_predicted.reshape(-1)
    loose = 3 * free
    x_search, x_coast, search_position, search_orientation, since = last_search
    if first == 0:
        # Written so that a motion that is not known counts as none.
        flags[_HURRIED] = iterations == 1 and dt > _SHORT and motion[0] > free * slow**2
        flags[_STILL] = same_poses(start[0], start[1], end[0], end[1])
        if flags[_STILL]:
            pose_shapes(shapes, end[0], end[1], end[0], end[1], origin, scratch, posed)
        # Where nothing was moved since the last step, its contacts are still those of the start.
        flags[_KNOWN] = same(x, x_end) and same_poses(
            start[0], start[1], to_position, to_orientation
        )
        flags[_TOUCHING] = 0
        if flags[_HURRIED] or not flags[_KNOWN]:
            low[:] = np.float32(0.0)
        to_position[:] = start[0]
        to_orientation[:] = start[1]
        x_search[:] = x
        glide(x_search, v, dt * np.float32(search_every), x_coast)
        search_position[:] = start[0]
        search_orientation[:] = start[1]
    hurried, still, known = flags[_HURRIED], flags[_STILL], flags[_KNOWN]
    for s in range(first, last):
        if not still:  # Planes need no poses, pins do.
            from_position[:] = to_position
            from_orientation[:] = to_orientation
            interpolate_poses(
                start[0], start[1], end[0], end[1], (s + 1) / count, to_position, to_orientation
            )
            if s + 1 == count:  # To the last digit, by which the next step knows them again.
                to_position[:] = end[0]
                to_orientation[:] = end[1]
            if (s + 1) % search_every == 0 or s == 0:
                pose_shapes(
                    shapes,
                    from_position,
                    from_orientation,
                    to_position,
                    to_orientation,
                    origin,
                    scratch,
                    posed,
                )
        if s == 0 and known and not still:
            ride_on(x_search, contacts.shape, posed.carry, ride)
        if s % bending_every == 0:
            # Bending acts evenly over the sub-steps until its next pass: in one kick it would make
            # the cloth quiver against its edges.
            x_predicted[:] = v
            between_bends = dt * np.float32(bending_every)
            bend(x, x_predicted, cloth.hinge_particles, cloth.hinges, between_bends)
            share_out(
                x_predicted.reshape(-1)[:loose],
                v.reshape(-1)[:loose],
                pull,
                np.float32(1.0 / bending_every),
                push,
            )
        if hurried:
            fall(
                flat[:loose],
                v.reshape(-1)[:loose],
                x_start.reshape(-1)[:loose],
                x_predicted.reshape(-1)[:loose],
                push,
                keep,
                dt,
            )
        else:
            moved[loose:] = np.float32(0.0)
            coast(
                flat[:loose],
                v.reshape(-1)[:loose],
                x_start.reshape(-1)[:loose],
                moved[:loose],
                low,
                push,
                keep,
                dt,
            )
        carry_pins(
            x[free:], v[free:], pin_collider, pin_position, to_position, to_orientation, origin, dt
        )
        pull_cells(flat, flat if hurried else moved, not hurried, coarse)
        if hurried:
            solve_edges(flat, cloth.edge_particles, cloth.edges)
            gain(
                flat[:loose],
                v.reshape(-1)[:loose],
                x_predicted.reshape(-1)[:loose],
                np.float32(1.0) / dt,
            )
        else:
            cloth.pull[:] = np.float32(0.0)
            for _ in range(iterations):
                alone = iterations == 1
                edges, pulls = cloth.edges, cloth.pull
                solve_edges_apart(flat, moved, cloth.edge_particles, edges, pulls, alone)
            arrive(
                flat[:loose],
                v.reshape(-1)[:loose],
                moved[:loose],
                low,
                dt,
                np.float32(1.0) / dt,
            )
        pull_attached(
            x,
            v,
            x_start,
            attached,
            to_position,
            to_orientation,
            origin,
            keep,
            dt,
            np.float32(1.0) / dt,
        )
        if (s + 1) % search_every != 0 and (s > 0 or known):
            touch_planes(
                x[:free],
                v[:free],
                x_start[:free],
                contacts.shape,
                contacts.normal,
                contacts.depth,
                place,
                ride,
                friction,
                dt,
            )
            continue
        if s > 0 or known:
            return_to_planes(
                x[:free],
                v[:free],
                x_start[:free],
                contacts.shape,
                contacts.normal,
                contacts.depth,
                place,
                ride,
                way.inner_radius,
                grip,
                dt,
            )
        pose_shapes(
            shapes,
            search_position,
            search_orientation,
            to_position,
            to_orientation,
            origin,
            scratch,
            since,
        )
        sweep(shapes, since, sides.side, way, x[:free], x_search[:free], x_coast[:free], thickness)
        x_predicted[:free] = x[:free]
        flags[_TOUCHING] = collide_particles(
            shapes, posed, sides, x[:free], x_start[:free], thickness, friction, contacts
        )
        stop_at_contacts(
            x[:free],
            v[:free],
            x_start[:free],
            x_predicted[:free],
            contacts.shape,
            contacts.normal,
            contacts.depth,
            posed.carry,
            friction,
            dt,
            motion,
        )
        remember_planes(x[:free], x_start[:free], contacts.shape, posed.carry, place, ride)
        x_search[:] = x
        glide(x_search, v, dt * np.float32(search_every), x_coast)
        search_position[:] = to_position
        search_orientation[:] = to_orientation
    if last == count:
        x_end[:] = x
    return flags[_TOUCHING]
