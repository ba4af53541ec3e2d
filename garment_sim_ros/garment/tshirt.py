"""T-shirts made around a body.

The shirt is the zero level of a field on a grid: the smooth union of a trunk (convex outlines of
the body's sections, straightened between hem and armpits as a shirt falls) and two sleeves
(convex outlines of the upper arms' sections), never closer to the skin than its least ease. Its
surface is cut open at hem, neck and sleeves and then meshed evenly.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.isosurface import clipped, surface_net
from garment_sim_ros.garment.measures import Arm, Measures
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.garment.slices import NORMALS, Profile
from garment_sim_ros.geometry.connectivity import components
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.remesh import remeshed
from garment_sim_ros.geometry.topology import (
    boundary_loops,
    mesh_topology,
    non_manifold_edges,
    pinched_vertices,
)

_MOST_NODES = 5_000_000

# Sizes for a person of 1.65 m [m].
_SPACING = 0.015
_WAISTBAND = 0.008  # that the hem hangs over
_COLLAR_EASE = 0.012
_COLLAR_GAP = 0.005  # that the neckline stands off the skin
_UNION_ROUNDING = 0.03
_SKIN_ROUNDING = 0.008
_COLLAR_TILT = np.radians(25.0)  # forward
_COLLAR_DEPTH = 0.35  # radii of the neck below its base
_COLLAR_RISE = 0.3  # radii of the neck above its base, below which a neckline is
_COLLAR_LENGTH = 1.15  # of the neckline from back to front, over its width
_COLLAR_REACH = (
    1.2  # radii of the neck beyond the neckline, over which the shirt comes to its ease
)
_SLEEVE_LENGTH = 0.6  # of the upper arm
_PINHOLE = 4.0  # spacings: the longest way around a hole that is none of the four openings
_SMALL_HOLE = 0.25  # of the shortest opening: what is shorter around is none
_FIT = 0.5  # 0: follows the waist; 1: straight from the armpits to the hem

# Shares of the trunk's ease.
_LEAST_EASE = 0.6
_SHOULDER_EASE = 0.8
_SLEEVE_EASE = 1.4


@dataclass(kw_only=True)
class Grid:
    """A field sampled on a regular grid.

    Attributes:
        origin: Position of node (0, 0, 0) [m], shape [3].
        spacing: Distance of nodes [m].
        shape: Nodes along x, y and z.
    """

    origin: FloatArray
    spacing: float
    shape: tuple[int, int, int]

    def points(self) -> FloatArray:
        """Positions of all nodes [m], shape [nx, ny, nz, 3]."""
        return self.origin + self.spacing * np.moveaxis(np.indices(self.shape), 0, -1)

    def sampled(self, field: FloatArray, points: FloatArray) -> FloatArray:
        """Values between the nodes, at points [n, 3], shape [n]."""
        node = ((points - self.origin) / self.spacing).T
        return map_coordinates(field, node, order=1, mode="nearest")

    def normalised(self, field: FloatArray) -> FloatArray:
        """A field made a distance near its zero level."""
        slope = np.linalg.norm(np.gradient(field, self.spacing), axis=0)
        return field / np.maximum(slope, 1.0)


def tshirt(measures: Measures, *, vertices: int, length: float, ease: float) -> GarmentMesh:
    """A T-shirt with sleeves to the middle of the upper arms.

    Args:
        measures: The body, arms held away from the trunk.
        vertices: Number of vertices.
        length: Its hem between the waist (0) and the widest hips (1).
        ease: How far the trunk stands off the body, for a person of 1.65 m [m].

    Raises:
        GeometryError: The body lacks what a shirt needs, or too few vertices for its openings.
    """
    hem = measures.waist - length * (measures.waist - measures.hips)
    ease *= measures.unit
    grid = _grid(measures, hem, ease)
    arms = measures.arms
    points = grid.points()
    trunk = _trunk_field(measures, grid, points, hem, arms, ease)
    tubes = [_sleeve_field(arm, grid, points, measures.unit, ease) for arm in arms]
    field = _shirt_field(measures, grid, points, trunk, arms, tubes, ease)
    x, triangles = surface_net(field, grid.origin, grid.spacing)
    x, triangles, _ = clipped(x, triangles, hem - x[:, 2])
    at_neck = np.maximum(_in_neckline(measures, x), _above_neckline(measures, x))
    x, triangles, _ = clipped(x, triangles, at_neck)
    for arm, tube in zip(arms, tubes):
        beyond = arm.along(x) - _SLEEVE_LENGTH * arm.length
        on_sleeve = grid.sampled(trunk - tube, x)
        cut = _largest_cut(triangles, np.minimum(beyond, on_sleeve))
        x, triangles, _ = clipped(x, triangles, cut)
    x, triangles = _without_pinches(*_largest_part(x, triangles))
    x, triangles = _without_pinholes(x, triangles, _PINHOLE * grid.spacing)
    gradient = [np.gradient(field, grid.spacing, axis=axis) for axis in range(3)]

    def project(points: FloatArray) -> FloatArray:
        for _ in range(2):
            f = grid.sampled(field, points)
            g = np.stack([grid.sampled(part, points) for part in gradient], axis=1)
            points = points - (f / np.maximum((g**2).sum(axis=1), 0.1))[:, None] * g
        return points

    x, triangles = remeshed(x, triangles, vertices, project)
    loops = len(boundary_loops(triangles))
    if loops != 4 or len(non_manifold_edges(triangles)):
        found = f"{loops} openings" if loops != 4 else "edges of more than two triangles"
        raise GeometryError(
            f"{measures.body.name}: a shirt around this body has {found}; allowed: a body on "
            "which hem, neck and two sleeves are apart"
        )
    return GarmentMesh(vertices=x, triangles=triangles)


def _grid(measures: Measures, hem: float, ease: float) -> Grid:
    spacing = _SPACING * measures.unit
    margin = 5.0 * spacing
    trunk = measures.trunk
    near = trunk.support[trunk.offset > hem - margin]
    quarter = len(NORMALS) // 4
    low = np.array([-near[:, 2 * quarter].max(), -near[:, 3 * quarter].max(), hem])
    neck = measures.neck_base
    top = neck.centre[2] + neck.radius
    high = np.array([near[:, 0].max(), near[:, quarter].max(), top])
    for arm in measures.arms:
        cuff = arm.frame[:3, 3] + _SLEEVE_LENGTH * arm.length * arm.frame[:3, 2]
        reach = arm.profile.support.max() + _SLEEVE_EASE * ease
        low, high = np.minimum(low, cuff - reach), np.maximum(high, cuff + reach)
        low[2] = max(low[2], hem)
    low, high = low - margin, high + margin
    nodes = np.ceil((high - low) / spacing) + 1.0
    if nodes.prod() > _MOST_NODES:
        raise GeometryError(
            f"{measures.body.name}: trunk and arms span {high - low} m at a height of "
            f"{measures.height:.3g} m; allowed: the proportions of a person"
        )
    return Grid(origin=low, spacing=spacing, shape=(int(nodes[0]), int(nodes[1]), int(nodes[2])))


def _shirt_field(
    measures: Measures,
    grid: Grid,
    points: FloatArray,
    trunk: FloatArray,
    arms: Sequence[Arm],
    tubes: Sequence[FloatArray],
    ease: float,
) -> FloatArray:
    """The shirt's field: negative inside, about a distance near its zero level [m]."""
    unit = measures.unit
    field = trunk
    for arm, tube in zip(arms, tubes):
        t = arm.along(points)
        beyond = t - _SLEEVE_LENGTH * arm.length - 3.0 * grid.spacing
        sleeve = np.maximum(tube, np.maximum(-t, beyond))
        field = _smooth_union(field, sleeve, _UNION_ROUNDING * unit)
    field = gaussian_filter(field, 1.0, mode="nearest")
    near = np.abs(field) < 0.06 * unit
    skin = MeshDistance(measures.vertices, _covered_skin(measures))
    gap = skin.signed_distance(points[near])[0]
    if (mesh_topology(measures.body.skin.triangles).triangle_count == 1).any():
        # Open parts, such as clothes in a body's file, have no inside; that of the body is within
        # the outlines of trunk and sleeves already.
        gap = np.abs(gap)
    beyond = -_in_neckline(measures, points[near]) / (_COLLAR_REACH * measures.neck_base.radius)
    least = np.interp(beyond, [0.0, 1.0], [_COLLAR_GAP * unit, _LEAST_EASE * ease])
    field[near] = _smooth_union(field[near], gap - least, _SKIN_ROUNDING * unit)
    return field


