"""One garment on a body, with all that belongs to it."""

import math
from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.guard.guard import Guard
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.contact.sides import Sides
from garment_sim_ros.sim.aside import Aside
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.detail.share import simulated_share
from garment_sim_ros.sim.detail.surface import Surface
from garment_sim_ros.sim.health import Health
from garment_sim_ros.sim.holds.attaching import attached_to
from garment_sim_ros.sim.holds.constraint import Constraint
from garment_sim_ros.sim.holds.letting_go import LettingGo
from garment_sim_ros.sim.holds.skin_limits import SKIN_LIMITS
from garment_sim_ros.sim.holds.skin_places import SkinPlaces
from garment_sim_ros.sim.holds.stitching import Stitching
from garment_sim_ros.sim.model import ClothModel, build_model
from garment_sim_ros.sim.motion import measure_motion, move_pins, shift, to_file_order
from garment_sim_ros.sim.on_its_way import OnItsWay
from garment_sim_ros.sim.over_skin import OverSkin
from garment_sim_ros.sim.piece import Piece
from garment_sim_ros.sim.placement import (
    Frames,
    GarmentLike,
    blend,
    find_frames,
    places_in_frames,
    rest_transforms,
)
from garment_sim_ros.sim.recovery import Recovery
from garment_sim_ros.sim.self_collision.garment import SelfCollision
from garment_sim_ros.sim.sides import shape_sides
from garment_sim_ros.sim.solvers import Solver
from garment_sim_ros.sim.state import State, Workspace

_NOWHERE = np.zeros(3)
_GOING_OVER = 0.2, 0.25
"""Where other vertices are simulated from now on, what is shown goes over at up to so many metres
a second against the skin, 3 mm in a 60th, in so many seconds at most."""


