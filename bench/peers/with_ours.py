"""This package's own solvers in the scenes of the peers."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import playing

from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.params import ImplicitSettings, Material, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.version import VERSION


class Ours:
    """A garment on one shape."""

    def __init__(self, scene: SimpleNamespace, solver: str, sub_steps: int, **more: Any) -> None:
        self.scene = scene
        material = Material(
            areal_density=scene.density,
            stretch_stiffness_warp=scene.stretch,
            stretch_stiffness_weft=scene.stretch,
            shear_stiffness=scene.shear,
            bending_stiffness=scene.bending,
            damping=0.0,
            air_drag=0.0,
            friction=scene.friction,
        )
        garment = Garment.from_mesh(
            scene.vertices,
            scene.triangles,
            material=material,
            pins=scene.pins.tolist(),
            bone="bone",
        )
        geometry = {"radius": scene.radius}
        if scene.shape == "capsule":
            geometry = {"radius0": scene.radius, "radius1": scene.radius, "length": scene.length}
        shape = Collider(name="shape", kind=scene.shape, bone="bone", geometry=geometry)
        frame = Collider(name="frame_bone", kind="frame", bone="bone", geometry={})
        settings: Any
        if solver == "xpbd":
            more["search_every"] = min(more.get("search_every", 4), sub_steps)
            settings = XpbdSettings(sub_step=scene.frame / sub_steps, **more)
        else:
            settings = ImplicitSettings(sub_step=scene.frame / sub_steps, **more)
        self.simulation = Simulation(
            (garment,),
            ColliderSet(colliders=(frame, shape)),
            solver=solver,
            settings=settings,
            solver_step=scene.frame,
        )
        self.name = self.simulation.names[0]

    def _poses(self, n: int) -> ColliderPoses:
        """The frame that carries pins, and the shape; a capsule's own frame is at its end."""
        poses = ColliderPoses.identity(2)
        position, orientation = playing.pose(self.scene, n)
        end = np.array([[0.0, 0.0, -0.5 * self.scene.length]])
        first = playing.rotated(orientation, self.scene.position[:1])[0]
        poses.position[0] = position - first  # what is on the bone was put there in the world
        poses.position[1] = position + playing.rotated(orientation, end)[0]
        poses.orientation[:] = orientation
        return poses

    def step(self, n: int) -> None:
        """Go on by one frame."""
        self.simulation.advance(self._poses(n - 1), self._poses(n), self.scene.frame)

    def positions(self) -> np.ndarray:
        """Where the vertices are."""
        return self.simulation.positions(self.name)


def warm(scene: SimpleNamespace, **settings: Any) -> Ours:
    """One whose kernels have been compiled, which is not what is measured."""
    Ours(scene, **settings).step(1)
    return Ours(scene, **settings)


if __name__ == "__main__":
    playing.main(warm, VERSION)
