"""Contact along rays from inside: an option of the `relaxation` solver.

As both papers begin. A particle that is in a shape goes to its surface along the ray from inside:
from the centre of a sphere (Sun et al. 2007, equations 5 and 6) or an ellipsoid (Gong et al., 4),
from the inner origin of a hull (Sun et al., 2.3 and 2.4: oriented box, planar meshes, outer map).
Shape after shape, all of them for all particles: no swept test, no sides, no friction. What moves
a particle is velocity afterwards, as Verlet's positions have it (equation 4).
"""

import numpy as np

from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.kinds.sphere import SPHERE
from garment_sim_ros.contact.papers.hull_location import between, in_box
from garment_sim_ros.contact.papers.kirkpatrick import Hierarchy, locate
from garment_sim_ros.contact.papers.outer_map import OuterMap, exit_point
from garment_sim_ros.jit import kernel

_SPHERE, _HULL = SPHERE.code, HULL.code


@kernel(inner=True)
def _scale(r0, r1, r2, is_sphere, x, y, z):
    """By how much a point in a sphere or ellipsoid is farther out on the surface; 0 outside.

    Args:
        r0: Half axes [m]; of a sphere its radius.
        r1: Likewise.
        r2: Likewise.
        is_sphere: Whether only the first counts.
        x: The point from the centre, along the axes [m].
        y: Likewise.
        z: Likewise.
    """
    a, b, c = x / r0, y / (r0 if is_sphere else r1), z / (r0 if is_sphere else r2)
    zeta = a * a + b * b + c * c
    return 1.0 / np.sqrt(zeta) if 0.0 < zeta < 1.0 else 0.0


@kernel(inner=True)
def _out_of_hull(tables, h, x, y, z):
    """The response point of a point in the frame of hull h, and whether it was inside."""
    F = tables.frame[h]
    p = (
        F[0, 0] * x + F[0, 1] * y + F[0, 2] * z + F[0, 3],
        F[1, 0] * x + F[1, 1] * y + F[1, 2] * z + F[1, 3],
        F[2, 0] * x + F[2, 1] * y + F[2, 2] * z + F[2, 3],
    )
    if not in_box(tables.box[h], p):
        return x, y, z, False
    trees = tables.corner, tables.label, tables.tree_start, tables.finer
    above = locate(Hierarchy(*trees, tables.tolerance[h, 0], tables.root[h, 0]), p[0], p[1])
    below = locate(Hierarchy(*trees, tables.tolerance[h, 1], tables.root[h, 1]), p[0], p[1])
    if above < 0 or below < 0 or not between(tables.plane, above, below, p):
        return x, y, z, False
    table = OuterMap(
        tables.is_sphere[h],
        tables.around[h],
        tables.rows[h],
        tables.low[h],
        tables.per_row[h],
        tables.start,
        tables.face,
        tables.plane,
        tables.first[h],
    )
    u, v, w, face = exit_point(table, p[0], p[1], p[2])
    u, v, w = u - F[0, 3], v - F[1, 3], w - F[2, 3]
    return (
        F[0, 0] * u + F[1, 0] * v + F[2, 0] * w,
        F[0, 1] * u + F[1, 1] * v + F[2, 1] * w,
        F[0, 2] * u + F[1, 2] * v + F[2, 2] * w,
        face >= 0,
    )


@kernel()
def meet_rays(shapes, posed, tables, x, v, x_predicted, dt, hit):
    """Moves particles out of one shape after the other, along rays.

    Args:
        shapes: Packed shapes.
        posed: The same, posed for the end of the step.
        tables: Of the hulls among them, see `ray_tables`.
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        x_predicted: Positions that outer forces led to [m], shape [n, 3].
        dt: Step [s].
        hit: Output: the last shape that moved each particle, -1 for none, shape [n].

    Returns:
        Number of particles that any shape moved.
    """
    count = 0
    for i in range(x.shape[0]):
        hit[i] = -1
        px, py, pz = np.float64(x[i, 0]), np.float64(x[i, 1]), np.float64(x[i, 2])
        for k in range(shapes.kind.shape[0]):
            R, c = posed.rotation[k], posed.centre[k]
            dx, dy, dz = px - c[0], py - c[1], pz - c[2]
            qx = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
            qy = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
            qz = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
            if shapes.kind[k] == _HULL:
                qx, qy, qz, inside = _out_of_hull(tables, shapes.hull[k], qx, qy, qz)
                if not inside:
                    continue
            else:
                s = shapes.size[k]
                scale = _scale(s[0], s[1], s[2], shapes.kind[k] == _SPHERE, qx, qy, qz)
                if scale == 0.0:
                    continue
                qx, qy, qz = scale * qx, scale * qy, scale * qz
            px = c[0] + (R[0, 0] * qx + R[0, 1] * qy + R[0, 2] * qz)
            py = c[1] + (R[1, 0] * qx + R[1, 1] * qy + R[1, 2] * qz)
            pz = c[2] + (R[2, 0] * qx + R[2, 1] * qy + R[2, 2] * qz)
            hit[i] = k
        if hit[i] >= 0:
            count += 1
            x[i, 0], x[i, 1], x[i, 2] = px, py, pz
        for r in range(3):
            v[i, r] += (x[i, r] - x_predicted[i, r]) / dt
    return count