@dataclass(kw_only=True)
class Worn(Piece):
    """One garment with all that belongs to it.

    Attributes:
        given: Mesh, material, frames and pins.
        garment: What of it is simulated: the same, or one of fewer vertices.
        surface: All its vertices over those that are simulated; None where they are the same.
        triangles: All its triangles, shape [t, 3].
        frames: The frames that it follows.
        good: Its motion when the last step began, of which every particle is good.
        recovery: Mends what is not.
        health: Counts and readings.
        places: Where it would be as skin, None unless a constraint asks.
        letting_go: Releases overstretched cloth from colliders that should only brush the
            garment; None where there are none.
        on_its_way: What it is shown off its place where it was wound back.
        aside: What it is shown off its place to lie over the shapes, with round creases.
        going_over: What it is shown off its place since other vertices are simulated.
        x_world: World positions of its vertices in file order [m], shape [v, 3].
        normal: Their unit normals, shape [v, 3].
        x_simulated: Scratch: those that are simulated, shape [n, 3].
    """

    given: GarmentLike
    garment: GarmentLike
    surface: Surface | None
    triangles: IntArray
    frames: Frames
    good: State
    recovery: Recovery
    health: Health
    places: SkinPlaces | None
    letting_go: LettingGo | None
    on_its_way: OnItsWay
    aside: Aside
    going_over: OnItsWay
    x_world: SingleArray
    normal: SingleArray
    x_simulated: SingleArray

    @classmethod
    def on(
        cls,
        given: GarmentLike,
        collider_set: ColliderSet,
        colliders: ColliderState,
        by: Solver,
        detail: float = 1.0,
    ) -> "Worn":
        """A garment where its file has it.

        Args:
            given: The garment.
            collider_set: The body's colliders.
            colliders: The same, to be posed.
            by: The solver that will advance it.
            detail: Share of its vertices that are simulated.

        Raises:
            GeometryError: It cannot be simulated, or a frame is missing.
        """
        garment, surface, limits = simulated_share(given, detail)
        frames = find_frames(garment.name, garment.frames, collider_set)
        model = build_model(
            garment.name,
            garment.vertices if garment.rest is None else garment.rest,
            garment.triangles,
            garment.material,
            pins=garment.pins,
            pin_collider=frames.collider[np.asarray(garment.pin_frame, dtype=np.int32)],
            pin_position=places_in_frames(garment, frames, garment.pins, garment.pin_frame),
            flat=garment.flat,
            elastic=garment.elastic,
        )
        state = State.at(model, garment.vertices, colliders.origin)
        workspace = by.workspace(model, len(colliders.shapes.kind))
        workspace.limits += limits
        row, side = shape_sides(garment, collider_set, colliders.shapes)
        workspace.attached = attached_to(garment, frames, model)
        workspace.sides = Sides.of(row[model.vertex[: model.free_count]], side)
        T_world_rest = rest_transforms([garment], collider_set)
        x_rest = np.asarray(garment.vertices, np.float64)[model.vertex]
        workspace.guard = Guard.of(
            *(collider_set, colliders.shapes, model.particle_triangles, workspace.sides.side),
            *(T_world_rest, x_rest),
        )
        pins = model.vertex[model.free_count :]
        workspace.pins.give_way_to(
            *(collider_set, colliders.shapes, T_world_rest),
            *(x_rest[model.free_count :], side[row[pins]].T),
        )
        places = None
        if garment.skin_limits:
            places = SkinPlaces(garment, frames, model)
            workspace.limited = True
        return cls(
            given=given,
            garment=garment,
            surface=surface,
            triangles=model.triangles if surface is None else surface.triangles,
            frames=frames,
            model=model,
            state=state,
            good=state.copy(),
            recovery=Recovery(model),
            workspace=workspace,
            health=Health(),
            places=places,
            letting_go=LettingGo(model, workspace.sides) if garment.passed_by else None,
            on_its_way=OnItsWay(garment),
            aside=Aside(
                *(model, surface, given.vertices if given.rest is None else given.rest),
                _shown_in_place(given),
                _over_skin(given, colliders, T_world_rest),
            ),
            going_over=OnItsWay(given, *_GOING_OVER),
            constraints=_constraints(garment, places, model, workspace),
            x_world=np.zeros((len(given.vertices), 3), np.float32),
            normal=np.zeros((len(given.vertices), 3), np.float32),
            x_simulated=np.zeros((len(model), 3), np.float32),
        )

    def begin(self, colliders: ColliderState, dt: float) -> None:
        """Sees to it that a step of dt [s] begins with good particles only, and keeps them."""
        if not self.recovery.keep(self.state, self.good, dt):
            self._mend(dt)
            self.good.assign(self.state)
        if self.places is not None:
            self.places.follow(colliders, dt)

    def finish(self, colliders: ColliderState, dt: float) -> None:
        """Sees to it that a step of dt [s] ended well, and to what comes once in a step."""
        self.check(dt)
        self.health.held = self.held + int(self.workspace.attached.held[0])
        if self.letting_go is not None:
            thickness = max(self.model.material.thickness, colliders.thickness)
            self.letting_go.look(self.state, colliders, thickness)

    def check(self, dt: float) -> None:
        """Mends what a step of dt [s] broke, as the motion that it measured tells."""
        if not self.recovery.is_believed(self.workspace.motion, dt):
            self._mend(dt)

    def _mend(self, dt: float) -> None:
        mended = self.recovery.mend(self.state, self.good, dt)
        if mended < 0:
            self.health.resets += 1
            self._forget()
        else:
            self.health.recovered += mended
        self.measure()

    def _forget(self) -> None:
        if self.letting_go is not None:
            self.letting_go.forget()
        self.workspace.attached.forget()
        self.workspace.guard.forget()
        if self.places is not None:
            self.places.forget()
        for constraint in self.constraints:
            constraint.forget()

    def shift(self, by: SingleArray) -> None:
        """The local origin has moved: coordinates change by [m], shape [3]."""
        shift(self.state.x, by)
        shift(self.good.x, by)
        self.workspace.attached.shift(by)
        if self.places is not None:
            self.places.shift(by)
        for constraint in self.constraints:
            constraint.shift(by)

    def transport(self, moved: FloatArray) -> None:
        """Takes the garment along, each vertex by its own way [m], shape [v, 3]."""
        for state in (self.state, self.good):
            state.x += moved[self.model.vertex].astype(np.float32)
        self._forget()

    def wind_back(
        self, x_world: FloatArray, v: SingleArray, share: FloatArray, origin: FloatArray
    ) -> None:
        """Moves vertices to where they were, and to the velocity of skin there.

        Args:
            x_world: Where each is to be [m], shape [v, 3].
            v: Velocities of the particles if they were skin [m/s], shape [n, 3].
            share: How much of the way each goes, shape [v].
            origin: What the state is relative to [m], shape [3].
        """
        free = self.model.free_count
        w = share[self.model.vertex[:free], None]
        x, own = self.state.x, self.state.v
        there = (np.asarray(x_world, np.float64) - origin)[self.model.vertex[:free]]
        x[:free] = (1.0 - w) * x[:free] + w * there
        own[:free] = (1.0 - w) * own[:free] + w * v[:free]
        self.good.assign(self.state)
        self._forget()
        self.measure()

    def shown(self, origin: FloatArray, out: SingleArray | None = None) -> SingleArray:
        """World positions of all its vertices as shown, in file order [m], shape [v, 3]."""
        out = self.simulated(origin, out)
        out += self.aside.off
        self.going_over.add_to(out)
        return out

    def simulated(self, origin: FloatArray, out: SingleArray | None = None) -> SingleArray:
        """The same before they are laid over the body; the state is relative to `origin` [m]."""
        if self.surface is None:
            return self.seen(origin, out)
        out = np.empty((len(self.surface), 3), np.float32) if out is None else out
        self.surface.follow(self.seen(_NOWHERE, self.x_simulated), origin, out)
        return out

    def beside(self, x: SingleArray) -> SingleArray:
        """All its vertices where those that are simulated are at x [m], shapes [n, 3], [v, 3]."""
        if self.surface is None:
            return x
        out = np.empty((len(self.surface), 3), np.float32)
        self.surface.follow(x, _NOWHERE, out)
        return out

    def seen(self, origin: FloatArray, out: SingleArray | None = None) -> SingleArray:
        """The same of those that are simulated, shape [n, 3]."""
        out = np.empty((len(self.model), 3), np.float32) if out is None else out
        to_file_order(self.state.x, self.model.vertex, origin, out)
        self.on_its_way.add_to(out)
        return out

    def of_simulated(self, values: FloatArray) -> FloatArray:
        """What all vertices have, shape [v, k], at those that are simulated, shape [n, k]."""
        return values if self.surface is None else self.surface.under.of(values)

    def velocities(self) -> SingleArray:
        """World velocities of all its vertices, in file order [m/s], shape [v, 3]."""
        v = np.empty((len(self.model), 3), np.float32)
        v[self.model.vertex] = self.state.v
        return v if self.surface is None else self.surface.between(v)

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
        self.workspace.pins.forget()
        free = self.model.free_count
        move_pins(
            self.state.x[free:],
            self.state.v[free:],
            self.model.pin_collider,
            self.workspace.pins.place,
            self.workspace.pins.step,
            colliders.end.position,
            colliders.end.orientation,
            colliders.origin,
            np.float32(1.0),
        )
        self.state.v[free:] = 0.0
        self.good.assign(self.state)
        self.on_its_way.end()
        self.going_over.end()
        self.aside.forget()
        self._forget()

    def watch(self, colliders: ColliderState, dt: float, time: float, *, aside: bool) -> None:
        """Takes readings after several steps and mends what layers broke; what is shown follows.

        Args:
            colliders: The colliders.
            dt: Length of the last step [s].
            time: Of all of them [s]; infinite where the garment was put on.
            aside: Whether it is shown off its place.
        """
        self.check(dt)
        health = self.health
        if self.recovery.is_lost(self.state, self.workspace.motion, dt):
            self.place(blend(self.garment, self.frames.world(colliders.end)), colliders)
            self.measure()
            health.resets += 1
        total, fastest = self.workspace.motion
        health.contacts = self.workspace.contact_count
        health.rms_speed = math.sqrt(total / max(self.model.free_count, 1))
        health.max_speed = math.sqrt(fastest)
        health.let_go = 0 if self.letting_go is None else self.letting_go.count
        if self.on_its_way.left > 0.0:
            self.on_its_way.go(time, self.frames.world(colliders.end))
        if self.going_over.left > 0.0:
            self.going_over.go(time, self.frames.world(colliders.end))
        if aside:
            keep = max(self.model.material.thickness, colliders.thickness)
            met = self.workspace.contacts, self.workspace.guard.kept, colliders
            self.aside.look(self.state.x, *met, keep, time)
        else:
            self.aside.forget()


