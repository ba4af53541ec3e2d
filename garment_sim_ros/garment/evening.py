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
from garment_sim_ros.garment.remesh import Lines, area_by_size, remeshed
from garment_sim_ros.garment.sizing import Sizes, edge_sizes
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.geometry.triangles import barycentric

_UNEVEN = 0.25
"""An edge shorter than this share of the median makes a mesh uneven."""
_SHARP = 0.7
"""Where a line turns by an angle of a smaller cosine it has a corner."""
_FEWEST, _MOST = 12, 250_000
"""Vertices that a mesh may be given."""
_AT_ONCE = 256
"""Points whose distances to all segments are held at once."""


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
    lines = _lines(mesh)
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


def _lines(mesh: GarmentMesh) -> Lines:
    """Open edges and seams, and where they turn or meet."""
    edges, _, sides = edge_table(mesh.triangles)
    lines = np.unique(np.concatenate([edges[sides == 1], mesh.seams]), axis=0)
    ends = np.concatenate([lines, lines[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    here, first, size = np.unique(ends[:, 0], return_index=True, return_counts=True)
    corner = np.zeros(len(mesh.vertices), dtype=bool)
    corner[here[size != 2]] = True
    two, at = here[size == 2], first[size == 2]
    x = mesh.vertices
    way = [x[ends[at + k, 1]] - x[two] for k in (0, 1)]
    unit = [w / np.maximum(np.linalg.norm(w, axis=1, keepdims=True), 1e-300) for w in way]
    corner[two[-np.einsum("ni,ni->n", *unit) < _SHARP]] = True
    start, along = x[lines[:, 0]], x[lines[:, 1]] - x[lines[:, 0]]
    return Lines(lines.astype(np.int32), corner, lambda p: _on_segments(p, start, along))


def _on_segments(points: FloatArray, start: FloatArray, along: FloatArray) -> FloatArray:
    """The nearest points of segments to points [n, 3], which start and run so, shape [s, 3]."""
    squared = np.maximum(np.einsum("si,si->s", along, along), 1e-300)
    nearest = np.empty_like(points)
    for k in range(0, len(points), _AT_ONCE):
        p = points[k : k + _AT_ONCE, None]
        share = np.clip(np.einsum("nsi,si->ns", p - start, along) / squared, 0.0, 1.0)
        there = start + share[..., None] * along
        chosen = np.argmin(((p - there) ** 2).sum(axis=2), axis=1)
        nearest[k : k + _AT_ONCE] = there[np.arange(len(chosen)), chosen]
    return nearest


def _lengths(mesh: GarmentMesh) -> FloatArray:
    edges = edge_table(mesh.triangles)[0]
    return np.linalg.norm(np.subtract(*mesh.vertices[edges.T]), axis=1)
