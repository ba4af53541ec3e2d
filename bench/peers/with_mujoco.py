"""MuJoCo's flexes in the scenes of the peers.

Two ways that its documentation has for cloth: `elasticity`, finite elements of the fabric's
stiffness, with the integrator `discrete` that it advises for them, and `edges`, an equality
constraint that keeps the length of each edge. A limb is a mocap body, to which pins are
connected: its flexes cannot be pinned to a body that is moved by hand.
"""

from types import SimpleNamespace

import mujoco
import numpy as np
import playing

POISSON = 0.3
RADIUS = 0.002
"""Of the flex's vertices and triangles in contact [m]."""

XML = """
<mujoco>
  <option timestep="{step}" gravity="0 0 -{s.gravity}" integrator="{integrator}" solver="{solver}"
    iterations="{iterations}" tolerance="1e-6" cone="elliptic" impratio="10"/>
  <size memory="1G"/>
  <worldbody>
    <body name="shape" mocap="true" pos="{pos}">
      <geom type="{s.shape}" size="{size}" friction="{s.friction} 0 0" solref="0.005 1"/>
    </body>
    <flexcomp name="c" type="direct" dim="2" mass="{mass}" radius="{radius}"
      point="{points}" element="{elements}">
      <contact selfcollide="none" solref="0.005 1" friction="{s.friction} 0 0"/>
      {edge}
      {elasticity}
      {pins}
    </flexcomp>
  </worldbody>
  {equality}
</mujoco>
"""


def text(values: np.ndarray) -> str:
    """Numbers as an attribute."""
    return " ".join(f"{v:.9g}" for v in np.ravel(values))


class Flex:
    """A flex and a mocap body."""

    def __init__(
        self, scene: SimpleNamespace, model: str, solver: str, steps: int, iterations: int
    ) -> None:
        self.scene, self.steps = scene, steps
        thickness = np.sqrt(12.0 * (1.0 - POISSON**2) * scene.bending / scene.stretch)
        elastic = (
            f'<elasticity young="{scene.stretch / thickness}" poisson="{POISSON}" '
            f'thickness="{thickness}" elastic2d="both"/>'
        )
        self.rides = scene.shape == "capsule"
        pins, equality = "", ""
        if self.rides:
            first = scene.vertices[scene.pins] - scene.position[0]
            equality = "<equality>" + "".join(
                f'<connect body1="shape" body2="c_{i}" anchor="{text(x)}" solref="0.002 1"/>'
                for i, x in zip(scene.pins, first)
            )
            equality += "</equality>"
        elif len(scene.pins):
            pins = f'<pin id="{" ".join(map(str, scene.pins))}"/>'
        size = f"{scene.radius} {0.5 * scene.length}" if scene.length else f"{scene.radius}"
        xml = XML.format(
            s=scene,
            step=scene.frame / steps,
            integrator="discrete" if model == "elasticity" else "implicitfast",
            solver=solver,
            iterations=iterations,
            pos=text(scene.position[0]),
            size=size,
            mass=scene.mass.sum(),
            radius=RADIUS,
            points=text(scene.vertices),
            elements=" ".join(map(str, scene.triangles.ravel())),
            edge='<edge equality="true" solref="0.004 1"/>' if model == "edges" else "",
            elasticity=elastic if model == "elasticity" else "",
            pins=pins,
            equality=equality,
        )
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def step(self, n: int) -> None:
        """Go on by one frame."""
        for k in range(self.steps):
            if self.rides:
                position, q = playing.pose(self.scene, n, (k + 1) / self.steps)
                self.data.mocap_pos[0] = position
                self.data.mocap_quat[0] = [q[3], *q[:3]]
            mujoco.mj_step(self.model, self.data)

    def positions(self) -> np.ndarray:
        """Where the vertices are."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_flex(self.model, self.data)
        return self.data.flexvert_xpos.reshape(-1, 3)


if __name__ == "__main__":
    playing.main(Flex, mujoco.__version__)
