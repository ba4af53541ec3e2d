"""The posed skin of a recorded avatar, worked out again from what its topics said."""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.geometry.transforms import (
    interpolate_poses,
    quaternion_from_matrix,
    transform_from,
)
from garment_sim_ros.mocap.source_urdf import reference_from_urdf
from garment_sim_ros.recording.bags import Recording
from garment_sim_ros.recording.previews import Figure


class Replay:
    """Poses a body as the recorded `joint_states` say, at any recorded time.

    Args:
        recording: What was recorded.
        body: The avatar.

    Raises:
        GeometryError: The recorded skeleton and the body have no bones in common.
    """

    def __init__(self, recording: Recording, body: Body) -> None:
        self._stamp = recording.joint_stamp
        rig = parse_urdf(recording.robot_description)
        place = {name: i for i, name in enumerate(rig.dofs.names)}
        known = [k for k, name in enumerate(recording.joint_names) if name in place]
        self._values = np.zeros((len(recording.joint_values), len(rig.dofs)))
        into = [place[recording.joint_names[k]] for k in known]
        self._values[:, into] = recording.joint_values[:, known]
        self._retargeter = Retargeter(
            rig,
            body,
            T_world_source=np.eye(4),
            reference=reference_from_urdf(recording.robot_description),
        )
        self._kept: dict[int, FloatArray] = {}
        self._skinner = Skinner.of(body)
        hips = body.humanoid.get("hips")
        self._root = body.rig.index(hips) if hips else 0
        # In rest pose bodies face along x.
        self._forward = rest_transforms(body.rig)[self._root, 0, :3].copy()

    def joints(self, stamp: int) -> FloatArray:
        """World transforms of the body's joints, shape [n, 4, 4].

        Between two messages they are interpolated as the cloth's colliders are.

        Args:
            stamp: Time [ns]; before and after the recording its ends hold.
        """
        after = int(np.clip(np.searchsorted(self._stamp, stamp), 1, len(self._stamp) - 1))
        span = int(self._stamp[after] - self._stamp[after - 1])
        part = np.clip((stamp - int(self._stamp[after - 1])) / max(span, 1), 0.0, 1.0)
        ends = [self._posed(k) for k in (after - 1, after)]
        a, b = ((T[:, :3, 3].copy(), quaternion_from_matrix(T[:, :3, :3])) for T in ends)
        position, orientation = np.empty_like(a[0]), np.empty_like(a[1])
        interpolate_poses(*a, *b, float(part), position, orientation)
        return transform_from(position, orientation)

    def _posed(self, k: int) -> FloatArray:
        """The body's joints at a message, feet and arms as `collider_node` has them by default.

        A recording does not tell whether they were. From its beginning on, for feet stay
        where they were put down.
        """
        if k not in self._kept:
            begin = max(self._kept, default=-1) + 1
            if begin > k:
                begin = 0
                self._kept.clear()
                self._retargeter.forget()
            for i in range(begin, k + 1):
                T = self._retargeter.world_joints(self._values[i], 1e-9 * int(self._stamp[i]))
                self._kept = {j: kept for j, kept in self._kept.items() if j == i - 1}
                self._kept[i] = T.copy()
        return self._kept[k]

    def figure(self, stamp: int, garments: tuple[FloatArray, ...]) -> Figure:
        """The posed skin with garments that were recorded at the same time [ns]."""
        T_world_joint = self.joints(stamp)
        T_world_root = T_world_joint[self._root]
        facing = T_world_root[:3, :3] @ self._forward
        return Figure(
            skin=self._skinner.vertices(T_world_joint).copy(),
            garments=garments,
            root=T_world_root[:3, 3].copy(),
            heading=float(np.arctan2(facing[1], facing[0])),
        )
