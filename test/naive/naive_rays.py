"""Contact along rays again, in float64, one particle and one plane at a time."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray


class Posed(NamedTuple):
    """A posed shape.

    Attributes:
        centre: Origin of its frame [m], shape [3].
        rotation: Of its frame, shape [3, 3].
        radii: Half axes of a sphere or an ellipsoid [m], shape [3]; None of a hull.
        planes: Outward unit normals and offsets of a hull in the frame of its box, shape [f, 4].
        box: Centre and axes, as columns, of that frame in the shape's, shapes [3] and [3, 3].
        is_round: Whether the hull's rays come from the centre of its box; else from its axis.
    """

    centre: FloatArray
    rotation: FloatArray
    radii: FloatArray | None = None
    planes: FloatArray | None = None
    box: tuple[FloatArray, FloatArray] = (np.zeros(3), np.eye(3))
    is_round: bool = True


def out_of_round(radii: FloatArray, q: FloatArray) -> FloatArray | None:
    """The place on an ellipsoid that a point inside goes to, along the ray from the centre."""
    zeta = float(np.sum((q / radii) ** 2))
    return q / np.sqrt(zeta) if 0.0 < zeta < 1.0 else None


def out_of_hull(shape: Posed, q: FloatArray) -> FloatArray | None:
    """The place on a hull that a point inside goes to, along the ray from inside."""
    assert shape.planes is not None
    centre, axes = shape.box
    p = axes.T @ (q - centre)
    if any(plane[:3] @ p > plane[3] for plane in shape.planes):
        return None
    origin = np.zeros(3) if shape.is_round else np.array([0.0, 0.0, p[2]])
    way = p - origin
    way = way / np.linalg.norm(way)
    far = min(
        (plane[3] - plane[:3] @ origin) / (plane[:3] @ way)
        for plane in shape.planes
        if plane[:3] @ way > 0.0
    )
    return centre + axes @ (origin + far * way)


def meet_rays(shapes: Sequence[Posed], x: FloatArray) -> tuple[FloatArray, list[int]]:
    """Places of particles after all shapes, one after the other; the last that moved each."""
    places, hits = [], []
    for p in np.asarray(x, np.float64):
        hit = -1
        for k, shape in enumerate(shapes):
            q = shape.rotation.T @ (p - shape.centre)
            out = out_of_hull(shape, q) if shape.radii is None else out_of_round(shape.radii, q)
            if out is not None:
                p = shape.centre + shape.rotation @ out
                hit = k
        places.append(p)
        hits.append(hit)
    return np.array(places), hits
