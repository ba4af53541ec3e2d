"""How far cloth may get behind where it would be as skin.

A common limit of cloth in games: a plane across the normal that the garment would have there as
skin, some distance behind the place. Where colliders leave a gap, or bend away from the skin,
cloth stays outside all the same.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.geometry.jit import kernel
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.geometry.transforms import invert_transform
from garment_sim_ros.sim.kernels.skinned import blended, pose_frames
from garment_sim_ros.sim.leash import weighted_places
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.placement import Frames, GarmentLike
from garment_sim_ros.sim.state import ColliderState, State

SingleArray = NDArray[np.float32]


class Backstop:
    """Holds one garment's free particles.

    Args:
        garment: The garment; its `backstop` is not None.
        frames: The frames that it rides on.
        model: Its particles.
    """

    def __init__(self, garment: GarmentLike, frames: Frames, model: ClothModel) -> None:
        assert garment.backstop is not None
        vertex = model.vertex[: model.free_count]
        self._index, self._place = weighted_places(garment, frames, vertex)
        x = np.asarray(garment.vertices, np.float64)
        normal = np.empty_like(x)
        vertex_normals(x, garment.triangles, normal)
        turn = (frames.T_collider_frame @ invert_transform(garment.T_world_frame_rest))[
            garment.frame_index[vertex], :3, :3
        ]
        weight = np.asarray(garment.frame_weight, np.float64)[vertex]
        self._normal = np.zeros_like(self._place)
        self._normal[..., :3] = np.einsum("nk,nkij,nj->nki", weight, turn, normal[vertex])
        self._collider = frames.collider
        self._T = np.zeros((len(frames.collider), 3, 4), np.float32)
        self._distance = np.asarray(garment.backstop, np.float32)[vertex]
        self._before = np.full((len(vertex), 3), np.nan, np.float32)

    def forget(self) -> None:
        """What follows does not depend on what was before."""
        self._before.fill(np.nan)

    def shift(self, by: SingleArray) -> None:
        """The local origin has moved: coordinates change by [m], shape [3]."""
        self._before += by

    def hold(self, state: State, colliders: ColliderState, dt: float) -> int:
        """Takes forward what has gone too far back, and the velocity that leads on.

        Args:
            state: Motion of the garment after a step, changed in place.
            colliders: The colliders in that step.
            dt: The step [s].

        Returns:
            Number of particles held.
        """
        end = colliders.end
        pose_frames(end.position, end.orientation, colliders.origin, self._collider, self._T)
        rows = self._T, self._index, self._place, self._normal, self._distance, self._before
        return int(hold(state.x, state.v, *rows, np.float32(dt)))


@kernel()
def hold(x, v, T, index, place, normal, distance, before, dt):
    """See `Backstop.hold`.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        T: Transforms of the frames that the garment rides on, shape [b, 3, 4].
        index: Those that each particle follows, shape [f, k], f at most n.
        place: Its place as skin in each, see `kernels.skinned.blended`, shape [f, k, 4].
        normal: Its normal likewise, shape [f, k, 4].
        distance: How far behind it may be [m], shape [f].
        before: Its place at the end of the last step [m], NaN where that is not known, changed in
            place, shape [f, 3].
        dt: Step [s].

    Returns:
        Number of particles held.
    """
    held = 0
    for p in range(distance.size):
        nx, ny, nz = blended(T, index[p], normal[p])
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if not length > np.float32(1e-6):
            continue  # frames turned against each other: no side is behind
        nx /= length
        ny /= length
        nz /= length
        tx, ty, tz = blended(T, index[p], place[p])
        short = (tx - x[p, 0]) * nx + (ty - x[p, 1]) * ny + (tz - x[p, 2]) * nz - distance[p]
        if short > np.float32(0.0):
            held += 1
            x[p, 0] += short * nx
            x[p, 1] += short * ny
            x[p, 2] += short * nz
            back = v[p, 0] * nx + v[p, 1] * ny + v[p, 2] * nz
            if before[p, 0] == before[p, 0]:
                back -= (
                    (tx - before[p, 0]) * nx + (ty - before[p, 1]) * ny + (tz - before[p, 2]) * nz
                ) / dt
            if back < np.float32(0.0):
                v[p, 0] -= back * nx
                v[p, 1] -= back * ny
                v[p, 2] -= back * nz
        before[p, 0] = tx
        before[p, 1] = ty
        before[p, 2] = tz
    return held
