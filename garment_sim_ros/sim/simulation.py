"""Garments on one moving body."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from garment_sim_ros.contact.papers.allowed import check_contact
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError, MessageError, ParameterError
from garment_sim_ros.params import Environment, ImplicitSettings, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.arguments import OutfitLike, checked_detail, garments_of, numerics_of
from garment_sim_ros.sim.auto.pacer import Pacer
from garment_sim_ros.sim.by_name import ByName
from garment_sim_ros.sim.cast import Cast
from garment_sim_ros.sim.garment_view import GarmentView
from garment_sim_ros.sim.loop import take_step
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.placement import GarmentLike, blend, rest_transforms
from garment_sim_ros.sim.putting_on import rest_at, set_in_motion, time_from
from garment_sim_ros.sim.rewinding import Kept
from garment_sim_ros.sim.settle import settle
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.sim.winding_back import moved_with_root, wind_back
from garment_sim_ros.sim.world.collider_motion import ColliderMotion
from garment_sim_ros.sim.world.root_motion import TakenOut, take_along
from garment_sim_ros.sim.world.wind_field import Wind, check_wind
from garment_sim_ros.sim.worn import Worn

_REPLAY = 2.0
"""What a garment is wound back to is replayed so many times as fast as it is put on."""


class Simulation(ByName):
    """Garments on one body, advanced by fixed steps.

    Garments collide with the body, with those in other layers (see `layers`), and with themselves
    where they ask for it. Positions are relative to an origin that follows the body, see `state`.

    Attributes:
        solver: Name of the solver.
        time: Time simulated since the last `reset` [s]; gusts depend on it.
        outran: Steps in which the root was faster than cloth feels, see `root_motion`.

    Args:
        garments: An outfit, a garment, or garments with different names.
        colliders: The body's colliders; `step`, `reset` and `advance` take one pose for each.
        preset: Name of a preset, see `presets`; what is given beside it wins. None: the defaults.
        environment: Outer forces.
        settings: Numerical parameters of the solver.
        solver: Name in `SOLVERS`; where None that of the preset, else xpbd.
        solver_step: Longest step taken at once [s]; None: the preset's, else the solver's usual.
        detail: Share of each garment's vertices that are simulated, the others follow them; None:
            the preset's, else all.
        parameters: Single values of `Environment` and of the solver's settings by name; they
            win over the groups. With preset auto `frame_budget_ms`, too, which `step` keeps to.

    Raises:
        GeometryError: A garment or collider that cannot be simulated, or a frame that is missing.
        ParameterError: An unknown solver, preset or name; a value that is not allowed.
    """

    def __init__(
        self,
        garments: OutfitLike | GarmentLike | Sequence[GarmentLike],
        colliders: ColliderSet,
        *,
        preset: str | None = None,
        environment: Environment | None = None,
        settings: RelaxationSettings | XpbdSettings | ImplicitSettings | None = None,
        solver: str | None = None,
        solver_step: float | None = None,
        detail: float | None = None,
        **parameters: Any,
    ) -> None:
        solver, solver_step, detail, asked, budget = numerics_of(
            preset, solver, solver_step, detail, environment, settings, parameters
        )
        self._garments = garments_of(garments)
        names = [g.name for g in self._garments]
        if len(set(names)) != len(names):
            raise GeometryError(f"garment names must be unique; found {', '.join(names)}")
        self.collider_set = colliders
        self.solver, self.solver_step = solver, solver_step
        self._solver = SOLVERS[solver]
        self._T_world_rest = rest_transforms(self._garments, colliders)
        self._motion = ColliderMotion(colliders, self._T_world_rest)
        self._colliders = self._motion.state
        if self._colliders.skin is not None and solver != "relaxation":
            raise ParameterError("solver", f"found {solver!r}", "allowed with a mesh: relaxation")
        self._casts, self._view = {}, {}
        self._is_on = self._is_first = False
        self.detail = detail
        self.time, self.outran = 0.0, 0
        self._is_sewing = any(g.stitches is not None for g in self._garments)
        self._coarseness = 1
        self._at = ColliderPoses.identity(len(colliders))
        self._wind = Wind(asked.environment)
        self.parameters = asked
        self.pace = Pacer.of(self, budget)

    @property
    def parameters(self) -> Parameters:
        """Outer forces and numerical parameters; may be replaced between steps.

        Raises:
            ParameterError: A wind that cannot be, or a contact that the colliders do not allow.
        """
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: Parameters) -> None:
        self.check(parameters)
        self._parameters = parameters
        self._taken_out = TakenOut(
            parameters.environment.root_linear_inertia,
            parameters.environment.root_angular_inertia,
            self.collider_set.root,
        )
        if self.time == 0.0:
            self._wind.begin(parameters.environment)
        else:
            self._wind.become(parameters.environment, self.time)
        self._acting = parameters
        self._extras = getattr(parameters.settings, "extras", True)

    @property
    def detail(self) -> float:
        """Share of each garment's vertices that are simulated; may be set between steps."""
        return self._detail

    @detail.setter
    def detail(self, share: float) -> None:
        self.prepare(share := checked_detail(share))
        now = self._casts[share]
        before, self._cast, self._detail = getattr(self, "_cast", now), now, share
        if now is not before and (self._is_on or self.time > 0.0):
            self._motion.interpolate(self._at, self._at, 0.0, 1.0)
            step = partial(self._step, tuple(now.worn.values()), self.solver_step)
            watch = partial(self._watch, 0, self.solver_step)
            now.take_over(before, self._colliders, self._at, step, watch)
        for name, worn in now.worn.items():
            self._view.setdefault(name, GarmentView(worn, self.origin)).worn = worn

    def prepare(self, share: float) -> None:
        """Makes what it takes to set `detail`; only what a step needs is made in the first one."""
        if (share := checked_detail(share)) not in self._casts:
            at = self.collider_set, self._colliders, self._solver, self._T_world_rest
            self._casts[share] = Cast.of(self._garments, share, *at)

    def check(self, parameters: Parameters) -> None:
        """See whether parameters may be set.

        Raises:
            ParameterError: A wind that cannot be, or a contact that the colliders do not allow.
        """
        check_wind(parameters.environment)
        check_contact(getattr(parameters.settings, "contact", ""), self.collider_set)

    def reset(self, poses: ColliderPoses, *, settle: bool = True) -> None:
        """Puts every garment on, moves the body to a pose (see `putting_on`), lets them settle.

        Args:
            poses: World poses of the colliders.
            settle: Whether to let it settle; else it begins to move with the first step.

        Raises:
            MessageError: Poses that are not usable; nothing changes.
        """
        self._motion.check(poses)
        self._is_on = True
        self._restart()
        rest = rest_at(self._T_world_rest, poses, self.collider_set.root)
        if (duration := time_from(rest, poses)) > 0.0:
            self._put_on(rest)
            self._go(rest, poses, duration)
            self._motion.interpolate(poses, poses, 0.0, 1.0)
            self._restart()
            self._is_first = True
        else:
            self._put_on(poses)
        self._at.assign(poses)
        self._colliders.pose_bare_skin()
        for worn in self._cast.worn.values():
            worn.health.settling_steps = self._settle(worn) if settle else 0
            worn.watch(self._colliders, self.solver_step, math.inf, aside=self._extras)
        self._cast.rewinding.begin(poses)
        for pair in self._cast.entangled:
            pair.begin()

    def _restart(self) -> None:
        self.time, self._is_first = 0.0, False
        self._wind.begin(self.parameters.environment)
        self._acting = self.parameters

    def _put_on(self, poses: ColliderPoses) -> None:
        """Places every garment on a pose, where it would be as skin."""
        self._motion.stand(poses)
        for worn in self._cast.worn.values():
            worn.place(blend(worn.garment, worn.frames.world(poses)), self._colliders)
            for _, pair in self._cast.under[worn.garment.name]:
                pair.forget()

    def step(self, poses: ColliderPoses | None = None, dt: float = 1 / 60) -> None:
        """Advances all garments while the colliders move from where they are to new poses.

        The first call puts the garments on, as `reset` does, and takes no time.

        Args:
            poses: World poses of the colliders after the step. None: they stay; in the first
                call, all bones are at the world's origin.
            dt: How long it takes them to get there [s].

        Raises:
            MessageError: Poses or a time that are not usable; nothing changes.
        """
        if not self._is_on:
            self.reset(self.collider_set.poses() if poses is None else poses)
        else:
            with self.pace:
                self.advance(self._at, self._at if poses is None else poses, dt)

    def transport(self, poses_start: ColliderPoses, poses_end: ColliderPoses) -> None:
        """Takes all garments along on a way of the body that is not simulated.

        Every vertex moves as far as skin there would, so that folds stay as they are; velocities
        do too.

        Args:
            poses_start: World poses of the colliders where the garments are now.
            poses_end: World poses where they shall be.

        Raises:
            MessageError: Poses that are not usable; nothing changes.
        """
        self._motion.check(poses_start, poses_end)
        self._follow(poses_start)
        for worn in self._cast.worn.values():
            start, end = (worn.frames.world(p) for p in (poses_start, poses_end))
            worn.transport(blend(worn.garment, end - start))
        self._follow(poses_end)
        self._at.assign(poses_end)

    def advance(
        self, poses_start: ColliderPoses, poses_end: ColliderPoses, dt: float | None = None
    ) -> None:
        """Advances all garments while the colliders move from one set of poses to another.

        The time is divided into equal steps of at most `solver_step`; poses are interpolated at
        each.

        Args:
            poses_start: World poses of the colliders at the start.
            poses_end: World poses at the end.
            dt: Time between them [s]; one `solver_step` where None.

        Raises:
            MessageError: Poses or a time that are not usable; nothing changes.
        """
        self._motion.check(poses_start, poses_end)
        self._go(poses_start, poses_end, dt)
        self._at.assign(poses_end)
        self._look_after(poses_end)

    def advance_coarsely(
        self, poses_start: ColliderPoses, poses_end: ColliderPoses, dt: float, times: int
    ) -> None:
        """Advances all garments in longer sub-steps, with fewer searches for contacts.

        The edges are longer then, and it takes less time.

        Args:
            poses_start: World poses of the colliders at the start.
            poses_end: World poses at the end.
            dt: Time between them [s].
            times: How many times as long sub-steps, and steps, are.

        Raises:
            MessageError: Poses or a time that are not usable; nothing changes.
        """
        self._coarseness = times
        try:
            self.advance(poses_start, poses_end, dt)
        finally:
            self._coarseness = 1

    def _look_after(self, poses: ColliderPoses) -> None:
        """Winds garments back that limbs stay in; the colliders are in their last poses."""
        if self._is_sewing or not self._extras:
            return
        cast, gravity = self._cast, self.parameters.environment.gravity
        for name in cast.rewinding.look(self.time, poses, gravity):
            wind_back(cast.rewinding, cast.worn[name], poses, self._replay)
            cast.rewinding.tried(name, self.time)
            for _, pair in cast.under[name]:
                pair.forget()
        for entangled in cast.entangled:
            entangled.look(cast.rewinding, self.time, poses)

    def _replay(self, worn: Worn, kept: Kept, poses: ColliderPoses) -> None:
        """Places one garment as it once was, and lets the body move from there to its poses."""
        start = moved_with_root(kept, poses, self.collider_set.root)
        steps = max(1, math.ceil(time_from(start.poses, poses) / _REPLAY / self.solver_step))
        self._motion.interpolate(start.poses, start.poses, 0.0, 1.0)
        worn.place(start.x.astype(float), self._colliders)
        for n in range(steps):
            self._motion.interpolate(start.poses, poses, n / steps, (n + 1) / steps)
            self._begin(worn, self.solver_step)
            take_step(self._solver, (worn,), (), self._colliders, self._acting, self.solver_step)
            worn.finish(self._colliders, self.solver_step)
        self._motion.interpolate(poses, poses, 0.0, 1.0)

    def _go(
        self, poses_start: ColliderPoses, poses_end: ColliderPoses, dt: float | None = None
    ) -> None:
        """Advances all garments between poses that are usable."""
        steps, everything = self._steps(dt), tuple(self._cast.worn.values())
        h = (self.solver_step if dt is None else dt) / steps
        if self._is_first and self._taken_out.is_nothing:
            set_in_motion(everything, poses_start, poses_end, steps * h)
        self._is_first = False
        self._follow(poses_start)
        for n in range(steps):
            self._motion.interpolate(poses_start, poses_end, n / steps, (n + 1) / steps)
            self._take_along(h)
            self._let_wind_change()
            self._step(everything, h)
            self.time += h
        self._watch(steps, h)

    def _steps(self, dt: float | None) -> int:
        """How many steps of the solver it takes to advance by dt [s]."""
        if dt is None:
            return 1
        if not (math.isfinite(dt) and dt > 0.0):
            raise MessageError("step_not_positive", f"found {dt!r} s; above 0 s is allowed")
        return max(1, math.ceil(dt / (self._coarseness * self.solver_step) - 1e-6))

    def _let_wind_change(self) -> None:
        """What acts in the next step is the wind as it is now."""
        now = self._wind.environment(self.time, self._parameters.environment)
        self._acting = self._parameters.in_environment(now)
        if self._coarseness > 1 and hasattr(self._acting.settings, "sub_step"):
            settings = self._acting.settings
            longer = replace(settings, sub_step=settings.sub_step * self._coarseness)
            self._acting = replace(self._acting, settings=longer)

    def _watch(self, steps: int, dt: float) -> None:
        """Takes readings after so many steps of dt [s]."""
        self._colliders.pose_bare_skin()
        for worn in self._cast.worn.values():
            worn.health.steps += steps
            worn.watch(self._colliders, dt, steps * dt, aside=self._extras)
        self._cast.count_tangled()

    def _settle(self, worn: Worn) -> int:
        """Lets one garment come to rest on those under it, which stay; counts the steps."""
        pairs = [pair for _, pair in self._cast.under[worn.garment.name]]
        for pair in pairs:
            pair.keep_inner_still(True)
        steps = settle(partial(self._step, (worn,)), worn, self.solver_step)
        for pair in pairs:
            pair.keep_inner_still(False)
        return steps

    def _step(self, garments: Sequence[Worn], dt: float) -> None:
        """A step of dt [s] of some garments on the colliders as they move."""
        worn_over = garments if self._extras else ()
        pairs = [pair for worn in worn_over for _, pair in self._cast.under[worn.garment.name]]
        for worn in garments:
            self._begin(worn, dt)
        take_step(self._solver, garments, pairs, self._colliders, self._acting, dt)
        for worn in garments:
            worn.finish(self._colliders, dt)

    def _begin(self, worn: Worn, dt: float) -> None:
        """What comes before a garment's step of dt [s], whichever solver it is."""
        worn.begin(self._colliders, dt)
        if self._wind.acts(self.time):
            self._cast.blow(worn, self._wind.at(self.time), self.origin, self.time, dt)

    def _follow(self, poses: ColliderPoses) -> None:
        """Moves the local origin after the body."""
        shift_by = self._motion.follow(poses)
        if shift_by is not None:
            for worn in self._cast.worn.values():
                worn.shift(shift_by)

    def _take_along(self, dt: float) -> None:
        """Takes the root's motion, as far as the cloth shall not feel it, out of a step."""
        colliders, taken = self._colliders, self._taken_out
        if not len(self.collider_set) or not taken.begin_step(colliders.start, colliders.end, dt):
            return
        self.outran += taken.outran
        self._motion.state.pose()
        for worn in self._cast.worn.values():
            take_along(
                worn.state.x, worn.state.v, colliders.origin, taken.pivot, taken.turn, taken.way
            )
