"""Fitting a garment over colliders, which stand a little off the skin here and there.

A garment cut to the skin would start inside such colliders: pushed out it would be stretched for
good, most of all next to pins. Like a tailor's letting out, this moves the cut itself.
"""

from collections.abc import Callable

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.kinds.ellipsoid import ELLIPSOID
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.contact.sides import Sides
from garment_sim_ros.contact.union import union_distance
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.geometry.connectivity import adjacency
from garment_sim_ros.geometry.topology import vertex_normals

_ROUNDS = 12
_STEP, _STEPS = 1e-3, 50
"""What is inside of ellipsoids still is moved outwards by so much at once, for a person of 1.65 m
[m], and so many times at most."""
_STAYS = 1e-6
"""What moved by less did not [m]."""
_SHORTEST = 0.4
"""No edge gets shorter than this share of its length as cut."""


def let_out(
    mesh: GarmentMesh, measures: Measures, colliders: ColliderSet, thickness: float
) -> FloatArray:
    """Positions of the mesh's vertices outside of all colliders.

    Vertices inside are moved out, and their neighbours with them, so that edges keep their
    lengths as far as they can.

    Args:
        mesh: The garment.
        measures: The body in the pose of the garment.
        colliders: Its colliders.
        thickness: Distance to keep from them, on top of the set's own [m].

    Returns:
        Positions [m], shape [v, 3].
    """
    poses = ColliderPoser(colliders, measures.body).poses(measures.T_world_joint)
    origin = mesh.vertices.mean(axis=0)
    shapes = pack(colliders)
    posed = PosedShapes.room_for(shapes)
    pose(shapes, poses, poses, origin, posed)
    contacts = Contacts.room_for(len(mesh.vertices), len(shapes.kind))
    sides = Sides.all_under(len(mesh.vertices), len(shapes.kind))
    start = mesh.vertices - origin

    def outside(x: FloatArray) -> FloatArray:
        single = x.astype(np.float32)
        distance = colliders.thickness + thickness
        collide(shapes, posed, sides, single, single.copy(), distance, 0.0, contacts)
        return np.where(contacts.shape[:, None] >= 0, single, x)

    def beyond(x: FloatArray) -> FloatArray:
        """Along the garment's normals; what does not get out so stays where it is."""
        y, step = x.copy(), _STEP * measures.unit
        distance = np.float32(colliders.thickness + thickness)
        normal = np.zeros(x.shape)
        vertex_normals(x, mesh.triangles, normal)
        inside = np.arange(len(x))
        for _ in range(_STEPS):
            gap = np.empty(len(inside), np.float32)
            union_distance(shapes, posed, y[inside].astype(np.float32), -1, distance, gap)
            inside = inside[gap < distance - step]
            y[inside] += step * normal[inside]
        y[inside] = x[inside]
        return y

    x = spread(start, mesh.triangles, outside)
    if any(c.kind == ELLIPSOID.name for c in colliders.colliders):
        # They are thin, and lie in the skin: the short way out of one may lead into the body.
        x = spread(x, mesh.triangles, beyond)
    return x + origin


def spread(
    start: FloatArray, triangles: IntArray, placed: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Positions of a mesh where some vertices had to move, and their neighbours with them.

    Args:
        start: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        placed: Moves those positions that are not allowed to the nearest ones that are.

    Returns:
        New positions [m], shape [v, 3]; `start` itself where all are allowed.
    """
    neighbours = adjacency(triangles, len(start))
    degree = np.maximum(neighbours.sum(axis=1).reshape(-1, 1), 1)
    moved = placed(start) - start
    if not moved.any():
        return start
    for _ in range(_ROUNDS):
        moved = 0.5 * (moved + np.asarray(neighbours @ moved / degree))
        moved = placed(start + moved) - start
    a, b = neighbours.nonzero()
    least = _SHORTEST * np.linalg.norm(start[a] - start[b], axis=1)
    for _ in range(_ROUNDS):
        # Two vertices moved to one place would leave an edge that any motion stretches.
        x = start + moved
        short = np.unique(a[np.linalg.norm(x[a] - x[b], axis=1) < least])
        if not len(short):
            break
        moved[short] = np.asarray(neighbours[short] @ moved) / degree[short]
    return start + moved


def let_out_panels(
    flat: FloatArray, triangles: IntArray, sewn: FloatArray, worn: FloatArray
) -> FloatArray:
    """Panels let out where the garment is wider over the colliders than it was sewn.

    Each triangle gets longer, in all directions alike or not, until it is stretched no more than
    as it was sewn. None gets shorter.

    Args:
        flat: Weft and warp of the triangles' corners [m], shape [t, 3, 2].
        triangles: Their vertices, shape [t, 3].
        sewn: Vertices of the garment as it was sewn [m], shape [v, 3].
        worn: The same as it is put on [m], shape [v, 3].

    Returns:
        Weft and warp of the corners [m], shape [t, 3, 2].
    """
    if flat.shape != (len(triangles), 3, 2):
        return flat  # of no use, as will be told
    moved = (np.abs(worn - sewn) > _STAYS)[triangles].any(axis=(1, 2))
    with np.errstate(invalid="ignore"):  # without area, or not numbers: as they are
        moved &= np.abs(np.linalg.det(_sides(flat))) > 0.0
    corners, of = flat[moved], triangles[moved]
    if not len(of):
        return flat
    to_flat = np.linalg.inv(_sides(corners))
    as_sewn, as_worn = (_sides(x[of]) @ to_flat for x in (sewn, worn))
    # In right stretch tensors squared: what is folded as sewn need not be let out to unfold.
    taut = _at_least_one(as_sewn.transpose(0, 2, 1) @ as_sewn)
    rate, axes = np.linalg.eigh(taut)
    slack = axes / np.sqrt(rate)[:, None, :] @ axes.transpose(0, 2, 1)
    more = _at_least_one(slack @ as_worn.transpose(0, 2, 1) @ as_worn @ slack)
    rate, axes = np.linalg.eigh(more)
    longer = axes * np.sqrt(rate)[:, None, :] @ axes.transpose(0, 2, 1)
    result = flat.copy()
    middle = corners.mean(axis=1, keepdims=True)
    result[moved] = middle + (corners - middle) @ longer
    return result


def _sides(corners: FloatArray) -> FloatArray:
    """Two sides of each triangle, as columns, shape [t, d, 2]."""
    sides: FloatArray = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    return sides


def _at_least_one(tensor: FloatArray) -> FloatArray:
    """Symmetric tensors with eigenvalues of 1 and more, shape [t, 2, 2]."""
    rate, axes = np.linalg.eigh(tensor)
    raised: FloatArray = axes * np.maximum(rate, 1.0)[:, None, :] @ axes.transpose(0, 2, 1)
    return raised
