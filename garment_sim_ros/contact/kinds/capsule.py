"""The kind ``capsule``: tapered, the convex hull of two spheres, from z = 0 to z = length."""

import numpy as np

from garment_sim_ros.contact.block import DISTANCE, X, Y, Z
from garment_sim_ros.contact.kinds.entries import Entries
from garment_sim_ros.contact.kinds.kind import Core, Geometry, Kind, Shape, Size, Surface, number
from garment_sim_ros.contact.kinds.round_surface import convex_surface, directions
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.jit import lean_kernel

_KEYS = ("radius0", "radius1", "length")


def capsule_size(radius0: float, radius1: float, length: float) -> Size:
    """Packed form of a capsule that runs from z = 0 to z = `length` [m].

    Returns:
        Radius at z = 0, its decrease per length, the length, and by how much the nearest sphere's
        centre lies lower than the point, per distance from the axis.

    Raises:
        GeometryError: A negative or non-finite number.
    """
    values = np.array([radius0, radius1, length], dtype=np.float64)
    if not np.isfinite(values).all() or (values < 0.0).any():
        raise GeometryError(
            f"capsule radii and length must be finite and not negative; found {values.tolist()}"
        )
    if length == 0.0:
        return max(radius0, radius1), 0.0, 0.0, 0.0
    taper = (radius0 - radius1) / length
    # One sphere inside the other: a slope so steep that the larger one is always nearest.
    lean = taper / np.sqrt(1.0 - taper**2) if abs(taper) < 1.0 else np.copysign(1e6, taper)
    return radius0, taper, length, float(lean)


@lean_kernel(inner=True)
def capsule_distance(qx, qy, qz, ax, ay, az, radius0, taper, length, lean, reach):
    """Signed distance to a tapered capsule, exact within `reach`.

    The nearest point belongs to the sphere about ``t`` on the axis, where the cone's normal
    through the point meets it, clamped to the ends.

    Args:
        qx: Point relative to the centre of the end at z = 0 [m].
        qy: Likewise.
        qz: Likewise.
        ax: Unit axis, from that end to the other.
        ay: Likewise.
        az: Likewise.
        radius0: From `capsule_size`, as the next three.
        taper: Decrease of the radius per length.
        length: Length of the axis [m].
        lean: See `capsule_size`.
        reach: Distances above this are not told apart [m].

    Returns:
        Distance [m], negative inside, infinite where above `reach`; and the unit outward direction
        in which it shrinks to 0.
    """
    zero = np.float32(0.0)
    along = qx * ax + qy * ay + qz * az
    squared = qx * qx + qy * qy + qz * qz
    across = max(squared - along * along, zero)
    beyond = along - min(max(along, zero), length)
    farthest = max(radius0, radius0 - taper * length) + reach
    if across + beyond * beyond > farthest * farthest:
        return np.float32(np.inf), ax, ay, az
    t = min(max(along - lean * np.sqrt(across), zero), length)
    radius = radius0 - taper * t
    cx = qx - t * ax
    cy = qy - t * ay
    cz = qz - t * az
    apart = np.sqrt(cx * cx + cy * cy + cz * cz)
    if apart < np.float32(1e-6) * radius:
        # On the axis every direction across it is as good: the one nearest to z, or x.
        if abs(az) < np.float32(0.9):
            scale = np.float32(1.0) / np.sqrt(np.float32(1.0) - az * az)
            return -radius, -az * ax * scale, -az * ay * scale, (np.float32(1.0) - az * az) * scale
        scale = np.float32(1.0) / np.sqrt(np.float32(1.0) - ax * ax)
        return -radius, (np.float32(1.0) - ax * ax) * scale, -ax * ay * scale, -ax * az * scale
    scale = np.float32(1.0) / apart
    return apart - radius, cx * scale, cy * scale, cz * scale


@lean_kernel(inner=True)
def capsule_distances(shapes, posed, k, block, is_capsule):
    """Distances of a block to the capsule that is, or else holds, shape k: to `DISTANCE`."""
    zero = np.float32(0.0)
    cx = posed.bound[k, 0]
    cy = posed.bound[k, 1]
    cz = posed.bound[k, 2]
    ax = posed.bound[k, 3]
    ay = posed.bound[k, 4]
    az = posed.bound[k, 5]
    length = posed.bound[k, 6]
    radius = posed.bound[k, 7]
    taper = lean = zero
    if is_capsule:
        radius = shapes.size[k, 0]
        taper = shapes.size[k, 1]
        lean = shapes.size[k, 3]
    for p in range(BLOCK):
        qx = block[X + p] - cx
        qy = block[Y + p] - cy
        qz = block[Z + p] - cz
        along = qx * ax + qy * ay + qz * az
        across = max(qx * qx + qy * qy + qz * qz - along * along, zero)
        t = along - lean * np.sqrt(across)
        t = zero if t < zero else (length if t > length else t)
        qx -= t * ax
        qy -= t * ay
        qz -= t * az
        block[DISTANCE + p] = np.sqrt(qx * qx + qy * qy + qz * qz) - radius + taper * t


def _parse(entries: Entries) -> dict[str, object]:
    values = {key: entries.number(key, 0.0) for key in _KEYS}
    if max(values["radius0"], values["radius1"]) <= 0.0:
        entries.refuse("radii are both 0; one must be positive")
    return dict(values)


def _numbers(geometry: Geometry) -> tuple[float, float, float]:
    r0, r1, length = (number(geometry, key) for key in _KEYS)
    return r0, r1, length


def _size(geometry: Geometry) -> Size:
    return capsule_size(*_numbers(geometry))


def _bound(geometry: Geometry) -> tuple[float, ...]:
    r0, r1, length = _numbers(geometry)
    return 0.0, 0.0, 0.0, 0.0, 0.0, length, max(r0, r1)


def _thinner(geometry: Geometry) -> float:
    return min(_numbers(geometry)[:2])


def _surface(geometry: Geometry, points: int, finest: float) -> Surface:
    r0, r1, length = _numbers(geometry)
    around = directions(points)
    end = np.array([0.0, 0.0, length])
    return convex_surface(np.concatenate([around * r0, end + around * r1]))


def _core(geometry: Geometry, share: float) -> Core:
    z = _numbers(geometry)[2] * (0.5 + 0.5 * share * np.array([-1.0, 1.0]))
    return Core(z[:, None] * [0.0, 0.0, 1.0], _thinner(geometry))


CAPSULE = Kind(
    name="capsule",
    code=1,
    keys=_KEYS,
    parse=_parse,
    shape=Shape(size=_size, bound=_bound, inscribed_radius=_thinner, surface=_surface, core=_core),
    variants={"capsule": {"radius0": 0.1, "radius1": 0.06, "length": 0.1}},
)
"""Size: see `capsule_size`."""
