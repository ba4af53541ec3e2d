"""What parameters and outfits switch: each feature alone, off or on against a preset's base."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from garment_sim_ros.collider_params import METHODS
from garment_sim_ros.contact.guard.guard import Guard
from garment_sim_ros.declaration import declarations
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.presets import usual_colliders
from garment_sim_ros.sim.arguments import Numerics, numerics_of
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.self_collision.garment import own_distance
from garment_sim_ros.solver_params import SPRINGS, TRIANGLES
from garment_sim_ros.tradeoff.playing import Player
from garment_sim_ros.tradeoff.points import Point, preset_point
from garment_sim_ros.tradeoff.scenes import PLAIN, SCENES, Staged, scene_named, staged_scene

_CALM = {"wind": (0.0, 0.0, 0.0), "wind_drag": 0.0, "wind_lift": 0.0, "gust": 0.0}
_BREEZE = {"wind": (2.0, 0.0, 0.0), "wind_drag": 1.2, "wind_lift": 0.4}
_QUARTER = 0.25


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene with a preset, as it is or with one feature switched.

    Attributes:
        name: Of the scene.
        seconds: So much of its motion [s]; 0: all.
        staged: The scene with colliders, its garments and outer forces perhaps changed.
        point: The preset, perhaps with another value of a parameter.
        guarded: Whether cores of body parts are kept out of triangles.
    """

    name: str
    seconds: float
    staged: Staged
    point: Point
    guarded: bool = True

    @classmethod
    def of(cls, scene: str, preset: str, seconds: float) -> "Case":
        """The base.

        Raises:
            ParameterError: There is no such scene or preset, or the scene's files are not there.
        """
        of = scene_named(scene)
        point = preset_point(preset, of.frame, "" if of.body else PLAIN)
        staged = staged_scene(scene, point.kind, seconds)
        return cls(name=scene, seconds=seconds, staged=staged, point=point)

    @property
    def numerics(self) -> Numerics:
        """How it is run."""
        values = {**self.staged.scene.environment, **dict(self.point.options)}
        detail = values.pop("detail", None)
        return numerics_of(self.point.preset, None, None, detail, None, None, values)

    @property
    def parameters(self) -> Parameters:
        """Outer forces and the solver's settings that it runs with."""
        return self.numerics.parameters

    def player(self) -> Player:
        """It, ready to be simulated.

        Raises:
            GarmentSimError: It cannot be.
        """
        player = Player(self.staged, self.point.arguments(self.staged.scene.frame))
        if not self.guarded:
            for view in player.simulation:
                view.worn.workspace.guard = Guard.none(view.model.free_count)
        return player

    def with_option(self, name: str, value: Any) -> "Case":
        """The same with another value of a parameter of the solver, or of `detail`."""
        return replace(self, point=replace(self.point, options=((name, value),)))

    def in_environment(self, values: Mapping[str, Any]) -> "Case":
        """The same with other outer forces."""
        scene = self.staged.scene
        windy = replace(scene, environment={**scene.environment, **values})
        return replace(self, staged=replace(self.staged, scene=windy))

    def with_garments(self, change: Callable[[Garment], Garment]) -> "Case":
        """The same with each garment changed."""
        garments = tuple(change(g) for g in self.staged.garments)
        return replace(self, staged=replace(self.staged, garments=garments))

    def on_colliders(self, kind: str) -> "Case":
        """The same on colliders of another kind."""
        staged = staged_scene(self.name, kind, self.seconds)
        return replace(self, staged=staged, point=replace(self.point, kind=kind))


Switched = tuple[Case, bool]
"""The other case, and whether the feature is on in that one."""


@dataclass(frozen=True, kw_only=True)
class Feature:
    """Something that costs time and is there for a reason.

    Attributes:
        text: What it does.
        figures: What it is there for, as `prices` has them.
        switch: From the base to the other case; None where there is nothing to switch.
    """

    text: str
    figures: tuple[str, ...] = ()
    switch: Callable[[Case], Switched | None]


def _parameter(name: str, off: Any, on: Any) -> Callable[[Case], Switched | None]:
    """A parameter of the solver; where the base has neither value, that is on."""

    def switch(case: Case) -> Switched | None:
        settings = case.parameters.settings
        known = declarations(type(settings))
        if name not in known or not all(n.met(settings) for n in known[name].needs):
            return None
        is_on = getattr(settings, name) != off
        return case.with_option(name, off if is_on else on), not is_on

    return switch


def _forces(off: Mapping[str, Any], on: Mapping[str, Any]) -> Callable[[Case], Switched | None]:
    """Outer forces; they are on where one of `off` has another value."""

    def switch(case: Case) -> Switched | None:
        now = case.parameters.environment
        is_on = any(getattr(now, name) != value for name, value in off.items())
        return case.in_environment(off if is_on else on), not is_on

    return switch


def _of_garments(
    has: Callable[[Garment], bool],
    without: Callable[[Garment], Garment],
    given: Callable[[Garment], Garment] | None = None,
    *,
    may: Callable[[Case], bool] = lambda case: True,
) -> Callable[[Case], Switched | None]:
    """What an outfit says of garments; on where one has it. Some cannot be given."""

    def switch(case: Case) -> Switched | None:
        if any(has(g) for g in case.staged.garments):
            return case.with_garments(without), False
        return (case.with_garments(given), True) if given and may(case) else None

    return switch


