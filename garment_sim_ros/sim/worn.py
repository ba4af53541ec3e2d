"""One garment on a body, with all that belongs to it."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.geometry.contact_sides import Sides
from garment_sim_ros.geometry.shapes import ColliderSet
from garment_sim_ros.sim.health import Health
from garment_sim_ros.sim.kernels.layers import measure_motion
from garment_sim_ros.sim.kernels.motion import carry_pins
from garment_sim_ros.sim.leash import Leash
from garment_sim_ros.sim.model import ClothModel, build_model
from garment_sim_ros.sim.placement import Frames, GarmentLike, find_frames, pin_positions
from garment_sim_ros.sim.sides import shape_sides
from garment_sim_ros.sim.solvers import Solver
from garment_sim_ros.sim.state import ColliderState, State, Workspace

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]


class Constraint(Protocol):
    """What holds a garment after each of the solver's steps, whichever solver it is."""

    def hold(self, state: State, colliders: ColliderState, dt: float) -> int:
        """Corrects positions and velocities in place; tells how many particles it held."""
        ...

    def forget(self) -> None:
        """What follows does not depend on what was before: the garment was put elsewhere."""
        ...


@dataclass(kw_only=True)
class Worn:
    """One garment with all that belongs to it.

    Attributes:
        garment: Mesh, material, frames and pins.
        frames: The frames that it rides on.
        model: Its particles and springs.
        state: Its motion.
        good: The last state that was finite.
        workspace: Scratch arrays of the solver.
        health: Counts and readings.
        constraints: What holds it after each step; only what the garment asks for.
        x_world: World positions of its vertices in file order [m], shape [v, 3].
        normal: Their unit normals, shape [v, 3].
    """

    garment: GarmentLike
    frames: Frames
    model: ClothModel
    state: State
    good: State
    workspace: Workspace
    health: Health
    constraints: tuple[Constraint, ...]
    x_world: SingleArray
    normal: SingleArray

    @classmethod
    def on(
        cls, garment: GarmentLike, collider_set: ColliderSet, colliders: ColliderState, by: Solver
    ) -> "Worn":
        """A garment where its file has it.

        Args:
            garment: The garment.
            collider_set: The body's colliders.
            colliders: The same, to be posed.
            by: The solver that will advance it.

        Raises:
            GeometryError: It cannot be simulated, or a frame is missing.
        """
        frames = find_frames(garment.name, garment.frames, collider_set)
        model = build_model(
            garment.name,
            garment.vertices,
            garment.triangles,
            garment.material,
            pins=garment.pins,
            pin_collider=frames.collider[np.asarray(garment.pin_frame, dtype=np.int32)],
            pin_position=pin_positions(garment, frames),
        )
        state = State.at(model, garment.vertices, colliders.origin)
        workspace = by.workspace(model, len(colliders.shapes.kind))
        row, side = shape_sides(garment, collider_set, colliders.shapes)
        workspace.sides = Sides.of(row[model.vertex[: model.free_count]], side)
        return cls(
            garment=garment,
            frames=frames,
            model=model,
            state=state,
            good=state.copy(),
            workspace=workspace,
            health=Health(),
            constraints=_constraints(garment, frames, model),
            x_world=np.zeros((len(model), 3), np.float32),
            normal=np.zeros((len(model), 3), np.float32),
        )

    def hold(self, colliders: ColliderState, dt: float) -> None:
        """Lets all constraints act, after a step of dt [s]."""
        held = 0
        for constraint in self.constraints:
            held += constraint.hold(self.state, colliders, dt)
        if held:
            self.measure()

    def measure(self) -> None:
        """Measures the motion again, where something else than the solver changed it."""
        measure_motion(self.state.v[: self.model.free_count], self.workspace.motion)

    def place(self, x_world: FloatArray, colliders: ColliderState) -> None:
        """Puts the garment at rest somewhere, its pins where their colliders are.

        Args:
            x_world: World positions of its vertices [m], shape [v, 3].
            colliders: The colliders, which stand still.
        """
        self.state.assign(State.at(self.model, x_world, colliders.origin))
        free = self.model.free_count
        carry_pins(
            self.state.x[free:],
            self.state.v[free:],
            self.model.pin_collider,
            self.model.pin_position,
            colliders.end.position,
            colliders.end.orientation,
            colliders.origin,
            np.float32(1.0),
        )
        self.state.v[free:] = 0.0
        self.good.assign(self.state)
        for constraint in self.constraints:
            constraint.forget()

    def watch(self) -> None:
        """Keeps a finite state as the last good one; puts back a state that is not finite."""
        total, fastest = self.workspace.motion
        health = self.health
        if math.isfinite(total):
            self.good.assign(self.state)
            health.contacts = self.workspace.contact_count
            health.rms_speed = math.sqrt(total / max(self.model.free_count, 1))
            health.max_speed = math.sqrt(fastest)
        else:
            self.state.assign(self.good)
            self.state.v[:] = 0.0
            health.resets += 1


def _constraints(
    garment: GarmentLike, frames: Frames, model: ClothModel
) -> tuple[Constraint, ...]:
    """Those that a garment asks for, in the order in which they act."""
    constraints: list[Constraint] = []
    if garment.max_distance is not None:
        constraints.append(Leash(garment, frames, model))
    return tuple(constraints)
