"""How a garment hangs beside its pins: tethers to them, and springs to places on the body.

A solver that takes few passes leaves cloth stretched, the more the longer it hangs. A tether (Kim,
Chentanez & Mueller-Fischer 2012, "Long range attachments") knows at once what passes over edges
would take hundreds to find out: a particle is at most as far from a pin as the way over the cloth
is long. It only ever pulls.

A soft attachment is a spring of so many newtons per metre from a vertex to its place on a bone.
Both act after the edges and before contact, so that nothing is pulled into the body.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.sim.holds.tether_kernels import pull_attached


class Attached(NamedTuple):
    """Tethers and soft attachments of one garment; empty arrays where it has none.

    Attributes:
        pin: Pinned particles that each free one is tethered to, shape [free or 0, k].
        length: Lengths of the tethers [m], shape [free or 0, k].
        held: Output, number of particles held by tethers in the last step, shape [1].
        particle: Softly attached particles, shape [s].
        collider: Collider that the place of each is on, shape [s].
        place: The place in that collider's frame [m], shape [s, 3].
        rate: Stiffness [1/s^2] and damping [1/s] over mass, shape [s, 2].
        target: The places when the last step ended [m], NaN where that is not known, shape [s, 3].
    """

    pin: IntArray
    length: SingleArray
    held: IntArray
    particle: IntArray
    collider: IntArray
    place: FloatArray
    rate: FloatArray
    target: SingleArray

    @classmethod
    def none(cls) -> "Attached":
        """Nothing at all."""
        return cls(
            pin=np.zeros((0, 1), np.int32),
            length=np.zeros((0, 1), np.float32),
            held=np.zeros(1, np.int32),
            particle=np.zeros(0, np.int32),
            collider=np.zeros(0, np.int32),
            place=np.zeros((0, 3)),
            rate=np.zeros((0, 2)),
            target=np.zeros((0, 3), np.float32),
        )

    @property
    def is_anything(self) -> bool:
        """Whether there is anything to do."""
        return bool(len(self.pin) or len(self.particle))

    def forget(self) -> None:
        """What follows does not depend on what was before: the garment was put elsewhere."""
        self.target.fill(np.nan)

    def shift(self, by: SingleArray) -> None:
        """The local origin has moved: coordinates change by [m], shape [3]."""
        np.add(self.target, by, out=self.target)

    def pull(
        self,
        x: SingleArray,
        v: SingleArray,
        x_start: SingleArray,
        poses: ColliderPoses,
        origin: FloatArray,
        *,
        keep: float,
        dt: float,
        rate: float,
    ) -> None:
        """Lets all of them act.

        Args:
            x: Positions, changed in place [m], shape [n, 3].
            v: Velocities, changed in place [m/s], shape [n, 3].
            x_start: Positions when the step began [m], shape [n, 3].
            poses: World poses of all colliders when it ends.
            origin: World position of the local origin [m], shape [3].
            keep: Part of velocity that damping leaves in the step.
            dt: The step [s].
            rate: Velocity gained by what they move, over that [1/s]: 1 / dt, or 0 where the solver
                takes velocities from positions.
        """
        pose = poses.position, poses.orientation, origin
        pull_attached(x, v, x_start, self, *pose, keep, dt, np.float32(rate))
