"""Arms out of the trunk again, with rotations of scipy, for tests to compare."""

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray, IntArray


def gaps(
    T: FloatArray, normals: FloatArray, support: FloatArray, centre: FloatArray, radius: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Distances of spheres [m, 3] from polytopes, [p, m], and in which direction each is."""
    local = np.einsum("pji,pmj->pmi", T[:, :3, :3], centre - T[:, None, :3, 3])
    heights = np.einsum("pmi,di->pmd", local, normals) - support[:, None]
    return heights.max(axis=2) - radius, heights.argmax(axis=2)


def push(
    T: FloatArray,
    normals: FloatArray,
    support: FloatArray,
    centre: FloatArray,
    shoulder: FloatArray,
    radius: FloatArray,
    gap: float,
    was: FloatArray,
    home: float,
    farthest: float,
) -> FloatArray:
    """Rotation vector of an arm that goes home and is pushed by what it is deepest in, [3]."""
    at = Rotation.from_rotvec(was * max(0.0, 1.0 - home / max(float(np.linalg.norm(was)), 1e-9)))
    for _ in range(16):
        x = at.apply(centre)
        apart, direction = gaps(T, normals, support, x + shoulder, radius)
        part, sphere = np.unravel_index(apart.argmin(), apart.shape)
        short = gap - apart[part, sphere]
        if short < 1e-4:
            break
        lever = np.cross(x[sphere], T[part, :3, :3] @ normals[direction[part, sphere]])
        at = Rotation.from_rotvec(lever * short / max(lever @ lever, 0.05**2)) * at
    start = Rotation.from_rotvec(was)
    change = (at * start.inv()).as_rotvec()
    share = min(1.0, farthest / max(float(np.linalg.norm(change)), 1e-9))
    return np.asarray((Rotation.from_rotvec(share * change) * start).as_rotvec())
