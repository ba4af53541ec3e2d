"""Circumferences of a body as a tape measures them: the convex outline of a plane section."""

from collections.abc import Callable

import numpy as np
from scipy.spatial import ConvexHull

from garment_sim_ros.arrays import FloatArray


def girth(
    field: Callable[[FloatArray], FloatArray],
    centre: FloatArray,
    u: FloatArray,
    v: FloatArray,
    radius: float,
    rays: int = 48,
    samples: int = 40,
) -> float:
    """Length of a tape around the body.

    Args:
        field: Negative inside the body, at points [n, 3].
        centre: A point inside the body [m], shape [3].
        u: A direction in the plane of the tape, shape [3].
        v: The direction in the plane across `u`, shape [3].
        radius: A rough radius [m]; the surface is looked for up to twice as far.
        rays: Number of rays from the centre.
        samples: Number of samples on each ray.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, rays, endpoint=False)
    direction = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v
    distance = np.linspace(0.0, 2.0 * radius, samples)
    points = centre + distance[None, :, None] * direction[:, None, :]
    value = field(points.reshape(-1, 3)).reshape(rays, samples)
    beyond = np.argmax(value >= 0.0, axis=1)
    i = np.arange(rays)
    inner, outer = value[i, beyond - 1], value[i, beyond]
    reach = distance[beyond - 1] + inner / (inner - outer) * (distance[1] - distance[0])
    outline = reach[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return float(ConvexHull(outline).area)