def _over_skin(
    given: GarmentLike, colliders: ColliderState, T_world_rest: FloatArray
) -> OverSkin | None:
    """What of a garment is to lie over skin that leaves the shapes: pins, too, as on skin."""
    if colliders.bare is None:
        return None
    held = _held_as_shown(given)
    return OverSkin(colliders.bare, T_world_rest, given.vertices, given.triangles, held)


def _shown_in_place(given: GarmentLike) -> IntArray:
    """Vertices whose creases are shown as they are: pins are where they are."""
    return np.union1d(_held_as_shown(given), given.pins).astype(np.int32)


def _held_as_shown(given: GarmentLike) -> IntArray:
    """Vertices that are shown in their places.

    Some limits hold what is shown, too, and a seam that is being sewn is as open as it is.
    """
    stays = np.zeros(len(given.vertices), np.bool_)
    for name, distance in given.skin_limits.items():
        stays |= np.isfinite(distance) & SKIN_LIMITS[name].holds_what_is_shown
    if given.stitches is not None:
        stays[:] = True
    return np.flatnonzero(stays).astype(np.int32)


def _constraints(
    garment: GarmentLike, places: SkinPlaces | None, model: ClothModel, workspace: Workspace
) -> tuple[Constraint, ...]:
    """Those that a garment asks for, in the order in which they act."""
    constraints: list[Constraint] = []
    if places is not None:
        constraints += [
            limit(garment, garment.skin_limits[name], places, workspace)
            for name, limit in SKIN_LIMITS.items()
            if name in garment.skin_limits
        ]
    if garment.self_collision is not None:
        constraints.append(SelfCollision(model, garment.self_collision, workspace.contacts))
    if garment.stitches is not None:
        constraints.append(Stitching(model, garment.stitches))
    return tuple(constraints)
