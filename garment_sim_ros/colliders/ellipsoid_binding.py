"""Ellipsoids on a moving body (the future work that Gong et al. name).

Every ellipsoid rides on the bone that carries most of its skin. One at a joint, whose skin several
bones share, does not fit once the joint bends; `refitted` finds the smallest ellipsoid around its
vertices where they are in a pose. That takes longer than a frame: nodes carry ellipsoids on one
bone each, and refitting tells what that costs in accuracy.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.ellipsoids import EllipsoidFit
from garment_sim_ros.geometry.ellipsoid_poses import PosedEllipsoids
from garment_sim_ros.geometry.mvee import mvee

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

_SHARED = 0.8
"""An ellipsoid of which no bone carries this share lies at a joint."""
_TOLERANCE = 0.03
"""Of refitted volumes; they hold their points in any case."""


class EllipsoidBinding:
    """Carries fitted ellipsoids on a rig.

    Args:
        fit: The ellipsoids in the bind pose.
        body: The body they were fitted to.

    Attributes:
        at_joint: Indices of the ellipsoids that several bones carry, shape [j].
    """

    def __init__(self, fit: EllipsoidFit, body: Body) -> None:
        skin = body.skin
        self._skin = skin
        self._members = fit.members
        count, bones = len(fit.ellipsoids), len(skin.T_bone_bind)
        share = np.zeros((count, bones))
        for i, m in enumerate(fit.members):
            np.add.at(share[i], skin.bone[m].ravel(), skin.weight[m].ravel() / len(m))
        self._share = share
        self._bone = share.argmax(axis=1)
        self.at_joint: IntArray = np.flatnonzero(share.max(axis=1) < _SHARED).astype(np.int32)
        posed = fit.posed()
        self._centre, self._axes, self._radii = posed.centre, posed.axes, posed.radii

    def static(self, T_world_joint: FloatArray) -> PosedEllipsoids:
        """Each on its one bone; transforms of the rig's joints have shape [n, 4, 4]."""
        motion = (T_world_joint @ self._skin.T_bone_bind)[self._bone]
        R = motion[:, :3, :3]
        centre = np.einsum("kij,kj->ki", R, self._centre) + motion[:, :3, 3]
        return PosedEllipsoids(centre, R @ self._axes, self._radii.copy())

    def refitted(
        self, T_world_joint: FloatArray, x_world: FloatArray | None = None
    ) -> PosedEllipsoids:
        """As `static`, but at joints around the skin in this pose.

        Args:
            T_world_joint: World transforms of the rig's joints, shape [n, 4, 4].
            x_world: The posed skin where it is at hand [m], shape [v, 3]; linear blend skinning of
                the vertices at joints otherwise.
        """
        posed = self.static(T_world_joint)
        motion = T_world_joint @ self._skin.T_bone_bind
        for k in self.at_joint:
            m = self._members[k]
            if x_world is not None:
                points = x_world[m]
            else:
                bone, weight = self._skin.bone[m], self._skin.weight[m]
                T = np.einsum("vk,vkij->vij", weight, motion[bone])
                points = np.einsum("vij,vj->vi", T[:, :3, :3], self._skin.vertices[m])
                points = points + T[:, :3, 3]
            e = mvee(points, tolerance=_TOLERANCE)
            posed.centre[k], posed.axes[k], posed.radii[k] = e.centre, e.axes, e.radii
        return posed


def distance_outside(posed: PosedEllipsoids, points: FloatArray) -> FloatArray:
    """How far points stick out of the union, to first order; 0 inside [m], shape [n]."""
    best = np.full(len(points), np.inf)
    for centre, axes, radii in zip(posed.centre, posed.axes, posed.radii):
        local = (points - centre) @ axes
        inverse = 1.0 / radii
        zeta = ((local * inverse) ** 2).sum(axis=1)
        root = np.sqrt(zeta)
        # (|q| - 1) |q| / |gradient| is the distance to first order.
        gradient = np.sqrt(((local * inverse**2) ** 2).sum(axis=1))
        away = (root - 1.0) * root / np.maximum(gradient, 1e-12)
        best = np.minimum(best, np.where(zeta > 1.0, away, 0.0))
    return best
