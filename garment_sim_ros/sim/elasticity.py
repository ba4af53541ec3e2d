"""Stiffness of a fabric, in SI units, as stiffness of a mesh's edges and hinges."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, LongArray
from garment_sim_ros.constants import GRAVITY
from garment_sim_ros.geometry.topology import hinge_vertices
from garment_sim_ros.geometry.triangles import area_vectors
from garment_sim_ros.params import Material
from garment_sim_ros.sim.rest_shape import hinge_corners

_FLAT = 0.9
"""Triangles whose normal is closer to the vertical than this (as a cosine) lie flat."""
_COUNTS = np.array([1.0, 1.0, 0.1])
"""What errors of warp, weft and shear count for where edges cannot have all three."""
_LEAST = 1e-3
"""Part of the largest of the three which the others there are at least."""
_CLEAR = 1e-3
"""Determinant of what edges add to the three from which on it tells them apart."""
_ROUNDING = 1e-6
"""Stiffness below zero, as a part of the largest asked, that is none."""
_SLIM = 0.1
"""Product of the sines of an edge's two angles that narrower triangles count as."""
SEAM = 4.0
"""How many times as stiff against bending cloth is at a seam: two layers and two allowances, which
are not glued."""
_SEWN = 1e-6
"""Distance between the two places of one edge, in edge lengths, from which on it is a seam."""
_NEAR_ZERO = 1e-9
"""Area of a triangle without shape, as a share of its longest edge's square."""


class Hinges(NamedTuple):
    """Pairs of triangles that share an edge.

    Attributes:
        particles: The edge's two ends and the two opposite corners, shape [h, 4].
        weight: Curvature of the pair is the length of ``sum_k weight_k x_k``, shape [h, 4].
        stiffness: Energy is half of this times curvature squared [N/m], shape [h].
    """

    particles: IntArray
    weight: FloatArray
    stiffness: FloatArray


def stiffness_by_weight(material: Material, extent: float, strain: float) -> float:
    """Stiffness in the plane with which a garment's own weight stretches it by so much [N/m].

    Args:
        material: The fabric.
        extent: The garment's longest extent, by one end of which it hangs [m].
        strain: Its stretch.
    """
    return material.areal_density * GRAVITY * extent / strain


def no_stiffer(material: Material, most: float) -> Material:
    """The material, in its plane at most so stiff [N/m]."""
    return replace(
        material,
        stretch_stiffness_warp=min(material.stretch_stiffness_warp, most),
        stretch_stiffness_weft=min(material.stretch_stiffness_weft, most),
        shear_stiffness=min(material.shear_stiffness, most),
    )


