"""Skirts made around a body: horizontal rings that follow the hips and flare towards the hem."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.garment.slices import outline

_WAIST_EASE = 0.003
_HIP_EASE = 0.012
_LEVELS = 160


def skirt(measures: Measures, *, vertices: int, hem: float, flare: float) -> GarmentMesh:
    """A skirt from the waist down.

    Every ring is the convex hull of all sections of the body between it and the waist, so that
    the skirt falls straight from its widest place, plus an ease of 3 mm at the waist and 12 mm
    from the hips down, plus the flare. Rings have as many vertices as give even edges; their
    number is exact: with n and m vertices on the top and bottom rings there are 2 v - n - m
    triangles.

    Args:
        measures: The body.
        vertices: Number of vertices.
        hem: Height of the hem [m].
        flare: Widening per length below the hips (tangent of the skirt's angle).

    Raises:
        GeometryError: The body lacks what a skirt needs.
    """
    z = np.linspace(measures.waist, hem, _LEVELS)
    support = np.maximum.accumulate(measures.trunk.at(z), axis=0)
    rise = measures.waist - measures.hips
    below = np.clip((measures.waist - z) / rise, 0.0, None)
    ease = measures.unit * (_WAIST_EASE + (_HIP_EASE - _WAIST_EASE) * np.minimum(below, 1.0))
    # The flare sets in smoothly half way from waist to hips.
    widening = (
        flare * rise * np.where(below < 1.0, np.clip(below - 0.5, 0.0, None) ** 2, below - 0.75)
    )
    support += (ease + widening)[:, None]

    rings = np.array([outline(s) for s in support])
    girth = np.linalg.norm(np.roll(rings, -1, axis=1) - rings, axis=2).sum(axis=1)
    across = np.linalg.norm(np.diff(rings, axis=0), axis=2).mean(axis=1)
    along = np.hypot(across, np.diff(z))
    along = np.concatenate([[0.0], np.cumsum(along)])
    rows = _row_count(vertices, along[-1], float(np.average(girth)))
    level = np.interp(np.linspace(0.0, along[-1], rows), along, np.arange(_LEVELS))
    counts = _shared_out(vertices, np.interp(level, np.arange(_LEVELS), girth))

    points, parameters = [], []
    for row, (place, count) in enumerate(zip(level, counts)):
        i = min(int(place), _LEVELS - 2)
        s = place - i
        ring = (1.0 - s) * rings[i] + s * rings[i + 1]
        u = (np.arange(count) + 0.5 * (row % 2)) / count
        height = (1.0 - s) * z[i] + s * z[i + 1]
        points.append(np.column_stack([_along(ring, u), np.full(count, height)]))
        parameters.append(u)
    return GarmentMesh(
        vertices=np.concatenate(points),
        triangles=_strips(parameters),
    )


def _row_count(vertices: int, length: float, girth: float) -> int:
    """Rings for triangles as equilateral as they can be."""
    rows = np.arange(3, vertices // 6 + 1)
    edge = rows * girth / vertices
    spacing = length / (rows - 1)
    return int(rows[np.argmin(np.abs(np.log(spacing / (np.sqrt(0.75) * edge))))])


def _shared_out(total: int, girth: FloatArray) -> NDArray[np.int64]:
    """Vertices per ring in proportion to its girth, in all exactly `total`."""
    bounds = np.rint(np.concatenate([[0.0], np.cumsum(girth)]) * (total / girth.sum()))
    return np.diff(bounds).astype(np.int64)


def _along(ring: FloatArray, u: FloatArray) -> FloatArray:
    """Points at shares u of a closed ring's length from the middle of its back, shape [n, 2]."""
    middle = 0.5 * (ring.min(axis=0) + ring.max(axis=0))
    behind = ring[:, 0] < middle[0]
    # Counter-clockwise the ring crosses the middle of the back from left (y > 0) to right.
    left = ring[:, 1] > middle[1]
    i = int(np.flatnonzero(behind & left & ~np.roll(left, -1))[0])
    a, b = ring[i], ring[(i + 1) % len(ring)]
    start = a + (b - a) * ((a[1] - middle[1]) / (a[1] - b[1]))
    closed = np.concatenate([[start], np.roll(ring, -i - 1, axis=0), [start]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    return np.column_stack([np.interp(u * length[-1], length, closed[:, k]) for k in range(2)])


def _strips(parameters: list[FloatArray]) -> IntArray:
    """Triangles between neighbouring rings, outward for rings counter-clockwise, top first.

    Of the two possible next triangles each time the one whose base ends first is taken, by the
    parameter at the base's middle, which keeps the sides of the strip level with each other.
    """
    triangles = []
    start = 0
    for upper, lower in pairwise(parameters):
        n, m = len(upper), len(lower)
        a, b = start, start + n
        # Both rings once around, each with its next vertex.
        middle_upper = upper + 0.5 / n
        middle_lower = lower + 0.5 / m
        owner = np.concatenate([np.zeros(n, bool), np.ones(m, bool)])
        order = np.argsort(np.concatenate([middle_upper, middle_lower]), kind="stable")
        i = j = 0
        for is_lower in owner[order]:
            if is_lower:
                triangles.append((a + i % n, b + j % m, b + (j + 1) % m))
                j += 1
            else:
                triangles.append((a + i % n, b + j % m, a + (i + 1) % n))
                i += 1
        start += n
    return np.array(triangles, dtype=np.int32)
