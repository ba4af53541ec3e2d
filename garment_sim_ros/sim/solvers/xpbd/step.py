"""Extended position-based dynamics with small sub-steps.

Macklin, Mueller & Chentanez 2016, "XPBD", with the sub-steps of Macklin et al. 2019, "Small steps
in physics simulation": multipliers start from zero in every sub-step, and one pass over the
constraints is usually enough. Stiffnesses are physical: at convergence neither the sub-step nor
the number of passes changes the shape that cloth hangs in.
"""

import math

import numpy as np

from garment_sim_ros.jit import compiled
from garment_sim_ros.params import XpbdSettings
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.motion import damping_rate, outer_forces
from garment_sim_ros.sim.piece import Piece, Step
from garment_sim_ros.sim.solvers.xpbd import sub_steps
from garment_sim_ros.sim.solvers.xpbd.given import (
    Bodies,
    Elastic,
    Frames,
    Given,
    Particles,
    Planes,
    Rule,
)
from garment_sim_ros.sim.solvers.xpbd.strain_limit import shorten_longest
from garment_sim_ros.sim.solvers.xpbd.workspace import XpbdWorkspace
from garment_sim_ros.solver_params import TRIANGLES

_SMALL, _EARTH = 0.15, 9.81
"""Extent of a garment [m] and gravity [m/s^2]: where it swings faster than with these, sub-steps
are shortened like its swing, or it would hang too long."""
_LAGS = 8000.0
"""A garment that lags more than this, see `hanging.lag` [1/m], as its heavy particles hang by
light ones, has sub-steps as short as it needs, too. With the default sub-step on earth it is 7 %
of stretch; garments have less than 0.1 %."""
_USUAL = XpbdSettings().sub_step
"""A shorter `sub_step` is as good; a longer one asks for less and is shortened in proportion."""
_SHORTEST = 1.0 / 16.0
"""Of `sub_step`, that they are shortened to."""
_SLOW = 0.03
"""RMS speed below which rounding shows [m/s]; that of a garment larger than a metre is larger."""


def pace(piece: Piece, params: Parameters, dt: float) -> tuple[int, int]:
    """How many sub-steps in a step of dt [s], and how many for each search for contacts."""
    settings = params.settings
    assert isinstance(settings, XpbdSettings)
    # What is not a number is no gravity: `recovery` sees to it.
    pull = max(_EARTH, math.hypot(*params.environment.gravity))
    workspace = _workspace(piece)
    swing = math.sqrt(workspace.extent / _SMALL * _EARTH / pull)
    even = math.sqrt(_LAGS * settings.iterations / max(workspace.lag, 1e-9) * _EARTH / pull)
    longest = min(swing * settings.sub_step, even * max(settings.sub_step, _USUAL))
    longest = min(max(longest, _SHORTEST * settings.sub_step), settings.sub_step)
    count = max(1, math.ceil(dt / longest - 1e-6))
    passes = math.ceil(count / settings.search_every)
    search_every = math.ceil(count / passes)
    return passes * search_every, search_every


def begin(piece: Piece, step: Step) -> bool:
    """Makes ready for a step; tells whether the contacts of the step before still hold."""
    workspace, colliders = _workspace(piece), step.colliders
    given = workspace.given
    if given is None or not given.fits(step):
        workspace.given = given = _given(piece, workspace, step)
    assert workspace.code is not None
    workspace.known = bool(workspace.code[0](given.own, given.rule, colliders.goes_on))
    return workspace.known


def solve(piece: Piece, step: Step, first: int, last: int, searches: bool) -> None:
    """Sub-steps `first` to `last`.

    Each: outer forces and a prediction, pins, the edges, tethers and soft attachments; contact
    with tangent planes where it does not search for contacts. Bending comes every so often, see
    `XpbdWorkspace.prepare`. Does not allocate arrays.
    """
    workspace = _workspace(piece)
    assert workspace.code is not None
    assert workspace.given is not None
    workspace.code[1](*workspace.given.to_solve, first, last, searches)
    workspace.has_planes = last > 1 or workspace.known


def meet(piece: Piece, step: Step) -> None:
    """Searches for contacts: an absolute constraint with friction; and velocities."""
    workspace = _workspace(piece)
    assert workspace.code is not None
    assert workspace.given is not None
    given, has_planes = workspace.given, workspace.has_planes
    own, bodies, _, planes, second, before, rule = given.to_meet
    workspace.contact_count = workspace.code[2](*given.to_meet, has_planes)
    if len(bodies.guard.shape):
        workspace.code[3](own, bodies, rule, has_planes)
    workspace.code[4](own, bodies, planes, second, before, rule)


