"""A farthest distance that cloth may be from where it would be as skin.

A sleeve that a limb has got out of, or a shirt that fell over the head in a handstand, does not
come back by itself. Each vertex may be held within some distance of where it would be if it
followed the bones as skin does; within that distance nothing acts on it.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.geometry.jit import kernel
from garment_sim_ros.geometry.transforms import invert_transform
from garment_sim_ros.sim.kernels.skinned import blended, pose_frames
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.placement import Frames, GarmentLike
from garment_sim_ros.sim.state import ColliderState, State

SingleArray = NDArray[np.float32]
IntArray = NDArray[np.int32]


class Leash:
    """Holds one garment's free particles.

    Args:
        garment: The garment; its `max_distance` is not None.
        frames: The frames that it rides on.
        model: Its particles.
    """

    def __init__(self, garment: GarmentLike, frames: Frames, model: ClothModel) -> None:
        assert garment.max_distance is not None
        vertex = model.vertex[: model.free_count]
        self._index, self._weighted = weighted_places(garment, frames, vertex)
        self._collider = frames.collider
        self._T = np.zeros((len(frames.collider), 3, 4), np.float32)
        self._limit = np.asarray(garment.max_distance, np.float32)[vertex]
        self._place = np.full((len(vertex), 3), np.nan, np.float32)

    def forget(self) -> None:
        """What follows does not depend on what was before."""
        self._place.fill(np.nan)

    def shift(self, by: SingleArray) -> None:
        """The local origin has moved: coordinates change by [m], shape [3]."""
        self._place += by

    def hold(self, state: State, colliders: ColliderState, dt: float) -> int:
        """Takes back what has gone too far, and the velocity that leads on.

        Args:
            state: Motion of the garment after a step, changed in place.
            colliders: The colliders in that step.
            dt: The step [s].

        Returns:
            Number of particles held.
        """
        end = colliders.end
        pose_frames(end.position, end.orientation, colliders.origin, self._collider, self._T)
        rows = self._T, self._index, self._weighted, self._limit, self._place
        return int(hold(state.x, state.v, *rows, np.float32(dt)))


def weighted_places(
    garment: GarmentLike, frames: Frames, vertex: IntArray
) -> tuple[IntArray, SingleArray]:
    """Vertices in the frame of each collider that they follow; constant while they are skin.

    Args:
        garment: The garment.
        frames: The frames that it rides on.
        vertex: The vertices, shape [f].

    Returns:
        Frames of each, shape [f, k]; its place there times its weight [m], and the weight, shape
        [f, k, 4].
    """
    to_collider = frames.T_collider_frame @ invert_transform(garment.T_world_frame_rest)
    T = to_collider[garment.frame_index[vertex]]
    x = np.asarray(garment.vertices, np.float64)[vertex]
    local = np.einsum("nkij,nj->nki", T[..., :3, :3], x) + T[..., :3, 3]
    weight = np.asarray(garment.frame_weight, np.float64)[vertex, :, None]
    weighted = np.concatenate([weight * local, weight], axis=2).astype(np.float32)
    return np.ascontiguousarray(garment.frame_index[vertex], np.int32), weighted


@kernel()
def hold(x, v, T, index, weighted, limit, place, dt):
    """See `Leash.hold`.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        T: Transforms of the frames that the garment rides on, shape [b, 3, 4].
        index: Those that each particle follows, shape [f, k], f at most n.
        weighted: Its place in the frame of each times its weight [m], and the weight, [f, k, 4].
        limit: How far it may be from where they would take it [m], shape [f].
        place: Where that was at the end of the last step [m], NaN where that is not known,
            changed in place, shape [f, 3].
        dt: Step [s].

    Returns:
        Number of particles held.
    """
    held = 0
    for p in range(limit.size):
        tx, ty, tz = blended(T, index[p], weighted[p])
        dx = x[p, 0] - tx
        dy = x[p, 1] - ty
        dz = x[p, 2] - tz
        squared = dx * dx + dy * dy + dz * dz
        if squared > limit[p] * limit[p]:
            held += 1
            shrink = np.float32(1.0) / np.sqrt(squared)
            dx *= shrink
            dy *= shrink
            dz *= shrink
            x[p, 0] = tx + limit[p] * dx
            x[p, 1] = ty + limit[p] * dy
            x[p, 2] = tz + limit[p] * dz
            away = v[p, 0] * dx + v[p, 1] * dy + v[p, 2] * dz
            if place[p, 0] == place[p, 0]:
                away -= (
                    (tx - place[p, 0]) * dx + (ty - place[p, 1]) * dy + (tz - place[p, 2]) * dz
                ) / dt
            if away > np.float32(0.0):
                v[p, 0] -= away * dx
                v[p, 1] -= away * dy
                v[p, 2] -= away * dz
        place[p, 0] = tx
        place[p, 1] = ty
        place[p, 2] = tz
    return held
