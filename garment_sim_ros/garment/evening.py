"""Garment meshes with triangles of very different sizes, meshed anew.

Modelled garments have loops of edges of a few millimetres beside others of centimetres. What a
solver cannot hold together in an armpit, by some centimetres, then falls on the shortest edges.
"""

from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.garment.remesh import remeshed
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.geometry.triangles import triangle_areas

_UNEVEN = 0.25
"""An edge shorter than this share of the median makes a mesh uneven."""


def is_uneven(mesh: GarmentMesh) -> bool:
    """Whether a mesh has edges that are much shorter than most."""
    length = _lengths(mesh)
    return bool(length.min(initial=np.inf) < _UNEVEN * np.median(length))


def evened(mesh: GarmentMesh, edge_length: float) -> GarmentMesh:
    """The same surface with even triangles; as it was where that cannot be.

    Args:
        mesh: The surface.
        edge_length: Length that edges shall have [m].
    """
    area = float(triangle_areas(mesh.vertices, mesh.triangles).sum())
    count = round(area / (np.sqrt(0.75) * edge_length**2))
    surface = MeshDistance(mesh.vertices, mesh.triangles)
    before = _lengths(mesh)
    try:
        vertices, triangles = remeshed(
            mesh.vertices, mesh.triangles, count, lambda x: surface.signed_distance(x)[1]
        )
    except GeometryError as error:
        return replace(mesh, notes=(*mesh.notes, f"left as it is: {error}"))
    made = replace(mesh, vertices=vertices, triangles=triangles)
    after = _lengths(made)
    note = (
        f"meshed anew: edges of {1e3 * before.min():.1f} to {1e3 * before.max():.1f} mm became "
        f"{1e3 * after.min():.1f} to {1e3 * after.max():.1f} mm; points have an order of their own"
    )
    return replace(made, notes=(*mesh.notes, note))


def _lengths(mesh: GarmentMesh) -> FloatArray:
    edges = edge_table(mesh.triangles)[0]
    return np.linalg.norm(np.subtract(*mesh.vertices[edges.T]), axis=1)
