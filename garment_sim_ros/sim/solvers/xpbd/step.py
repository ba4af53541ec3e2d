"""Extended position-based dynamics with small sub-steps.

Macklin, Mueller & Chentanez 2016, "XPBD", with the sub-steps of Macklin et al. 2019, "Small steps
in physics simulation": multipliers start from zero in every sub-step, and one pass over the
constraints is usually enough. Stiffnesses are physical: at convergence neither the sub-step nor
the number of passes changes the shape that cloth hangs in.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from garment_sim_ros.contact.packed import PosedShapes
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.jit import compiled
from garment_sim_ros.params import XpbdSettings
from garment_sim_ros.sim.layers.pair import LayerPair
from garment_sim_ros.sim.model import ClothModel, Parameters
from garment_sim_ros.sim.solvers.xpbd.sub_steps import run_sub_steps
from garment_sim_ros.sim.solvers.xpbd.workspace import XpbdWorkspace
from garment_sim_ros.sim.state import ColliderState, State, Workspace

_SMALL = 0.1
"""Extent of a garment below which sub-steps are shortened like its swing [m]."""
_SLOW = 0.03
"""RMS speed below which rounding shows [m/s]; that of a garment larger than a metre is larger."""


def step(
    model: ClothModel,
    colliders: ColliderState,
    params: Parameters,
    state: State,
    workspace: Workspace,
    dt: float,
) -> None:
    """Advances one garment by one step, in equal sub-steps.

    Each sub-step: outer forces and a prediction, pins, the edges, collision as an absolute
    constraint with friction, velocities. Bending and the search for contacts come every so often,
    see `XpbdSettings.search_every` and `XpbdWorkspace.prepare`; in between, contact is with
    tangent planes. Does not allocate arrays after the first step.

    Args:
        model: The garment.
        colliders: Colliders at the start and end of the step.
        params: Outer forces and `XpbdSettings`.
        state: Its motion, changed in place.
        workspace: Its `XpbdWorkspace`.
        dt: Step [s].
    """
    assert isinstance(workspace, XpbdWorkspace)
    count, search_every = _sub_steps(workspace, params, dt)
    given = _given(model, colliders, params, state, workspace, dt, count, search_every)
    advance = _machine_code(workspace, given, count)
    workspace.contact_count = advance(*given, 0, count)


def step_layers(
    garments: Sequence[tuple[ClothModel, State, XpbdWorkspace]],
    pairs: Sequence[LayerPair],
    colliders: ColliderState,
    params: Parameters,
    dt: float,
    hold: Sequence[Callable[[float, float], None]] = (),
) -> None:
    """Advances garments over garments by one step, which meet each other in each sub-step.

    What is parted or held after a whole step springs back in the first sub-step of the next one,
    with a velocity of that way over a sub-step: layers would never rest.

    Args:
        garments: Model, motion (changed in place) and `XpbdWorkspace` of each.
        pairs: The pairs of them that meet.
        colliders: Colliders at the start and end of the step.
        params: Outer forces and `XpbdSettings`.
        dt: Step [s].
        hold: What else holds them, told the time to the end of the step and the sub-step [s].
    """
    count, search_every = max(_sub_steps(w, params, dt) for _, _, w in garments)
    given = []
    for model, state, workspace in garments:
        given.append(_given(model, colliders, params, state, workspace, dt, count, search_every))
        _machine_code(workspace, given[-1], count)
    for s in range(count):
        for (_, _, workspace), g in zip(garments, given, strict=True):
            assert workspace.code is not None
            workspace.contact_count = workspace.code(*g, s, s + 1)
        for pair in pairs:
            if s % search_every == 0:
                pair.find_close(dt / count)
            pair.part()
        for constrain in hold:
            constrain(dt * (count - 1 - s) / count, dt / count)
    for _, state, workspace in garments:
        workspace.x_end[:] = state.x  # What that moved last was no jump: contacts still hold.


def _sub_steps(workspace: Workspace, params: Parameters, dt: float) -> tuple[int, int]:
    """How many in a step of dt [s], and how many for each search for contacts."""
    assert isinstance(workspace, XpbdWorkspace)
    settings = params.settings
    assert isinstance(settings, XpbdSettings)
    longest = settings.sub_step * min(1.0, math.sqrt(workspace.extent / _SMALL))
    count = max(1, math.ceil(dt / longest - 1e-6))
    passes = math.ceil(count / settings.search_every)
    search_every = math.ceil(count / passes)
    return passes * search_every, search_every


def _machine_code(
    workspace: XpbdWorkspace, given: tuple[Any, ...], count: int
) -> Callable[..., int]:
    """`run_sub_steps` for what is given, whose types take longer to look at than the call."""
    if workspace.code is None:
        workspace.code = compiled(run_sub_steps, *given, 0, count)
    return workspace.code


def _given(
    model: ClothModel,
    colliders: ColliderState,
    params: Parameters,
    state: State,
    workspace: Workspace,
    dt: float,
    count: int,
    search_every: int,
) -> tuple[Any, ...]:
    """What `run_sub_steps` needs for `count` sub-steps in dt [s]."""
    h = dt / count
    assert isinstance(workspace, XpbdWorkspace)
    settings = params.settings
    assert isinstance(settings, XpbdSettings)
    material, environment = model.material, params.environment
    drag = material.air_drag / material.areal_density
    rate = material.damping + drag
    coarse = settings.coarse and settings.iterations == 1
    workspace.prepare(model, h, rate, search_every, coarse, count)
    if workspace.between is None:
        a, b = colliders.start.copy(), ColliderPoses.identity(len(colliders.start.position))
        scratch = np.zeros((3, 3, 3))
        workspace.between = (a.position, a.orientation, b.position, b.orientation, scratch)
        c = colliders.start.copy()
        x, coast = np.zeros((2, len(model), 3), np.float32)
        posed = PosedShapes.room_for(colliders.shapes)
        workspace.last_search = (x, coast, c.position, c.orientation, posed)

    held = model.free_count < len(model) or workspace.limited
    keep = 1.0 / (1.0 + h * rate)
    for k in range(3):
        pull = environment.gravity[k] + drag * environment.wind[k]
        workspace.push[k] = keep * h * pull
    return (
        state.x,
        state.v,
        model.free_count,
        workspace.x_start,
        workspace.x_predicted,
        workspace.low,
        workspace.prepared,
        workspace.coarse,
        workspace.attached,
        model.pin_collider,
        model.pin_position,
        colliders.shapes,
        (colliders.start.position, colliders.start.orientation),
        (colliders.end.position, colliders.end.orientation),
        workspace.between,
        workspace.last_search,
        workspace.x_end,
        colliders.origin,
        colliders.posed,
        colliders.sweep,
        workspace.sides,
        workspace.contacts,
        workspace.place,
        workspace.ride,
        np.float32(max(material.thickness, colliders.thickness)),
        np.float32(material.friction),
        np.float32(material.friction if held else 0.0),
        workspace.push,
        workspace.push_all,
        np.float32(keep),
        np.float32(h),
        count,
        settings.iterations,
        workspace.bending_every,
        search_every,
        _SLOW * max(1.0, workspace.extent),
        workspace.motion,
        workspace.flags,
    )
