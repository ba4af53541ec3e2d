"""On which side of a plane through three points others lie, decided without rounding."""

from fractions import Fraction

import numpy as np

from garment_sim_ros.arrays import FloatArray

_ERROR = 1e-15
"""Bound of the rounding error of the determinant below as a share of its absolute terms; Shewchuk
1997 ("Adaptive precision floating-point arithmetic", A-bound of orient3d) has 7.8e-16."""


def orientation(a: FloatArray, b: FloatArray, c: FloatArray, points: FloatArray) -> FloatArray:
    """Sign of the volume of (a, b, c, point): 1 behind the triangle seen counter-clockwise.

    Args:
        a: First corners, shape [f, 3].
        b: Second corners, shape [f, 3].
        c: Third corners, shape [f, 3].
        points: Points, shape [n, 3].

    Returns:
        -1.0 in front of the plane, 0.0 on it, 1.0 behind it, shape [f, n].
    """
    pa, pb, pc = (corner[:, None] - points for corner in (a, b, c))
    value = np.zeros(pa.shape[:2])
    magnitude = np.zeros(pa.shape[:2])
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        plus, minus = pb[..., i] * pc[..., j], pb[..., j] * pc[..., i]
        value += (plus - minus) * pa[..., k]
        magnitude += (np.abs(plus) + np.abs(minus)) * np.abs(pa[..., k])
    sign = np.sign(value)
    for f, n in np.argwhere(np.abs(value) <= _ERROR * magnitude):
        sign[f, n] = _exact_sign(a[f], b[f], c[f], points[n])
    return sign


def _exact_sign(a: FloatArray, b: FloatArray, c: FloatArray, p: FloatArray) -> int:
    rows = [[Fraction(float(x)) - Fraction(float(y)) for x, y in zip(q, p)] for q in (a, b, c)]
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = rows
    value = az * (bx * cy - by * cx) + ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz)
    return (value > 0) - (value < 0)
