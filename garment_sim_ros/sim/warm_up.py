"""Compiling before the first step instead of in it: what a scene has, and nothing else.

A scene made of scraps of cloth, with the same features as the real one, goes through all that can
happen to it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from garment_sim_ros.contact.kinds import KINDS
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet, frame_of
from garment_sim_ros.geometry.sheet import sheet
from garment_sim_ros.params import Material
from garment_sim_ros.sim.aside import Aside
from garment_sim_ros.sim.detail.surface import itself
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.placement import GarmentLike, SoftAttachments
from garment_sim_ros.sim.simulation import Simulation

_EXAMPLES = {
    variant: (kind, geometry)
    for kind in KINDS.values()
    for variant, geometry in kind.variants.items()
}
"""Kind and geometry of an example of every variant of collider."""


@dataclass(frozen=True, order=True, kw_only=True)
class Features:
    """What of a garment decides which code it runs.

    Attributes:
        layer: See `garment.Garment`.
        pinned: Whether it has pins.
        skin_limits: Names of its limits, see `holds.skin_limits`, sorted.
        soft: Whether springs hold it.
        tethers: Whether it has tethers.
        self_collision: Whether it is kept from passing through itself.
        passed: Whether something passes it by.
    """

    layer: int = 0
    pinned: bool = True
    skin_limits: tuple[str, ...] = ()
    soft: bool = False
    tethers: bool = False
    self_collision: bool = False
    passed: bool = False

    @classmethod
    def of(cls, garment: GarmentLike) -> "Features":
        """Those of a garment."""
        return cls(
            layer=garment.layer,
            pinned=len(garment.pins) > 0,
            skin_limits=tuple(sorted(garment.skin_limits)),
            soft=garment.soft is not None,
            tethers=garment.tethers is not None,
            self_collision=garment.self_collision is not None,
            passed=bool(garment.passed_by),
        )


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What decides which code a simulation runs, besides its solver and parameters.

    Attributes:
        kinds: Variants of the colliders, see `contact.kinds.kind.Kind`.
        garments: Features of the garments.
    """

    kinds: frozenset[str] = field(default_factory=frozenset)
    garments: frozenset[Features] = frozenset({Features()})

    @classmethod
    def of(cls, colliders: ColliderSet, garments: Iterable[GarmentLike]) -> "Scene":
        """Of garments on colliders."""
        return cls(
            kinds=frozenset(
                c.record.variant_of(c.geometry) for c in colliders.colliders if not c.is_frame
            ),
            garments=frozenset(Features.of(garment) for garment in garments),
        )


def warm_up(scene: Scene, solver: str = "xpbd", parameters: Parameters | None = None) -> None:
    """Compiles, or loads from the cache, all that a `Simulation` of such a scene runs.

    Args:
        scene: What there is.
        solver: Name of the solver.
        parameters: Outer forces and settings; defaults where None.

    Raises:
        ParameterError: Parameters that cannot be, or not with these colliders.
    """
    garments: list[Any] = [_scrap(f"scrap{i}", f) for i, f in enumerate(sorted(scene.garments))]
    kinds = sorted(scene.kinds)
    shapes = [_collider(kind, kind, "bone") for kind in kinds]
    passing = [kind for kind in kinds if _EXAMPLES[kind][0].shape is not None]
    if passing and any(f.passed for f in scene.garments):
        shapes.append(_collider("passing", passing[0], "passing"))
    frame = frame_of("bone")
    simulation = Simulation(
        garments,
        ColliderSet(colliders=(frame, *shapes)),
        environment=None if parameters is None else parameters.environment,
        settings=None if parameters is None else parameters.settings,
        solver=solver,
    )
    near = ColliderPoses.identity(1 + len(shapes))
    far = ColliderPoses(position=near.position + 2.0, orientation=near.orientation)
    simulation.reset(near)
    simulation.advance(near, near, 2.5 * simulation.solver_step)
    for view in simulation:
        worn, rest = view.worn, view.garment.vertices
        surface = itself(rest, view.triangles)
        worn.aside = Aside(worn.model, surface, rest, np.zeros(0, np.int32))
    simulation.advance(far, far)
    simulation.transport(far, near)
    for name in simulation.names:
        simulation.state(name).x[0] = np.nan  # is mended
        simulation.advance(near, near)
        simulation.state(name).x[:] = np.nan
        simulation.advance(near, near)
        simulation.normals(name)


def _collider(name: str, variant: str, bone: str) -> Collider:
    kind, geometry = _EXAMPLES[variant]
    return Collider(name=name, kind=kind.name, bone=bone, geometry=geometry)


def _scrap(name: str, features: Features) -> SimpleNamespace:
    """A small garment with such features."""
    side = 4 if features.self_collision else 2
    count = side * side
    soft = SoftAttachments(
        vertices=np.array([1], np.int32),
        frame=np.zeros(1, np.int32),
        stiffness=np.ones(1),
        damping=np.zeros(1),
    )
    return _sheet(
        side,
        name=name,
        layer=features.layer,
        pins=np.zeros(int(features.pinned), np.int32),
        pin_frame=np.zeros(int(features.pinned), np.int32),
        skin_limits={limit: np.full(count, 1.0) for limit in features.skin_limits},
        soft=soft if features.soft else None,
        tethers=1.0 if features.tethers else None,
        self_collision=0.002 if features.self_collision else None,
        passed_by=("passing",) if features.passed else (),
    )


def _sheet(side: int, **asked: object) -> SimpleNamespace:
    """A square garment with so many vertices along a side, and what it asks for."""
    length = 0.1 * (side - 1)
    vertices, triangles, _ = sheet(length, length, edge=0.1)
    nothing = dict.fromkeys(
        ("tethers", "soft", "self_collision", "flat", "rest", "stitches", "elastic")
    )
    plain = {
        "name": "scrap",
        "vertices": vertices,
        "triangles": triangles,
        "material": Material(),
        "frames": ("bone",),
        "T_world_frame_rest": np.eye(4)[None],
        "frame_index": np.zeros((side * side, 1), np.int32),
        "frame_weight": np.ones((side * side, 1)),
        "pins": np.zeros(1, np.int32),
        "pin_frame": np.zeros(1, np.int32),
        "passed_by": (),
        "layer": 0,
        "skin_limits": {},
        "T_world_bone_rest": {},
    }
    return SimpleNamespace(**{**plain, **nothing, **asked})
