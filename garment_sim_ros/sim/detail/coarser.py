"""A garment of fewer vertices, to be simulated in the place of one that has more.

It is the same surface, meshed anew: its vertices lie on the garment, those of open edges and
elastic bands on these. What a vertex has, such as weights, pins and limits, the garment has there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.lines import Lines, lines_of
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.remesh import remeshed_along
from garment_sim_ros.geometry.topology import edge_table, non_manifold_edges
from garment_sim_ros.geometry.triangles import barycentric
from garment_sim_ros.params import Material
from garment_sim_ros.sim.detail.surface import Places, Surface
from garment_sim_ros.sim.elastic import ElasticEdges
from garment_sim_ros.sim.placement import GarmentLike, SoftAttachments

_FEWEST = 60
"""Vertices that a garment is simulated with at least."""
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
        None where it has no more than so many, or is still being sewn.

    Raises:
        GeometryError: Its surface cannot have fewer.
    """
    x, triangles = (
        np.asarray(garment.vertices, np.float64),
        np.asarray(garment.triangles, np.int32),
    )
    count = max(round(detail * len(x)), _FEWEST)
    if count >= len(x) or garment.stitches is not None:
        return None
    if len(non_manifold_edges(triangles)):
        raise GeometryError("more than two triangles meet at an edge")
    surface = MeshDistance(x, triangles)
    bands = np.zeros((0, 2), np.int32) if garment.elastic is None else garment.elastic.edges
    lines = lines_of(x, triangles, np.sort(bands, axis=1))
    why = "too few vertices tell its shape"
    while count < len(x):
        try:
            places, faces, kept = _meshed(garment, surface, lines, count)
            whole = Surface(x, triangles, places, faces)
            off = np.percentile(np.linalg.norm(whole.off, axis=1), 99.0)
            if off <= _FARTHEST * _edge_length(places.of(x), faces):
                made = _made(garment, surface, places, faces)
                elastic = _along(garment, made.vertices, kept, lines.edges)
                return replace(made, elastic=elastic), whole
        except GeometryError as error:
            why = str(error)
        count = round(_MORE * count)
    raise GeometryError(why)


def _meshed(
    garment: GarmentLike, surface: MeshDistance, lines: Lines, count: int
) -> tuple[Places, IntArray, IntArray]:
    """Where so many vertices are on a garment, their triangles, and edges along its lines."""
    x, triangles = np.asarray(garment.vertices, np.float64), garment.triangles
    made, faces, kept = remeshed_along(
        *(x, np.asarray(triangles, np.int32), count),
        lambda p: surface.signed_distance(p)[1],
        lines,
    )
    _, closest, under = surface.signed_distance(made)
    corner = triangles[under]
    places = Places(corner=corner, share=barycentric(x[corner], closest))
    return _at_pins(garment, places, faces), faces, kept


def _made(garment: GarmentLike, surface: MeshDistance, places: Places, faces: IntArray) -> Coarser:
    """What a garment has at places on it."""
    x = np.asarray(garment.vertices, np.float64)
    made = places.of(x)
    frame_index, frame_weight = _followed(garment, places)
    pins, pin_frame = _pins(garment, places)
    return Coarser(
        name=garment.name,
        vertices=made,
        triangles=faces,
        material=garment.material,
        frames=garment.frames,
        T_world_frame_rest=garment.T_world_frame_rest,
        T_world_bone_rest=garment.T_world_bone_rest,
        frame_index=frame_index,
        frame_weight=frame_weight,
        pins=pins,
        pin_frame=pin_frame,
        soft=_soft(garment, pins, made),
        layer=garment.layer,
        passed_by=garment.passed_by,
        skin_limits={n: np.asarray(v)[places.nearest] for n, v in garment.skin_limits.items()},
        tethers=garment.tethers,
        flat=None if garment.flat is None else _flat(garment, surface, made, faces),
        rest=None if garment.rest is None else places.of(np.asarray(garment.rest)),
        stitches=None,
        elastic=None,
        self_collision=garment.self_collision,
    )


def _edge_length(x: FloatArray, triangles: IntArray) -> float:
    edges = edge_table(triangles)[0]
    return float(np.median(np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)))


