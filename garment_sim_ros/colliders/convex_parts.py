"""A solid cut by planes into parts whose convex hulls fit it.

Greedy: of all parts, the one whose best cut saves the most hull volume is cut, as long as that is
worth another hull. A cut may leave separate solids on one side, as below a crotch; they become
separate parts where that saves enough, so that a body without a rig comes apart into head, trunk
and limbs. Sections are closed by their convex hulls: parts are solids, not shells.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_OFFSETS = np.linspace(0.12, 0.88, 7)
"""Places where a part is tried to be cut, as shares of its extent."""
_COARSE = 1000
"""Surfaces of at most so many triangles are cut to see what a cut saves."""
_SAMPLES = 2000
"""Most points that it is estimated from for finer ones."""
_DIRECTIONS = 50
"""An estimated volume is that of the hull of the farthest points in so many directions."""
_TRIED = 3
"""Cuts that seem best and are made to see what they really save."""
_WELD_BITS = 20
"""Points that agree to this many bits of the surface's extent, per coordinate, are one."""


@dataclass(eq=False)
class _Part:
    """A solid's surface and its best cut.

    Attributes:
        surface: Corners of triangles [m], shape [t, 3, 3].
        saving: Hull volume that the best cut saves [m^3].
        plane: That cut: unit normal and offset, shape [4].
    """

    surface: FloatArray
    saving: float
    plane: FloatArray


def convex_parts(surface: FloatArray, *, saving: float, most: int) -> list[FloatArray]:
    """Cut a solid into parts.

    Args:
        surface: Corners of its surface's triangles [m], shape [t, 3, 3]; holes are closed.
        saving: Hull volume that a cut must save [m^3].
        most: Largest number of parts.

    Returns:
        Surfaces whose hulls together contain the solid.
    """
    parts = [_assess(np.concatenate([surface, *_lids(*_rims(surface))]), saving)]
    while len(parts) < most:
        best = max(parts, key=lambda part: part.saving)
        if best.saving <= saving:
            break
        parts.remove(best)
        below, above = cut(best.surface, best.plane)
        room = most - len(parts)
        groups = _separate(below, saving, room - 1)
        groups += _separate(above, saving, room - len(groups))
        parts += [_assess(group, saving) for group in groups]
    return [part.surface for part in parts]


