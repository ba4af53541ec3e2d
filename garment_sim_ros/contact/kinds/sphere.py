"""The kind ``sphere``: about the origin of its frame."""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.kinds.capsule import capsule_size
from garment_sim_ros.contact.kinds.entries import Entries
from garment_sim_ros.contact.kinds.kind import Geometry, Kind, Shape, Size, Surface, number
from garment_sim_ros.contact.kinds.round_surface import convex_surface, directions
from garment_sim_ros.jit import lean_kernel


@lean_kernel(inner=True)
def sphere_distance(qx, qy, qz, radius, reach):
    """Signed distance to a sphere, equations 5 and 6 of Sun et al. 2007.

    Args:
        qx: Point relative to the centre [m].
        qy: Likewise.
        qz: Likewise.
        radius: Radius [m].
        reach: Distances above this are not told apart [m].

    Returns:
        Distance [m], negative inside, infinite where above `reach`; and the unit outward direction
        in which it shrinks to 0.
    """
    squared = qx * qx + qy * qy + qz * qz
    farthest = radius + reach
    if squared > farthest * farthest:
        return np.float32(np.inf), qx, qy, qz
    length = np.sqrt(squared)
    if length < np.float32(1e-6) * radius:
        return -radius, np.float32(0.0), np.float32(0.0), np.float32(1.0)
    scale = np.float32(1.0) / length
    return length - radius, qx * scale, qy * scale, qz * scale


def _parse(entries: Entries) -> dict[str, object]:
    return {"radius": entries.number("radius", 1e-9), **entries.share()}


def _radius(geometry: Geometry) -> float:
    return number(geometry, "radius")


def _size(geometry: Geometry) -> Size:
    return capsule_size(_radius(geometry), 0.0, 0.0)[0], 0.0, 0.0, 0.0


def _bound(geometry: Geometry) -> tuple[float, ...]:
    return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, _radius(geometry)


def _surface(geometry: Geometry, points: int, finest: float) -> Surface:
    return convex_surface(directions(points) * _radius(geometry))


def _radii(geometry: Geometry) -> FloatArray:
    return np.full(3, _radius(geometry))


SPHERE = Kind(
    name="sphere",
    code=0,
    keys=("radius",),
    optional=("share",),
    parse=_parse,
    shape=Shape(
        size=_size, bound=_bound, inscribed_radius=_radius, surface=_surface, radii=_radii
    ),
    variants={"sphere": {"radius": 0.1}},
)
"""Size: the radius."""
