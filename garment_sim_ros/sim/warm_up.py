"""Compiling before the first step instead of in it."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from garment_sim_ros.geometry.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.params import Environment, Material
from garment_sim_ros.sim.simulation import Simulation


def warm_up(
    solver: str = "relaxation", *, layers: bool = False, environment: Environment | None = None
) -> None:
    """Compiles, or loads from the cache, all that a `Simulation` with this solver runs.

    Args:
        solver: Its name.
        layers: Whether garments are worn over others.
        environment: Outer forces: wind on triangles is compiled where there is any.

    Raises:
        ParameterError: An environment that cannot be.
    """
    scrap: Any = SimpleNamespace(
        name="scrap",
        vertices=np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0]]),
        triangles=np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
        material=Material(),
        frames=("bone",),
        T_world_frame_rest=np.eye(4)[None],
        frame_index=np.zeros((4, 1), np.int32),
        frame_weight=np.ones((4, 1)),
        pins=np.zeros(1, np.int32),
        pin_frame=np.zeros(1, np.int32),
        passed_by=(),
        layer=0,
    )
    ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": 0.1})
    over: Any = SimpleNamespace(**{**vars(scrap), "name": "over", "layer": int(layers)})
    simulation = Simulation(
        (scrap, over), ColliderSet(colliders=(ball,)), environment=environment, solver=solver
    )
    poses = ColliderPoses.identity(1)
    simulation.reset(poses)
    far = ColliderPoses(position=poses.position + 2.0, orientation=poses.orientation)
    simulation.advance(far, far)
    simulation.normals("scrap")
