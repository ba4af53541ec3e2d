"""Forces of triangles of constant strain, and how much they resist at most."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix

from garment_sim_ros.arrays import FloatArray, IndexArray, IntArray, SingleArray
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.membrane import FADING, PRESSED, Law, Membrane

_TINY = np.float32(1e-20)
_THIN = np.float32(1e-4)
"""As in `solvers.xpbd.triangles`."""
_HALF_ROOT = np.float32(np.sqrt(0.5))
_IN_SHEAR = 3.0
"""Curvature of the energy of shear over its stiffness, at most: u^2 / 2, u the difference of two
lengths, has 2 of the square of u's gradient and 1 of u times its curvature."""


class Triangles(NamedTuple):
    """Triangles as sub-steps need them, t of them.

    Attributes:
        particles: Corners, flat, shape [3 t].
        place: Their columns, flat, shape [3 t].
        along: See `Membrane`, flat [1/m], shape [4 t].
        area: Areas [m^2], shape [t].
        law: Stiffness along warp and weft and against shear [N/m], Poisson's ratio, shape [4].
    """

    particles: IndexArray
    place: IndexArray
    along: SingleArray
    area: SingleArray
    law: SingleArray

    @classmethod
    def of(cls, cloth: Membrane, law: Law, column: IndexArray) -> "Triangles":
        """Those of a garment whose particles have such columns."""
        return cls(
            particles=np.ascontiguousarray(cloth.particles.ravel(), np.uint32),
            place=np.ascontiguousarray(column[cloth.particles].ravel(), np.uint32),
            along=np.ascontiguousarray(cloth.along.ravel(), np.float32),
            area=cloth.area.astype(np.float32),
            law=np.array(law, np.float32),
        )


def no_triangles() -> Triangles:
    """None."""
    empty = Membrane(np.zeros((0, 3), np.int32), np.zeros((0, 2, 2)), np.zeros(0))
    return Triangles.of(empty, Law(1.0, 1.0, 1.0, 0.0), np.zeros(0, np.uint32))


def triangle_bound(edges: IntArray, cloth: Membrane, law: Law) -> FloatArray:
    """Stiffness for each edge [m, 2] whose springs together resist at least as triangles do.

    With a_i and b_i the shares of corner i in warp and weft, a triangle resists at most as
    A (E' a a^T + D' b b^T) does, for each axis; between two corners that is a spring of
    -A (E' a_i a_j + D' b_i b_j), which in obtuse triangles is less than none. E' and D' are
    E / (1 - n), as Poisson's ratio n adds to one strain what the other one's stress is, and
    `_IN_SHEAR` G.
    """
    n = int(edges.max(initial=-1)) + 1
    share = np.concatenate([-cloth.along.sum(axis=2, keepdims=True), cloth.along], axis=2)
    most = np.array([law.warp, law.weft]) / (1.0 - law.poisson) + _IN_SHEAR * law.shear
    rows, columns, values = [], [], []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        pair = cloth.particles[:, (i, j)]
        rows.append(pair.min(axis=1))
        columns.append(pair.max(axis=1))
        values.append(-cloth.area * (share[:, :, i] * share[:, :, j] @ most))
    joined = np.concatenate(rows), np.concatenate(columns)
    keep = joined[1] < n
    matrix = coo_matrix(
        (np.concatenate(values)[keep], (joined[0][keep], joined[1][keep])), shape=(n, n)
    ).tocsr()
    return np.asarray(matrix[edges.min(axis=1), edges.max(axis=1)]).ravel()


@kernel(inner=True)
def _stresses(e, d, law):
    """Stresses of warp and weft [N/m] from their strains, see `sim.membrane`."""
    warp, weft = law[0], law[1]
    zero, one, part = np.float32(0.0), np.float32(1.0), np.float32(PRESSED)
    fading = np.float32(FADING)
    small = one / (one + fading * (e * e + d * d))
    poisson = law[3] * small
    both = np.sqrt(warp * weft)
    softer_e = one if warp * e + poisson * both * max(d, part * d) >= zero else one / part
    softer_d = one if weft * d + poisson * both * max(e, part * e) >= zero else one / part
    scale = one / (softer_e * softer_d - poisson * poisson)
    p = scale * (softer_d * warp * e + poisson * both * d)
    q = scale * (softer_e * weft * d + poisson * both * e)
    # What is saved where Poisson's ratio falls.
    fall = np.float32(2.0) * fading * small * poisson * p * q / both
    return p - fall * e, q - fall * d


@kernel(inner=True)
def _pulls(ff, fg, gg, area, law):
    """What pulls f along f, f along g and g along f, and g along g, from their products [N m]."""
    f, g = np.sqrt(ff), np.sqrt(gg)
    p, q = _stresses(f - np.float32(1.0), g - np.float32(1.0), law)
    both = ff + gg
    least = _THIN * both
    a, b = np.sqrt(max(both + fg + fg, least)), np.sqrt(max(both - fg - fg, least))
    s = law[2] * _HALF_ROOT * (a - b)
    turn, grow = _HALF_ROOT / a + _HALF_ROOT / b, _HALF_ROOT / a - _HALF_ROOT / b
    return area * (p / f + s * grow), area * s * turn, area * (q / g + s * grow)


@kernel(forceinline=True)
def triangle_forces(x, triangles, force):
    """Adds the forces of triangles.

    Args:
        x: Positions [m], shape [n, 3].
        triangles: `Triangles`.
        force: Changed in place [N], shape [3, free + 1].
    """
    along, law = triangles.along, triangles.law
    for t in range(triangles.area.size):
        i = np.uint64(triangles.particles[3 * t])
        j = np.uint64(triangles.particles[3 * t + 1])
        k = np.uint64(triangles.particles[3 * t + 2])
        a1, a2, b1, b2 = along[4 * t], along[4 * t + 1], along[4 * t + 2], along[4 * t + 3]
        dx, dy, dz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        ex, ey, ez = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        fx, fy, fz = a1 * dx + a2 * ex, a1 * dy + a2 * ey, a1 * dz + a2 * ez
        gx, gy, gz = b1 * dx + b2 * ex, b1 * dy + b2 * ey, b1 * dz + b2 * ez
        ff = fx * fx + fy * fy + fz * fz + _TINY
        gg = gx * gx + gy * gy + gz * gz + _TINY
        p, s, q = _pulls(ff, fx * gx + fy * gy + fz * gz, gg, triangles.area[t], law)
        p1, q1, p2, q2 = a1 * p + b1 * s, a1 * s + b1 * q, a2 * p + b2 * s, a2 * s + b2 * q
        for axis in range(3):
            if axis == 0:
                u, v = fx, gx
            elif axis == 1:
                u, v = fy, gy
            else:
                u, v = fz, gz
            first, second = p1 * u + q1 * v, p2 * u + q2 * v
            force[axis, np.uint64(triangles.place[3 * t])] += first + second
            force[axis, np.uint64(triangles.place[3 * t + 1])] -= first
            force[axis, np.uint64(triangles.place[3 * t + 2])] -= second
