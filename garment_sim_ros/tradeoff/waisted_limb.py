"""A model such as the first paper's Fig. 8 has, and the hull that cloth falls on there.

Sun et al. 2007 print of their model that it has 508 triangles, edges of 0.084 on average and a
convex hull of 224 faces, which is inflated by delta = 0.005 and simplified to 116.
"""

import numpy as np
from scipy.spatial import ConvexHull

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.colliders.hulls.hull import Hull, convex_hull, inflate_vertices
from garment_sim_ros.colliders.hulls.hull_simplify import Simplification, simplify_hull
from garment_sim_ros.contact.plain_shapes import hull
from garment_sim_ros.contact.shapes import Collider

DELTA = 0.005
"""Inflation of the paper's Fig. 8 [m]."""
_FACES = 116
_EDGE = 0.084


def waisted_limb() -> tuple[FloatArray, IntArray]:
    """A limb along z: 256 evenly spread directions, radii that swell and shrink along it.

    Returns:
        Vertices [m], shape [256, 3]; triangles, shape [508, 3].
    """
    i = np.arange(256) + 0.5
    polar, turn = np.arccos(1 - 2 * i / 256), np.pi * (1 + 5**0.5) * i
    ball = np.column_stack(
        [np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)]
    )
    triangles = ConvexHull(ball).simplices
    radius = 1 + 0.2 * np.cos(3.5 * polar) + 0.3 * np.sin(4 * turn) * np.sin(polar)
    x = ball * [0.5, 0.45, 1.6] * np.column_stack([radius, radius, np.ones(256)])
    edges = x[triangles] - np.roll(x[triangles], 1, axis=1)
    return x * _EDGE / np.linalg.norm(edges, axis=-1).mean(), triangles


def lying_hulls(*, printed: bool = False) -> tuple[Hull, Hull]:
    """Its own hull, of 224 faces, as it lies along x, and that one inflated and simplified.

    Args:
        printed: Whether by deleting triangles alone, without a limit of how far it may stick out,
            as the paper has it.
    """
    x, _ = waisted_limb()
    inner = convex_hull(x[:, [2, 1, 0]] * [1.0, 1.0, -1.0])
    outside = np.inf if printed else 2.0 * DELTA
    how = Simplification(max_faces=_FACES, outside=outside, triangles_only=printed)
    return inner, simplify_hull(inflate_vertices(inner, DELTA), inner, how)


def lying_limb() -> Collider:
    """The simplified hull as a collider, its highest corner at the origin's height."""
    _, outer = lying_hulls()
    top = float(outer.vertices[:, 2].max())
    return hull(outer.vertices, outer.faces, position=(0.0, 0.0, -top), name="limb")
