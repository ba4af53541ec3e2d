"""Oriented bounding boxes by statistics.

The axes are the eigenvectors of the covariance of the surface, each triangle weighted by its area
(Gottschalk, Lin, Manocha 1996, "OBBTree", section 4): dense corners do not pull them.
"""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.ties import facing, to_nanometres
from garment_sim_ros.geometry.triangles import triangle_areas


@dataclass(frozen=True)
class Box:
    """An oriented box.

    Attributes:
        centre: Its middle [m], shape [3].
        axes: Right-handed unit axes as columns, the last one the longest, shape [3, 3].
        half: Half its extent along each axis [m], shape [3].
    """

    centre: FloatArray
    axes: FloatArray
    half: FloatArray

    def local(self, points: FloatArray) -> FloatArray:
        """Points [n, 3] in the box's frame."""
        return (points - self.centre) @ self.axes


def oriented_box(vertices: FloatArray, faces: IntArray) -> Box:
    """The box of a triangle mesh.

    Args:
        vertices: Positions [m], shape [v, 3].
        faces: Triangles, not all without area, shape [f, 3].
    """
    corners = vertices[faces]
    area = triangle_areas(vertices, faces)
    area /= area.sum()
    middle = corners.mean(axis=1)
    mean = area @ middle
    # The integral of x x^T over a triangle: 9 parts at the middle, 1 at each corner, of 12.
    moments = 9.0 * np.einsum("f,fi,fj->ij", area, middle, middle)
    moments += np.einsum("f,fki,fkj->ij", area, corners, corners)
    axes = facing(np.linalg.eigh(moments / 12.0 - np.outer(mean, mean))[1])
    extent = to_nanometres(np.ptp(vertices @ axes, axis=0))
    axes = axes[:, np.argsort(extent, kind="stable")]
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    along = vertices @ axes
    low, high = along.min(axis=0), along.max(axis=0)
    return Box(centre=axes @ (0.5 * (low + high)), axes=axes, half=0.5 * (high - low))
