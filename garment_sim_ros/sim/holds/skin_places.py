"""Where a garment's free particles would be if they followed the bones as skin does."""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.geometry.transforms import invert_transform
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.holds.skinned import blended, pose_frames
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.placement import Frames, GarmentLike


class SkinPlaces:
    """The places of one garment's free particles, of which there are f.

    Args:
        garment: The garment.
        frames: The b frames that it follows.
        model: Its particles.

    Attributes:
        T: Transforms of the frames to local coordinates, as last followed, shape [b, 3, 4].
        index: Frames that each particle follows, shape [f, k].
        place: Where they would take it, as last followed [m]; NaN before that, shape [f, 3].
        velocity: How fast that moved in the step followed [m/s]; zero in the first one after the
            garment was put somewhere, shape [f, 3].
    """

    def __init__(self, garment: GarmentLike, frames: Frames, model: ClothModel) -> None:
        self._vertex = model.vertex[: model.free_count]
        self._to_collider = frames.T_collider_frame @ invert_transform(garment.T_world_frame_rest)
        self._weight = np.asarray(garment.frame_weight, np.float64)[self._vertex]
        self._collider = frames.collider
        self.T = np.zeros((len(frames.collider), 3, 4), np.float32)
        self.index = np.ascontiguousarray(garment.frame_index[self._vertex], np.int32)
        self._weighted = self.carried(garment.vertices, 1.0)
        self.place = np.full((len(self._vertex), 3), np.nan, np.float32)
        self.velocity = np.zeros_like(self.place)

    def carried(self, a: NDArray[np.floating], w: float) -> SingleArray:
        """Something of each vertex in the frames that it follows; constant while it is skin.

        Args:
            a: Points [m] or directions of all vertices at rest in world space, shape [v, 3].
            w: 1 for points, 0 for directions.

        Returns:
            Coordinates times weight, and w times weight, for `holds.skinned.blended`, shape
            [f, k, 4].
        """
        T = self._to_collider[self.index]
        own = np.asarray(a, np.float64)[self._vertex]
        local = np.einsum("nkij,nj->nki", T[..., :3, :3], own) + w * T[..., :3, 3]
        weight = self._weight[..., None]
        return np.concatenate([weight * local, w * weight], axis=2).astype(np.float32)

    def of(self, values: NDArray[np.floating]) -> SingleArray:
        """A value of each vertex, shape [v], as one of each particle, shape [f]."""
        return np.asarray(values, np.float32)[self._vertex]

    def forget(self) -> None:
        """What follows does not depend on what was before."""
        self.place.fill(np.nan)

    def shift(self, by: SingleArray) -> None:
        """The local origin has moved: coordinates change by [m], shape [3]."""
        self.place += by

    def follow(self, colliders: ColliderState, dt: float) -> None:
        """Follows the colliders through a step of dt [s]."""
        end = colliders.end
        pose_frames(end.position, end.orientation, colliders.origin, self._collider, self.T)
        follow(self.T, self.index, self._weighted, self.place, self.velocity, np.float32(dt))


@kernel()
def follow(T, index, weighted, place, velocity, dt):
    """Places as skin at the end of a step, and how fast they moved in it.

    Args:
        T: Transforms of the frames, shape [b, 3, 4].
        index: Those that each particle follows, shape [f, k].
        weighted: Its place in each, see `blended`, shape [f, k, 4].
        place: Places at the end of the last step [m], NaN where not known; output, shape [f, 3].
        velocity: Output; zero where the place was not known [m/s], shape [f, 3].
        dt: Step [s].
    """
    per_second = np.float32(1.0) / dt
    for p in range(place.shape[0]):
        to = blended(T, index[p], weighted[p])
        is_known = place[p, 0] == place[p, 0]
        for i in range(3):
            velocity[p, i] = (to[i] - place[p, i]) * per_second if is_known else np.float32(0.0)
            place[p, i] = to[i]
