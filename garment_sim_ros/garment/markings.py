"""Colours, groups and seams of a mesh's file on the surface that was made of it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, LongArray
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.triangles import barycentric


def marked(
    mesh: GarmentMesh,
    vertices: FloatArray,
    triangles: IntArray,
    colours: FloatArray | None,
    groups: Mapping[str, NDArray[np.bool_]],
) -> GarmentMesh:
    """The mesh with what is painted at the nearest points of another surface.

    Vertices may have been welded, added, or moved along the surface since; their number in the
    file tells nothing then, where they lie does. A vertex is in a group where that is more than
    half in it, between the corners of the triangle there.

    Args:
        mesh: The surface.
        vertices: Vertices of the painted one [m], shape [v, 3].
        triangles: Its triangles, shape [t, 3].
        colours: Its colours, as `GarmentMesh.colours`, shape [v, 3]; None: none.
        groups: Which of its vertices are in each group, shape [v].
    """
    if colours is None and not groups:
        return mesh
    columns = [flags.astype(np.float64)[:, None] for flags in groups.values()]
    if colours is not None:
        columns.append(colours)
    _, closest, triangle = MeshDistance(vertices, triangles).signed_distance(mesh.vertices)
    corners = triangles[triangle]
    share = barycentric(vertices[corners], closest)
    there = np.einsum("vk,vkm->vm", share, np.concatenate(columns, axis=1)[corners])
    return replace(
        mesh,
        colours=None if colours is None else there[:, -3:],
        groups={
            name: np.flatnonzero(there[:, k] > 0.5 + 1e-6).astype(np.int32)
            for k, name in enumerate(groups)
        },
    )


def texture_seams(
    vertices: FloatArray, triangles: IntArray, texture: LongArray, clean: FloatArray
) -> IntArray:
    """Edges at which the two triangles beside them have different texture points, shape [s, 2].

    Args:
        vertices: The file's vertices [m], shape [v, 3].
        triangles: Triangles of the file's polygons, shape [t, 3].
        texture: Number of the texture point at each of their corners, shape [t, 3].
        clean: Vertices of the repaired mesh, each in the place of some of the file's [m], [n, 3];
            edges are given in their numbers.
    """
    places = np.concatenate([clean, vertices]) + 0.0
    _, first, place = np.unique(places, axis=0, return_index=True, return_inverse=True)
    number = first[place.ravel()[len(clean) :]]  # below n where the repaired mesh has it
    welded = number[triangles]
    sides = [[0, 1], [1, 2], [2, 0]]
    ends = welded[:, sides].reshape(-1, 2)
    at = texture[:, sides].reshape(-1, 2)
    turned = ends[:, 0] > ends[:, 1]
    ends[turned], at[turned] = ends[turned, ::-1], at[turned, ::-1]
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, at = ends[order], at[order]
    same = (ends[1:] == ends[:-1]).all(axis=1)
    cut = same & (at[1:] != at[:-1]).any(axis=1) & (ends[1:] < len(clean)).all(axis=1)
    return np.unique(ends[1:][cut], axis=0).astype(np.int32)
