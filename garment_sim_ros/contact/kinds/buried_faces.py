"""Faces of hulls that lie inside other hulls, and so are no part of a body's surface.

The hulls of a body overlap. Between the top of the hips and the bottom of the spine, which lies
below it inside of the body, is a slab from which the short way out of either leads into the other:
cloth that got in there would stay. Out of a hull there is no way through a face from which it
goes on through other hulls.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray

_INWARD = 1 / 3
"""What is looked at of a face: its corners, so far drawn to their middle, and that."""
_GAP = 0.1
"""Gaps between hulls that are no surface, as a share of how far they go on."""


def buried_planes(
    planes: Sequence[FloatArray], vertices: Sequence[FloatArray], way: float
) -> list[NDArray[np.bool_]]:
    """Which planes of hulls have no surface of their union near them.

    Args:
        planes: Outward unit normals and offsets of each hull in one frame, shape [f, 4]; an empty
            array where a hull's place is not known.
        vertices: Its corners [m], shape [n, 3].
        way: How far other hulls must go on outside of a face for it to be buried [m].

    Returns:
        For each hull a flag for each plane; none where all of its planes would be buried.
    """
    boxes = [(v.min(axis=0), v.max(axis=0)) for v in vertices]
    found = []
    for h, own in enumerate(planes):
        low, high = boxes[h]
        others = [
            p
            for k, p in enumerate(planes)
            if k != h
            and len(p)
            and (boxes[k][0] <= high + way).all()
            and (boxes[k][1] >= low - way).all()
        ]
        buried = _are_covered(own[:, :3], [_of_face(p, vertices[h]) for p in own], others, way)
        found.append(buried & ~buried.all())
    return found


def _of_face(plane: FloatArray, vertices: FloatArray) -> FloatArray:
    """Points of a face, shape [k, 3]."""
    height = vertices @ plane[:3] - plane[3]
    size = np.ptp(vertices, axis=0).max()
    corners = vertices[height > -1e-5 * size]
    middle = corners.mean(axis=0)
    return np.vstack([corners + _INWARD * (middle - corners), middle])


def _are_covered(
    direction: FloatArray, of_faces: list[FloatArray], hulls: Sequence[FloatArray], way: float
) -> NDArray[np.bool_]:
    """Whether hulls go on from most of each face's points, its way out, by over a way [m].

    Args:
        direction: Way out of each face, shape [f, 3].
        of_faces: Points of each face, shape [k, 3].
        hulls: Planes of each hull, shape [p, 4].
        way: The way [m].
    """
    if not hulls or not of_faces:
        return np.zeros(len(of_faces), bool)
    points = np.concatenate(of_faces)
    face = np.repeat(np.arange(len(of_faces)), [len(p) for p in of_faces])
    enter, leave = np.full((2, len(hulls), len(points)), np.inf)
    for k, planes in enumerate(hulls):
        height = points @ planes[:, :3].T - planes[:, 3]
        climb = (direction @ planes[:, :3].T)[face]
        with np.errstate(divide="ignore", invalid="ignore"):
            at = -height / climb
        enter[k] = np.where(climb < 0.0, at, -np.inf).max(axis=1)
        leave[k] = np.where(climb > 0.0, at, np.inf).min(axis=1)
        beside = ((climb == 0.0) & (height > 0.0)).any(axis=1) | (leave[k] < enter[k])
        enter[k][beside], leave[k][beside] = np.inf, -np.inf
    reached = np.zeros(len(points))
    for _ in hulls:
        inside = enter <= reached + _GAP * way
        reached = np.maximum(reached, np.where(inside, leave, 0.0).max(axis=0))
    return np.bincount(face, reached > way) > 0.5 * np.bincount(face)