def _at_pins(garment: GarmentLike, places: Places, faces: IntArray) -> Places:
    """Places, of which some are moved so that no pin is farther than an edge from a pinned one."""
    x = np.asarray(garment.vertices, np.float64)
    made = places.of(x)
    length = _edge_length(made, faces)
    pins = np.asarray(garment.pins)
    corner, share = places.corner.copy(), places.share.copy()
    pinned = np.isin(places.nearest, pins)
    for pin in pins:
        held = made[pinned]
        if len(held) and np.linalg.norm(held - x[pin], axis=1).min() <= length:
            continue
        away = np.linalg.norm(made - x[pin], axis=1)
        away[pinned] = np.inf
        c = int(away.argmin())
        corner[c], share[c], made[c], pinned[c] = pin, (1.0, 0.0, 0.0), x[pin], True
    return replace(places, corner=corner, share=share)


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


def _soft(garment: GarmentLike, pins: IntArray, made: FloatArray) -> SoftAttachments | None:
    """Soft attachments: the springs of those that are near go to the same vertex."""
    free = np.setdiff1d(np.arange(len(made), dtype=np.int32), pins)
    old = garment.soft
    if old is None or not len(free):
        return None
    near = free[cKDTree(made[free]).query(np.asarray(garment.vertices)[old.vertices])[1]]
    vertices, first, group = np.unique(near, return_index=True, return_inverse=True)
    return SoftAttachments(
        vertices=vertices,
        frame=old.frame[first],
        stiffness=np.bincount(group, old.stiffness).astype(np.float64),
        damping=np.bincount(group, old.damping).astype(np.float64),
    )


def _flat(
    garment: GarmentLike, surface: MeshDistance, made: FloatArray, faces: IntArray
) -> FloatArray:
    """Where corners lie in the panels: as the garment's triangle under the middle maps them.

    Returns:
        Weft and warp [m], shape [s, 3, 2].
    """
    assert garment.flat is not None
    own = made[faces]
    under = surface.signed_distance(own.mean(axis=1))[2]
    theirs = np.asarray(garment.vertices, np.float64)[np.asarray(garment.triangles)[under]]
    panel = np.asarray(garment.flat, np.float64)[under]
    along = _unit(own[:, 1] - own[:, 0])
    up = _unit(np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0]))
    beside = _unit(np.cross(theirs[:, 1] - theirs[:, 0], theirs[:, 2] - theirs[:, 0]))
    level = _unit(along - np.einsum("si,si->s", along, beside)[:, None] * beside)
    ours = np.stack([along, np.cross(up, along)], axis=1)
    other = np.stack([level, np.cross(beside, level)], axis=1)
    sides = np.einsum("ski,sni->skn", other, theirs[:, 1:] - theirs[:, :1])
    mapped = (panel[:, 1:] - panel[:, :1]).transpose(0, 2, 1) @ np.linalg.pinv(sides)
    corners = np.einsum("ski,sni->snk", ours, own - own[:, :1])
    flat: FloatArray = np.einsum("slk,snk->snl", mapped, corners)
    return flat


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    result: FloatArray = vectors / np.maximum(length, 1e-300)
    return result


def _along(
    garment: GarmentLike, made: FloatArray, lines: IntArray, of_garment: IntArray
) -> ElasticEdges | None:
    """Bands along the lines that run where the garment's bands do.

    Args:
        garment: The garment.
        made: Vertices of the coarser one [m], shape [c, 3].
        lines: Its edges along open edges and bands, shape [f, 2].
        of_garment: The same of the garment, shape [g, 2].
    """
    bands, x = garment.elastic, np.asarray(garment.vertices, np.float64)
    if bands is None:
        return None
    v = len(x)
    key, of_bands = (
        np.sort(e, axis=1).astype(np.int64) @ (v, 1) for e in (of_garment, bands.edges)
    )
    middle, nearest = made[lines].mean(axis=1), cKDTree(x[of_garment].mean(axis=1))
    order = np.argsort(of_bands, kind="stable")
    place = np.minimum(np.searchsorted(of_bands[order], key), len(order) - 1)
    band = np.where(of_bands[order][place] == key, order[place], -1)
    band = band[nearest.query(middle)[1]]
    runs = band >= 0
    edges = np.sort(lines[runs], axis=1).astype(np.int32)
    return ElasticEdges(edges, bands.tension[band[runs]], bands.slack[band[runs]])
