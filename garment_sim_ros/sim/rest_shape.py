"""The rest shape of cloth: one place for each triangle's corners, whatever other triangles have.

Where cloth was cut from flat panels no single surface has all rest lengths: a seam has two, one
in each panel, and a dart closes a cone. Rest lengths are taken in the triangles; where two of them
disagree, because the one is eased to the other, it is their mean.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, LongArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.sim.placement import GarmentLike


def upright(flat: FloatArray, count: int, name: str) -> FloatArray:
    """Corners in their panels, stood upright: weft along y, warp along z [m], shape [t, 3, 3].

    Args:
        flat: Weft and warp of each triangle's corners [m], shape [t, 3, 2].
        count: Number of triangles t.
        name: The garment's name, for messages.

    Raises:
        GeometryError: Another shape, or numbers that are not finite.
    """
    flat = np.asarray(flat, dtype=np.float64)
    if flat.shape != (count, 3, 2) or not np.isfinite(flat).all():
        raise GeometryError(
            f"garment {name!r}: its flat corners must be finite, shape [{count}, 3, 2]"
        )
    return np.concatenate([np.zeros((count, 3, 1)), flat], axis=2)


def rest_corners(garment: GarmentLike) -> FloatArray:
    """Where the corners of a garment's triangles are at rest [m], shape [t, 3, 3].

    Raises:
        GeometryError: Its `flat` has another shape, or numbers that are not finite.
    """
    if garment.flat is not None:
        return upright(garment.flat, len(garment.triangles), garment.name)
    rest = garment.vertices if garment.rest is None else garment.rest
    corners: FloatArray = np.asarray(rest, np.float64)[garment.triangles]
    return corners


def edge_lengths(corners: FloatArray, triangles: IntArray, edges: IntArray) -> FloatArray:
    """Rest length of each edge, of all triangles at it the mean [m], shape [m].

    Args:
        corners: Rest positions of the triangles' corners [m], shape [t, 3, 3].
        triangles: Their vertices, shape [t, 3].
        edges: Vertex pairs, each of some triangle, shape [m, 2].
    """
    ends = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    apart = corners[:, [0, 1, 2]] - corners[:, [1, 2, 0]]
    length = np.linalg.norm(apart.reshape(-1, corners.shape[2]), axis=1)
    n = int(triangles.max()) + 1
    keys, index = np.unique(_pair_keys(ends, n), return_inverse=True)
    total = np.bincount(index.ravel(), length, len(keys)) / np.bincount(index.ravel())
    return total[np.searchsorted(keys, _pair_keys(edges, n))]


def hinge_corners(
    corners: FloatArray, triangles: IntArray, hinges: IntArray
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], ...]:
    """Both triangles of each hinge at rest, each in its own place.

    Args:
        corners: Rest positions of the triangles' corners [m], shape [t, 3, 3].
        triangles: Their vertices, shape [t, 3].
        hinges: The shared edge's ends, then the two opposite vertices, shape [h, 4].

    Returns:
        For each opposite vertex: the two ends and that vertex [m], each shape [h, 3].
    """
    n = int(triangles.max()) + 1
    t = triangles[:, [[0, 1, 2], [1, 2, 0], [2, 0, 1]]]
    keys = (
        _pair_keys(t[..., :2].reshape(-1, 2), n) * n + t[..., 2].ravel().astype(np.int64)
    ).ravel()
    order = np.argsort(keys, kind="stable")
    result = []
    for apex in (2, 3):
        wanted = _pair_keys(hinges[:, :2], n) * n + hinges[:, apex].astype(np.int64)
        found = order[np.searchsorted(keys[order], wanted)]
        triangle, first = found // 3, found % 3
        rows = np.arange(len(hinges))
        place = corners[triangle][rows[:, None], (first[:, None] + np.arange(3)) % 3]
        turned = triangles[triangle, first] != hinges[:, 0]
        place[turned] = place[turned][:, [1, 0, 2]]
        result.append((place[:, 0], place[:, 1], place[:, 2]))
    return tuple(result)


def unfolded(corners: FloatArray, triangles: IntArray, hinges: IntArray) -> FloatArray:
    """Distance of the opposite vertices of each hinge where both triangles lie flat [m], [h]."""
    along, across = [], []
    for a, b, c in hinge_corners(corners, triangles, hinges):
        axis = b - a
        length = np.maximum(np.linalg.norm(axis, axis=1), 1e-300)
        along.append(((c - a) * axis).sum(axis=1) / length - 0.5 * length)
        across.append(np.linalg.norm(np.cross(axis, c - a), axis=1) / length)
    return np.hypot(along[0] - along[1], across[0] + across[1])


def _pair_keys(pairs: IntArray, n: int) -> LongArray:
    """A number for each unordered pair of n vertices."""
    ends = np.sort(pairs.astype(np.int64), axis=1)
    return ends[:, 0] * n + ends[:, 1]
