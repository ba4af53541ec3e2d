"""Signed-distance colliders for any body: a grid per bone, and one per joint that needs it.

Each rigid region of the skin, closed by lids where it was cut off its neighbours, is sampled in a
box about it that is fixed to its bone. About a joint the band of skin that both its sides move is
sampled, too, and turns halfway, so that the two blend. Grids follow concave skin, which hulls
cannot. What is thinner than a voxel is made as thick as it takes: no skin is outside, verified.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import SdfSettings
from garment_sim_ros.colliders.capsules.capsules import frame_colliders
from garment_sim_ros.colliders.hulls.convex_parts import closed, split, weld
from garment_sim_ros.colliders.joint_shapes import (
    SHARE,
    Joint,
    is_covered,
    is_worth_it,
    joints,
    seen_turned,
    turned_skin,
)
from garment_sim_ros.colliders.regions import Regions, region_surface, skin_regions
from garment_sim_ros.contact.kinds.distance_grid import CORNERS, DistanceGrid, cells_and_shares
from garment_sim_ros.contact.kinds.sdf import SDF
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.errors import GeometryError, ParameterError
from garment_sim_ros.geometry.closest_sweep import grid_distances
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.obb import Box, oriented_box
from garment_sim_ros.geometry.transforms import quaternion_from_matrix, transform_points
from garment_sim_ros.params import declarations, validated

_MOST_NODES = 2**20
"""Samples of one grid; of a larger one the voxels grow."""
_BEYOND = 2.0
"""How far a grid goes on beyond its inflated surface, in voxels."""
_HELD = 1e-4
"""How deep skin is inside at least [m]."""
_BAND = (0.1, 0.9)
"""Weights of the lower side between which skin belongs to a joint's grid."""


@dataclass(frozen=True, kw_only=True)
class GridFit:
    """How one grid came about.

    Attributes:
        name: The collider's.
        nodes: Its samples.
        voxel: Their distance [m].
        volume: Volume of what is inside, by counting samples [m^3].
        lowered: The most that a sample was lowered by to hold the skin [m].
        outside: Skin points of its region that are outside; 0 unless the fit is faulty.
        note: What was done about an unusual surface, or what a joint's grid covers.
    """

    name: str
    nodes: int
    voxel: float
    volume: float
    lowered: float = 0.0
    outside: int = 0
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class SignedDistanceFit:
    """Fitted colliders and how each came about, in the same order without the frames."""

    colliders: ColliderSet
    shapes: tuple[GridFit, ...] = field(default_factory=tuple)

    def report(self) -> dict[str, dict[str, object]]:
        """Figures of each shape by name, lengths in mm."""
        return {
            shape.name: {
                "kind": SDF.name,
                "nodes": shape.nodes,
                "voxel_mm": round(1e3 * shape.voxel, 3),
                "volume": round(shape.volume, 6),
                "lowered_mm_max": round(1e3 * shape.lowered, 3),
                "outside": shape.outside,
                "note": shape.note,
            }
            for shape in self.shapes
        }


@dataclass(frozen=True)
class _Piece:
    """A grid in the bind pose, in the frame of a box."""

    grid: DistanceGrid
    box: Box
    lowered: float
    outside: int
    note: str

    def value(self, points: FloatArray) -> FloatArray:
        """Signed distance of points [n, 3] of the bind pose [m]."""
        return self.grid.value(self.box.local(points))


