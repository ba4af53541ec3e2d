"""Garment meshes from files, meshed anew: even triangles, or smaller ones where the surface bends.

Modelled garments have loops of edges of a few millimetres beside others of centimetres. What a
solver cannot hold together in an armpit, by some centimetres, then falls on the shortest edges.
"""

from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.markings import marked
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.garment.sizing import Sizes, edge_sizes
from garment_sim_ros.geometry.lines import lines_of
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.remesh import area_by_size, remeshed
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.geometry.triangles import barycentric

_UNEVEN = 0.25
"""An edge shorter than this share of the median makes a mesh uneven."""
_FEWEST, _MOST = 12, 250_000
"""Vertices that a mesh may be given."""


def is_uneven(mesh: GarmentMesh) -> bool:
    """Whether a mesh has edges that are much shorter than most."""
    length = _lengths(mesh)
    return bool(length.min(initial=np.inf) < _UNEVEN * np.median(length))


def evened(mesh: GarmentMesh, sizes: Sizes) -> GarmentMesh:
    """The same surface with even triangles; as it was where that cannot be.

    Vertices lie on the surface as it was; those of open edges and of seams lie on these, and where
    they end, meet or turn sharply is a vertex. Colours and groups stay where they are.

    Args:
        mesh: The surface.
        sizes: Lengths that edges shall have.
    """
    lines = lines_of(mesh.vertices, mesh.triangles, mesh.seams)
    size = edge_sizes(mesh.vertices, mesh.triangles, lines.edges, sizes)
    count = round(area_by_size(mesh.vertices, mesh.triangles, size) / np.sqrt(0.75))
    if not _FEWEST <= count <= _MOST:
        note = f"left as it is: edges of {sizes.longest:g} m make {count} vertices of it"
        return replace(mesh, notes=(*mesh.notes, note))
    surface = MeshDistance(mesh.vertices, mesh.triangles)

    def sizing(x: FloatArray) -> FloatArray:
        _, closest, triangle = surface.signed_distance(x)
        corners = mesh.triangles[triangle]
        share = barycentric(mesh.vertices[corners], closest)
        there: FloatArray = np.einsum("vk,vk->v", share, size[corners])
        return there

    before = _lengths(mesh)
    try:
        vertices, triangles = remeshed(
            *(mesh.vertices, mesh.triangles, count),
            lambda x: surface.signed_distance(x)[1],
            lines,
            None if sizes.shortest == sizes.longest else sizing,
        )
    except GeometryError as error:
        return replace(mesh, notes=(*mesh.notes, f"left as it is: {error}"))
    flags = {}
    for name, inside in mesh.groups.items():
        flags[name] = np.zeros(len(mesh.vertices), bool)
        flags[name][inside] = True
    made = replace(GarmentMesh(vertices=vertices, triangles=triangles), notes=mesh.notes)
    made = marked(made, mesh.vertices, mesh.triangles, mesh.colours, flags)
    after = _lengths(made)
    note = (
        f"meshed anew: edges of {1e3 * before.min():.1f} to {1e3 * before.max():.1f} mm became "
        f"{1e3 * after.min():.1f} to {1e3 * after.max():.1f} mm, {len(mesh.vertices)} vertices "
        f"became {count}; points have an order of their own"
    )
    return replace(made, notes=(*mesh.notes, note))


def _lengths(mesh: GarmentMesh) -> FloatArray:
    edges = edge_table(mesh.triangles)[0]
    return np.linalg.norm(np.subtract(*mesh.vertices[edges.T]), axis=1)