def cut(surface: FloatArray, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The solids below and above a plane (unit normal, offset), closed by lids on it."""
    below, above, segments = split(surface, surface @ plane[:3] - plane[3])
    lids = _lids(*_weld(segments))
    turned = [lid[:, ::-1] for lid in lids]
    return np.concatenate([below, *lids]), np.concatenate([above, *turned])


def split(corners: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Triangles on both sides of the line where a linear function is zero.

    Args:
        corners: Corners of triangles, with any values beside the positions, shape [t, 3, d].
        height: The function at the corners, shape [t, 3].

    Returns:
        Triangles where it is at most zero, shape [., 3, d], where it is positive, and the
        segments between, with the first ones on their right, shape [., 2, d].
    """
    above = height > 0.0
    count = above.sum(axis=1)
    sides = [[corners[count == 0]], [corners[count == 3]]]
    segments = []
    for lone in (True, False):  # the corner that is alone on its side is above or below
        index = np.flatnonzero(count == (1 if lone else 2))
        first = np.argmax(above[index] == lone, axis=1)
        a, b, c = (corners[index, (first + k) % 3] for k in range(3))
        ha, hb, hc = (height[index, (first + k) % 3, None] for k in range(3))
        ab = (hb * a - ha * b) / (hb - ha)
        ac = (hc * a - ha * c) / (hc - ha)
        sides[int(lone)].append(np.stack([a, ab, ac], axis=1))
        sides[1 - int(lone)] += [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]
        segments.append(np.stack([ab, ac] if lone else [ac, ab], axis=1))
    return np.concatenate(sides[0]), np.concatenate(sides[1]), np.concatenate(segments)


def _weld(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distinct points, and the point of each corner, of simplices [n, k, 3]."""
    flat = corners.reshape(-1, 3)
    if len(flat) == 0:
        return flat, np.zeros(corners.shape[:2], np.int64)
    low = flat.min(axis=0)
    scale = (2**_WELD_BITS - 1) / max(float((flat.max(axis=0) - low).max()), 1e-12)
    x, y, z = np.round((flat - low) * scale).astype(np.int64).T
    keys = (x << 2 * _WELD_BITS) | (y << _WELD_BITS) | z
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    return flat[first], number.reshape(corners.shape[:2])


def _components(corner: IntArray, size: int) -> IntArray:
    """Component of each simplex [n, k] over `size` points."""
    start, end = corner[:, :-1].ravel(), corner[:, 1:].ravel()
    graph = coo_matrix((np.ones(len(start)), (start, end)), shape=(size, size))
    _, label = connected_components(graph, directed=False)
    return label[corner[:, 0]].astype(np.int64)


def _rims(surface: FloatArray) -> tuple[FloatArray, IntArray]:
    """The edges of holes, turned for `_lids`: points [n, 3] and pairs of them [e, 2]."""
    points, corner = _weld(surface)
    size = len(points)
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    alone = ~np.isin(start * size + end, end * size + start) & (start != end)
    return points, np.stack([end[alone], start[alone]], axis=1)


def _lids(points: FloatArray, edges: IntArray) -> list[FloatArray]:
    """Fans of triangles over each loop of edges, about its middle."""
    if len(edges) == 0:
        return []
    loop = _components(edges, len(points))
    lids = []
    for label in np.unique(loop):
        ends = points[edges[loop == label]]
        middle = np.broadcast_to(ends.mean(axis=(0, 1)), ends[:, 0].shape)
        lids.append(np.stack([ends[:, 0], ends[:, 1], middle], axis=1))
    return lids


def _separate(surface: FloatArray, saving: float, most: int) -> list[FloatArray]:
    """Connected solids, joined unless to be apart saves enough hull volume."""
    if len(surface) == 0:
        return []
    points, corner = _weld(surface)
    label = _components(corner, len(points))
    solids = [surface[label == k] for k in np.argsort(-np.bincount(label))]
    groups: list[FloatArray] = []
    volumes: list[float] = []
    for solid in (s for s in solids if len(s)):
        own = _hull_volume(solid.reshape(-1, 3))
        joined = [np.concatenate([group, solid]) for group in groups]
        totals = [_hull_volume(both.reshape(-1, 3)) for both in joined]
        costs = [total - volume - own for total, volume in zip(totals, volumes)]
        if groups and (len(groups) >= most or min(costs) <= saving):
            k = int(np.argmin(costs))
            groups[k], volumes[k] = joined[k], totals[k]
        else:
            groups.append(solid)
            volumes.append(own)
    return groups


def _assess(surface: FloatArray, worth: float) -> _Part:
    """Find a part's best cut, by an estimate first, then its true saving.

    No cut saves more than what the hull has over the solid; where that is not `worth` it, none is
    looked for.
    """
    volume = _hull_volume(surface.reshape(-1, 3))
    a, b, c = (surface - surface[0, 0]).transpose(1, 0, 2)
    solid = float(np.einsum("tk,tk->", a, np.cross(b, c))) / 6.0
    if volume - abs(solid) <= worth:
        return _Part(surface, 0.0, np.zeros(4))
    points, _ = _weld(surface)
    mean = points.mean(axis=0)
    _, axes = np.linalg.eigh((points - mean).T @ (points - mean))
    estimate = _cut_surface if len(surface) <= _COARSE else _cut_samples
    planes = [
        np.array([*axis, low + share * (high - low)])
        for axis in axes.T
        for low, high in [((points @ axis).min(), (points @ axis).max())]
        for share in _OFFSETS
    ]
    likely = sorted(planes, key=lambda candidate: estimate(surface, points, candidate))[:_TRIED]
    kept = [sum(_hull_volume(s.reshape(-1, 3)) for s in cut(surface, plane)) for plane in likely]
    best = int(np.argmin(kept))
    return _Part(surface, volume - kept[best], likely[best])


def _cut_surface(surface: FloatArray, points: FloatArray, plane: FloatArray) -> float:
    """About the hull volume left by a cut."""
    below, above, _ = split(surface, surface @ plane[:3] - plane[3])
    return _about_volume(below.reshape(-1, 3)) + _about_volume(above.reshape(-1, 3))


def _cut_samples(surface: FloatArray, points: FloatArray, plane: FloatArray) -> float:
    """The same from some of the points; those near the section stand in for it."""
    points = points[:: max(1, len(points) // _SAMPLES)]
    height = points @ plane[:3] - plane[3]
    band = 0.02 * float(np.ptp(height))
    return _about_volume(points[height <= band]) + _about_volume(points[height >= -band])


def _about_volume(points: FloatArray) -> float:
    """Volume of the hull of extreme points: a little less than that of all."""
    if len(points) <= _DIRECTIONS:
        return _hull_volume(points)
    return _hull_volume(points[np.unique(np.argmax(points @ _AROUND, axis=0))])


def _lattice(count: int) -> FloatArray:
    """Unit vectors spread evenly over all directions (Fibonacci lattice), shape [3, count]."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * i
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z])


_AROUND = _lattice(_DIRECTIONS)


def _hull_volume(points: FloatArray) -> float:
    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):  # too few points, or flat: no volume
        return 0.0
