"""A farthest distance that cloth may be from where it would be as skin.

A sleeve that a limb has got out of, or a shirt that fell over the head in a handstand, does not
come back by itself. Each vertex may be held within some distance of where it would be if it
followed the bones as skin does; within that distance nothing acts on it.
"""

import numpy as np

from garment_sim_ros.geometry.jit import kernel
from garment_sim_ros.sim.constraint import Constraint
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.skin_places import SkinPlaces
from garment_sim_ros.sim.state import ColliderState, State


class Leash(Constraint):
    """Holds one garment's free particles.

    Args:
        garment: The garment; its `max_distance` is not None.
        places: Where its particles would be as skin, followed through each step.
    """

    def __init__(self, garment: GarmentLike, places: SkinPlaces) -> None:
        assert garment.max_distance is not None
        self._places = places
        self._limit = places.of(garment.max_distance)

    def hold(self, state: State, colliders: ColliderState, dt: float) -> int:
        """Takes back what has gone too far, and the velocity that leads on.

        Args:
            state: Motion of the garment after a step, changed in place.
            colliders: The colliders in that step.
            dt: The step [s].

        Returns:
            Number of particles held.
        """
        places = self._places
        return int(hold(state.x, state.v, places.place, places.velocity, self._limit))


@kernel()
def hold(x, v, place, velocity, limit):
    """See `Leash.hold`.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        place: Where each particle would be as skin [m], shape [f, 3], f at most n.
        velocity: How fast that moves [m/s], shape [f, 3].
        limit: How far it may be from there [m], shape [f].

    Returns:
        Number of particles held.
    """
    held = 0
    for p in range(limit.size):
        dx = x[p, 0] - place[p, 0]
        dy = x[p, 1] - place[p, 1]
        dz = x[p, 2] - place[p, 2]
        squared = dx * dx + dy * dy + dz * dz
        if squared > limit[p] * limit[p]:
            held += 1
            shrink = np.float32(1.0) / np.sqrt(squared)
            dx *= shrink
            dy *= shrink
            dz *= shrink
            x[p, 0] = place[p, 0] + limit[p] * dx
            x[p, 1] = place[p, 1] + limit[p] * dy
            x[p, 2] = place[p, 2] + limit[p] * dz
            away = (
                (v[p, 0] - velocity[p, 0]) * dx
                + (v[p, 1] - velocity[p, 1]) * dy
                + (v[p, 2] - velocity[p, 2]) * dz
            )
            if away > np.float32(0.0):
                v[p, 0] -= away * dx
                v[p, 1] -= away * dy
                v[p, 2] -= away * dz
    return held