def _trunk_field(
    measures: Measures,
    grid: Grid,
    points: FloatArray,
    hem: float,
    arms: Sequence[Arm],
    ease: float,
) -> FloatArray:
    z = points[0, 0, :, 2]
    support = measures.trunk.at(z)
    armpit = min(float(arm.frame[2, 3]) - 1.2 * arm.radius for arm in arms)
    shoulder = max(float(arm.frame[2, 3]) for arm in arms)
    girth = support.sum(axis=1)
    # A trunk of bare bones: the shirt falls from the shoulders, not from the chest.
    bare = np.interp(armpit, z, girth) < 0.5 * np.interp(shoulder, z, girth)
    straight = np.flatnonzero(
        (z >= hem - 3.0 * grid.spacing) & (z <= (shoulder if bare else armpit))
    )
    if straight.size > 1:
        part = support[straight]
        support[straight] = part + _FIT * (_concave_envelope(part) - part)
    ground = points[:, :, 0, :2] @ NORMALS.T
    field = np.stack([(ground - h).max(axis=-1) for h in support], axis=-1)
    neck = measures.neck_base
    field = np.maximum(field, z - neck.centre[2] - 0.5 * neck.radius)
    eases = {
        hem: ease + _WAISTBAND * measures.unit,
        armpit: ease,
        shoulder: _SHOULDER_EASE * ease,
        max(float(neck.centre[2]), shoulder + grid.spacing): _COLLAR_GAP * measures.unit,
    }
    return grid.normalised(field) - np.interp(z, list(eases), list(eases.values()))


