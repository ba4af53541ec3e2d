"""World poses of a body's colliders from the world transforms of its joints.

A collider with the geometry entry ``share`` sits at a joint and turns only by that share of the
joint's rotation: its bone's frame is replaced by one with the same origin that lies between the
bone before it has turned (carried along by the rig's next joint above) and the bone as it is. A
share of 0.5 is what skin does that both bones move alike.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import (
    invert_transform,
    quaternion_from_matrix,
    quaternion_multiply,
    rotate,
    slerp,
    unit_quaternion,
)
from garment_sim_ros.jit import kernel


class ColliderPoser:
    """Carries a collider set on a rig; everything is allocated once.

    Args:
        colliders: The set.
        body: The body that it was fitted to.

    Raises:
        GeometryError: A collider's bone is not a joint of the body's rig.
    """

    def __init__(self, colliders: ColliderSet, body: Body) -> None:
        count = len(colliders)
        self._joint = np.array(
            [body.rig.index(c.bone) for c in colliders.colliders], dtype=np.int32
        )
        self._above = np.maximum(body.rig.parent[self._joint], 0)
        self._share = np.array([_share(c, body) for c in colliders.colliders])
        T_bone_bind = body.skin.T_bone_bind
        unturned = T_bone_bind[self._above] @ invert_transform(T_bone_bind[self._joint])
        self._unturned = quaternion_from_matrix(unturned[:, :3, :3])
        self._position = np.zeros((count, 3))
        self._orientation = np.zeros((count, 4))
        for i, c in enumerate(colliders.colliders):
            self._position[i] = c.position
            self._orientation[i] = c.orientation

    def poses(self, T_world_joint: FloatArray, out: ColliderPoses | None = None) -> ColliderPoses:
        """Poses of all colliders, in the set's order.

        Args:
            T_world_joint: World transforms of the rig's joints, rigid, shape [n, 4, 4].
            out: Overwritten and returned where given.
        """
        if out is None:
            out = ColliderPoses.identity(len(self._joint))
        _pose(
            np.ascontiguousarray(T_world_joint, dtype=np.float64),
            self._joint,
            self._above,
            self._share,
            self._unturned,
            self._position,
            self._orientation,
            out.position,
            out.orientation,
        )
        return out


def _share(collider: Collider, body: Body) -> float:
    """How much of its joint's rotation a collider takes part in; all of it at a root."""
    is_root = body.rig.parent[body.rig.index(collider.bone)] < 0
    return 1.0 if is_root else float(collider.geometry.get("share", 1.0))  # type: ignore[arg-type]


@kernel()
def _pose(
    T_world_joint,
    joint,
    above,
    share,
    unturned,
    local_position,
    local_orientation,
    position,
    orientation,
):
    """``T_world_collider = T_world_joint T_joint_collider`` for every collider."""
    for i in range(joint.shape[0]):
        T = T_world_joint[joint[i]]
        qx, qy, qz, qw = unit_quaternion(T)
        if share[i] < 1.0:
            px, py, pz, pw = unit_quaternion(T_world_joint[above[i]])
            u = unturned[i]
            px, py, pz, pw = quaternion_multiply(px, py, pz, pw, u[0], u[1], u[2], u[3])
            qx, qy, qz, qw = slerp(px, py, pz, pw, qx, qy, qz, qw, share[i])
        p = local_position[i]
        x, y, z = rotate(qx, qy, qz, qw, p[0], p[1], p[2])
        position[i, 0] = T[0, 3] + x
        position[i, 1] = T[1, 3] + y
        position[i, 2] = T[2, 3] + z
        q = local_orientation[i]
        ox, oy, oz, ow = quaternion_multiply(qx, qy, qz, qw, q[0], q[1], q[2], q[3])
        orientation[i, 0] = ox
        orientation[i, 1] = oy
        orientation[i, 2] = oz
        orientation[i, 3] = ow
