"""Newton on the CPU in the scenes of the peers: its solvers XPBD, VBD and Style3D.

Pins are particles without mass that are put where they belong; the limb is a kinematic body.
"""

from types import SimpleNamespace

import newton
import numpy as np
import playing
import warp as wp

RADIUS = 0.002
"""Of a particle in contact [m]."""


def flattened(scene: SimpleNamespace) -> np.ndarray:
    """Each triangle in its own plane, the second axis upwards or away, shape [t, 3, 2]."""
    corners = scene.vertices[scene.triangles]
    sides = corners - corners[:, :1]
    normal = np.cross(sides[:, 1], sides[:, 2])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = np.cross([0.0, 0.0, 1.0], normal)
    across[np.linalg.norm(across, axis=1) < 1e-6] = [1.0, 0.0, 0.0]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    axes = np.stack([across, np.cross(normal, across)], axis=1)
    return np.einsum("tck,tak->tca", sides, axes)


class Newton:
    """A cloth mesh and one shape."""

    def __init__(
        self,
        scene: SimpleNamespace,
        solver: str,
        steps: int,
        iterations: int,
        share: float = 1.0,
    ) -> None:
        self.scene, self.steps = scene, steps
        builder = newton.ModelBuilder(gravity=(0.0, 0.0, -scene.gravity))
        if solver == "style3d":
            newton.solvers.SolverStyle3D.register_custom_attributes(builder)
        self._add_shape(builder)
        self._add_cloth(builder, solver, share)
        if solver == "vbd":
            builder.color(include_bending=True)
        self.model = builder.finalize(device="cpu")
        self.model.soft_contact_ke = 1e3
        self.model.soft_contact_kd = 1e-1 if solver == "vbd" else 1.0
        self.model.soft_contact_mu = scene.friction
        if solver == "xpbd":
            self.solver = newton.solvers.SolverXPBD(self.model, iterations=iterations)
        elif solver == "vbd":
            self.solver = newton.solvers.SolverVBD(self.model, iterations=iterations)
        else:
            config = newton.solvers.SolverStyle3D.Config(iterations=iterations)
            self.solver = newton.solvers.SolverStyle3D(self.model, config=config)
        self.control = self.model.control()
        self.pipeline = newton.CollisionPipeline(self.model, soft_contact_gap=0.01)
        self.contacts = self.pipeline.contacts()
        self.states = [self.model.state(), self.model.state()]
        self.step(1)  # compiles, which is not what is measured
        self.states = [self.model.state(), self.model.state()]

    def _add_shape(self, builder: newton.ModelBuilder) -> None:
        s = self.scene
        config = newton.ModelBuilder.ShapeConfig(mu=s.friction)
        if s.shape == "sphere":
            at = wp.transform(wp.vec3(*s.position[0]), wp.quat_identity())
            builder.add_shape_sphere(-1, xform=at, radius=s.radius, cfg=config)
        else:
            at = wp.transform(wp.vec3(*s.position[0]), wp.quat(*s.orientation[0]))
            body = builder.add_body(xform=at, mass=1.0, is_kinematic=True)
            builder.add_shape_capsule(
                body, radius=s.radius, half_height=0.5 * s.length, cfg=config
            )

    def _add_cloth(self, builder: newton.ModelBuilder, solver: str, share: float) -> None:
        s = self.scene
        where = {"pos": wp.vec3(0.0), "rot": wp.quat_identity(), "vel": wp.vec3(0.0), "scale": 1.0}
        mesh = {
            **where,
            "vertices": [wp.vec3(*x) for x in s.vertices],
            "indices": s.triangles.ravel().tolist(),
            "density": s.density,
            "particle_radius": RADIUS,
        }
        if solver == "xpbd":
            more = {"tri_ke": 0.0, "tri_ka": 0.0, "tri_kd": 0.0, "edge_ke": 0.0, "edge_kd": 0.0}
            builder.add_cloth_mesh(
                **mesh, **more, add_springs=True, spring_ke=share * s.stretch, spring_kd=0.0
            )
        elif solver == "vbd":
            # First and second Lame parameters of the sheet: E / (2 (1 + nu)), E nu / (1 - nu^2).
            shear, area = s.stretch / 2.6, s.stretch * 0.3 / 0.91
            more = {"tri_ke": shear, "tri_ka": area, "tri_kd": 0.0}
            builder.add_cloth_mesh(**mesh, **more, edge_ke=s.bending, edge_kd=0.0)
        else:
            from newton.solvers import style3d

            panels = flattened(s)
            style3d.add_cloth_mesh(
                builder,
                **mesh,
                panel_verts=panels.reshape(-1, 2).tolist(),
                panel_indices=list(range(3 * len(panels))),
                tri_aniso_ke=wp.vec3(s.stretch, s.stretch, s.shear),
                edge_aniso_ke=wp.vec3(s.bending, s.bending, s.bending),
            )
        for i in s.pins:
            builder.particle_mass[int(i)] = 0.0
            builder.particle_flags[int(i)] &= ~int(newton.ParticleFlags.ACTIVE)

    def step(self, n: int) -> None:
        """Go on by one frame."""
        s = self.scene
        for k in range(self.steps):
            now, then = self.states
            now.clear_forces()
            if s.shape == "capsule":
                part = (k + 1) / self.steps
                position, q = playing.pose(s, n, part)
                for state in self.states:
                    state.body_q.numpy()[0] = [*position, *q]
                    state.particle_q.numpy()[s.pins] = playing.pinned(s, n, part)
            self.pipeline.collide(now, self.contacts)
            self.solver.step(now, then, self.control, self.contacts, s.frame / self.steps)
            self.states = [then, now]

    def positions(self) -> np.ndarray:
        """Where the vertices are."""
        return self.states[0].particle_q.numpy()


if __name__ == "__main__":
    wp.config.quiet = True
    playing.main(Newton, newton.__version__)