def _concave_envelope(values: FloatArray) -> FloatArray:
    """Least concave sequences above equally spaced samples, shape [n, m]."""
    n = len(values)
    envelope = values.copy()
    for i in range(n):
        for j in range(i + 2, n):
            s = np.linspace(0.0, 1.0, j - i + 1)[1:-1, None]
            chord = (1.0 - s) * values[i] + s * values[j]
            np.maximum(envelope[i + 1 : j], chord, out=envelope[i + 1 : j])
    return envelope


def _sleeve_field(
    arm: Arm, grid: Grid, points: FloatArray, unit: float, ease: float
) -> FloatArray:
    """Field of a sleeve without ends, exact near it [m]."""
    profile = arm.profile
    # A sleeve does not narrow towards the shoulder: each outline contains those further out.
    widest = np.maximum.accumulate(profile.support[::-1], axis=0)[::-1]
    local = (points - arm.frame[:3, 3]) @ arm.frame[:3, :3]
    field = np.linalg.norm(local[..., :2], axis=-1) - widest.max()
    near = field < 2.0 * _UNION_ROUNDING * unit
    support = Profile(offset=profile.offset, support=widest).at(local[near, 2])
    field[near] = (local[near, :2] @ NORMALS.T - support).max(axis=-1)
    return grid.normalised(field) - _SLEEVE_EASE * ease


def _smooth_union(a: FloatArray, b: FloatArray, rounding: float) -> FloatArray:
    """Polynomial smooth minimum; differs from the minimum where |a - b| < rounding."""
    s = np.clip(0.5 + 0.5 * (b - a) / rounding, 0.0, 1.0)
    return b + s * (a - b) - rounding * s * (1.0 - s)


def _largest_cut(triangles: IntArray, cut: FloatArray) -> FloatArray:
    """What cuts off the end of a sleeve, without what it cuts elsewhere [m], shape [v].

    A wide, short sleeve, made longer, grazes hips.
    """
    inside = cut > 0.0
    within = triangles[inside[triangles].all(axis=1)]
    if not len(within):
        return cut
    _, part = components(within, len(cut))
    largest = np.bincount(part[within[:, 0]]).argmax()
    return np.where(inside & (part != largest), -np.abs(cut), cut)


