"""A garment of fewer vertices, to be simulated in the place of one that has more.

It is the same surface, meshed anew: its vertices lie on the garment, those of open edges and
elastic bands on these. What a vertex has, such as weights, pins and limits, the garment has there.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import edge_table, non_manifold_edges
from garment_sim_ros.geometry.triangles import area_vectors, triangle_areas, unit_vectors
from garment_sim_ros.params import Material
from garment_sim_ros.sim.detail.meshing import Meshed, meshed
from garment_sim_ros.sim.detail.surface import Places, Surface
from garment_sim_ros.sim.elastic import ElasticEdges
from garment_sim_ros.sim.placement import GarmentLike, SoftAttachments

_FEWEST = 60
"""Vertices that a garment is simulated with at least."""
_APART = 1e3
"""Distance that is put between parts of a garment where places on others must not be found [m]."""
_FARTHEST, _MORE = 0.5, 1.5
"""Where one vertex in a hundred is farther from the coarser surface than that share of an edge, as
in trousers whose legs are hardly wider than edges are long, it has so many times as many."""


@dataclass(frozen=True, kw_only=True)
class Coarser:
    """A garment of fewer vertices; all as in `GarmentLike`."""

    name: str
    vertices: FloatArray
    triangles: IntArray
    material: Material
    frames: tuple[str, ...]
    T_world_frame_rest: FloatArray
    T_world_bone_rest: Mapping[str, FloatArray]
    frame_index: IntArray
    frame_weight: FloatArray
    pins: IntArray
    pin_frame: IntArray
    layer: int
    passed_by: tuple[str, ...]
    skin_limits: Mapping[str, FloatArray]
    soft: SoftAttachments | None
    tethers: float | None
    flat: FloatArray | None
    rest: FloatArray | None
    stitches: IntArray | None
    elastic: ElasticEdges | None
    self_collision: float | None


def coarser(garment: GarmentLike, detail: float) -> tuple[Coarser, Surface] | None:
    """A garment of fewer vertices, and the garment's own over it.

    Where so few cannot tell its shape it has more.

    Args:
        garment: The garment.
        detail: Share of its vertices, above 0 and up to 1.

    Returns:
        None where it has no more than so many, is still being sewn, or is none that can be
        simulated.

    Raises:
        GeometryError: Its surface cannot have fewer.
    """
    x = np.asarray(garment.vertices, np.float64)
    triangles = np.asarray(garment.triangles, np.int32)
    count = fewest(garment, detail)
    if count >= len(x) or garment.stitches is not None or not _is_cloth(x, triangles):
        return None
    if len(non_manifold_edges(triangles)):
        raise GeometryError("triangles meet at an edge that are more than two, or turned over")
    bands = np.zeros((0, 2), np.int32) if garment.elastic is None else garment.elastic.edges
    while count < len(x):
        mesh = meshed(x, triangles, bands, count)
        mesh = mesh._replace(places=_at_pins(garment, mesh))
        if len(mesh.places.corner) < len(x):
            whole = Surface(x, triangles, mesh.places, mesh.triangles)
            off = np.percentile(np.linalg.norm(whole.off, axis=1), 99.0)
            if off <= _FARTHEST * _edge_length(mesh.places.of(x), mesh.triangles):
                return _made(garment, mesh), whole
        count = round(_MORE * count)
    raise GeometryError("fewer vertices cannot tell its shape")


def fewest(garment: GarmentLike, detail: float) -> int:
    """How many vertices of a garment that share is."""
    return max(round(detail * len(garment.vertices)), _FEWEST)


def _is_cloth(x: FloatArray, triangles: IntArray) -> bool:
    """Whether all vertices are of triangles, and these have an area; else the model says so."""
    used = np.bincount(triangles.ravel(), minlength=len(x)) > 0
    return bool(used.all()) and float(triangle_areas(x, triangles).sum()) > 0.0


def _made(garment: GarmentLike, mesh: Meshed) -> Coarser:
    """What a garment has at places on it."""
    places = mesh.places
    made = places.of(np.asarray(garment.vertices, np.float64))
    frame_index, frame_weight = _followed(garment, places)
    pins, pin_frame = _pins(garment, places)
    return Coarser(
        name=garment.name,
        vertices=made,
        triangles=mesh.triangles,
        material=garment.material,
        frames=garment.frames,
        T_world_frame_rest=garment.T_world_frame_rest,
        T_world_bone_rest=garment.T_world_bone_rest,
        frame_index=frame_index,
        frame_weight=frame_weight,
        pins=pins,
        pin_frame=pin_frame,
        soft=_soft(garment, pins, made, mesh),
        layer=garment.layer,
        passed_by=garment.passed_by,
        skin_limits={n: np.asarray(v)[places.nearest] for n, v in garment.skin_limits.items()},
        tethers=garment.tethers,
        flat=None if garment.flat is None else _flat(garment, made, mesh),
        rest=None if garment.rest is None else places.of(np.asarray(garment.rest)),
        stitches=None,
        elastic=_along(garment, mesh),
        self_collision=garment.self_collision,
    )


def _edge_length(x: FloatArray, triangles: IntArray) -> float:
    edges = edge_table(triangles)[0]
    return float(np.median(np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)))


def _at_pins(garment: GarmentLike, mesh: Meshed) -> Places:
    """Places, of which some are moved so that no pin is farther than an edge from a pinned one."""
    x, places = np.asarray(garment.vertices, np.float64), mesh.places
    made, part = places.of(x), mesh.part[places.nearest]
    length = _edge_length(made, mesh.triangles)
    corner, share = places.corner.copy(), places.share.copy()
    pinned = np.isin(places.nearest, garment.pins)
    for pin in np.asarray(garment.pins):
        away = np.linalg.norm(made - x[pin], axis=1)
        away[part != mesh.part[pin]] = np.inf
        if away[pinned].min(initial=np.inf) <= length:
            continue
        away[pinned] = np.inf
        c = int(away.argmin())
        if away[c] < np.inf:
            corner[c], share[c], made[c], pinned[c] = pin, (1.0, 0.0, 0.0), x[pin], True
    return Places(corner=corner, share=share)


def _followed(garment: GarmentLike, places: Places) -> tuple[IntArray, FloatArray]:
    """The frames that each vertex follows, and their weights."""
    count, rows = len(garment.frames), np.arange(len(garment.vertices))[:, None]
    weight = np.zeros((len(garment.vertices), count))
    np.add.at(weight, (rows, garment.frame_index), garment.frame_weight)
    blended = places.of(weight)
    most = max(1, int((blended > 0.0).sum(axis=1).max()))
    index = np.argsort(-blended, axis=1, kind="stable")[:, :most]
    return index.astype(np.int32), np.take_along_axis(blended, index, axis=1)


def _pins(garment: GarmentLike, places: Places) -> tuple[IntArray, IntArray]:
    """Vertices beside pins, and the frames that they are fixed to."""
    frame_of = np.full(len(garment.vertices), -1, np.int32)
    frame_of[garment.pins] = garment.pin_frame
    frame = frame_of[places.nearest]
    pins = np.flatnonzero(frame >= 0).astype(np.int32)
    return pins, frame[pins]


def _soft(
    garment: GarmentLike, pins: IntArray, made: FloatArray, mesh: Meshed
) -> SoftAttachments | None:
    """Soft attachments; springs that are near act on one vertex, from the stiffest's frame."""
    free = np.setdiff1d(np.arange(len(made), dtype=np.int32), pins)
    old, part = garment.soft, mesh.part[mesh.places.nearest]
    if old is None or not len(free) or not len(old.vertices):
        return None
    # Those of another part of the garment are far away.
    there = np.c_[made, _APART * part][free]
    here = np.c_[np.asarray(garment.vertices), _APART * mesh.part][old.vertices]
    near = free[cKDTree(there).query(here)[1]]
    stiffest = np.argsort(-old.stiffness, kind="stable")
    vertices, first, group = np.unique(near[stiffest], return_index=True, return_inverse=True)
    return SoftAttachments(
        vertices=vertices,
        frame=old.frame[stiffest[first]],
        stiffness=np.bincount(group, old.stiffness[stiffest]).astype(np.float64),
        damping=np.bincount(group, old.damping[stiffest]).astype(np.float64),
    )


