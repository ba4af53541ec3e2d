"""The best place for a new hull vertex over the outline of the patch that it replaces.

Sun et al. 2007, section 2.2, place the vertex where the quadric error is least, then test whether
all edges stay convex and the un-inflated hull stays inside, and give up where not. With the
outline fixed all these conditions are half-spaces for the vertex:

- convex across an outline edge: below the plane of the face outside it;
- convex across the new edge to an outline vertex: above the plane through that vertex and its two
  neighbours in the outline;
- containing: above the plane through an outline edge that touches the un-inflated hull.

So the best allowed place is the point of a small polyhedron nearest to the wanted one: found
exactly, or there is none.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.geometry.nearest_in_polyhedron import nearest_in_polyhedron
from garment_sim_ros.jit import exact_kernel

QUADRIC = 0
"""Stay close to the faces that the patch had at the start."""
VOLUME = 1
"""Take all the slack there is."""
_MARGIN = 1e-7
"""Slack of all conditions, as a share of the hull's size; far above rounding."""
MAX_CUTS = 12
"""Most limits that bound one placement."""


@exact_kernel()
def add_quadrics(x, faces, quadrics):
    """Area-weighted squared plane distances of each vertex's faces (Garland & Heckbert 1997)."""
    row = np.empty(4)
    for f in range(faces.shape[0]):
        a, b, c = x[faces[f, 0]], x[faces[f, 1]], x[faces[f, 2]]
        row[0] = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
        row[1] = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        row[2] = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        length = np.sqrt(row[0] ** 2 + row[1] ** 2 + row[2] ** 2)
        if length == 0.0:
            continue
        for k in range(3):
            row[k] /= length
        row[3] = -(row[0] * a[0] + row[1] * a[1] + row[2] * a[2])
        for corner in range(3):
            at = 0
            for i in range(4):
                for j in range(i, 4):
                    quadrics[faces[f, corner], at] += length / 6.0 * row[i] * row[j]
                    at += 1


@exact_kernel()
def quadric_error(q, v):
    """``(v, 1) Q (v, 1)`` with Q stored as its upper triangle, row by row."""
    x, y, z = v[0], v[1], v[2]
    return (
        q[0] * x * x
        + q[4] * y * y
        + q[7] * z * z
        + q[9]
        + 2.0 * (q[1] * x * y + q[2] * x * z + q[5] * y * z + q[3] * x + q[6] * y + q[8] * z)
    )