def _covered_skin(measures: Measures) -> IntArray:
    """Triangles of the skin that a shirt lies on: below the neck, without forearms."""
    left_out = measures.share("head", "leftLowerArm", "rightLowerArm") > 0.5
    left_out |= measures.vertices[:, 2] > measures.neck_base.centre[2]
    triangles = measures.body.skin.triangles
    return triangles[~left_out[triangles].any(axis=1)]


def _in_neckline(measures: Measures, x: FloatArray) -> FloatArray:
    """How far points are within the neckline; negative outside [m], shape [n].

    An elliptic tube about the neck, tilted forward, cuts the shirt: wider than the neck's base, so
    that the neckline lies on the shoulders. Flat shoulders and raised arms are beyond it. Its
    bottom keeps it from running down a steep back.
    """
    neck = measures.neck_base
    offset = x - neck.centre
    up = offset @ np.array([np.sin(_COLLAR_TILT), 0.0, np.cos(_COLLAR_TILT)])
    forward = offset @ np.array([np.cos(_COLLAR_TILT), 0.0, -np.sin(_COLLAR_TILT)])
    wide = _neckline_half_width(measures)
    # The front is lower than the back, which stays where it is.
    along = forward / _COLLAR_LENGTH - (_COLLAR_LENGTH - 1.0) * wide
    within = wide - np.hypot(along, offset[..., 1])
    return np.minimum(within, up + _COLLAR_DEPTH * neck.radius)


def _above_neckline(measures: Measures, x: FloatArray) -> FloatArray:
    """How far points are in what is above a neckline and about it; negative outside [m].

    Skin is cut off at the neck, so that above it its distance says nothing of inside and outside.
    """
    neck = measures.neck_base
    about = np.hypot(*(x[:, :2] - neck.centre[:2]).T)
    rise = x[:, 2] - neck.centre[2] - _COLLAR_RISE * neck.radius
    return np.minimum(1.5 * _neckline_half_width(measures) - about, rise)


def _neckline_half_width(measures: Measures) -> float:
    """In metres. A thick neck's girth is that of where it is thinner than at its base."""
    neck = measures.neck_base
    return max(1.1 * neck.radius + _COLLAR_EASE * measures.unit, neck.half_width)


def _largest_part(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    _, part = components(triangles, len(vertices))
    largest = np.argmax(np.bincount(part[triangles[:, 0]]))
    used, compact = np.unique(triangles[part[triangles[:, 0]] == largest], return_inverse=True)
    return vertices[used], compact.reshape(-1, 3).astype(np.int32)


def _without_pinches(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Makes one hole of those that touch in a vertex, which is left out with its triangles."""
    while (pinched := pinched_vertices(triangles)).size:
        kept = ~np.isin(triangles, pinched).any(axis=1)
        if not kept.any():
            break
        vertices, triangles = _largest_part(vertices, triangles[kept])
    return vertices, triangles


def _without_pinholes(
    vertices: FloatArray, triangles: IntArray, longest: float
) -> tuple[FloatArray, IntArray]:
    """Closes small holes, as where a neckline grazes a fold or sleeves meet the parts of a robot.

    The four longest are the shirt's openings; of the others, those are closed that are shorter
    around than `longest` [m] or than a quarter of each of the four.
    """
    loops = sorted(boundary_loops(triangles), key=lambda loop: -_around(vertices[loop]))
    if len(loops) > 4:
        longest = max(longest, _SMALL_HOLE * _around(vertices[loops[3]]))
    for loop in loops[4:]:
        if _around(vertices[loop]) < longest:
            middle = np.full(len(loop), len(vertices))
            fan = np.stack([np.roll(loop, -1), loop, middle], axis=1).astype(np.int32)
            vertices = np.concatenate([vertices, vertices[loop].mean(axis=0, keepdims=True)])
            triangles = np.concatenate([triangles, fan])
    return vertices, triangles


def _around(corners: FloatArray) -> float:
    """Length of a closed line through points [n, 3] [m]."""
    return float(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1).sum())
