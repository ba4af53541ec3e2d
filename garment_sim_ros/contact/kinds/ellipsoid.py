"""The kind ``ellipsoid``: its axes along those of its frame.

The nearest point to p has the coordinates ``r_i^2 p_i / (t + r_i^2)``, where t is the largest root
of ``sum (r_i p_i / (t + r_i^2))^2 = 1`` (Eberly, "Distance from a point to an ellipse, an
ellipsoid, or a hyperellipsoid"). The square root of the sum is nearly a hyperbola in t, so
Newton's method on its inverse (as in More & Sorensen 1983 for trust regions) needs few steps, all
from one side.
"""

import math

import numpy as np
from numba import types
from numba.extending import overload

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.block import DISTANCE, X, Y, Z, higher
from garment_sim_ros.contact.kinds.entries import Entries
from garment_sim_ros.contact.kinds.kind import (
    Core,
    Geometry,
    Kind,
    Own,
    Shape,
    Size,
    Surface,
    numbers,
)
from garment_sim_ros.contact.kinds.round_surface import convex_surface, directions
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.jit import lean_kernel

_STEPS = 12
_NUDGE = 1e-4
"""Points closer to a plane of symmetry than this share of the radius are taken to be off it."""
REFITTED = "refitted ellipsoid"
"""The variant that is fitted again in every pose, see `contact.ellipsoid_refit`."""
REFIT_KEYS = ("frames", "points", "weights", "inflation")
"""Geometry entries of such an ellipsoid: indices of the set's frames that carry it, shape [b]; its
points in each of these frames [m], shape [b, n, 3]; their weights, shape [b, n]; and what is added
to the radii around them [m]."""


def ellipsoid_size(radii: object) -> Size:
    """Size numbers of an ellipsoid: the radii along x, y and z [m], and zero.

    Raises:
        GeometryError: Not three positive finite numbers.
    """
    array = np.asarray(radii, dtype=np.float64)
    if array.shape != (3,) or not (np.isfinite(array).all() and (array > 0.0).all()):
        raise GeometryError("radii must be three positive numbers")
    return float(array[0]), float(array[1]), float(array[2]), 0.0


def ellipsoid_bound(radii: tuple[float, ...]) -> tuple[float, ...]:
    """A capsule that holds an ellipsoid, in its frame: start, end and radius [m]."""
    axis = int(np.argmax(radii[:3]))
    longest = radii[axis]
    radius = max(r for i, r in enumerate(radii[:3]) if i != axis)
    end = np.zeros(3)
    end[axis] = longest - radius
    return (*(-end).tolist(), *end.tolist(), radius)


@lean_kernel(forceinline=True)
def nearest_on_ellipsoid(px, py, pz, rx, ry, rz):
    """The point of the surface nearest to p, in the ellipsoid's frame.

    Returns:
        The point, and the unit normal there.
    """
    # Literals are float64, and so would be all that follows.
    one = np.float32(1.0)
    zero = np.float32(0.0)
    nudge = np.float32(_NUDGE)
    ax = max(abs(px), rx * nudge)
    ay = max(abs(py), ry * nudge)
    az = max(abs(pz), rz * nudge)
    x2 = rx * rx
    y2 = ry * ry
    z2 = rz * rz
    ux = rx * ax
    uy = ry * ay
    uz = rz * az
    # The root is not below any value at which one term alone is 1. The guess is the distance to
    # first order, good near the surface; from above the root, the first step passes it.
    lowest = max(ux - x2, uy - y2, uz - z2)
    ex = ax / x2
    ey = ay / y2
    ez = az / z2
    total = ax * ex + ay * ey + az * ez
    t = max(lowest, (total - np.sqrt(total)) / (ex * ex + ey * ey + ez * ez))
    for _ in range(_STEPS):
        dx = t + x2
        dy = t + y2
        dz = t + z2
        ex = ux / dx
        ey = uy / dy
        ez = uz / dz
        ex *= ex
        ey *= ey
        ez *= ez
        total = ex + ey + ez
        length = np.sqrt(total)
        step = (length - one) * total / (ex / dx + ey / dy + ez / dz)
        t = max(lowest, t + step)
        if abs(length - one) < np.float32(3e-4):  # squared by the step just made
            break
    gx = ax / (t + x2)
    gy = ay / (t + y2)
    gz = az / (t + z2)
    # Radially onto the surface, for what the last step has left.
    k = one / np.sqrt(gx * gx * x2 + gy * gy * y2 + gz * gz * z2)
    gx = gx * k if px >= zero else -gx * k
    gy = gy * k if py >= zero else -gy * k
    gz = gz * k if pz >= zero else -gz * k
    n = one / np.sqrt(gx * gx + gy * gy + gz * gz)
    return gx * x2, gy * y2, gz * z2, gx * n, gy * n, gz * n


