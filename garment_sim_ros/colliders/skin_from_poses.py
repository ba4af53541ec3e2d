"""The posed skin of a body of which only the world poses of its colliders are known.

A bone's place is that of a collider that is fixed to it. A bone without one goes with the next
bone above it that has one, or below it where none above has, as if the joints between were as in
rest pose: with the shapes that are fitted by default these are fingers, toes and face.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.transforms import invert_transform, transform_from


class SkinFromPoses:
    """Poses a body's skin.

    Args:
        colliders: The set whose poses are known.
        body: The body that it was fitted to.

    Raises:
        GeometryError: No collider is fixed to a bone of the body.
    """

    def __init__(self, colliders: ColliderSet, body: Body) -> None:
        rig = body.rig
        carrier: dict[int, int] = {}
        for i, c in enumerate(colliders.colliders):
            if c.bone in rig.joint_names and "share" not in c.geometry:
                carrier.setdefault(rig.index(c.bone), i)
        if not carrier:
            raise GeometryError("no collider is fixed to a bone of the body")
        found = np.array([j if j in carrier else -1 for j in range(len(rig.joint_names))])
        for j, above in enumerate(rig.parent):  # parents come first
            if found[j] < 0 and above >= 0:
                found[j] = found[above]
        for j in range(len(found) - 1, -1, -1):
            above = int(rig.parent[j])
            if above >= 0 and found[above] < 0:
                found[above] = found[j]
        found[found < 0] = next(iter(carrier))
        rest = rest_transforms(rig)
        self._carrier = np.array([carrier[int(j)] for j in found])
        fixed = [colliders.colliders[i] for i in self._carrier]
        T_bone_collider = transform_from(
            np.array([c.position for c in fixed], np.float64),
            np.array([c.orientation for c in fixed], np.float64),
        )
        T_carrying_joint = invert_transform(rest[found]) @ rest
        self._T_collider_joint = invert_transform(T_bone_collider) @ T_carrying_joint
        self._skinner = Skinner.of(body)

    def joints(self, poses: ColliderPoses) -> FloatArray:
        """World transforms of the rig's joints, shape [n, 4, 4]."""
        carried = transform_from(poses.position[self._carrier], poses.orientation[self._carrier])
        T_world_joint: FloatArray = carried @ self._T_collider_joint
        return T_world_joint

    def vertices(self, poses: ColliderPoses) -> FloatArray:
        """Skin vertices in the world [m], shape [v, 3]; the next call overwrites them."""
        return self._skinner.vertices(self.joints(poses))