def finish(piece: Piece) -> None:
    """Ends a step: what moves particles after it is a jump, and contacts are looked for anew."""
    workspace = _workspace(piece)
    assert workspace.code is not None
    assert workspace.given is not None
    own, bodies, ready, planes, _, _, rule = workspace.given.to_meet
    if rule.strain_limit > 0.0:
        workspace.code[5](own.x, ready.edges, planes, bodies.guard.kept, rule.strain_limit)
    workspace.x_end[:] = piece.state.x


def _workspace(piece: Piece) -> XpbdWorkspace:
    workspace = piece.workspace
    assert isinstance(workspace, XpbdWorkspace)
    return workspace


def _given(piece: Piece, workspace: XpbdWorkspace, step: Step) -> Given:
    """What the kernels are given in steps such as this one."""
    settings = step.params.settings
    assert isinstance(settings, XpbdSettings)
    rate = damping_rate(piece.model.material)
    coarse = settings.coarse and settings.iterations == 1
    workspace.prepare(
        *(piece.model, step.dt, rate, step.search_every, coarse),
        settings.membrane == TRIANGLES,
    )
    known = workspace.all_given.get(step.search_every)
    if known is not None and known.fits(step):
        return known
    own, elastic, planes = _own(piece, workspace)
    frames, bodies = _around(workspace, step.colliders)
    rule = _rule(piece, workspace, step)
    given = Given(
        step=step,
        path=step.colliders.path,
        own=own,
        rule=rule,
        to_solve=(own, elastic, frames, planes, workspace.second, rule),
        to_meet=(
            *(own, bodies, elastic.ready, planes),
            *(workspace.second, workspace.before, rule),
        ),
    )
    workspace.all_given[step.search_every] = given
    if workspace.code is None:
        workspace.code = (
            compiled(sub_steps.begin, own, rule, True),
            compiled(sub_steps.solve, *given.to_solve, 0, 1, True),
            compiled(sub_steps.meet, *given.to_meet, True),
            compiled(sub_steps.guard, own, bodies, rule, True),
            compiled(
                *(sub_steps.stop, own, bodies, planes),
                *(workspace.second, workspace.before, rule),
            ),
            compiled(
                *(shorten_longest, own.x, elastic.ready.edges, planes, bodies.guard.kept),
                rule.strain_limit,
            ),
        )
    return given


def _own(piece: Piece, workspace: XpbdWorkspace) -> tuple[Particles, Elastic, Planes]:
    """What is a garment's own."""
    own = Particles(
        x=piece.state.x,
        v=piece.state.v,
        x_start=workspace.x_start,
        x_predicted=workspace.x_predicted,
        wide_x=workspace.wide,
        wide_v=workspace.wide_v,
        x_search=workspace.x_search,
        x_coast=workspace.x_coast,
        x_end=workspace.x_end,
        low=workspace.low,
        push=workspace.push_all,
        motion=workspace.motion,
        flags=workspace.flags,
    )
    elastic = Elastic(
        ready=workspace.prepared,
        coarse=workspace.coarse,
        attached=workspace.attached,
        pin_collider=workspace.pins.collider,
        pin_place=workspace.pins.place,
        pin_step=workspace.pins.step,
    )
    planes = Planes(
        shape=workspace.contacts.shape,
        normal=workspace.contacts.normal,
        depth=workspace.contacts.depth,
        caught=workspace.contacts.caught,
        place=workspace.place,
        shift=workspace.shift,
    )
    return own, elastic, planes


def _around(workspace: XpbdWorkspace, colliders: ColliderState) -> tuple[Frames, Bodies]:
    """What of the colliders it meets."""
    frames = Frames(
        position=colliders.path.position,
        orientation=colliders.path.orientation,
        origin=colliders.origin,
        carry=colliders.posed.carry,
    )
    bodies = Bodies(
        shapes=colliders.shapes,
        posed=colliders.posed,
        since=colliders.since,
        way=colliders.sweep,
        sides=workspace.sides,
        contacts=workspace.contacts,
        guard=workspace.guard,
    )
    return frames, bodies


def _rule(piece: Piece, workspace: XpbdWorkspace, step: Step) -> Rule:
    """Numbers of a step."""
    model, settings = piece.model, step.params.settings
    held = model.free_count < len(model) or workspace.limited
    pull = np.zeros(3, np.float32)
    friction = np.float32(model.material.friction)
    return Rule(
        free=model.free_count,
        dt=np.float32(step.dt),
        keep=np.float32(outer_forces(model, step.params, step.dt, pull)),
        pull=pull,
        thickness=np.float32(max(model.material.thickness, step.colliders.thickness)),
        friction=friction,
        held_friction=friction if held else np.float32(0.0),
        strain_limit=np.float32(settings.strain_limit),
        iterations=settings.iterations,
        bend_every=workspace.bend_every,
        search_every=step.search_every,
        slow=_SLOW * max(1.0, workspace.extent),
    )