def fit_signed_distances(
    body: Body,
    settings: SdfSettings | None = None,
    *,
    delta: float = 0.003,
    merge: float = 0.0,
    bend: bool = True,
    thickness: float = 0.002,
) -> SignedDistanceFit:
    """A grid per region of the skin and per joint, and one frame per major bone.

    Args:
        body: Rig and skin; without a rig all of it is one grid.
        settings: How.
        delta: Inflation [m].
        merge: A region with a smaller share of the skin joins the next one.
        bend: Whether joints get grids.
        thickness: Distance that cloth keeps on top [m].

    Raises:
        ParameterError: A setting out of range.
        GeometryError: The skin has no triangles.
    """
    given = settings or SdfSettings()
    settings = validated(
        SdfSettings, {name: getattr(given, name) for name in declarations(SdfSettings)}
    )
    for name, value in (("delta", delta), ("thickness", thickness)):
        if not 0.0 <= value < np.inf:
            raise ParameterError(name, f"found {value!r}", "allowed: 0 m or more")
    if len(body.skin.triangles) == 0:
        raise GeometryError(f"body {body.name!r} has no triangles to sample distances to")
    regions = skin_regions(body, merge=merge)
    colliders: list[Collider] = []
    shapes: list[GridFit] = []
    pieces: dict[int, _Piece] = {}

    def add(name: str, region: int, piece: _Piece, note: str, share: float | None) -> None:
        T_bone_bind = body.skin.T_bone_bind[regions.joint[region]]
        colliders.append(_collider(name, regions.names[region], piece, T_bone_bind, share))
        shapes.append(_figures(name, piece, note))

    for m in range(len(regions)):
        surface = region_surface(body.skin, regions, m)
        if len(surface) > 0:
            pieces[m] = _sampled(surface, settings.voxel, delta, hold=True)
            add(regions.names[m], m, pieces[m], pieces[m].note, None)
    skin = MeshDistance(body.skin.vertices, body.skin.triangles)
    for joint in joints(body, regions, skin) if bend else ():
        found = _joint_piece(body, regions, joint, pieces, settings.voxel, delta)
        if found is not None:
            add(f"joint_{regions.names[joint.region]}", joint.region, *found, SHARE)
    frames = frame_colliders(major_bones(body))
    return SignedDistanceFit(
        colliders=ColliderSet(colliders=(*colliders, *frames), thickness=thickness),
        shapes=tuple(shapes),
    )


def _sampled(surface: FloatArray, voxel: float, delta: float, *, hold: bool) -> _Piece:
    """The distance to a closed surface, sampled.

    Args:
        surface: Corners of triangles [m], shape [t, 3, 3]; holes are closed.
        voxel: Distance of samples [m]; more where there would be too many.
        delta: Inflation [m].
        hold: Whether all of the surface must be inside.
    """
    points, triangles = _mesh(closed(surface))
    notes = []
    a, b, c = (points - points[0])[triangles].transpose(1, 0, 2)
    if np.einsum("tk,tk->", a, np.cross(b, c)) < 0.0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
        notes.append("inside-out: turned")
    if np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() > 0.0:
        box = oriented_box(points, triangles)
    else:
        low, high = points.min(axis=0), points.max(axis=0)
        box = Box(centre=0.5 * (low + high), axes=np.eye(3), half=0.5 * (high - low))
    extent = 2.0 * (box.half + delta)
    least = voxel
    while np.prod(np.ceil(extent / voxel + 2.0 * _BEYOND) + 1.0) > _MOST_NODES:
        voxel *= 1.05
    if voxel > least:
        notes.append(f"too large for voxels of {1e3 * least:g} mm: {1e3 * voxel:.1f}")
    count = (np.ceil(extent / voxel + 2.0 * _BEYOND) + 1.0).astype(np.int64)
    at_voxel = box.local(points) / voxel + 0.5 * (count - 1)
    away = voxel * grid_distances(at_voxel, triangles, count)
    inside = _inside(MeshDistance(at_voxel, triangles), away / voxel)
    values = np.where(inside, -away, away) - delta
    lowered, held = 0.0, np.zeros((0, 3))
    if values.min() >= 0.0:
        notes.append("nothing is inside: as thick as it takes to hold the surface")
        hold = True
    if hold:
        held = np.concatenate([weld(surface)[0], surface.mean(axis=1)])
        lowered = _lower(values, (box.local(held) / voxel) + 0.5 * (count - 1))
    grid = DistanceGrid.sampled(voxel, values)
    outside = int((grid.value(box.local(held)) > 0.0).sum())
    return _Piece(grid=grid, box=box, lowered=lowered, outside=outside, note="; ".join(notes))