@lean_kernel(inner=True)
def ellipsoid_distance(shapes, posed, k, qx, qy, qz, reach):
    """Signed distance to shape k, an ellipsoid, infinite above `reach`, and the unit way out.

    Args:
        shapes: Packed shapes with ellipsoids.
        posed: The same, posed.
        k: Which one.
        qx: Point relative to the centre [m].
        qy: See `qx`.
        qz: See `qx`.
        reach: Distances above this need not be known [m].
    """
    rx, ry, rz = shapes.radii[k, 0], shapes.radii[k, 1], shapes.radii[k, 2]
    r00, r01, r02 = posed.rotation[k, 0, 0], posed.rotation[k, 0, 1], posed.rotation[k, 0, 2]
    r10, r11, r12 = posed.rotation[k, 1, 0], posed.rotation[k, 1, 1], posed.rotation[k, 1, 2]
    r20, r21, r22 = posed.rotation[k, 2, 0], posed.rotation[k, 2, 1], posed.rotation[k, 2, 2]
    px = r00 * qx + r10 * qy + r20 * qz
    py = r01 * qx + r11 * qy + r21 * qz
    pz = r02 * qx + r12 * qy + r22 * qz
    zeta = (px / rx) ** 2 + (py / ry) ** 2 + (pz / rz) ** 2
    away = reach / min(rx, ry, rz) + np.float32(1.0)
    if away > np.float32(0.0) and zeta > away * away:
        return np.float32(np.inf), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    sx, sy, sz, nx, ny, nz = nearest_on_ellipsoid(px, py, pz, rx, ry, rz)
    distance = (px - sx) * nx + (py - sy) * ny + (pz - sz) * nz
    return (
        np.float32(distance),
        np.float32(r00 * nx + r01 * ny + r02 * nz),
        np.float32(r10 * nx + r11 * ny + r12 * nz),
        np.float32(r20 * nx + r21 * ny + r22 * nz),
    )


def ellipsoid_distance_if_any(shapes, posed, k, qx, qy, qz, reach):
    """As `ellipsoid_distance`; infinite, at no cost, where ``shapes.radii`` is None."""
    if shapes.radii is None:
        return np.float32(np.inf), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    return ellipsoid_distance(shapes, posed, k, qx, qy, qz, reach)


@overload(ellipsoid_distance_if_any, inline="always")
def _compiled_ellipsoid_distance_if_any(shapes, posed, k, qx, qy, qz, reach):
    # Decided by type, as for hulls.
    if isinstance(shapes.types[shapes.fields.index("radii")], types.NoneType):
        return lambda shapes, posed, k, qx, qy, qz, reach: (
            np.float32(np.inf),
            np.float32(0.0),
            np.float32(0.0),
            np.float32(0.0),
        )
    return lambda shapes, posed, k, qx, qy, qz, reach: ellipsoid_distance(
        shapes, posed, k, qx, qy, qz, reach
    )


