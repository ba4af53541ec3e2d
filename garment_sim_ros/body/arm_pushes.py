"""The compiled part of `body.arms`: distances from the trunk, and pushes out of it."""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.geometry.transforms import quaternion_multiply, rotate
from garment_sim_ros.jit import kernel

_PUSHES = 16
"""Most pushes in a pose, each by what the arm is deepest in."""
_CLOSE = 1e-4
"""Shortage of room that is left [m]."""
_SHORTEST = 0.05
"""Shortest lever [m]: what is pushed towards the shoulder stays."""


class Trunk(NamedTuple):
    """Parts of the trunk in a pose: polytopes, the support of their skin in directions.

    Attributes:
        T: World poses of their joints, shape [p, 4, 4].
        normals: The directions in their joints' frames, axis by axis, shape [3, d].
        support: How far each part goes in each of them [m], shape [p, d].
    """

    T: FloatArray
    normals: FloatArray
    support: FloatArray


@kernel(inner=True)
def _height(trunk, part, x, y, z, height):
    """The height of a place over a part, and the direction it is in; `height` is scratch, [d]."""
    P, n = trunk.T[part], trunk.normals
    x, y, z = x - P[0, 3], y - P[1, 3], z - P[2, 3]
    u = P[0, 0] * x + P[1, 0] * y + P[2, 0] * z
    v = P[0, 1] * x + P[1, 1] * y + P[2, 1] * z
    w = P[0, 2] * x + P[1, 2] * y + P[2, 2] * z
    for d in range(height.size):
        height[d] = (n[0, d] * u + n[1, d] * v + n[2, d] * w) - trunk.support[part, d]
    highest = 0
    for d in range(1, height.size):
        highest = d if height[d] > height[highest] else highest
    return height[highest], highest


@kernel()
def find_gaps(trunk, centre, shoulder, radius, gaps):
    """Distances of spheres from the parts of a trunk.

    Args:
        trunk: `Trunk`.
        centre: Centres of the spheres, from the shoulder [m], shape [a, m, 3].
        shoulder: World position [m], shape [3].
        radius: Radii [m], shape [m].
        gaps: Output [m], shape [p, a, m].
    """
    height = np.empty(trunk.normals.shape[1])
    for part in range(gaps.shape[0]):
        for a in range(gaps.shape[1]):
            for m in range(gaps.shape[2]):
                x = centre[a, m, 0] + shoulder[0]
                y = centre[a, m, 1] + shoulder[1]
                z = centre[a, m, 2] + shoulder[2]
                above, _ = _height(trunk, part, x, y, z, height)
                gaps[part, a, m] = above - radius[m]


@kernel(inner=True)
def _turned_by(turn, share):
    """Unit quaternion of so much of a rotation vector [rad]."""
    x, y, z = share * turn[0], share * turn[1], share * turn[2]
    angle = np.sqrt(x * x + y * y + z * z)
    f = 0.5 - angle * angle / 48.0 if angle < 1e-3 else np.sin(0.5 * angle) / angle
    return f * x, f * y, f * z, np.cos(0.5 * angle)


@kernel(inner=True)
def _vector(q):
    """Rotation vector of a unit quaternion [rad]."""
    x, y, z, w = q
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    sine = np.sqrt(x * x + y * y + z * z)
    f = 2.0 + sine * sine / 3.0 if sine < 1e-3 else 2.0 * np.arctan2(sine, w) / sine
    return f * x, f * y, f * z


@kernel(inner=True)
def _deepest(trunk, centre, shoulder, radius, at, height):
    """The smallest gap of spheres that are turned by `at`, where it is, and the way out of it."""
    least, px, py, pz, nx, ny, nz = np.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for part in range(trunk.support.shape[0]):
        P = trunk.T[part]
        for m in range(radius.size):
            x, y, z = rotate(*at, centre[m, 0], centre[m, 1], centre[m, 2])
            above, d = _height(
                trunk, part, x + shoulder[0], y + shoulder[1], z + shoulder[2], height
            )
            if above - radius[m] < least:
                least, px, py, pz = above - radius[m], x, y, z
                u, v, w = trunk.normals[0, d], trunk.normals[1, d], trunk.normals[2, d]
                nx = P[0, 0] * u + P[0, 1] * v + P[0, 2] * w
                ny = P[1, 0] * u + P[1, 1] * v + P[1, 2] * w
                nz = P[2, 0] * u + P[2, 1] * v + P[2, 2] * w
    return least, px, py, pz, nx, ny, nz


@kernel()
def push(trunk, centre, shoulder, radius, gap, was, home, farthest):
    """The turn of an arm that goes home, and that the trunk pushes out of its way.

    Args:
        trunk: `Trunk`.
        centre: The arm's spheres where the source has them, from the shoulder [m], shape [m, 3].
        shoulder: World position [m], shape [3].
        radius: Radii of the spheres [m], shape [m].
        gap: Room to keep [m].
        was: Rotation vector of its turn so far [rad], shape [3].
        home: How far it goes home [rad].
        farthest: How far it can be turned at once [rad].

    Returns:
        The rotation vector [rad], three numbers.
    """
    height = np.empty(trunk.normals.shape[1])
    angle = np.sqrt(was[0] * was[0] + was[1] * was[1] + was[2] * was[2])
    start = _turned_by(was, 1.0)
    at = _turned_by(was, max(0.0, 1.0 - home / max(angle, 1e-9)))
    for _ in range(_PUSHES):
        least, x, y, z, nx, ny, nz = _deepest(trunk, centre, shoulder, radius, at, height)
        short = gap - least
        if short < _CLOSE:
            break
        lever = (y * nz - z * ny, z * nx - x * nz, x * ny - y * nx)
        square = lever[0] * lever[0] + lever[1] * lever[1] + lever[2] * lever[2]
        more = _turned_by(lever, short / max(square, _SHORTEST * _SHORTEST))
        at = quaternion_multiply(*more, *at)
    x, y, z, w = start
    change = _vector(quaternion_multiply(*at, -x, -y, -z, w))
    way = np.sqrt(change[0] * change[0] + change[1] * change[1] + change[2] * change[2])
    if way > farthest:
        at = quaternion_multiply(*_turned_by(change, farthest / way), *start)
    return _vector(at)
