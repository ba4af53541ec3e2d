"""The compiled kernels again, in float64 and one particle at a time: what they must agree with.

Written for reading, not for speed; nothing but tests runs this.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.shapes import Collider
from garment_sim_ros.geometry.transforms import matrix_from_quaternion

Shape = tuple[Collider, FloatArray, FloatArray]
"""A collider with the world position [3] and rotation matrix [3, 3] of its frame."""


def correct_springs(
    x: FloatArray,
    springs: NDArray[np.int32],
    rest_length: FloatArray,
    inverse_mass: FloatArray,
    sweeps: int,
) -> FloatArray:
    """Positions [n, 3] after `sweeps` passes over springs [m, 2], equations 2 and 3."""
    x = np.array(x, dtype=np.float64)
    for _ in range(sweeps):
        for (i, j), rest in zip(springs, rest_length):
            apart = x[i] - x[j]
            length = np.linalg.norm(apart)
            if length == 0.0:
                continue
            excess = apart / length * (length - rest)
            total = inverse_mass[i] + inverse_mass[j]
            x[i] -= inverse_mass[i] / total * excess
            x[j] += inverse_mass[j] / total * excess
    return x


def predict(
    x: FloatArray,
    v: FloatArray,
    acceleration: FloatArray,
    damping: float,
    drag: float,
    wind: FloatArray,
    dt: float,
) -> tuple[FloatArray, FloatArray]:
    """Positions and velocities after outer forces; rates in 1/s, taken at the end of the step."""
    v = np.array(v, dtype=np.float64)
    for i in range(len(v)):
        v[i] = (v[i] + dt * (acceleration + drag * wind)) / (1.0 + dt * (damping + drag))
    return np.asarray(x, dtype=np.float64) + dt * v, v


def update_velocities(
    x: FloatArray,
    v: FloatArray,
    x_start: FloatArray,
    x_predicted: FloatArray,
    contact_shape: NDArray[np.int32],
    contact_normal: FloatArray,
    carry: FloatArray,
    dt: float,
) -> FloatArray:
    """Velocities [n, 3] from the positions that constraints left; contact is inelastic."""
    v = np.asarray(v, dtype=np.float64) + (np.float64(x) - np.float64(x_predicted)) / dt
    for i, shape in enumerate(contact_shape):
        if shape >= 0:
            moved_with = (carry[shape, :, :3] @ x_start[i] + carry[shape, :, 3]) / dt
            v[i] -= max(float((v[i] - moved_with) @ contact_normal[i]), 0.0) * contact_normal[i]
    return v


def move_pins(local: FloatArray, position: FloatArray, orientation: FloatArray) -> FloatArray:
    """World positions [p, 3] of points in frames with the given poses ([p, 3], [p, 4])."""
    return np.array(
        [
            matrix_from_quaternion(q) @ point + p
            for point, p, q in zip(local, position, orientation)
        ]
    ).reshape(-1, 3)


def signed_distance(shape: Shape, point: FloatArray) -> tuple[float, FloatArray]:
    """Distance of a point to a sphere or tapered capsule, and the unit direction out of it.

    The capsule is the union of spheres along its axis: the nearest is found by ternary search
    over a function that has one minimum.
    """
    collider, position, rotation = shape
    if collider.kind == "sphere":
        apart = point - position
        length = float(np.linalg.norm(apart))
        return length - float(collider.geometry["radius"]), apart / length  # type: ignore[arg-type]
    r0, r1, span = (float(collider.geometry[k]) for k in ("radius0", "radius1", "length"))  # type: ignore[arg-type]

    def at(t: float) -> tuple[float, FloatArray]:
        apart = point - position - rotation[:, 2] * t * span
        length = float(np.linalg.norm(apart))
        return length - (r0 + t * (r1 - r0)), apart / max(length, 1e-300)

    low, high = 0.0, 1.0
    for _ in range(80):
        a, b = low + (high - low) / 3, high - (high - low) / 3
        low, high = (low, b) if at(a)[0] < at(b)[0] else (a, high)
    return at((low + high) / 2)


def deepest(shapes: Sequence[Shape], point: FloatArray) -> tuple[float, FloatArray]:
    """The lowest signed distance to any of the shapes, and the direction out of that one."""
    return min((signed_distance(s, point) for s in shapes), key=lambda found: found[0])


def leave_union(
    shapes: Sequence[Shape], point: FloatArray, thickness: float, farthest: float = 4.0
) -> FloatArray:
    """A point moved out of the union, by the rule of `contact.way_out.leave_union`."""
    start = point = np.array(point, dtype=np.float64)
    met: list[FloatArray] = []
    let_go: list[FloatArray] = []
    limit = 0.0
    for attempt in range(8 + 64):
        distance, normal = deepest(shapes, point)
        depth = thickness - distance
        if attempt >= 2 and float(np.linalg.norm(point - start)) > limit:
            break
        if depth <= 1e-9:
            return point
        if attempt < 8:
            limit = farthest * depth if attempt == 0 else limit
            met.append(normal)
            point = point + depth * normal
            let_go.append(point)
            continue
        direction = np.sum(met, axis=0)
        length = float(np.linalg.norm(direction))
        if length < 1e-3:
            break
        direction = direction / length
        point = point + depth / max(float(normal @ direction), 0.1) * direction
    return 0.5 * (let_go[0] + let_go[1])