def warp_directions(
    rest: FloatArray, triangles: IntArray, corners: FloatArray | None = None
) -> FloatArray:
    """Unit warp direction of every triangle, shape [t, 3]; arguments as for `edge_stiffness`.

    Garments hang along the warp (knits: along the wales): it is the vertical of the rest shape,
    projected into the triangle. In a triangle that lies flat it is the x axis.
    """
    if corners is not None:
        rest, triangles = _unwelded(corners)
    normal = area_vectors(rest, triangles)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    axis = np.where(np.abs(normal[:, 2:]) > _FLAT, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    warp = axis - (axis * normal).sum(axis=1, keepdims=True) * normal
    return warp / np.maximum(np.linalg.norm(warp, axis=1, keepdims=True), 1e-300)


def _unwelded(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Triangles that share no vertices, from their corners [t, 3, 3]."""
    count = 3 * len(corners)
    return corners.reshape(count, 3), np.arange(count, dtype=np.int32).reshape(-1, 3)


def _triangle_edges(corners: FloatArray, triangles: IntArray) -> tuple[LongArray, FloatArray]:
    """Ends of each triangle's edges, ascending, shape [t, 3, 2], and edge vectors [t, 3, 3]."""
    ends = triangles[:, [[0, 1], [1, 2], [2, 0]]].astype(np.int64)
    apart = corners[:, [0, 1, 2]] - corners[:, [1, 2, 0]]
    turned = ends[..., 0] > ends[..., 1]
    return np.sort(ends, axis=2), np.where(turned[..., None], -apart, apart)


def _areas(apart: FloatArray) -> FloatArray:
    """Areas of triangles from edge vectors; 0 for those without shape, shape [t]."""
    area = 0.5 * np.linalg.norm(np.cross(apart[:, 0], apart[:, 1]), axis=1)
    area[area < _NEAR_ZERO * (apart**2).sum(axis=2).max(axis=1)] = 0.0
    return area


def _share(along: FloatArray, across: FloatArray, asked: FloatArray) -> FloatArray:
    """The c [t, 3] of `edge_stiffness`.

    Args:
        along: Cosines of the angles of triangles' edges to the warp, shape [t, 3].
        across: Their sines, shape [t, 3].
        asked: Stiffness of warp, weft and shear [N/m], shape [3].
    """
    stress = np.stack([along**2, across**2, along * across], axis=1)
    sums = stress**2
    clear = np.abs(np.linalg.det(sums)) > _CLEAR
    solvable = np.where(clear[:, None, None], sums, np.eye(3))
    exact = np.linalg.solve(solvable, asked[None, :, None])[..., 0]
    clear &= exact.min(axis=1) >= -_ROUNDING * asked.max()

    # Strains (warp, weft, shear) with which one edge gets longer and the two others, i and j, stay
    # as they are.
    i, j = [1, 2, 0], [2, 0, 1]
    turned = (along * across[:, i] - across * along[:, i]) * (
        along * across[:, j] - across * along[:, j]
    )
    strain = np.stack(
        [
            across[:, i] * across[:, j],
            along[:, i] * along[:, j],
            along[:, i] * across[:, j] + across[:, i] * along[:, j],
        ],
        axis=1,
    )
    strain /= np.maximum(np.abs(turned), _SLIM)[:, None]
    aimed = np.maximum(asked, max(_LEAST * asked.max(), 1e-30))
    held = np.einsum("i,tie->te", _COUNTS * aimed, strain**2)
    free = np.einsum("i,tie->te", _COUNTS / aimed, sums)
    return np.where(
        clear[:, None],
        np.maximum(exact, 0.0),
        np.sqrt(held / np.maximum(free, 1e-3 / aimed.max())),
    )


def _sum_per_edge(pairs: LongArray, values: FloatArray, wanted: IntArray) -> FloatArray:
    """Sums of values [t, 3] over the triangles at each edge in `wanted` [m, 2], shape [m]."""
    n = int(pairs.max()) + 1
    unique, index = np.unique(pairs[..., 0] * n + pairs[..., 1], return_inverse=True)
    total = np.zeros(len(unique))
    np.add.at(total, index.ravel(), values.ravel())
    ends = np.sort(wanted.astype(np.int64), axis=1)
    return total[np.searchsorted(unique, ends[:, 0] * n + ends[:, 1])]


def edge_stiffness(
    rest: FloatArray,
    triangles: IntArray,
    edges: IntArray,
    material: Material,
    corners: FloatArray | None = None,
) -> FloatArray:
    """Stiffness of each edge as a spring [N/m], shape [m].

    A triangle of area A whose edges, of lengths l_e at angles a_e to the warp, have the strains
    s_e, stores A/2 sum_e c_e s_e^2, with k_e = A c_e / l_e^2. In a homogeneous strain that is the
    energy of a membrane with the stiffnesses

        warp: sum c_e cos^4 a_e,  weft: sum c_e sin^4 a_e,  shear: sum c_e cos^2 a_e sin^2 a_e

    (Ostoja-Starzewski 2002, "Lattice models in micromechanics", section 2): a matrix
    C = sum c_e b_e b_e^T of stiffness, b = (cos^2, sin^2, cos sin), has them on its diagonal.
    Where c_e, none negative, give all three as asked, as on a grid along the threads, they are
    taken. Springs have no more freedom: their resistance to warp strain from weft stress equals
    the shear stiffness.

    In other triangles the c_e are those with the least

        sum_i n_i (C_ii / asked_i + (C^-1)_ii asked_i),

    the divergence of Jeffreys 1946 ("An invariant form for the prior probability in estimation
    problems") between C and the diagonal matrix of what is asked, with n_3 = 0.1 for the shear.
    C_ii is the stiffness where the other strains are held, 1 / (C^-1)_ii where they are free, and
    half of it costs as much as its double. With d_e the strain in which edge e alone gets longer,
    by all of its length, C^-1 is sum d_e d_e^T / c_e, so that

        c_e = sqrt(sum_i n_i asked_i d_ei^2 / sum_i n_i b_ei^2 / asked_i).

    None is zero: edges without stiffness let a mesh give way like a linkage, whatever the sums.
    Edges at large angles to the threads carry them only with a shear stiffness of their own: shear
    gets stiffer than asked there, and threads softer, see docs/solvers.md.

    Args:
        rest: Rest positions [m], shape [n, 3].
        triangles: Particles of the triangles, shape [t, 3].
        edges: Particles of the edges, each of some triangle, shape [m, 2].
        material: The fabric.
        corners: Rest positions of the triangles' corners, as `ClothModel.corners`, shape
            [t, 3, 3]; None: those of `rest`.
    """
    pairs, apart = _triangle_edges(rest[triangles] if corners is None else corners, triangles)
    squared = np.maximum((apart**2).sum(axis=2), 1e-300)
    direction = apart / np.sqrt(squared)[..., None]
    warp = warp_directions(rest, triangles, corners)
    normal = np.cross(apart[:, 0], apart[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    asked = (
        material.stretch_stiffness_warp,
        material.stretch_stiffness_weft,
        material.shear_stiffness,
    )
    c = _share(
        np.einsum("tek,tk->te", direction, warp),
        np.einsum("tek,tk->te", direction, np.cross(normal, warp)),
        np.array(asked),
    )
    return _sum_per_edge(pairs, _areas(apart)[:, None] * c / squared, edges)


def hinges(
    rest: FloatArray,
    triangles: IntArray,
    material: Material,
    corners: FloatArray | None = None,
) -> Hinges:
    """Pairs of adjacent triangles with their resistance to bending.

    With angles measured at rest, x0 and x1 the ends of the shared edge and x2 and x3 the opposite
    corners, the sum over w = (cot_1 + cot_1', cot_0 + cot_0', -cot_0 - cot_1, -cot_0' - cot_1')
    times x vanishes where the pair is flat, and is linear. Divided by the area A of both triangles
    it is a curvature: the energy is B / 2A |sum w_k x_k|^2. That is equation 2 of Bergou et al.
    2006, "A quadratic bending model for inextensible surfaces", without its factor of 3, which
    belongs to edge-based elements: a mesh of equilateral triangles that is bent to a cylinder
    stores B/2 per area and squared curvature in every direction, and a grid does along its axes.

    Poisson's ratio is that of the mesh, 1/3 for equilateral triangles. Cloth is cut from flat
    panels: the rest state is flat, whatever shape the garment is given in. Where two panels are
    sewn together there are three layers and more: the hinge is `SEAM` times as stiff.

    Arguments as for `edge_stiffness`.
    """
    particles = hinge_vertices(triangles)
    given = rest[triangles] if corners is None else corners
    sides = hinge_corners(given, triangles, particles)
    areas, cot0, cot1 = [], [], []
    for x0, x1, corner in sides:
        doubled = np.linalg.norm(np.cross(x1 - x0, corner - x0), axis=1)
        areas.append(0.5 * doubled)
        doubled = np.maximum(doubled, 1e-300)
        cot0.append(((x1 - x0) * (corner - x0)).sum(axis=1) / doubled)
        cot1.append(((x0 - x1) * (corner - x1)).sum(axis=1) / doubled)
    weight = np.stack(
        [cot1[0] + cot1[1], cot0[0] + cot0[1], -cot0[0] - cot1[0], -cot0[1] - cot1[1]], axis=1
    )
    (a0, a1, _), (b0, b1, _) = sides
    proper = np.minimum(*areas) > _NEAR_ZERO * ((a1 - a0) ** 2).sum(axis=1)
    apart = np.abs(a0 - b0).max(axis=1) + np.abs(a1 - b1).max(axis=1)
    sewn = np.where(apart > _SEWN * np.linalg.norm(a1 - a0, axis=1), SEAM, 1.0)
    both = areas[0][proper] + areas[1][proper]
    return Hinges(
        particles=particles[proper],
        weight=weight[proper],
        stiffness=sewn[proper] * material.bending_stiffness / both,
    )