def _flat(garment: GarmentLike, made: FloatArray, mesh: Meshed) -> FloatArray:
    """Where corners lie in the panels: as the garment's triangle under the middle maps them.

    Returns:
        Weft and warp [m], shape [s, 3, 2].
    """
    assert garment.flat is not None
    x, under = np.asarray(garment.vertices, np.float64), np.asarray(garment.triangles)[mesh.under]
    own, theirs = made[mesh.triangles], x[under]
    panel = np.asarray(garment.flat, np.float64)[mesh.under]
    along = unit_vectors(own[:, 1] - own[:, 0])
    up = unit_vectors(area_vectors(made, mesh.triangles))
    beside = unit_vectors(area_vectors(x, under))
    level = unit_vectors(along - np.einsum("si,si->s", along, beside)[:, None] * beside)
    ours = np.stack([along, np.cross(up, along)], axis=1)
    other = np.stack([level, np.cross(beside, level)], axis=1)
    sides = np.einsum("ski,sni->skn", other, theirs[:, 1:] - theirs[:, :1])
    mapped = (panel[:, 1:] - panel[:, :1]).transpose(0, 2, 1) @ np.linalg.pinv(sides)
    corners = np.einsum("ski,sni->snk", ours, own - own[:, :1])
    flat: FloatArray = np.einsum("slk,snk->snl", mapped, corners)
    return flat


def _along(garment: GarmentLike, mesh: Meshed) -> ElasticEdges | None:
    """Bands along the lines that run where the garment's bands do; each of several at one edge."""
    bands, v = garment.elastic, len(garment.vertices)
    if bands is None:
        return None
    line, band = (
        np.sort(edges, axis=1).astype(np.int64) @ (v, 1) for edges in (mesh.along, bands.edges)
    )
    at, which = np.nonzero(line[:, None] == band)
    edges = np.sort(mesh.lines[at], axis=1).astype(np.int32)
    return ElasticEdges(edges, bands.tension[which], bands.slack[which])
