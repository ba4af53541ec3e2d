"""A solid cut by planes into parts whose convex hulls fit it.

Greedy: of all parts, the one whose best cut saves the most hull volume is cut, as long as that is
worth another hull. A cut may leave separate solids on one side, as below a crotch; they become
separate parts where that saves enough, so that a body without a rig comes apart into head, trunk
and limbs. Sections are closed by their convex hulls: parts are solids, not shells.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from garment_sim_ros.arrays import FloatArray, LongArray
from garment_sim_ros.geometry.ties import facing, first_least
from garment_sim_ros.jit import exact_kernel

_OFFSETS = np.linspace(0.08, 0.92, 15)
"""Places where a part is tried to be cut, as shares of its extent."""
_DIRECTIONS = 50
"""A volume is estimated from the farthest points in so many directions."""
_TRIED = 4
"""Cuts that seem best and are made to see what they really save."""
_EQUAL = 1e-7
"""Cuts that save as much but for this share of a hull's volume are equally good."""
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
    parts = [_assess(closed(surface), saving)]
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


def closed(surface: FloatArray) -> FloatArray:
    """A surface [t, 3, 3] with a lid over each of its holes."""
    return np.concatenate([surface, *_lids(*_rims(surface))])


def cut(surface: FloatArray, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The solids below and above a plane (unit normal, offset), closed by lids on it."""
    below, above, segments = split(surface, surface @ plane[:3] - plane[3])
    lids = _lids(*weld(segments))
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


def weld(corners: FloatArray) -> tuple[FloatArray, LongArray]:
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


def _components(corner: LongArray, size: int) -> LongArray:
    """Component of each simplex [n, k] over `size` points."""
    start, end = corner[:, :-1].ravel(), corner[:, 1:].ravel()
    graph = coo_matrix((np.ones(len(start)), (start, end)), shape=(size, size))
    _, label = connected_components(graph, directed=False)
    return label[corner[:, 0]].astype(np.int64)


def _rims(surface: FloatArray) -> tuple[FloatArray, LongArray]:
    """The edges of holes, turned for `_lids`: points [n, 3] and pairs of them [e, 2]."""
    points, corner = weld(surface)
    size = len(points)
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    alone = ~np.isin(start * size + end, end * size + start) & (start != end)
    return points, np.stack([end[alone], start[alone]], axis=1)


def _lids(points: FloatArray, edges: LongArray) -> list[FloatArray]:
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
    points, corner = weld(surface)
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
            k = first_least(costs, _EQUAL * own)
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
    points, corner = weld(surface)
    volume = _hull_volume(points)
    a, b, c = (surface - surface[0, 0]).transpose(1, 0, 2)
    solid = float(np.einsum("tk,tk->", a, np.cross(b, c))) / 6.0
    if volume - abs(solid) <= worth:
        return _Part(surface, 0.0, np.zeros(4))
    mean = points.mean(axis=0)
    axes = facing(np.linalg.eigh((points - mean).T @ (points - mean))[1])
    planes = np.array(
        [
            [*axis, low + share * (high - low)]
            for axis in axes.T
            for low, high in [((points @ axis).min(), (points @ axis).max())]
            for share in _OFFSETS
        ]
    )
    left = np.empty(len(planes))
    _estimate(points, corner, points @ _AROUND, planes, _AROUND, _BETWEEN, left)
    likely = planes[np.argsort(np.round(left / (_EQUAL * volume)), kind="stable")[:_TRIED]]
    kept = [_kept(points, corner, plane) for plane in likely]
    best = first_least(kept, _EQUAL * volume)
    return _Part(surface, volume - kept[best], likely[best])


def _kept(points: FloatArray, corner: LongArray, plane: FloatArray) -> float:
    """The hull volume that a cut leaves [m^3]."""
    height = points @ plane[:3] - plane[3]
    _, _, section = split(points[corner], height[corner])
    section = section.reshape(-1, 3)
    sides = points[height <= 0.0], points[height > 0.0]
    return sum(_hull_volume(np.concatenate([side, section])) for side in sides)


@exact_kernel()
def _estimate(points, corner, along, planes, around, between, left):
    """About the hull volume that each cut leaves: a little less, from the extreme points.

    The farthest points in directions that are spread evenly, joined like the directions are, bound
    most of a convex hull.

    Args:
        points: Corners of a closed surface [m], shape [n, 3].
        corner: Those of each triangle, shape [t, 3].
        along: How far each point is along each direction [m], shape [n, d].
        planes: Cuts: unit normal and offset, shape [p, 4].
        around: Directions, shape [3, d].
        between: Triangles of the directions' hull, outwards, shape [f, 3].
        left: Output [m^3], shape [p].
    """
    directions = around.shape[1]
    height = np.empty(points.shape[0])
    farthest = np.empty((2, directions))
    extreme = np.empty((2, directions, 3))
    at = np.empty(3)
    for p in range(planes.shape[0]):
        n = planes[p]
        farthest[:] = -np.inf
        for i in range(points.shape[0]):
            x = points[i]
            height[i] = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - n[3]
            side = 1 if height[i] > 0.0 else 0
            for d in range(directions):
                if along[i, d] > farthest[side, d]:
                    farthest[side, d] = along[i, d]
                    extreme[side, d, 0], extreme[side, d, 1], extreme[side, d, 2] = (
                        x[0],
                        x[1],
                        x[2],
                    )
        for t in range(corner.shape[0]):
            for c in range(3):
                i, j = corner[t, c], corner[t, (c + 1) % 3]
                if not (height[i] <= 0.0 < height[j]):
                    continue  # each edge once: its other triangle has it the other way round
                share = height[i] / (height[i] - height[j])
                for k in range(3):
                    at[k] = points[i, k] + share * (points[j, k] - points[i, k])
                for d in range(directions):
                    far = at[0] * around[0, d] + at[1] * around[1, d] + at[2] * around[2, d]
                    for side in range(2):
                        if far > farthest[side, d]:
                            farthest[side, d] = far
                            for k in range(3):
                                extreme[side, d, k] = at[k]
        total = 0.0
        for side in range(2):
            if farthest[side, 0] == -np.inf:
                continue
            o = extreme[side, 0]
            for f in range(between.shape[0]):
                a, b, c = (
                    extreme[side, between[f, 0]],
                    extreme[side, between[f, 1]],
                    extreme[side, between[f, 2]],
                )
                ax, ay, az = a[0] - o[0], a[1] - o[1], a[2] - o[2]
                bx, by, bz = b[0] - o[0], b[1] - o[1], b[2] - o[2]
                cx, cy, cz = c[0] - o[0], c[1] - o[1], c[2] - o[2]
                total += (
                    ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
                ) / 6.0
        left[p] = total


def lattice(count: int) -> FloatArray:
    """Unit vectors spread evenly over all directions (Fibonacci lattice), shape [3, count]."""
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * i
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z])


def _joined(around: FloatArray) -> LongArray:
    """Triangles between unit vectors [3, d], counter-clockwise seen from outside, shape [f, 3]."""
    triangles = ConvexHull(around.T).simplices.astype(np.int64)
    a, b, c = around.T[triangles].transpose(1, 0, 2)
    inwards = np.einsum("fk,fk->f", a, np.cross(b, c)) < 0.0
    triangles[inwards] = triangles[inwards][:, ::-1]
    return triangles


_AROUND = lattice(_DIRECTIONS)
_BETWEEN = _joined(_AROUND)


def _hull_volume(points: FloatArray) -> float:
    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):  # too few points, or flat: no volume
        return 0.0
