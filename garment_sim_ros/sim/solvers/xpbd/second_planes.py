"""Second planes: of the shape that a particle touched before the one that it touches now.

In a crease, where body parts close on cloth, a particle that only one shape is known to touch is
pulled into the other one until the next search, which moves it out there and finds that one only:
it would go back and forth from search to search, for ever. So would one that a search finds a
little above the shape, and that has no plane then. Here the shape touched before is kept, where it
is still near, as a plane that touches it: between two searches, particles meet both.
"""

import numpy as np

from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.sides import OPPOSED, UNDER
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.solvers.xpbd.planes import follow_shapes

_NEAR = np.float32(0.25)
"""How far off a shape is near, in its inscribed radii."""


@lean_kernel(inner=True)
def _other(bodies, planes, second, before, p):
    """The shape that particle p touched before the one that it touches now, -1 for none.

    What the guard keeps has none: it is held by that; nor what shapes press from two sides. What
    passes a garment by is none.
    """
    now = planes.shape[p]
    if bodies.guard.kept[p] >= 0 or (now >= 0 and planes.depth[p] == np.float32(np.inf)):
        return -1
    c = before[p]
    if c < 0 or c == now:
        c = second.shape[p]
    if c < 0 or c == now or bodies.sides.side[c, p] not in (UNDER, OPPOSED):
        return -1
    return c


@lean_kernel(inner=True)
def _touch_from_afar(x, bodies, second, p, c, thickness):
    """Lays the plane of particle p in shape c; returns whether that is near."""
    shapes, posed = bodies.shapes, bodies.posed
    reach = _NEAR * bodies.way.inscribed_radius[c] + thickness
    d, nx, ny, nz = shape_distance(shapes, posed, np.int64(c), x[p, 0], x[p, 1], x[p, 2], reach)
    if not d < reach:
        return False
    gap = max(d - thickness, np.float32(0.0))
    normal, place = second.normal, second.place
    normal[p, 0], normal[p, 1], normal[p, 2] = nx, ny, nz
    for k in range(3):
        place[p, k] = x[p, k] - gap * normal[p, k]
    return True


@lean_kernel(forceinline=True)
def remember_second_planes(x, x_start, bodies, planes, second, before, thickness):
    """Keeps shapes that particles touched before, where they are near.

    Args:
        x: Positions after the search [m], shape [f, 3].
        x_start: Positions at the start of that sub-step [m], shape [f, 3].
        bodies: `Bodies`.
        planes: `Planes`; of them what the search found.
        second: `Planes`, changed in place; their depths stay 0.
        before: Shape that each particle touched before the search, -1 for none, shape [f].
        thickness: Distance to keep from surfaces [m].
    """
    for p in range(before.size):
        c = _other(bodies, planes, second, before, p)
        if c >= 0 and not _touch_from_afar(x, bodies, second, p, c, thickness):
            c = -1
        second.shape[p] = c
    follow_shapes(x_start, second.shape, bodies.posed.carry, second.shift)