@exact_kernel(inner=True)
def _fill_conditions(x, faces, inner, link, outer, edges, touching, planes):
    """The half-spaces that a new vertex over the outline must lie in; returns their number."""
    count = 0
    n = np.empty(3)
    for k in range(edges):
        a = x[link[k]]
        b = x[link[(k + 1) % edges]]
        c = x[link[(k + 2) % edges]]
        # Below the face outside the edge.
        g = faces[outer[k] // 3]
        p, q, r = x[g[0]], x[g[1]], x[g[2]]
        _cross(p, q, r, n)
        if not _unit(n):
            return -1
        for i in range(3):
            planes[count, i] = n[i]
        planes[count, 3] = n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - _MARGIN
        count += 1
        # Above the plane through the edge that touches the inner hull.
        known = touching[outer[k]]
        if known[0] != known[0] and not _touch(inner, a, b, n, known):
            return -1
        for i in range(4):
            planes[count, i] = known[i]
        count += 1
        # Above the plane through three consecutive outline vertices.
        _cross(a, b, c, n)
        if _unit(n):
            for i in range(3):
                planes[count, i] = -n[i]
            planes[count, 3] = -(n[0] * a[0] + n[1] * a[1] + n[2] * a[2]) - _MARGIN
            count += 1
    return count


@exact_kernel()
def _touch(inner, a, b, n, plane):
    """Half-space above the plane through the edge from a to b that touches the inner hull.

    Of all inner points, seen along the edge, it goes through the one least turned down from the
    plane of the face outside, with the normal n.
    """
    e = np.empty(3)
    t = np.empty(3)
    for i in range(3):
        e[i] = b[i] - a[i]
    if not _unit(e):
        return False
    t[0] = n[1] * e[2] - n[2] * e[1]
    t[1] = n[2] * e[0] - n[0] * e[2]
    t[2] = n[0] * e[1] - n[1] * e[0]
    best_t = -1.0
    best_n = 0.0
    for i in range(inner.shape[0]):
        rx, ry, rz = inner[i, 0] - a[0], inner[i, 1] - a[1], inner[i, 2] - a[2]
        along_t = rx * t[0] + ry * t[1] + rz * t[2]
        down = max(-(rx * n[0] + ry * n[1] + rz * n[2]), 0.0)
        if best_t * down - best_n * along_t < 0.0:
            best_t, best_n = along_t, down
    length = np.sqrt(best_t * best_t + best_n * best_n)
    for i in range(3):
        t[i] = (best_t * t[i] - best_n * n[i]) / length
    plane[0] = -(e[1] * t[2] - e[2] * t[1])
    plane[1] = -(e[2] * t[0] - e[0] * t[2])
    plane[2] = -(e[0] * t[1] - e[1] * t[0])
    plane[3] = plane[0] * a[0] + plane[1] * a[1] + plane[2] * a[2] - _MARGIN
    return True


@exact_kernel()
def _cross(a, b, c, n):
    """Normal of the triangle a, b, c, not normalised."""
    n[0] = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
    n[1] = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
    n[2] = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@exact_kernel(inner=True)
def _unit(n):
    """Normalise in place; False if there is nothing to normalise."""
    length = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if length < 1e-12:
        return False
    for i in range(3):
        n[i] /= length
    return True


@exact_kernel()
def fan_volume(x, link, edges, v):
    """Volume between the fan of v over the outline and the origin."""
    volume = 0.0
    for k in range(edges):
        a = x[link[k]]
        b = x[link[(k + 1) % edges]]
        volume += (
            a[0] * (b[1] * v[2] - b[2] * v[1])
            + a[1] * (b[2] * v[0] - b[0] * v[2])
            + a[2] * (b[0] * v[1] - b[1] * v[0])
        )
    return volume / 6.0


@exact_kernel(inner=True)
def _quadric_metric(q, guess, metric, centre):
    """Coordinates in which the quadric error is the squared distance from its least point.

    Written to `metric` [6] (rows of the Cholesky factor L of the error's matrix) and `centre` [3]:
    the error at v is ``|L^T (v - centre)|^2`` and a constant.
    """
    trace = (q[0] + q[4] + q[7]) * 1e-3 + 1e-12  # flat patches: pulled gently to the guess
    l00 = np.sqrt(q[0] + trace)
    l10 = q[1] / l00
    l20 = q[2] / l00
    l11 = np.sqrt(max(q[4] + trace - l10 * l10, 1e-15))
    l21 = (q[5] - l20 * l10) / l11
    l22 = np.sqrt(max(q[7] + trace - l20 * l20 - l21 * l21, 1e-15))
    y0 = (-q[3] + trace * guess[0]) / l00
    y1 = (-q[6] + trace * guess[1] - l10 * y0) / l11
    y2 = (-q[8] + trace * guess[2] - l20 * y0 - l21 * y1) / l22
    centre[2] = y2 / l22
    centre[1] = (y1 - l21 * centre[2]) / l11
    centre[0] = (y0 - l10 * centre[1] - l20 * centre[2]) / l00
    metric[0], metric[1], metric[2] = l00, l10, l11
    metric[3], metric[4], metric[5] = l20, l21, l22


@exact_kernel(inner=True)
def _volume_metric(x, link, edges, guess, metric, centre):
    """Plain coordinates about a point far down the gradient of the volume, linear in v.

    Returns:
        False if the outline is so small that there is no gradient.
    """
    for i in range(3):
        centre[i] = 0.0
    gradient = np.empty(3)
    for i in range(3):
        centre[i] = 1.0
        gradient[i] = fan_volume(x, link, edges, centre)
        centre[i] = 0.0
    if not _unit(gradient):
        return False
    for i in range(3):
        centre[i] = guess[i] - 5.0 * gradient[i]
    metric[:] = 0.0
    metric[0] = metric[2] = metric[5] = 1.0
    return True


@exact_kernel(inner=True)
def _change_plane(n, metric, centre, out):
    """A half-space in the coordinates ``L^T (v - centre)``."""
    m0 = n[0] / metric[0]
    m1 = (n[1] - metric[1] * m0) / metric[2]
    m2 = (n[2] - metric[3] * m0 - metric[4] * m1) / metric[5]
    scale = 1.0 / np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    room = n[3] - n[0] * centre[0] - n[1] * centre[1] - n[2] * centre[2]
    out[0], out[1], out[2], out[3] = m0 * scale, m1 * scale, m2 * scale, room * scale


class Bounds(NamedTuple):
    """What hulls that are made must contain and keep within.

    Attributes:
        inner: Vertices of the hull to contain, shape [p, 3].
        limits: Half-spaces that all vertices must lie in besides, shape [q, 4].
        touching: For each edge of each face the half-space inside it that touches the inner hull,
            NaN where not known yet, shape [3 f, 4].
        objective: `QUADRIC` or `VOLUME`.
    """

    inner: FloatArray
    limits: FloatArray
    touching: FloatArray
    objective: int


@exact_kernel()
def place(x, quadric, faces, bounds, link, outer, edges, guess, planes, v):
    """Best allowed vertex over an outline.

    Args:
        x: Vertices, shape [n, 3].
        quadric: Sum of the quadrics of the vertices replaced, shape [10].
        faces: Triangles, shape [f, 3].
        bounds: `Bounds`, of which `touching` is filled.
        link: Outline, see `gather_link`.
        outer: What is outside it.
        edges: Its length.
        guess: A point near the patch, shape [3].
        planes: Scratch, shape [3 MAX_PATCH + MAX_CUTS, 4].
        v: Output, shape [3].

    Returns:
        False if there is none.
    """
    limits = bounds.limits
    count = _fill_conditions(x, faces, bounds.inner, link, outer, edges, bounds.touching, planes)
    if count < 0:
        return False
    metric = np.empty(6)
    centre = np.empty(3)
    if bounds.objective == QUADRIC:
        _quadric_metric(quadric, guess, metric, centre)
    elif not _volume_metric(x, link, edges, guess, metric, centre):
        return False
    for k in range(count):
        _change_plane(planes[k], metric, centre, planes[k])
    target = np.zeros(3)
    for _ in range(MAX_CUTS):
        if not nearest_in_polyhedron(planes, count, target, 1e-12, v):
            return False
        v[2] /= metric[5]
        v[1] = (v[1] - metric[4] * v[2]) / metric[2]
        v[0] = (v[0] - metric[1] * v[1] - metric[3] * v[2]) / metric[0]
        for i in range(3):
            v[i] += centre[i]
        # Of the many limits only those that the optimum breaks take part, one at a time.
        worst = 0.1 * _MARGIN
        broken = -1
        for k in range(limits.shape[0]):
            n = limits[k]
            excess = n[0] * v[0] + n[1] * v[1] + n[2] * v[2] - n[3]
            if excess > worst:
                worst = excess
                broken = k
        if broken < 0:
            return True
        _change_plane(limits[broken], metric, centre, planes[count])
        count += 1
    return False
