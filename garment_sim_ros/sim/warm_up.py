"""Compiling before the first step instead of in it."""

from collections.abc import Collection
from types import SimpleNamespace
from typing import Any

import numpy as np

from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.geometry.sheet import sheet
from garment_sim_ros.params import Environment, Material
from garment_sim_ros.sim.simulation import Simulation

_CORNERS = 0.1 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
_FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
_GRID = np.full((3, 3, 3), 50, np.int16)
_GRID[1, 1, 1] = -50
_GEOMETRY: dict[str, dict[str, object]] = {
    "sphere": {"radius": 0.1},
    "capsule": {"radius0": 0.1, "radius1": 0.1, "length": 0.1},
    "ellipsoid": {"radii": np.full(3, 0.1)},
    "hull": {"vertices": _CORNERS, "faces": _FACES},
    "sdf": {"cell": 0.1, "step": 1e-3, "distance": _GRID},
    "mesh": {
        "vertices": _CORNERS,
        "triangles": _FACES,
        "frame": np.zeros((4, 1)),
        "weight": np.ones((4, 1)),
        "bind": np.eye(4)[None, :3],
    },
}


def warm_up(
    solver: str = "relaxation",
    *,
    kinds: Collection[str] = ("sphere",),
    layers: bool = False,
    self_collision: bool = False,
    environment: Environment | None = None,
) -> None:
    """Compiles, or loads from the cache, all that a `Simulation` with this solver runs.

    Args:
        solver: Its name.
        kinds: Kinds of the colliders; the code of hulls, sdfs and ellipsoids is only compiled for
            sets that have some.
        layers: Whether garments are worn over others.
        self_collision: Whether garments are kept from passing through themselves.
        environment: Outer forces: wind on triangles is compiled where there is any.

    Raises:
        ParameterError: An environment that cannot be.
    """
    scrap: Any = _sheet(
        2,
        max_distance=np.full(4, 1.0),
        backstop=np.full(4, 1.0),
        tethers=1.0,
        self_collision=0.002 if self_collision else None,
    )
    frame = Collider(name="frame", kind="frame", bone="bone")
    shapes = (
        Collider(name=kind, kind=kind, bone="bone", geometry=_GEOMETRY[kind])
        for kind in sorted(kinds)
    )
    over: Any = SimpleNamespace(**{**vars(scrap), "name": "over", "layer": int(layers)})
    colliders = ColliderSet(colliders=(frame, *shapes))
    simulation = Simulation(
        (scrap, over),
        colliders,
        environment=environment,
        solver=solver,
    )
    poses = ColliderPoses.identity(1 + len(kinds))
    simulation.reset(poses)
    far = ColliderPoses(position=poses.position + 2.0, orientation=poses.orientation)
    simulation.advance(far, far)
    simulation.normals("scrap")


def _sheet(side: int, **asked: object) -> SimpleNamespace:
    """A square garment with so many vertices along a side, and what it asks for."""
    length = 0.1 * (side - 1)
    vertices, triangles, _ = sheet(length, length, edge=0.1)
    nothing = dict.fromkeys(("max_distance", "backstop", "tethers", "soft", "self_collision"))
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
    }
    return SimpleNamespace(**{**plain, **nothing, **asked})
