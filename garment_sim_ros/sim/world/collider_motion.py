"""Where the colliders are in each step, about a local origin that follows them."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import MessageError
from garment_sim_ros.geometry.transforms import interpolate_poses
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.colliders import ColliderState

_FARTHEST_ORIGIN = 1.0
"""The local origin follows when the body is farther away than this [m]."""
_WORLD_SIZE = 1e6
"""Largest coordinate of a collider that is believed [m]."""
_OFF_UNIT = 1e-3
"""How much longer or shorter than 1 a quaternion may be."""


@kernel()
def usable(position, orientation, farthest, off_unit):
    """Whether positions [n, 3] are `farthest` at most, and quaternions [n, 4] about 1 long.

    Comparisons with NaN are false.
    """
    good = True
    for i in range(position.shape[0]):
        for k in range(3):
            good &= abs(position[i, k]) <= farthest
        squared = 0.0
        for k in range(4):
            squared += orientation[i, k] * orientation[i, k]
        good &= abs(np.sqrt(squared) - 1.0) <= off_unit
    return good


class ColliderMotion:
    """Poses of a collider set, step by step.

    Args:
        colliders: The set.
        T_world_rest: Its rest, see `contact.packed.pack`.

    Attributes:
        state: The colliders during one step.

    Raises:
        GeometryError: A collider that nothing can touch.
    """

    def __init__(
        self,
        colliders: ColliderSet,
        T_world_rest: FloatArray | None = None,
    ) -> None:
        self._set = colliders
        self._shift = np.zeros(3, np.float32)
        self.state = ColliderState.of(colliders, T_world_rest)

    def check(self, *of_all: ColliderPoses) -> None:
        """Whether all of these poses can be used.

        Raises:
            MessageError: They cannot; the reason is named.
        """
        n = len(self._set)
        for poses in of_all:
            if poses.position.shape != (n, 3) or poses.orientation.shape != (n, 4):
                raise MessageError(
                    "pose_count",
                    f"found positions of shape {poses.position.shape} and orientations of shape "
                    f"{poses.orientation.shape}; the collider set has {n} colliders",
                )
            if not usable(poses.position, poses.orientation, _WORLD_SIZE, _OFF_UNIT):
                self._refuse(poses)

    def _refuse(self, poses: ColliderPoses) -> None:
        """Names what is wrong with poses of the right number."""
        if not (np.isfinite(poses.position).all() and np.isfinite(poses.orientation).all()):
            raise MessageError("poses_not_finite", "found NaN or infinity in collider poses")
        if np.abs(poses.position).max() > _WORLD_SIZE:
            raise MessageError(
                "pose_too_far",
                f"found a coordinate of {np.abs(poses.position).max():.4g} m; up to "
                f"{_WORLD_SIZE:g} m is allowed",
            )
        norm = np.linalg.norm(poses.orientation, axis=1)
        worst = int(np.argmax(np.abs(norm - 1.0)))
        raise MessageError(
            "orientation_not_unit",
            f"collider {self._set.colliders[worst].name!r} has an orientation of "
            f"length {norm[worst]:.4g}; 1 is allowed",
        )

    def stand(self, poses: ColliderPoses) -> None:
        """Colliders stand still, and the local origin is in their middle."""
        self.state.origin[:] = poses.position.mean(axis=0) if len(poses.position) else 0.0
        self.state.refit.forget()
        self.interpolate(poses, poses, 0.0, 1.0)

    def follow(self, poses: ColliderPoses) -> SingleArray | None:
        """Moves the local origin after the body.

        Returns:
            What local coordinates change by [m], shape [3]; None if the origin stays.
        """
        if not len(poses.position):
            return None
        away = poses.position.mean(axis=0) - self.state.origin
        if np.abs(away).max() < _FARTHEST_ORIGIN:
            return None
        # Whole multiples of 1/4 m: subtracting them hardly rounds a float32 coordinate.
        away = np.round(away * 4.0) / 4.0
        self.state.origin += away
        self._shift[:] = -away
        return self._shift

    def interpolate(self, start: ColliderPoses, end: ColliderPoses, s0: float, s1: float) -> None:
        """Poses colliders for a step that takes place between s0 and s1 of the way."""
        c = self.state
        for s, pose_at in ((s0, c.start), (s1, c.end)):
            interpolate_poses(
                start.position,
                start.orientation,
                end.position,
                end.orientation,
                s,
                pose_at.position,
                pose_at.orientation,
            )
        c.pose()
