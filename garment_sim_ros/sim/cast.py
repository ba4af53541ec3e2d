"""The garments of a simulation at one share of their vertices, and how another share takes over.

Which vertices are simulated decides all that looks after a garment, from its springs to what is
kept of it to wind it back. So a simulation that may change the share has all of that twice, and
goes over from one to the other: fewer vertices begin on the surface of the many, the many begin
where they were shown beside the few.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.entangled import Entangled, Pairs, entangled_of, pairs_of
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.rewinding import Kept, Rewinding
from garment_sim_ros.sim.solvers import Solver
from garment_sim_ros.sim.state import State
from garment_sim_ros.sim.world.wind_field import WindField
from garment_sim_ros.sim.world.wind_on_cloth import WindOnCloth
from garment_sim_ros.sim.worn import Worn

_GIVING_WAY = 3
"""Steps in which garments of fewer vertices give way to what that pressed together; of more: 1."""


@dataclass(frozen=True, kw_only=True)
class Cast:
    """The garments at one share of their vertices.

    Attributes:
        worn: Each with all that belongs to it, by name, inner layers first.
        under: How each meets those that it is worn over.
        entangled: Looks after each of these pairs.
        rewinding: Looks whether they stay worn.
        wind_on: How wind pushes them, made when it first blows.
    """

    worn: dict[str, Worn]
    under: Pairs
    entangled: list[Entangled]
    rewinding: Rewinding
    wind_on: dict[str, WindOnCloth] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        garments: Sequence[GarmentLike],
        detail: float,
        collider_set: ColliderSet,
        colliders: ColliderState,
        solver: Solver,
        T_world_rest: FloatArray,
    ) -> "Cast":
        """Garments where their files have them.

        Args:
            garments: The garments.
            detail: Share of the vertices of each that are simulated.
            collider_set: The body's colliders.
            colliders: The same, to be posed.
            solver: What will advance them.
            T_world_rest: Where the colliders are at rest, shape [n, 4, 4].

        Raises:
            GeometryError: One cannot be simulated, or a frame is missing.
        """
        # Inner ones first: what lies on them then meets them where they are.
        worn = {
            g.name: Worn.on(g, collider_set, colliders, solver, detail)
            for g in sorted(garments, key=lambda g: g.layer)
        }
        under = pairs_of(worn)
        return cls(
            worn=worn,
            under=under,
            entangled=entangled_of(worn, under),
            rewinding=Rewinding(collider_set, worn, colliders.origin, T_world_rest),
        )

    def take_over(
        self,
        before: "Cast",
        colliders: ColliderState,
        poses: ColliderPoses,
        step: Callable[[], object],
        watch: Callable[[], object],
    ) -> None:
        """Goes on where the same garments at another share are.

        Edges over folds that fewer vertices do not have are pressed together: the garments give
        way to that while the body stands. What they are shown at goes over in the next frames.

        Args:
            before: The garments as they were simulated until now.
            colliders: The colliders, which stand.
            poses: Their world poses.
            step: Advances these garments by a step.
            watch: Finds what they are shown off their places.
        """
        origin = colliders.origin
        shown = {name: worn.shown(origin).astype(np.float64) for name, worn in before.worn.items()}
        v = {name: _go_on(worn, before.worn[name], colliders) for name, worn in self.worn.items()}
        for name in self.worn:
            for _, pair in self.under[name]:
                pair.forget()
        fewer = sum(map(_size, self.worn.values())) < sum(map(_size, before.worn.values()))
        for _ in range(_GIVING_WAY if fewer else 1):
            for worn in self.worn.values():
                worn.state.v[:] = 0.0
            step()
        watch()
        for name, worn in self.worn.items():
            worn.state.v[:] = v[name]
            worn.good.assign(worn.state)
            worn.measure()
            off = shown[name] - worn.shown(origin)
            worn.going_over.begin(off, worn.frames.world(poses))

        def carry(name: str, kept: Kept) -> Kept:
            x = before.worn[name].beside(kept.x).astype(np.float64)
            return Kept(self.worn[name].of_simulated(x).astype(np.float32), kept.poses)

        self.rewinding.take_over(before.rewinding, carry)
        for entangled in self.entangled:
            entangled.begin()

    def blow(
        self, worn: Worn, wind: WindField, origin: FloatArray, time: float, dt: float
    ) -> None:
        """Wind pushes one garment for dt [s], see `WindOnCloth.blow`."""
        name = worn.garment.name
        if name not in self.wind_on:
            self.wind_on[name] = WindOnCloth(worn.model)
        self.wind_on[name].blow(wind, worn.state, origin, time, dt)

    def count_tangled(self) -> None:
        """Tells of each garment how many particles are through another one."""
        for worn in self.worn.values():
            worn.health.tangled = 0
        for outer, pairs in self.under.items():
            for inner, pair in pairs:
                of_outer, of_inner = pair.tangled
                self.worn[outer].health.tangled += of_outer
                inner.health.tangled += of_inner


def _size(worn: Worn) -> int:
    """How many particles of a garment are simulated."""
    return len(worn.model)


def _go_on(worn: Worn, before: Worn, colliders: ColliderState) -> SingleArray:
    """Puts a garment where the same one is, with its counts; the velocities that it had."""
    origin = colliders.origin
    before.on_its_way.end()
    x = worn.of_simulated(before.simulated(origin).astype(np.float64))
    v = worn.of_simulated(before.velocities().astype(np.float64))
    worn.place(x, colliders)
    # Pins, too, are where they were: some give way to a limb.
    worn.state.assign(State.at(worn.model, x, origin))
    worn.good.assign(worn.state)
    worn.measure()
    worn.health = before.health
    return v[worn.model.vertex].astype(np.float32)
