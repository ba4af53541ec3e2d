"""Thin hulls that get more of the body's inside: slices of skin are shells, body parts are not.

A cut may leave a part that is little but skin, as a buttock beside the pelvis. Its hull's vertices
are all near the skin, so the core between them comes out through it, where clothes lie; and cloth
that is deeper in it than its middle is led out to the wrong side. Such a hull gets a smaller copy
of itself as a second side, as deep in the body as there is room.
"""

import numpy as np

from garment_sim_ros.colliders.hulls.convex_parts import lattice
from garment_sim_ros.colliders.hulls.hull import Hull, convex_hull
from garment_sim_ros.contact.cores import middle
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.ties import first_least, to_nanometres

_THIN = 0.015
"""A hull whose core is nearer to its surface than this is thin [m]."""
_WAYS = np.concatenate([f * lattice(50) for f in np.linspace(0.0, 0.06, 6)], axis=1)
"""Ways from the first side to the second that are tried [m], shape [3, w]."""
_EQUAL = 1e-7
"""Ways that lead to places as deep as each other but for so much [m] are equally good."""
_PLACES = 9
"""Places of a core that are to be under the skin."""
_SMALLER = 0.5
"""Size of the second side, as a share: it is to stay inside the body."""


def thickened(hull: Hull, skin: MeshDistance) -> Hull:
    """A hull that is as it was, or thicker towards the inside of the body.

    Args:
        hull: In the bind pose [m].
        skin: The body's, in the bind pose.
    """
    thick = -float(hull.height(middle(hull.vertices)).max()) >= _THIN
    return hull if thick else deepened(hull, skin)


def comes_out(hull: Hull, skin: MeshDistance) -> bool:
    """Whether the core of a hull in the bind pose is not all under the skin."""
    start, end = middle(hull.vertices)
    share = np.linspace(0.0, 1.0, _PLACES)[:, None]
    return bool(skin.signed_distance((1.0 - share) * start + share * end)[0].max() > 0.0)


def deepened(hull: Hull, skin: MeshDistance) -> Hull:
    """A hull with a smaller copy of itself as a second side, see `thickened`."""
    centre = hull.vertices.mean(axis=0)
    depth = skin.signed_distance(centre + _WAYS.T)[0]
    way = _WAYS.T[first_least(depth, _EQUAL)]
    second = to_nanometres(centre + way + _SMALLER * (hull.vertices - centre))
    return convex_hull(np.concatenate([hull.vertices, second]))
