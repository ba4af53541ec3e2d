"""The way that a clip's root covers per cycle, to walk on where the clip ends."""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.rig import TRANSLATION
from garment_sim_ros.geometry.transforms import (
    invert_transform,
    quaternion_from_matrix,
    quaternion_multiply,
    rotate,
    transform_from,
)
from garment_sim_ros.jit import kernel
from garment_sim_ros.mocap.channels import ball_joints
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.euler import (
    euler_near,
    quaternion_from_euler,
    quaternions_from_euler,
)


class RootMotion:
    """Moves poses of a clip by whole cycles: a turn about the vertical and a step on the ground.

    Only a root with three position channels followed by three rotation channels can be moved; for
    others `moves` is false and `advance` changes nothing.

    Args:
        clip: The clip.
    """

    def __init__(self, clip: Clip) -> None:
        rig, dofs = clip.rig, clip.rig.dofs
        joints = ball_joints(rig)
        first_joints = dofs.joint[:6]
        between = np.unique(first_joints[first_joints != first_joints[:1]])
        self.moves = (
            len(dofs) >= 6
            and bool((dofs.kind[:3] == TRANSLATION).all())
            and len(joints.channels) > 0
            and list(joints.channels[0]) == [3, 4, 5]
            and np.allclose(dofs.axis[:3] @ dofs.axis[:3].T, np.eye(3), atol=1e-9)
            and np.allclose(rig.T_parent_joint[between], np.eye(4), atol=1e-9)
        )
        if not self.moves:
            return
        zero = ForwardKinematics(rig).from_dofs(np.zeros(len(dofs)))
        self._T_world_base = clip.T_world_file @ zero[dofs.joint[0]]
        self._T_base_world = invert_transform(self._T_world_base)
        self._place_axes = np.ascontiguousarray(dofs.axis[:3])
        self._turn_axes = joints.axes[0]
        self._T_cycle = self._ground_motion(clip.values[0], clip.values[-1])
        self._carried = (0, np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3))

    def advance(self, q: FloatArray, cycles: int) -> None:
        """Move a pose on by a number of cycles, in place.

        Args:
            q: Channel values [rad or m], shape [d].
            cycles: How many.
        """
        if not self.moves or cycles == 0:
            return
        if self._carried[0] != cycles:
            T_world = np.linalg.matrix_power(self._T_cycle, cycles)
            T = self._T_base_world @ T_world @ self._T_world_base
            self._carried = (cycles, quaternion_from_matrix(T[:3, :3]), T[:3, 3].copy())
        _, turn, step = self._carried
        _move(q, turn, step, self._place_axes, self._turn_axes)

    def _ground_motion(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """The motion on the ground that comes nearest to leading one root pose to another."""
        T_start, T_end = self._root_pose(start), self._root_pose(end)
        turn = T_end[:3, :3] @ T_start[:3, :3].T
        rotation = quaternion_from_matrix(turn)
        heading = 2.0 * np.arctan2(rotation[2], rotation[3])
        c, s = np.cos(heading), np.sin(heading)
        T = np.eye(4)
        T[:2, :2] = [[c, -s], [s, c]]
        T[:2, 3] = T_end[:2, 3] - T[:2, :2] @ T_start[:2, 3]
        return T

    def _root_pose(self, q: FloatArray) -> FloatArray:
        rotation = quaternions_from_euler(self._turn_axes, q[None, 3:6])[0]
        return self._T_world_base @ transform_from(q[:3] @ self._place_axes, rotation)


@kernel()
def _move(q, turn, step, place_axes, turn_axes):
    """Apply a rigid motion to the first six channels, three positions and three rotations."""
    position = np.zeros(3)
    for k in range(3):
        for i in range(3):
            position[i] += q[k] * place_axes[k, i]
    tx, ty, tz, tw = turn[0], turn[1], turn[2], turn[3]
    x, y, z = rotate(tx, ty, tz, tw, position[0], position[1], position[2])
    for k in range(3):
        axis = place_axes[k]
        q[k] = axis[0] * (x + step[0]) + axis[1] * (y + step[1]) + axis[2] * (z + step[2])
    rx, ry, rz, rw = quaternion_from_euler(turn_axes, q[3], q[4], q[5])
    rotation = np.empty(4)
    rotation[0], rotation[1], rotation[2], rotation[3] = quaternion_multiply(
        tx, ty, tz, tw, rx, ry, rz, rw
    )
    euler_near(rotation, turn_axes, q[3:6].copy(), q[3:6])
