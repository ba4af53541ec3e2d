"""A farthest distance that cloth may be from where it would be as skin.

A sleeve that a limb has got out of, or a shirt that fell over the head in a handstand, does not
come back by itself. Each vertex may be held within some distance of where it would be if it
followed the bones as skin does; within that distance nothing acts on it.
"""

from collections.abc import Callable

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.jit import compiled, kernel
from garment_sim_ros.sim.holds.constraint import SkinLimit
from garment_sim_ros.sim.holds.skin_places import SkinPlaces
from garment_sim_ros.sim.placement import GarmentLike
from garment_sim_ros.sim.state import State, Workspace


class DistanceLimit(SkinLimit):
    """Holds one garment's free particles; see `SkinLimit`."""

    effect = "a farthest distance from skin"

    def __init__(
        self,
        garment: GarmentLike,
        distance: FloatArray,
        places: SkinPlaces,
        workspace: Workspace,
    ) -> None:
        self._places = places
        self._workspace = workspace
        self._limit = places.of(distance)
        self._code: Callable[..., int] | None = None

    def hold(self, state: State, left: float, dt: float) -> int:
        """Takes back what has gone too far, and the velocity that leads on."""
        at, contacts = self._places, self._workspace.contacts
        given = (
            state.x,
            state.v,
            self._workspace.x_start,
            contacts.shape,
            contacts.normal,
            at.place,
            at.velocity,
            np.float32(left),
            np.float32(dt),
            self._limit,
        )
        if self._code is None:
            self._code = compiled(hold, *given)
        return int(self._code(*given))


@kernel()
def hold(x, v, x_start, shape, normal, place, velocity, left, dt, limit):
    """See `DistanceLimit.hold`.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        x_start: Positions before the sub-step [m], shape [n, 3].
        shape: Shape that each particle touches, -1 for none, shape [f].
        normal: Outward normal there, shape [f, 3].
        place: Where each particle would be as skin at the end of the step [m], shape [f, 3], f at
            most n.
        velocity: How fast that moves [m/s], shape [f, 3].
        left: How long it is to the end of the step [s].
        dt: Sub-step [s].
        limit: How far it may be from there [m], shape [f].

    Returns:
        Number of particles held.
    """
    zero = np.float32(0.0)
    held = 0
    for p in range(limit.size):
        px = place[p, 0] - left * velocity[p, 0]
        py = place[p, 1] - left * velocity[p, 1]
        pz = place[p, 2] - left * velocity[p, 2]
        dx = x[p, 0] - px
        dy = x[p, 1] - py
        dz = x[p, 2] - pz
        squared = dx * dx + dy * dy + dz * dz
        if squared > limit[p] * limit[p]:
            held += 1
            shrink = np.float32(1.0) / np.sqrt(squared)
            dx *= shrink
            dy *= shrink
            dz *= shrink
            back = limit[p] - squared * shrink
            bx, by, bz = back * dx, back * dy, back * dz
            if shape[p] >= 0:
                # Along what it touches, not into it.
                into = bx * normal[p, 0] + by * normal[p, 1] + bz * normal[p, 2]
                if into < zero:
                    bx -= into * normal[p, 0]
                    by -= into * normal[p, 1]
                    bz -= into * normal[p, 2]
            x[p, 0] += bx
            x[p, 1] += by
            x[p, 2] += bz
            away = (
                (v[p, 0] - velocity[p, 0]) * dx
                + (v[p, 1] - velocity[p, 1]) * dy
                + (v[p, 2] - velocity[p, 2]) * dz
            )
            if away > zero:
                v[p, 0] -= away * dx
                v[p, 1] -= away * dy
                v[p, 2] -= away * dz
            # What other constraints pull against it gets nowhere, however fast it is there.
            gx, gy, gz = x[p, 0] - x_start[p, 0], x[p, 1] - x_start[p, 1], x[p, 2] - x_start[p, 2]
            speed = v[p, 0] * v[p, 0] + v[p, 1] * v[p, 1] + v[p, 2] * v[p, 2]
            gone = gx * gx + gy * gy + gz * gz
            if speed * dt * dt > gone:
                rate = np.float32(1.0) / dt
                v[p, 0] = rate * gx
                v[p, 1] = rate * gy
                v[p, 2] = rate * gz
    return held
