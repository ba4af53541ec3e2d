"""Whether a garment that is worn over another one still is."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.triangles import area_vectors
from garment_sim_ros.recording.metrics import GarmentMesh

_REACH = 0.03
"""Garments nearer to each other than this lie on each other [m]."""
_ACROSS = 0.9
"""Cosine from which on the shortest way to a garment is along its normal, not to its border."""
_CLEARLY = 0.002
"""The one that is nearer to the skin by this is under the other [m]."""


def under(
    outer: GarmentMesh,
    x_outer: FloatArray,
    inner: tuple[MeshDistance, FloatArray, IntArray],
    body: MeshDistance,
) -> float:
    """Area of the outer garment that lies under the inner one, over all that lies on it.

    It is under it where it is behind its outer face and nearer to the skin than that is.

    Args:
        outer: The garment that belongs outside.
        x_outer: Its vertices [m], shape [v, 3].
        inner: The other one where it is, its vertices [m], and its triangles.
        body: The skin, where it is.
    """
    samples = outer.samples(x_outer)
    surface, x_inner, triangles = inner
    distance, closest, triangle = surface.signed_distance(samples)
    normal = area_vectors(x_inner, triangles)[triangle]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    way = np.einsum("ni,ni->n", samples - closest, normal)
    on = (np.abs(distance) < _REACH) & (np.abs(way) > _ACROSS * np.abs(distance))
    near = np.flatnonzero(on & (way < 0.0))
    depth = body.signed_distance(samples[near])[0] - body.signed_distance(closest[near])[0]
    wrong = np.zeros(len(samples), bool)
    wrong[near[depth < -_CLEARLY]] = True
    share = [which[outer.samples_of_triangle].mean(axis=1) for which in (on, wrong)]
    area = [s @ outer.rest_area for s in share]
    return float(area[1] / max(area[0], 1e-300))