@lean_kernel()
def ellipsoid_distances(shapes, posed, k, block):
    """Raises the lower bounds in `DISTANCE` that shape k, an ellipsoid, has of its capsule.

    Scaled to a unit ball, a point at s from its centre is |s - 1| from it. No direction is
    scaled to less than the shortest radius, nor to more than the longest.
    """
    one = np.float32(1.0)
    cx = posed.centre[k, 0]
    cy = posed.centre[k, 1]
    cz = posed.centre[k, 2]
    rx = shapes.radii[k, 0]
    ry = shapes.radii[k, 1]
    rz = shapes.radii[k, 2]
    shortest = min(rx, ry, rz)
    longest = max(rx, ry, rz)
    u0 = posed.rotation[k, 0, 0] / rx
    u1 = posed.rotation[k, 1, 0] / rx
    u2 = posed.rotation[k, 2, 0] / rx
    v0 = posed.rotation[k, 0, 1] / ry
    v1 = posed.rotation[k, 1, 1] / ry
    v2 = posed.rotation[k, 2, 1] / ry
    w0 = posed.rotation[k, 0, 2] / rz
    w1 = posed.rotation[k, 1, 2] / rz
    w2 = posed.rotation[k, 2, 2] / rz
    for p in range(BLOCK):
        qx = block[X + p] - cx
        qy = block[Y + p] - cy
        qz = block[Z + p] - cz
        u = u0 * qx + u1 * qy + u2 * qz
        v = v0 * qx + v1 * qy + v2 * qz
        w = w0 * qx + w1 * qy + w2 * qz
        over = np.sqrt(u * u + v * v + w * w) - one
        bound = over * (shortest if over > np.float32(0.0) else longest)
        block[DISTANCE + p] = higher(block[DISTANCE + p], bound)


def ellipsoid_distances_if_any(shapes, posed, k, block):
    """As `ellipsoid_distances`; nothing where ``shapes.radii`` is None."""
    if shapes.radii is not None:
        ellipsoid_distances(shapes, posed, k, block)


@overload(ellipsoid_distances_if_any, inline="always")
def _compiled_ellipsoid_distances_if_any(shapes, posed, k, block):
    if isinstance(shapes.types[shapes.fields.index("radii")], types.NoneType):
        return lambda shapes, posed, k, block: None
    return lambda shapes, posed, k, block: ellipsoid_distances(shapes, posed, k, block)


def _parse(entries: Entries) -> dict[str, object]:
    radii = entries.vector("radii", 3)
    if radii.min() <= 0.0:
        entries.refuse("radii must be positive")
    if "points" in entries:
        entries.only(("radii", *REFIT_KEYS))
    return {"radii": radii, **{k: entries.array(k) for k in REFIT_KEYS if k in entries}}


def _radii(geometry: Geometry) -> FloatArray:
    return numbers(geometry, "radii")


def _size(geometry: Geometry) -> Size:
    return ellipsoid_size(geometry["radii"])


def _bound(geometry: Geometry) -> tuple[float, ...]:
    return ellipsoid_bound(_size(geometry))


def _shortest(geometry: Geometry) -> float:
    return float(_radii(geometry).min())


def _surface(geometry: Geometry, points: int, finest: float) -> Surface:
    return convex_surface(directions(points) * _radii(geometry))


def _core(geometry: Geometry, share: float) -> Core:
    radii = _radii(geometry)
    longest, shortest = float(radii.max()), float(radii.min())
    end = share * longest
    half = end * np.eye(3)[int(radii.argmax())]
    # The ends are the nearest to the surface: across, or along the axis where the tip is nearer.
    flat = longest**2 - shortest**2
    across = end * longest < flat
    depth = shortest * math.sqrt(1.0 - end**2 / flat) if across else longest - end
    return Core(np.stack([-half, half]), depth)


def _arrays(own: Own) -> tuple[SingleArray, None]:
    return own.size[:, :3].copy(), None


def _variant(geometry: Geometry) -> str:
    return REFITTED if "points" in geometry else "ellipsoid"


ELLIPSOID = Kind(
    name="ellipsoid",
    code=2,
    keys=("radii",),
    optional=REFIT_KEYS,
    parse=_parse,
    shape=Shape(
        size=_size,
        bound=_bound,
        inscribed_radius=_shortest,
        surface=_surface,
        table="radii",
        arrays=_arrays,
        core=_core,
        radii=_radii,
    ),
    variants={
        "ellipsoid": {"radii": np.array([0.1, 0.06, 0.08])},
        REFITTED: {
            "radii": np.full(3, 0.1),
            "frames": np.zeros(1, np.int64),
            "points": 0.1 * np.array([np.indices((2, 2, 2)).reshape(3, -1).T - 0.5]),
            "weights": np.ones((1, 8)),
            "inflation": 0.001,
        },
    },
    variant=_variant,
)
"""Size: the radii along x, y and z."""
