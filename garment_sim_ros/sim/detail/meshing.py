"""A garment's surface meshed anew with fewer vertices.

Each connected part is meshed by itself: a lining lies nearer to its outer cloth than edges are
long, and would else be mixed up with it.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.connectivity import components
from garment_sim_ros.geometry.lines import lines_of
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.remesh import remeshed_along
from garment_sim_ros.geometry.triangles import barycentric
from garment_sim_ros.sim.detail.surface import Places

_FEWEST = 12
"""Vertices of a part, at least."""


class Meshed(NamedTuple):
    """A coarser mesh of a garment.

    Attributes:
        places: Where its vertices are on the garment, c of them.
        triangles: Its triangles, shape [s, 3].
        under: The garment's triangle under the middle of each, shape [s].
        lines: Its edges along the garment's open edges and bands, shape [f, 2].
        along: The garment's edge that each of those runs along, shape [f, 2].
        part: The connected part that each vertex of the garment belongs to, shape [v].
    """

    places: Places
    triangles: IntArray
    under: IntArray
    lines: IntArray
    along: IntArray
    part: IntArray


def meshed(x: FloatArray, triangles: IntArray, bands: IntArray, count: int) -> Meshed:
    """A garment's surface with about so many vertices.

    Parts that cannot have fewer vertices stay as they are.

    Args:
        x: Its vertices [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        bands: Edges that are kept as lines, as open edges are, shape [b, 2].
        count: Vertices wanted.
    """
    number, part = components(triangles, len(x))
    made, begin = [], 0
    for p in range(number):
        of_part = np.flatnonzero(part == p)
        own = np.full(len(x), -1, np.int32)
        own[of_part] = np.arange(len(of_part), dtype=np.int32)
        rows = np.flatnonzero(part[triangles[:, 0]] == p).astype(np.int32)
        inside = own[bands[(own[bands] >= 0).all(axis=1)]]
        wanted = max(round(count * len(of_part) / len(x)), _FEWEST)
        one = _part(x[of_part], own[triangles[rows]], inside, wanted)
        corner = of_part[one.places.corner].astype(np.int32)
        made.append(
            one._replace(
                places=Places(corner=corner, share=one.places.share),
                triangles=one.triangles + begin,
                under=rows[one.under],
                lines=one.lines + begin,
                along=of_part[one.along].astype(np.int32),
            )
        )
        begin += len(corner)
    places = Places(
        corner=np.concatenate([m.places.corner for m in made]),
        share=np.concatenate([m.places.share for m in made]),
    )
    return Meshed(
        places=places,
        triangles=np.concatenate([m.triangles for m in made]).astype(np.int32),
        under=np.concatenate([m.under for m in made]),
        lines=np.concatenate([m.lines for m in made]).astype(np.int32),
        along=np.concatenate([m.along for m in made]),
        part=part,
    )


def _part(x: FloatArray, triangles: IntArray, bands: IntArray, count: int) -> Meshed:
    """One connected part; as it is where it cannot have so few vertices."""
    lines = lines_of(x, triangles, np.sort(bands, axis=1))
    each, none = np.arange(len(x), dtype=np.int32), np.zeros(len(x), np.int32)
    places = Places(corner=each.repeat(3).reshape(-1, 3), share=np.eye(3)[none])
    rows = np.arange(len(triangles), dtype=np.int32)
    as_it_is = Meshed(places, triangles, rows, lines.edges, lines.edges, none)
    if count >= len(x):
        return as_it_is
    surface = MeshDistance(x, triangles)
    try:
        made, faces, kept = remeshed_along(
            *(x, triangles, count), lambda p: surface.signed_distance(p)[1], lines
        )
    except GeometryError:
        return as_it_is
    _, closest, on = surface.signed_distance(made)
    corner = triangles[on]
    places = Places(corner=corner, share=barycentric(x[corner], closest))
    under = surface.signed_distance(made[faces].mean(axis=1))[2]
    along = lines.edges[:0]
    if len(kept):
        middles = x[lines.edges].mean(axis=1)[None]
        off = ((made[kept].mean(axis=1)[:, None] - middles) ** 2).sum(axis=2)
        along = lines.edges[off.argmin(axis=1)]
    return Meshed(places, faces, under, kept, along, none)
