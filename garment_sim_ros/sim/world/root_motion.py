"""How much of the body's own motion through the world the cloth feels.

The first paper simulates cloth relative to the body: the translation of its root is taken out
(Sun et al. 2007, section 1.4). Here any fraction of it can be, and of its rotation. What is taken
out moves cloth and colliders alike before each step, as if the world went along; the step then
sees the rest. Fractions of 1 are the world as it is and cost nothing.

No fabric hands motion on faster than waves of tension run in it, some 100 m/s where it is stiff
(the root of stiffness over areal density): what moves it faster tears it. So of a root that is
faster, as in a jump that is simulated, cloth feels so much and is taken along on the rest.
"""

import math

import numpy as np

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.geometry.transforms import quaternion_multiply, rotate, slerp
from garment_sim_ros.jit import kernel

_FASTEST = 100.0
"""Highest speed of the root that cloth feels [m/s]."""


class TakenOut:
    """The part of a step's root motion that the cloth does not feel: a rigid motion.

    Args:
        linear_inertia: Fraction of the root's translation that the cloth feels, from 0 to 1.
        angular_inertia: Fraction of its rotation.
        root: The collider whose motion it is, see `ColliderSet.root`.

    Attributes:
        pivot: The root at the start of the step, in the world [m], shape [3].
        turn: Unit quaternion about the pivot, shape [4].
        way: Translation after it [m], shape [3].
        outran: Whether the root was faster in the last step than cloth can feel.
        is_nothing: Whether the cloth feels all of it, as long as the root is not too fast.
    """

    def __init__(self, linear_inertia: float, angular_inertia: float, root: int = 0) -> None:
        self._linear = 1.0 - linear_inertia
        self._angular = 1.0 - angular_inertia
        self._root = root
        self.pivot = np.zeros(3)
        self.turn = np.array([0.0, 0.0, 0.0, 1.0])
        self.way = np.zeros(3)
        self.outran = False
        self.is_nothing = linear_inertia == angular_inertia == 1.0

    def begin_step(self, start: ColliderPoses, end: ColliderPoses, dt: float) -> bool:
        """Finds the motion of a step, and takes the colliders' start along on it.

        Args:
            start: Poses at the start, changed in place.
            end: Poses at the end.
            dt: Step [s].

        Returns:
            Whether there is any; if not, nothing is done.
        """
        way = math.dist(start.position[self._root], end.position[self._root])
        self.outran = way * (1.0 - self._linear) > _FASTEST * dt
        linear = 1.0 - _FASTEST * dt / way if self.outran else self._linear
        if linear == 0.0 and self._angular == 0.0:
            return False
        begin_step(
            start.position,
            start.orientation,
            end.position,
            end.orientation,
            linear,
            self._angular,
            self._root,
            self.pivot,
            self.turn,
            self.way,
        )
        return True


@kernel()
def begin_step(
    position0, orientation0, position1, orientation1, linear, angular, root, pivot, turn, way
):
    """See `TakenOut.begin_step`."""
    q0, q1 = orientation0[root], orientation1[root]
    turned = quaternion_multiply(q1[0], q1[1], q1[2], q1[3], -q0[0], -q0[1], -q0[2], q0[3])
    part = slerp(0.0, 0.0, 0.0, 1.0, turned[0], turned[1], turned[2], turned[3], angular)
    for k in range(4):
        turn[k] = part[k]
    for k in range(3):
        pivot[k] = position0[root, k]
        way[k] = linear * (position1[root, k] - position0[root, k])
    for c in range(position0.shape[0]):
        place = rotate(
            turn[0],
            turn[1],
            turn[2],
            turn[3],
            position0[c, 0] - pivot[0],
            position0[c, 1] - pivot[1],
            position0[c, 2] - pivot[2],
        )
        q = orientation0[c]
        new = quaternion_multiply(turn[0], turn[1], turn[2], turn[3], q[0], q[1], q[2], q[3])
        for k in range(3):
            position0[c, k] = place[k] + pivot[k] + way[k]
        for k in range(4):
            orientation0[c, k] = new[k]


@kernel()
def take_along(x, v, origin, pivot, turn, way):
    """Moves cloth by the motion that is taken out; velocities turn with it.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        origin: World position of the local origin [m], shape [3].
        pivot: See `TakenOut`.
        turn: See `TakenOut`.
        way: See `TakenOut`.
    """
    for i in range(x.shape[0]):
        place = rotate(
            turn[0],
            turn[1],
            turn[2],
            turn[3],
            x[i, 0] - (pivot[0] - origin[0]),
            x[i, 1] - (pivot[1] - origin[1]),
            x[i, 2] - (pivot[2] - origin[2]),
        )
        speed = rotate(turn[0], turn[1], turn[2], turn[3], v[i, 0], v[i, 1], v[i, 2])
        for k in range(3):
            x[i, k] = place[k] + (pivot[k] - origin[k]) + way[k]
            v[i, k] = speed[k]
