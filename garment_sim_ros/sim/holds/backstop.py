"""How far cloth may get behind where it would be as skin.

A common limit of cloth in games: a plane across the normal that the garment would have there as
skin, some distance behind the place. Where colliders leave a gap, or bend away from the skin,
cloth stays outside all the same.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.holds.constraint import SkinLimit
from garment_sim_ros.sim.holds.skin_places import SkinPlaces
from garment_sim_ros.sim.holds.skinned import blended
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.state import State, Workspace


class Backstop(SkinLimit):
    """Holds one garment's free particles; see `SkinLimit`."""

    effect = "a farthest distance behind skin"
    holds_what_is_shown = True

    def __init__(
        self,
        garment: GarmentLike,
        distance: FloatArray,
        places: SkinPlaces,
        workspace: Workspace,
    ) -> None:
        self._places = places
        x = np.asarray(garment.vertices, np.float64)
        normal = np.empty_like(x)
        vertex_normals(x, garment.triangles, normal)
        self._normal = places.carried(normal, 0.0)
        self._distance = places.of(distance)

    def hold(self, state: State, left: float, dt: float) -> int:
        """Takes forward what has gone too far back, and the velocity that leads on.

        Normals are those of the end of the step.
        """
        at = self._places
        back = np.float32(left)
        normals = at.T, at.index, self._normal
        return int(hold(state.x, state.v, at.place, at.velocity, back, *normals, self._distance))


@kernel()
def hold(x, v, place, velocity, left, T, index, normal, distance):
    """See `Backstop.hold`.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        place: Where each particle would be as skin at the end of the step [m], shape [f, 3], f at
            most n.
        velocity: How fast that moves [m/s], shape [f, 3].
        left: How long it is to the end of the step [s].
        T: Transforms of the frames that the garment follows, shape [b, 3, 4].
        index: Those that each particle follows, shape [f, k].
        normal: Its normal as skin in each, see `holds.skinned.blended`, shape [f, k, 4].
        distance: How far behind it may be [m], shape [f].

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
        short = (
            (place[p, 0] - left * velocity[p, 0] - x[p, 0]) * nx
            + (place[p, 1] - left * velocity[p, 1] - x[p, 1]) * ny
            + (place[p, 2] - left * velocity[p, 2] - x[p, 2]) * nz
            - distance[p]
        )
        if short > np.float32(0.0):
            held += 1
            x[p, 0] += short * nx
            x[p, 1] += short * ny
            x[p, 2] += short * nz
            back = (
                (v[p, 0] - velocity[p, 0]) * nx
                + (v[p, 1] - velocity[p, 1]) * ny
                + (v[p, 2] - velocity[p, 2]) * nz
            )
            if back < np.float32(0.0):
                v[p, 0] -= back * nx
                v[p, 1] -= back * ny
                v[p, 2] -= back * nz
    return held
