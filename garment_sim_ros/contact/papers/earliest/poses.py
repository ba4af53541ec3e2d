"""Ellipsoids at one instant, and the maps between them and the unit ball."""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.jit import kernel

ON_SURFACE = 1e-5
"""A zeta that is less than 1 by this is on the surface, where hits put particles in single
precision: half a micrometre at a radius of 10 cm."""


@dataclass(frozen=True)
class PosedEllipsoids:
    """Ellipsoids at one instant.

    Attributes:
        centre: Centres [m], shape [m, 3].
        axes: Half-axis directions as columns, shape [m, 3, 3].
        radii: Half-axis lengths [m], shape [m, 3].
    """

    centre: FloatArray
    axes: FloatArray
    radii: FloatArray

    def __post_init__(self) -> None:
        m = len(self.centre)
        shapes = {"centre": (m, 3), "axes": (m, 3, 3), "radii": (m, 3)}
        for name, shape in shapes.items():
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise GeometryError(f"{name} of ellipsoids must be finite, shape {shape}")
            object.__setattr__(self, name, array)
        if (self.radii <= 0.0).any():
            raise GeometryError("radii of ellipsoids must be positive")

    def inflated(self, thickness: float) -> "PosedEllipsoids":
        """The same with all radii larger by `thickness` [m]."""
        return PosedEllipsoids(self.centre, self.axes, self.radii + thickness)

    def table(self) -> FloatArray:
        """One row of numbers each: centre, map to the unit ball by rows, radii; shape [m, 15]."""
        ball = np.swapaxes(self.axes, 1, 2) / self.radii[:, :, None]
        return np.concatenate([self.centre, ball.reshape(-1, 9), self.radii], axis=1)


# Kernels take such tables and not several arrays: those would be counted in and out at every call.


@kernel(inner=True)
def prepare(table, box, single, first):
    """Boxes around ellipsoids, over both ends of the step, and their maps in single precision.

    Args:
        table: See `PosedEllipsoids.table`.
        box: Output, least and greatest coordinates [m], shape [6, m].
        single: Output, maps to the unit ball by rows, shape [m, 9].
        first: Begin the boxes, or extend them.
    """
    for k in range(table.shape[0]):
        for r in range(9):
            single[k, r] = table[k, 3 + r]
        for r in range(3):
            half = 0.0
            for c in range(3):
                half += (table[k, 3 + 3 * c + r] * table[k, 12 + c] ** 2) ** 2
            half = np.sqrt(half)
            low, high = table[k, r] - half, table[k, r] + half
            box[r, k] = low if first else min(box[r, k], low)
            box[3 + r, k] = high if first else max(box[3 + r, k], high)


@kernel(inner=True)
def to_ball(table, k, px, py, pz):
    """A point where ellipsoid k is the unit ball."""
    dx, dy, dz = px - table[k, 0], py - table[k, 1], pz - table[k, 2]
    return (
        table[k, 3] * dx + table[k, 4] * dy + table[k, 5] * dz,
        table[k, 6] * dx + table[k, 7] * dy + table[k, 8] * dz,
        table[k, 9] * dx + table[k, 10] * dy + table[k, 11] * dz,
    )


@kernel(inner=True)
def turn_back(table, k, qx, qy, qz):
    """The transpose of the map to the unit ball, without its centre: normals come back so."""
    return (
        table[k, 3] * qx + table[k, 6] * qy + table[k, 9] * qz,
        table[k, 4] * qx + table[k, 7] * qy + table[k, 10] * qz,
        table[k, 5] * qx + table[k, 8] * qy + table[k, 11] * qz,
    )


@kernel(inner=True)
def from_ball(table, k, qx, qy, qz):
    """The inverse of `to_ball`."""
    # The map is a rotation over radii: its inverse is its transpose times their squares.
    rx, ry, rz = table[k, 12], table[k, 13], table[k, 14]
    x, y, z = turn_back(table, k, qx * rx * rx, qy * ry * ry, qz * rz * rz)
    return table[k, 0] + x, table[k, 1] + y, table[k, 2] + z


@kernel(inner=True)
def inside_any(table, candidates, count, px, py, pz, but):
    """Whether one of the first `count` candidates other than `but` holds the point."""
    for c in range(count):
        k = candidates[c]
        if k != but:
            qx, qy, qz = to_ball(table, k, px, py, pz)
            if qx * qx + qy * qy + qz * qz < 1.0 - ON_SURFACE:
                return True
    return False
