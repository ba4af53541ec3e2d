"""A farthest distance that cloth may be from where it would be as skin.

A sleeve that a limb has got out of, or a shirt that fell over the head in a handstand, does not
come back by itself. Each vertex may be held within some distance of where it would be if it
followed the bones as skin does; within that distance nothing acts on it.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.geometry.jit import kernel
from garment_sim_ros.geometry.transforms import invert_transform, rotate
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.placement import Frames, GarmentLike
from garment_sim_ros.sim.state import ColliderState, State

SingleArray = NDArray[np.float32]
FloatArray = NDArray[np.float64]


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
        # A vertex in the frame of each collider that it follows; constant while it is skin.
        to_collider = frames.T_collider_frame @ invert_transform(garment.T_world_frame_rest)
        T = to_collider[garment.frame_index[vertex]]
        x = np.asarray(garment.vertices, np.float64)[vertex]
        local = np.einsum("nkij,nj->nki", T[..., :3, :3], x) + T[..., :3, 3]
        weight = np.asarray(garment.frame_weight, np.float64)[vertex, :, None]
        self._weighted = np.concatenate([weight * local, weight], axis=2).astype(np.float32)
        self._index = np.ascontiguousarray(garment.frame_index[vertex], np.int32)
        self._collider = frames.collider
        self._T = np.zeros((len(frames.collider), 3, 4), np.float32)
        self._limit = np.asarray(garment.max_distance, np.float32)[vertex]
        self._place = np.full((len(vertex), 3), np.nan, np.float32)

    def forget(self) -> None:
        """What follows does not depend on what was before."""
        self._place.fill(np.nan)

    def hold(self, state: State, colliders: ColliderState, dt: float) -> int:
        """Takes back what has gone too far, and the velocity that leads on.

        Args:
            state: Motion of the garment after a step, changed in place.
            colliders: The colliders in that step.
            dt: The step [s].

        Returns:
            Number of particles held.
        """
        return int(
            hold(
                state.x,
                state.v,
                colliders.end.position,
                colliders.end.orientation,
                colliders.origin,
                self._collider,
                self._T,
                self._index,
                self._weighted,
                self._limit,
                self._place,
                np.float32(dt),
            )
        )


@kernel()
def hold(x, v, position, orientation, origin, collider, T, index, weighted, limit, place, dt):
    """See `Leash.hold`.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        position: World positions of all colliders [m], shape [c, 3].
        orientation: Their unit quaternions, shape [c, 4].
        origin: World position of the local origin [m], shape [3].
        collider: The colliders that the garment rides on, shape [b].
        T: Scratch: their transforms to local coordinates, shape [b, 3, 4].
        index: Those that each particle follows, shape [f, k], f at most n.
        weighted: Its place in the frame of each times its weight [m], and the weight, [f, k, 4].
        limit: How far it may be from where they would take it [m], shape [f].
        place: Where that was at the end of the last step [m], NaN where that is not known,
            changed in place, shape [f, 3].
        dt: Step [s].

    Returns:
        Number of particles held.
    """
    for b in range(collider.size):
        c = collider[b]
        q = orientation[c]
        ex = rotate(q[0], q[1], q[2], q[3], 1.0, 0.0, 0.0)
        ey = rotate(q[0], q[1], q[2], q[3], 0.0, 1.0, 0.0)
        ez = rotate(q[0], q[1], q[2], q[3], 0.0, 0.0, 1.0)
        for i in range(3):
            T[b, i, 0] = ex[i]
            T[b, i, 1] = ey[i]
            T[b, i, 2] = ez[i]
            T[b, i, 3] = position[c, i] - origin[i]
    held = 0
    for p in range(limit.size):
        tx = ty = tz = np.float32(0.0)
        for k in range(index.shape[1]):
            w = weighted[p, k, 3]
            if w == np.float32(0.0):
                continue
            b = index[p, k]
            ax = weighted[p, k, 0]
            ay = weighted[p, k, 1]
            az = weighted[p, k, 2]
            tx += T[b, 0, 0] * ax + T[b, 0, 1] * ay + T[b, 0, 2] * az + T[b, 0, 3] * w
            ty += T[b, 1, 0] * ax + T[b, 1, 1] * ay + T[b, 1, 2] * az + T[b, 1, 3] * w
            tz += T[b, 2, 0] * ax + T[b, 2, 1] * ay + T[b, 2, 2] * az + T[b, 2, 3] * w
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
