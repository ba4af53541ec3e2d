"""Hems that a hand lifts: how much of a hem hangs too high beside a lower arm or hand.

A point of a hem is lifted where it hangs less than three quarters as far below what holds its
garment (waist band, shoulders) as it would as skin. Legs and speed lift hems, too: only points
within 10 cm of the skin of a lower arm or hand count.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.sim.placement import blend
from garment_sim_ros.sim.riding_up import RidingUp
from garment_sim_ros.sim.simulation import Simulation

LIFTED = 0.1
"""Share of a garment's hems that is lifted in a frame that counts."""
_HANGS = 0.75
"""Part of its length as skin that a hem hangs at least."""
_BESIDE = 0.1
"""Farthest that an arm's skin is from what it lifts [m]."""
_ARMS = ("leftLowerArm", "rightLowerArm")


def lifted(below: FloatArray, as_skin: FloatArray, x: FloatArray, arms: FloatArray) -> float:
    """Share of a hem that is lifted.

    Args:
        below: How far each of its points is below what holds it [m], shape [n].
        as_skin: The same as skin; above counts as hanging [m], shape [n].
        x: The points [m], shape [n, 3].
        arms: Vertices of the arms' skin [m], shape [a, 3].
    """
    high = (as_skin > 0.0) & (below < _HANGS * as_skin)
    if not high.any() or not len(arms):
        return 0.0
    away = np.full(len(x), np.inf)
    away[high] = cKDTree(arms).query(x[high])[0]
    return float(np.mean(away < _BESIDE))


class LiftMeter:
    """Largest share of a hem that a hand lifts, and the frames in which one does.

    Args:
        body: Whose arms they are.
        simulation: What is worn; its garments' hems.

    Attributes:
        largest: Largest share of a hem.
        frames: Frames with a share above `LIFTED`.
    """

    def __init__(self, body: Body, simulation: Simulation) -> None:
        self._arms = _vertices_of(body)
        self._dressed = {view.name: view.worn for view in simulation}
        self._hems = {n: RidingUp(w.given).hems for n, w in self._dressed.items()}
        self.largest = 0.0
        self.frames = 0

    def add(
        self, skin: FloatArray, garments: dict[str, NDArray[np.floating]], poses: ColliderPoses
    ) -> float:
        """Look at a frame.

        Args:
            skin: Posed skin vertices [m], shape [v, 3].
            garments: Vertices of each garment at the same instant [m].
            poses: World poses of the colliders then.

        Returns:
            Largest share of a hem that is lifted.
        """
        most = 0.0
        for name, hems in self._hems.items():
            worn, x = self._dressed[name], np.asarray(garments[name], np.float64)
            T = worn.frames.world(poses)
            for hem in hems:
                rest = blend(worn.given, T, np.concatenate(hem)).reshape(2, -1, 3)
                as_skin = rest[1, :, 2] - rest[0, :, 2]
                below = x[hem.held, 2] - x[hem.vertex, 2]
                most = max(most, lifted(below, as_skin, x[hem.vertex], skin[self._arms]))
        self.largest = max(self.largest, most)
        self.frames += most > LIFTED
        return most


def _vertices_of(body: Body) -> NDArray[np.intp]:
    """Vertices of the skin that lower arms and what is below them move most."""
    joints = [body.rig.index(body.humanoid[b]) for b in _ARMS if b in body.humanoid]
    skin = body.skin
    main = skin.bone[np.arange(len(skin.vertices)), skin.weight.argmax(axis=1)]
    moves = np.zeros(len(body.rig.joint_names), bool)
    for joint in joints:
        moves |= body.rig.below(joint)
    return np.flatnonzero(moves[main])
