"""PyBullet's two kinds of cloth in the scenes of the peers.

`soft`: soft bodies of its usual world, position based. `deformable`: mass and springs of its
deformable world, explicit in time, with the fabric's stiffness and as many steps as that needs.
Pins are anchors of nodes to the shape's body, or to the world.
"""

import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import playing
import pybullet as p

MARGIN = 0.005


class Bullet:
    """A soft body and a body without mass."""

    def __init__(self, scene: SimpleNamespace, world: str, steps: int) -> None:
        self.scene, self.steps = scene, steps
        p.connect(p.DIRECT)
        deformable = world == "deformable"
        p.resetSimulation(p.RESET_USE_DEFORMABLE_WORLD if deformable else 0)
        p.setGravity(0.0, 0.0, -scene.gravity)
        p.setTimeStep(scene.frame / steps)
        p.setPhysicsEngineParameter(sparseSdfVoxelSize=0.05)
        kind = p.GEOM_CAPSULE if scene.length else p.GEOM_SPHERE
        shape = p.createCollisionShape(kind, radius=scene.radius, height=scene.length)
        # In the soft world anchors hold on to rigid bodies, which these are, only.
        self.body = p.createMultiBody(
            0.0,
            shape,
            basePosition=scene.position[0].tolist(),
            useMaximalCoordinates=not deformable,
        )
        p.changeDynamics(self.body, -1, lateralFriction=scene.friction)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "cloth.obj"
            lines = [f"v {x} {y} {z}" for x, y, z in scene.vertices]
            lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in scene.triangles]
            path.write_text("\n".join(lines) + "\n")
            self.cloth = p.loadSoftBody(
                str(path),
                mass=float(scene.mass.sum()),
                useMassSpring=1,
                useBendingSprings=0,
                useNeoHookean=0,
                springElasticStiffness=scene.stretch,
                springDampingStiffness=0.0,
                frictionCoeff=scene.friction,
                useFaceContact=int(deformable),
                useSelfCollision=0,
                collisionMargin=MARGIN,
            )
        nodes = np.array(self._nodes())
        far = np.linalg.norm(nodes[:, None] - scene.vertices[None], axis=2)
        self.order = far.argmin(axis=0)  # node of each vertex
        assert far.min(axis=0).max() < 1e-4
        for i in scene.pins:
            node = int(self.order[i])
            if scene.shape == "capsule":
                first = (scene.vertices[i] - scene.position[0]).tolist()
                p.createSoftBodyAnchor(self.cloth, node, self.body, -1, first)
            else:
                p.createSoftBodyAnchor(self.cloth, node, -1, -1)

    def _nodes(self) -> tuple:
        return p.getMeshData(self.cloth, -1, flags=p.MESH_DATA_SIMULATION_MESH)[1]

    def step(self, n: int) -> None:
        """Go on by one frame."""
        for k in range(self.steps):
            if self.scene.shape == "capsule":
                position, q = playing.pose(self.scene, n, (k + 1) / self.steps)
                p.resetBasePositionAndOrientation(self.body, position.tolist(), q.tolist())
            p.stepSimulation()

    def positions(self) -> np.ndarray:
        """Where the vertices are."""
        return np.array(self._nodes())[self.order]


if __name__ == "__main__":
    from importlib.metadata import version

    playing.main(Bullet, version("pybullet"))