def _limit(name: str, distance: float) -> Callable[[Case], Switched | None]:
    """A limit of how cloth lies to its place as skin."""

    def without(g: Garment) -> Garment:
        left = {key: value for key, value in g.skin_limits.items() if key != name}
        return replace(g, skin_limits=left)

    def given(g: Garment) -> Garment:
        everywhere = np.full(len(g.vertices), distance)
        return replace(g, skin_limits={**g.skin_limits, name: everywhere})

    return _of_garments(
        lambda g: name in g.skin_limits, without, given, may=lambda case: bool(case.staged.avatar)
    )


def _fabric(name: str, on: float) -> Callable[[Case], Switched | None]:
    """A value of the fabrics that may be 0."""

    def fabric(value: float) -> Callable[[Garment], Garment]:
        return lambda g: replace(g, material=replace(g.material, **{name: value}))

    return _of_garments(lambda g: getattr(g.material, name) > 0.0, fabric(0.0), fabric(on))


def _layers(case: Case) -> Switched | None:
    """Garments in layers; those that have none do not say which is the outer one."""
    if len({g.layer for g in case.staged.garments}) < 2:
        return None
    return case.with_garments(lambda g: replace(g, layer=0)), False


def _guard(case: Case) -> Switched | None:
    return (replace(case, guarded=False), False) if case.staged.avatar else None


def _detail(case: Case) -> Switched | None:
    whole = case.numerics.detail == 1.0
    return case.with_option("detail", _QUARTER if whole else 1.0), whole


def _colliders(method: str) -> Callable[[Case], Switched | None]:
    """Another kind of colliders than the preset's."""

    def switch(case: Case) -> Switched | None:
        own = usual_colliders(case.point.preset).method
        if not SCENES[case.name].body or method == own:
            return None
        return case.on_colliders(method), True

    return switch


def _own_distance(g: Garment) -> Garment:
    return replace(g, self_collision=own_distance(g.vertices, g.triangles, g.material))


FEATURES: Mapping[str, Feature] = MappingProxyType(
    {
        "self_collision": Feature(
            text="garments do not pass through themselves",
            figures=("crossed_own",),
            switch=_of_garments(
                lambda g: g.self_collision is not None,
                lambda g: replace(g, self_collision=None),
                _own_distance,
            ),
        ),
        "layers": Feature(
            text="garments over garments are kept apart", figures=("crossed",), switch=_layers
        ),
        "guard": Feature(
            text="body parts do not change sides of a garment; no parameter switches it",
            figures=("pierced", "inside"),
            switch=_guard,
        ),
        "strain_limit": Feature(
            text="cloth that is pulled harder moves instead",
            figures=("strain_max",),
            switch=_parameter("strain_limit", 0.0, 0.3),
        ),
        "coarse": Feature(
            text="stretch is corrected on a coarse level, too",
            figures=("strain_p95",),
            switch=_parameter("coarse", False, True),
        ),
        "detail": Feature(
            text="a quarter of the vertices is simulated, the others follow",
            figures=("strain_p95", "inside", "crossed"),
            switch=_detail,
        ),
        "triangles": Feature(
            text="membrane of triangles instead of springs",
            figures=("strain_p95", "strain_max"),
            switch=_parameter("membrane", SPRINGS, TRIANGLES),
        ),
        "extras": Feature(
            text="what the papers do not have: layers, winding back",
            figures=("crossed", "pierced"),
            switch=_parameter("extras", False, True),
        ),
        "max_distance": Feature(
            text="cloth stays within 0.1 m of its place as skin",
            figures=("strain_max",),
            switch=_limit("max_distance", 0.1),
        ),
        "backstop": Feature(
            text="cloth stays within 0.02 m behind its place as skin",
            figures=("inside", "penetration_mm"),
            switch=_limit("backstop", 0.02),
        ),
        "tethers": Feature(
            text="vertices stay within 1.02 of their way over the cloth from the pins",
            figures=("strain_p95", "strain_max"),
            switch=_of_garments(
                lambda g: g.tethers is not None,
                lambda g: replace(g, tethers=None),
                lambda g: replace(g, tethers=0.02) if len(g.pins) else g,
                may=lambda case: any(len(g.pins) for g in case.staged.garments),
            ),
        ),
        "elastic": Feature(
            text="elastic bands",
            switch=_of_garments(
                lambda g: g.elastic is not None, lambda g: replace(g, elastic=None)
            ),
        ),
        "friction": Feature(text="friction on the body", switch=_fabric("friction", 0.3)),
        "bending": Feature(
            text="resistance to bending", switch=_fabric("bending_stiffness", 1e-5)
        ),
        "wind": Feature(
            text="wind of 2 m/s on triangles, or the scene's own",
            switch=_forces(_CALM, _BREEZE),
        ),
        "gusts": Feature(
            text="noise of 1 m/s in the air on triangles, or the scene's own",
            switch=_forces({"gust": 0.0}, {"wind_drag": 1.2, "wind_lift": 0.4, "gust": 1.0}),
        ),
        "root_motion": Feature(
            text="the root's motion is taken out",
            switch=_forces(
                {"root_linear_inertia": 1.0, "root_angular_inertia": 1.0},
                {"root_linear_inertia": 0.0, "root_angular_inertia": 0.0},
            ),
        ),
        **{
            method: Feature(
                text=f"colliders: {method} instead of the preset's",
                figures=("inside", "penetration_mm", "gap_mm"),
                switch=_colliders(method),
            )
            for method in METHODS
        },
    }
)
"""The features by name."""