def _inside(mesh: MeshDistance, away: FloatArray) -> NDArray[np.bool_]:
    """Which nodes of a grid a mesh goes around; it and distances [nx, ny, nz] are in cells.

    By the winding number, which takes long: two neighbours, both more than half a cell away from
    the mesh, are on the same side of it.
    """
    apart, _ = label(away > 0.5)
    inside = np.zeros(away.size, np.bool_)
    near = np.flatnonzero(apart == 0)
    number, first = np.unique(apart, return_index=True)
    asked = np.concatenate([near, first[number > 0]])
    at = np.stack(np.unravel_index(asked, away.shape), axis=1).astype(np.float64)
    found = mesh.is_inside(at)
    inside[near] = found[: len(near)]
    of_part = np.concatenate([[False], found[len(near) :]])
    far = apart.ravel() > 0
    inside[far] = of_part[apart.ravel()[far]]
    return inside.reshape(away.shape)


def _mesh(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distinct points, and triangles between them, those of three points if there are any."""
    points, corner = weld(corners)
    distinct = (corner != np.roll(corner, -1, axis=1)).all(axis=1)
    chosen = corner[distinct] if distinct.any() else corner
    return points, chosen.astype(np.int32)


def _lower(values: FloatArray, at: FloatArray) -> float:
    """Lowers samples until places in cells [n, 3] are inside, and returns by how much at most.

    The samples around each place by their weights: least in the sum of squares.
    """
    first, share = cells_and_shares(values.shape, at)
    weight = np.stack([np.where(c, share, 1.0 - share).prod(axis=1) for c in CORNERS], axis=1)
    index = [tuple((first + c).T) for c in CORNERS]
    value = sum(weight[:, k] * values[i] for k, i in enumerate(index))
    excess = np.maximum(value + _HELD, 0.0) / np.square(weight).sum(axis=1)
    lower = np.zeros_like(values)
    for k, i in enumerate(index):
        np.maximum.at(lower, i, weight[:, k] * excess)
    values -= lower
    return float(lower.max())


def _joint_piece(
    body: Body,
    regions: Regions,
    joint: Joint,
    pieces: dict[int, _Piece],
    voxel: float,
    delta: float,
) -> tuple[_Piece, str] | None:
    """The grid of the skin that both sides of a joint move, and what it covers.

    None where the regions' grids cover the skin through the joint's range, or this would not.
    """
    posed = turned_skin(joint)
    height = np.full(posed.shape[:2], np.inf)
    for region, piece in pieces.items():
        seen = posed @ joint.rotations if region in joint.below else posed
        own = piece.value((seen + joint.centre).reshape(-1, 3)).reshape(height.shape)
        height = np.minimum(height, own)
    if is_covered(height):
        return None
    weight = regions.weight[:, sorted(joint.below)].sum(axis=1)
    corners = np.column_stack([body.skin.vertices, weight])[body.skin.triangles]
    _, corners, _ = split(corners, corners[..., 3] - _BAND[0])
    corners, _, _ = split(corners, corners[..., 3] - _BAND[1])
    if len(corners) == 0:
        return None
    piece = _sampled(corners[..., :3], voxel, delta, hold=False)
    own = piece.value(seen_turned(joint, posed, SHARE).reshape(-1, 3)).reshape(height.shape)
    if not is_worth_it(height, own):
        return None
    left = max(float(np.minimum(height, own).max()), 0.0)
    return piece, (
        f"turns halfway; leaves {1e3 * left:.1f} of {1e3 * height.max():.1f} mm "
        "that open through the range of motion"
    )


def _figures(name: str, piece: _Piece, note: str) -> GridFit:
    grid = piece.grid
    return GridFit(
        name=name,
        nodes=grid.distance.size,
        voxel=grid.cell,
        volume=float((grid.distance < 0).sum()) * grid.cell**3,
        lowered=piece.lowered,
        outside=piece.outside,
        note=note,
    )


def _collider(
    name: str, bone: str, piece: _Piece, T_bone_bind: FloatArray, share: float | None
) -> Collider:
    geometry = piece.grid.geometry()
    if share is not None:
        geometry["share"] = share
    return Collider(
        name=name,
        kind=SDF.name,
        bone=bone,
        position=transform_points(T_bone_bind, piece.box.centre[None])[0],
        orientation=quaternion_from_matrix(T_bone_bind[:3, :3] @ piece.box.axes),
        geometry=geometry,
    )
