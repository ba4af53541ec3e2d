"""A simulation that plays parts of a scene from given states, and how long its frames take."""

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.sim.putting_on import set_in_motion
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.state import State
from garment_sim_ros.tradeoff.scenes import Staged

_INSTANT = 1e-4
"""A step in which nothing moves far [s]."""


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """All garments at one time.

    Attributes:
        frame: Which frame they are in.
        x: World positions by name, as they are simulated [m], shape [v, 3].
        v: World velocities by name [m/s], shape [v, 3].
    """

    frame: int
    x: dict[str, SingleArray]
    v: dict[str, SingleArray]


@dataclass(kw_only=True)
class Played:
    """What was seen in some frames.

    Attributes:
        paths: World positions by name as they are shown [m], the start and after each frame, shape
            [f + 1, v, 3].
        simulated: The same where the solver has them.
        processor: Processor time of each frame [s].
        wall: Time of each frame [s].
        let_go: Particles whose contact was dropped, after each frame.
    """

    paths: dict[str, SingleArray]
    simulated: dict[str, SingleArray]
    processor: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)
    let_go: list[int] = field(default_factory=list)


class Player:
    """One scene with one setting.

    Args:
        staged: The scene.
        arguments: Solver, settings and step, as `Simulation` takes them.

    Raises:
        GarmentSimError: It cannot be simulated.
    """

    def __init__(self, staged: Staged, arguments: dict[str, Any]) -> None:
        self.staged = staged
        self.simulation = Simulation(
            staged.garments, staged.colliders, **{**staged.scene.environment, **arguments}
        )
        self._mended = 0

    @property
    def mended(self) -> int:
        """Times that garments or particles had to be put right since they were put on."""
        health = [self.simulation.health(name) for name in self.simulation.names]
        every = sum(h.resets + h.recovered + h.rewound + h.rewound_parts for h in health)
        return every - self._mended

    def put_on(self, *, settle: bool) -> None:
        """Put the garments on the first pose; those of a scene without a body where they are.

        On a body they have its speed, as from the first step on that a node takes.
        """
        simulation, poses = self.simulation, self.staged.poses
        on_body = self.staged.avatar is not None
        simulation.reset(poses[0], settle=settle and on_body)
        self._mended += self.mended
        if on_body:
            # The first step would give that speed to garments which begin later, too.
            simulation.advance(poses[0], poses[0], _INSTANT)
            around = simulation.parameters.environment
            if around.root_linear_inertia == around.root_angular_inertia == 1.0:
                worn = [view.worn for view in simulation]
                set_in_motion(worn, poses[0], poses[1], self.staged.scene.frame)

    def snapshot(self, frame: int) -> Snapshot:
        """What there is now."""
        return Snapshot(
            frame=frame,
            x={view.name: view.simulated for view in self.simulation},
            v={view.name: view.velocities for view in self.simulation},
        )

    def begin(self, at: Snapshot) -> None:
        """Be where a snapshot is, without contacts or anything else known from before.

        With `detail` what is simulated lies on the surface of the snapshot, which folds may put it
        off by a little.
        """
        simulation, poses = self.simulation, self.staged.poses[at.frame]
        simulation.transport(poses, poses)
        simulation.time = at.frame * self.staged.scene.frame
        for view in simulation:
            worn, state = view.worn, view.state
            x, v = (worn.of_simulated(of[view.name].astype(np.float64)) for of in (at.x, at.v))
            worn.place(x, simulation.collider_state)
            # Pins, too, are where they were.
            state.assign(State.at(view.model, x, simulation.origin))
            state.v[:] = v[view.model.vertex]
            worn.good.assign(state)
            for pair in simulation.over(view.name):
                pair.forget()

    def play(self, first: int, last: int, *, paced: bool = False) -> Played:
        """The frames from one number to another.

        Args:
            first: Where it begins.
            last: Where it ends; frames after the scene's last one hold its last pose.
            paced: Whether each frame begins when it is due, after a pause; else back to back.
        """
        poses, dt = self.staged.poses, self.staged.scene.frame
        end = len(poses) - 1
        shown: dict[str, list[SingleArray]] = {v.name: [v.positions] for v in self.simulation}
        simulated: dict[str, list[SingleArray]] = {v.name: [v.simulated] for v in self.simulation}
        played = Played(paths={}, simulated={})
        due = time.perf_counter()
        for n in range(first, last):
            if paced:
                due = max(due + dt, time.perf_counter())
                time.sleep(max(0.0, due - time.perf_counter()))
            wall, processor = time.perf_counter(), time.thread_time()
            self.simulation.advance(poses[min(n, end)], poses[min(n + 1, end)], dt)
            played.processor.append(time.thread_time() - processor)
            played.wall.append(time.perf_counter() - wall)
            played.let_go.append(sum(v.health.let_go for v in self.simulation))
            for view in self.simulation:
                shown[view.name].append(view.positions)
                simulated[view.name].append(view.simulated)
        played.paths = {name: np.array(row) for name, row in shown.items()}
        played.simulated = {name: np.array(row) for name, row in simulated.items()}
        return played
