"""pyPBD in the scenes of the peers: PBD and XPBD with signed distance fields of meshes.

y is up there. The sphere is its analytic one, the capsule a signed distance field that it makes
of a mesh, its documented way for shapes of any form. Stiffness of XPBD's edges is the sheet's.
"""

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import playing
import pypbd as pbd

DISTANCE_PBD, FEM_PBD, STRAIN_PBD, DISTANCE_XPBD = 1, 2, 3, 4
BENDING_PBD, ISOMETRIC_PBD, ISOMETRIC_XPBD = 1, 2, 3
TOLERANCE = 0.005
"""From the surface, within which contact begins [m]."""


def y_up(x: np.ndarray) -> np.ndarray:
    """From z up to y up, shape [v, 3]."""
    return np.stack([x[..., 0], x[..., 2], -x[..., 1]], axis=-1)


def capsule_mesh(radius: float, length: float, around: int = 24, rings: int = 7) -> tuple:
    """Vertices and triangles of a capsule about z, closed, normals outwards."""
    tilt = np.linspace(0.0, 0.5 * np.pi, rings)[:-1]
    caps = [(radius * math.cos(a), 0.5 * length + radius * math.sin(a)) for a in tilt]
    rows = [(r, -z) for r, z in reversed(caps)] + caps
    if length == 0.0:
        del rows[len(caps)]  # the equator, once
    angle = 2.0 * np.pi * np.arange(around) / around
    x = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full(around, z)], -1) for r, z in rows]
    end = 0.5 * length + radius
    vertices = np.concatenate([*x, [[0.0, 0.0, -end], [0.0, 0.0, end]]])
    index = np.arange(len(rows) * around).reshape(len(rows), around)
    a, d = index[:-1], index[1:]
    b, c = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
    low, high = len(vertices) - 2, len(vertices) - 1
    first, last = index[0], index[-1]
    faces = [np.stack(q, -1).reshape(-1, 3) for q in ((a, b, c), (a, c, d))]
    faces.append(np.stack([np.full(around, low), np.roll(first, -1), first], -1))
    faces.append(np.stack([np.full(around, high), last, np.roll(last, -1)], -1))
    return vertices, np.concatenate(faces)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The turn b and then the turn a, as quaternions (x, y, z, w)."""
    v = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.array([*v, a[3] * b[3] - a[:3] @ b[:3]])


class PyPBD:
    """A triangle model and one static body."""

    def __init__(
        self,
        scene: SimpleNamespace,
        kind: int,
        sub_steps: int,
        iterations: int,
        bending: bool = False,
    ) -> None:
        self.scene = scene
        self.simulation = pbd.Simulation.getCurrent()
        self.simulation.initDefault()
        self.model = self.simulation.getModel()
        self.controller = self.simulation.getTimeStep()
        controller = pbd.TimeStepController
        # The steps are made here, so that pins and the shape move with each of them.
        self.controller.setValueUInt(controller.NUM_SUB_STEPS, 1)
        self.controller.setValueUInt(controller.MAX_ITERATIONS, iterations)
        pbd.TimeManager.getCurrent().setTimeStepSize(scene.frame / sub_steps)
        self.sub_steps = sub_steps
        self.body = self._add_shape()
        self.first = self.body.getRotation()  # it turns bodies to their main axes
        self._add_cloth(kind, bending)

    def _add_shape(self) -> object:
        """The sphere or capsule, without mass: it goes where it is put."""
        s = self.scene
        vertices, faces = capsule_mesh(s.radius, s.length)
        lines = [f"v {x} {y} {z}" for x, y, z in y_up(vertices)]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
        with TemporaryDirectory() as folder:
            path = Path(folder) / "shape.obj"
            path.write_text("\n".join(lines) + "\n")
            data, mesh = pbd.OBJLoader.loadObjToMesh(str(path), [1, 1, 1])
        position = y_up(s.position[0])
        if s.length == 0.0:
            body = self.model.addRigidBody(1.0, data, mesh, position, np.eye(3), [1, 1, 1])
            self.detection = pbd.DistanceFieldCollisionDetection()
            self.controller.setCollisionDetection(self.model, self.detection)
        else:
            field = pbd.CubicSDFCollisionDetection.generateSDF(data, mesh, [30, 60, 30])
            body = self.model.addRigidBody(
                1.0, data, mesh, position, np.eye(3), [1, 1, 1], sdf=field
            )
        body.setMass(0.0)
        body.setFrictionCoeff(s.friction)
        self.controller.getCollisionDetection().setTolerance(TOLERANCE)
        return body

    def _add_cloth(self, kind: int, bends: bool) -> None:
        s = self.scene
        self.model.addTriangleModel(
            list(y_up(s.vertices)), s.triangles.ravel().tolist(), testMesh=s.length > 0.0
        )
        cloth = self.model.getTriangleModels()[0]
        cloth.setFrictionCoeff(s.friction)
        is_xpbd = kind == DISTANCE_XPBD
        stiffness = s.stretch if is_xpbd else 1.0
        self.model.addClothConstraints(
            cloth, kind, stiffness, stiffness, stiffness, stiffness, 0.3, 0.3, False, False
        )
        if bends:
            bending = (ISOMETRIC_XPBD, s.bending) if is_xpbd else (ISOMETRIC_PBD, 0.01)
            self.model.addBendingConstraints(cloth, *bending)
        self.particles = self.model.getParticles()
        for i, mass in enumerate(s.mass):
            self.particles.setMass(i, float(mass))
        for i in s.pins:
            self.particles.setMass(int(i), 0.0)
        if s.length == 0.0:
            kinds = pbd.CollisionObject
            geometry = self.body.getGeometry().getVertexDataLocal()
            self.detection.addCollisionSphere(
                *(0, kinds.RigidBodyCollisionObjectType, geometry, 0, geometry.size()),
                *(s.radius, True, False),
            )
            self.detection.addCollisionObjectWithoutGeometry(
                *(0, kinds.TriangleModelCollisionObjectType, self.particles),
                *(0, self.particles.size(), True),
            )

    def step(self, n: int) -> None:
        """Go on by one frame."""
        s = self.scene
        for k in range(self.sub_steps):
            part = (k + 1) / self.sub_steps
            if s.shape == "capsule":
                before = playing.pose(s, n, k / self.sub_steps)
                self._move(*playing.pose(s, n, part), *before)
                for i, x in zip(s.pins, y_up(playing.pinned(s, n, part))):
                    self.particles.setPosition(int(i), x)
            self.controller.step(self.model)

    def _move(
        self,
        position: np.ndarray,
        q: np.ndarray,
        position_before: np.ndarray,
        q_before: np.ndarray,
    ) -> None:
        """Put the shape somewhere: it does none of this for bodies without mass."""
        rate = self.sub_steps / self.scene.frame
        turned = product(q, q_before * [-1.0, -1.0, -1.0, 1.0])
        self.body.setVelocity(y_up(rate * (position - position_before)))
        self.body.setAngularVelocity(y_up(2.0 * rate * turned[:3]))
        turn = product(np.array([*y_up(q[:3]), q[3]]), self.first)
        axes = [playing.rotated(turn, axis[None])[0] for axis in np.eye(3)]
        self.body.setPosition(y_up(position))
        self.body.setRotation(turn)
        self.body.setRotationMatrix(np.array(axes).T)
        self.body.rotationUpdated()
        self.body.updateInverseTransformation()
        # Its bounds are those of its mesh.
        self.body.getGeometry().updateMeshTransformation(y_up(position), np.array(axes).T)

    def positions(self) -> np.ndarray:
        """Where the vertices are."""
        x = np.array(self.particles.getVertices(), copy=True).reshape(-1, 3)
        return np.stack([x[:, 0], -x[:, 2], x[:, 1]], axis=-1)


if __name__ == "__main__":
    from importlib.metadata import version

    playing.main(PyPBD, version("pyPBD"))
