"""What a garment's tethers and soft attachments are, from its mesh and its file."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.geodesics import mesh_graph
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.sim.holds.tethers import Attached
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.placement import Frames, GarmentLike, places_in_frames

MOST_TETHERS = 4
"""Groups of pins that a particle is tethered to: the nearest ones."""
_STIFFEST = 1e18
"""Stiffness over mass that stands for an infinite one [1/s^2]."""


def attached_to(garment: GarmentLike, frames: Frames, model: ClothModel) -> Attached:
    """What a garment asks for.

    Args:
        garment: The garment.
        frames: The frames that it follows.
        model: Its particles.

    Raises:
        GeometryError: Tethers without pins.
    """
    attached = Attached.none()
    if garment.tethers is not None:
        pin, length = nearest_pins(model)
        limit = (length * (1.0 + garment.tethers)).astype(np.float32)
        attached = attached._replace(pin=pin, length=limit)
    soft = garment.soft
    if soft is not None:
        p = model.particle[soft.vertices]
        attached = attached._replace(
            particle=p,
            collider=frames.collider[soft.frame],
            place=places_in_frames(garment, frames, soft.vertices, soft.frame),
            rate=np.minimum(
                np.stack([soft.stiffness, soft.damping], axis=1) / model.mass[p, None], _STIFFEST
            ),
            target=np.full((len(p), 3), np.nan, np.float32),
        )
    return attached


def nearest_pins(model: ClothModel) -> tuple[IntArray, FloatArray]:
    """The nearest pin of each of the nearest groups, and the way there over the cloth at rest.

    Pins that hang together by edges are a group: a waist band is one, the shoulders of a shirt are
    several. The way follows edges and straight lines across pairs of triangles, so that it is not
    shorter than the true one; where there is none it is infinite.

    Args:
        model: A garment's particles.

    Returns:
        Particles, shape [free, k], and lengths [m], shape [free, k], shortest first.

    Raises:
        GeometryError: There are no pins.
    """
    free = model.free_count
    if free == len(model):
        raise GeometryError(
            f"garment {model.name!r} has tethers but nothing that they could hang from; "
            "allowed: with pinned vertices"
        )
    triangles = model.particle_triangles
    graph = mesh_graph(model.rest, triangles)
    pin, length = [], []
    for group in _groups(triangles, np.arange(free, len(model), dtype=np.int32)):
        distance, before = graph.distances(group)
        root = np.arange(len(model), dtype=np.int32)
        for p in np.argsort(distance, kind="stable"):
            if before[p] >= 0:
                root[p] = root[before[p]]
        pin.append(root[:free])
        length.append(distance[:free])
    near = np.argsort(length, axis=0, kind="stable")[:MOST_TETHERS]
    pins = np.take_along_axis(np.array(pin), near, axis=0).T
    lengths = np.take_along_axis(np.array(length), near, axis=0).T
    return np.ascontiguousarray(pins), np.ascontiguousarray(lengths)


def _groups(triangles: IntArray, pins: IntArray) -> list[IntArray]:
    """Pins that hang together by edges between them."""
    edges = edge_table(triangles)[0]
    edges = edges[np.isin(edges, pins).all(axis=1)]
    n = int(triangles.max()) + 1
    links = coo_matrix((np.ones(len(edges), np.int8), tuple(edges.T)), shape=(n, n))
    _, label = connected_components(links, directed=False)
    return [pins[label[pins] == k] for k in np.unique(label[pins])]
