"""The loop over the sub-steps of a step: the only one, for all solvers and all garments.

What acts on cloth takes its turn here. A sub-step is:

1. the colliders move, up to the next search for contacts, once for all garments
   (`ColliderState.move`);
2. the solver solves each garment (`Solver.solve`): outer forces, pins, edges, hinges, tethers and
   soft attachments; where contacts are not searched for, also contact with what was found last;
3. where they are, each garment meets the colliders (`Solver.meet`). What else keeps cloth and body
   apart has its place behind that: it finds the poses in `ColliderState.before` and `now`, the
   positions in `State.x` and `Workspace.x_start`;
4. garments over garments are parted (`LayerPair`);
5. the constraints of each garment hold it (`Constraint.hold`): distance limits and backstops, and
   in the last sub-step the garment itself.

After the last one garments that run through each other are untangled (`LayerPair`).

What acts after whole steps only, edges take back in the first sub-step of the next one, with a
velocity of its way over a sub-step: cloth would never rest. Where nothing acts on any garment
between two searches but the solver, the sub-steps between them are one call.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.layers.pair import LayerPair
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.motion import measure_motion
from garment_sim_ros.sim.piece import Piece, Step
from garment_sim_ros.sim.solvers import Solver


def take_step(
    solver: Solver,
    pieces: Sequence[Piece],
    pairs: Sequence[LayerPair],
    colliders: ColliderState,
    params: Parameters,
    dt: float,
) -> None:
    """Advances garments by one step, in equal sub-steps.

    Args:
        solver: What solves them.
        pieces: The garments, changed in place.
        pairs: Those of them that are worn over each other.
        colliders: Posed from the start to the end of the step.
        params: Outer forces and the solver's settings.
        dt: The step [s].
    """
    count, search_every = max((solver.pace(piece, params, dt) for piece in pieces), default=(1, 1))
    # To a precision at which sub-steps of steps of several lengths are the same.
    sub_step = float(np.float32(dt / count))
    step = Step(colliders, params, count, search_every, sub_step)
    colliders.begin(search_every)
    for pair in pairs:
        pair.look()
    known = [solver.begin(piece, step) for piece in pieces]
    others = [constraint for piece in pieces for constraint in piece.constraints]
    singly = bool(pairs) or not all(constraint.once_a_step for constraint in others)
    for first, last, searches in _intervals(step, all(known)):
        colliders.move(first, last, count, searches)
        for piece in pieces:
            piece.workspace.pins.follow(colliders, step.dt, last - first)
        for s, end in pairwise(range(first, last + 1)) if singly else [(first, last)]:
            meets = searches and end == last
            for piece in pieces:
                solver.solve(piece, step, s, end, meets)
            if meets:
                for piece in pieces:
                    solver.meet(piece, step)
            for pair in pairs:
                if s % search_every == 0:
                    pair.find_close(step.dt)
                pair.separate()
            for piece in pieces:
                _hold(piece, step, end)
    rests = colliders.still and not params.environment.blows
    for pair in pairs:
        pair.untangle(dt, rests)
    for piece in pieces:
        if pairs or others:
            measure_motion(piece.state.v[: piece.model.free_count], piece.workspace.motion)
        solver.finish(piece)


def _intervals(step: Step, known: bool) -> Iterator[tuple[int, int, bool]]:
    """Sub-steps from one search for contacts to the next; the first one of a step is alone.

    Args:
        step: The step.
        known: Whether contacts of the step before still hold; else the first sub-step searches.

    Yields:
        The first of them, the one to stop before, and whether the last of them searches.
    """
    first = 0
    for last in range(1, step.sub_steps + 1):
        searches = last % step.search_every == 0 or (last == 1 and not known)
        if searches or last == 1:
            yield first, last, searches
            first = last


def _hold(piece: Piece, step: Step, end: int) -> None:
    """Lets constraints act after the sub-step before number `end`."""
    if not piece.constraints:
        return
    left = step.sub_steps - end
    held = 0
    for constraint in piece.constraints:
        if not constraint.once_a_step:
            held += constraint.hold(piece.state, step.dt * left, step.dt)
        elif left == 0:
            held += constraint.hold(piece.state, 0.0, step.dt * step.sub_steps)
    piece.held = held
