"""Particles against the exact moving surface: the yardstick of all other colliders.

A particle that met the surface from its front between two updates, wherever both went, stays in
front of what it met first. What is inside then goes to the closest point of the outer surface.
Inside is where the winding number is above a half (Jacobson et al. 2013; far triangles by dipoles,
Barill et al. 2018), so that folds, parts that cut each other and small holes do not matter;
triangles that lie inside themselves, as in the crease of a bent elbow, are left out of the search.

Right before fast: nothing here is for real time.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.mesh_distance import (
    box_distance2,
    closest_point,
    refit_boxes,
    sort_triangles,
)
from garment_sim_ros.geometry.winding_number import (
    BURIED,
    INSIDE,
    MIXED,
    OUTER,
    UNKNOWN,
    burial,
    face_normal,
    insides,
    is_buried,
    refit_dipoles,
    winding,
)
from garment_sim_ros.jit import exact_kernel

_LEAF_SIZE = 4
_ROUNDS = 8
"""Most moves out: each may end in another fold or nearer than the thickness to one."""
_BISECTIONS = 45
_SURE = 1e-5
"""Farther than this from the nearest triangle, its side is that of the surface [m]."""
_EDGE = 1e-7
"""A hit may miss a triangle by this in its barycentric coordinates: no slits between them."""


class _Skin(NamedTuple):
    """A skin with its hierarchy of boxes and dipoles, and what is known of its triangles."""

    x: FloatArray
    triangles: IntArray
    depth: int
    boxes: FloatArray
    dipoles: FloatArray
    state: NDArray[np.int8]


class MeshCollider:
    """A skin that particles stay out of.

    Args:
        vertices: Positions [m], shape [v, 3].
        triangles: Vertex indices, shape [t, 3], at least one; all turned the same way.

    Raises:
        GeometryError: No triangle, an index out of range, or positions that are not finite.
    """

    def __init__(self, vertices: FloatArray, triangles: IntArray) -> None:
        x = _checked(vertices, len(vertices))
        triangles = np.ascontiguousarray(triangles, dtype=np.int32)
        if triangles.ndim != 2 or triangles.shape[1:] != (3,) or len(triangles) == 0:
            raise GeometryError(f"triangles have shape {triangles.shape}; allowed: [1 or more, 3]")
        if triangles.min() < 0 or triangles.max() >= len(x):
            raise GeometryError(f"triangle indices must lie in 0..{len(x) - 1}")
        a, b, c = (x - x.mean(axis=0))[triangles].transpose(1, 0, 2)
        if np.einsum("tk,tk->", a, np.cross(b, c)) < 0.0:  # the inside is out
            triangles = triangles[:, ::-1]
        self._depth = 0
        while len(triangles) > _LEAF_SIZE << self._depth:
            self._depth += 1
        self._order = np.arange(len(triangles), dtype=np.int32)
        sort_triangles(x[triangles].mean(axis=1), self._order, self._depth)
        self._triangles = np.ascontiguousarray(triangles[self._order])
        nodes = 2 ** (self._depth + 1) - 1
        self._x = x
        self._before = x.copy()
        self._boxes = np.empty((nodes, 6))
        self._boxes_before = np.empty((nodes, 6))
        self._dipoles = np.empty((nodes, 7))
        self._state = np.zeros(len(triangles), dtype=np.int8)
        self._refit()
        self._boxes_before[:] = self._boxes

    def update(self, vertices: FloatArray, before: FloatArray | None = None) -> None:
        """Move the skin; where it was is the start of the step that `collide` looks at.

        Args:
            vertices: New positions in the constructor's order [m], shape [v, 3].
            before: Where it was, if that is not what the last update said [m], shape [v, 3].

        Raises:
            GeometryError: Another count, or positions that are not finite.
        """
        x = _checked(vertices, len(self._x))
        if before is None:
            self._before = self._x
            self._boxes_before[:] = self._boxes
        else:
            self._before = _checked(before, len(self._x))
            refit_boxes(self._before, self._triangles, self._boxes_before, self._depth)
        self._x = x
        self._refit()

    def collide(
        self, x: FloatArray, x_start: FloatArray, thickness: float = 0.0
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """Positions out of the skin.

        Args:
            x: Where particles are to go in the step [m], shape [n, 3].
            x_start: Where they were at its start, when the skin was where it was before the last
                `update` [m], shape [n, 3].
            thickness: Distance to keep [m].

        Returns:
            Corrected positions [m], shape [n, 3]; unit normals of the surface met, zero where
            nothing was, shape [n, 3]; the triangle met, -1 where none was, shape [n].
        """
        x = np.array(x, dtype=np.float64, order="C")
        start = np.ascontiguousarray(x_start, dtype=np.float64)
        if x.ndim != 2 or x.shape[1:] != (3,) or x.shape != start.shape:
            raise GeometryError(f"x {x.shape} and x_start {start.shape} must both be [n, 3]")
        normal = np.zeros_like(x)
        met = np.full(len(x), -1, dtype=np.int32)
        _collide(self._skin(), self._before, self._boxes_before, start, thickness, x, normal, met)
        met[met >= 0] = self._order[met[met >= 0]]
        return x, normal, met

    def is_inside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Which points [n, 3] are in the body."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        result = np.zeros(len(points), dtype=np.bool_)
        insides(self._x, self._triangles, self._depth, self._dipoles, points, result)
        return result

    def _skin(self) -> "_Skin":
        return _Skin(
            self._x, self._triangles, self._depth, self._boxes, self._dipoles, self._state
        )

    def _refit(self) -> None:
        refit_boxes(self._x, self._triangles, self._boxes, self._depth)
        refit_dipoles(self._x, self._triangles, self._depth, self._boxes, self._dipoles)
        self._state[:] = UNKNOWN


def _checked(vertices: FloatArray, count: int) -> FloatArray:
    x = np.array(vertices, dtype=np.float64, order="C")
    if x.shape != (count, 3) or not np.isfinite(x).all():
        raise GeometryError(f"vertices must be finite, shape [{count}, 3]")
    return x


@exact_kernel(inner=True)
def _closest_outer(x, triangles, depth, boxes, dipoles, state, strict, p, closest):
    """Squared distance to the nearest place that is not buried, and its triangle; -1 for none.

    Of a triangle only the closest place is looked at: where that is buried, another triangle is
    near. `strict` does not believe that triangles are wholly outer ones.

    Returns:
        Squared distance, triangle, and on which side of it the point is, where that is certain: in
        front 1, behind -1, else 0. Nothing lies between a point and the nearest place of all.
    """
    n = triangles.shape[0]
    first_leaf = (1 << depth) - 1
    stack = np.empty(depth + 2, np.int32)
    stack[0] = 0
    top = 1
    best = -1
    best_d2 = np.inf
    best_side = 0
    skipped = np.inf
    at = np.empty(3)
    while top > 0:
        top -= 1
        node = stack[top]
        if box_distance2(boxes[node], p[0], p[1], p[2]) >= best_d2:
            continue
        if node < first_leaf:
            left, right = 2 * node + 1, 2 * node + 2
            if box_distance2(boxes[left], p[0], p[1], p[2]) < box_distance2(
                boxes[right], p[0], p[1], p[2]
            ):
                left, right = right, left
            stack[top] = left  # the nearer one is looked at first
            stack[top + 1] = right
            top += 2
            continue
        leaf = node - first_leaf
        for t in range((leaf * n) >> depth, ((leaf + 1) * n) >> depth):
            d2, cx, cy, cz, feature = closest_point(x, triangles[t], p[0], p[1], p[2])
            if d2 >= best_d2:
                continue
            at[0], at[1], at[2] = cx, cy, cz
            kind = burial(x, triangles, depth, dipoles, state, t)
            if kind == BURIED or (
                (strict or kind == MIXED)
                and is_buried(x, triangles, depth, dipoles, triangles[t], at)
            ):
                skipped = min(skipped, d2)
                continue
            best_d2, best = d2, t
            closest[:] = at
            best_side = 0
            if feature == 0 and kind == OUTER and d2 > _SURE * _SURE:
                best_side = 1 if _dot(face_normal(x, triangles[t]), p - at) > 0.0 else -1
    return best_d2, best, best_side if best_d2 < skipped else 0


@exact_kernel(inner=True)
def _corner_from(before, x, corner, p, q, s):
    """A moving corner as seen from a moving point at the share `s` of the step."""
    e = before[corner]
    f = x[corner]
    return (
        e[0] + s * (f[0] - e[0]) - p[0] - s * (q[0] - p[0]),
        e[1] + s * (f[1] - e[1]) - p[1] - s * (q[1] - p[1]),
        e[2] + s * (f[2] - e[2]) - p[2] - s * (q[2] - p[2]),
    )


@exact_kernel()
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@exact_kernel(inner=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@exact_kernel(inner=True)
def _over(before, x, triangle, p, q, s):
    """Volume under a moving point over a moving triangle: positive in front of it."""
    a = _corner_from(before, x, triangle[0], p, q, s)
    b = _corner_from(before, x, triangle[1], p, q, s)
    c = _corner_from(before, x, triangle[2], p, q, s)
    return -_dot(a, _cross(b, c))


@exact_kernel()
def _shares(before, x, triangle, p, q, s):
    """Barycentric coordinates of a moving point in a moving triangle's plane."""
    a = _corner_from(before, x, triangle[0], p, q, s)
    b = _corner_from(before, x, triangle[1], p, q, s)
    c = _corner_from(before, x, triangle[2], p, q, s)
    bc, ca, ab = _cross(b, c), _cross(c, a), _cross(a, b)
    face = (bc[0] + ca[0] + ab[0], bc[1] + ca[1] + ab[1], bc[2] + ca[2] + ab[2])
    area2 = max(_dot(face, face), 1e-300)
    return _dot(bc, face) / area2, _dot(ca, face) / area2, _dot(ab, face) / area2


@exact_kernel(inner=True)
def _meets(before, x, triangle, p, q):
    """When a moving point goes through a moving triangle from the front; 2 for never."""
    if _over(before, x, triangle, p, q, 0.0) < 0.0 or _over(before, x, triangle, p, q, 1.0) >= 0.0:
        return 2.0
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if _over(before, x, triangle, p, q, middle) >= 0.0:
            low = middle
        else:
            high = middle
    u, v, w = _shares(before, x, triangle, p, q, high)
    return high if min(u, v, w) >= -_EDGE else 2.0


@exact_kernel(inner=True)
def _first_met(x, triangles, depth, boxes, before, boxes_before, p, q):
    """The triangle that a point meets first from the front on its way, -1 for none."""
    n = triangles.shape[0]
    first_leaf = (1 << depth) - 1
    stack = np.empty(depth + 2, np.int32)
    stack[0] = 0
    top = 1
    best = -1
    best_s = 2.0
    while top > 0:
        top -= 1
        node = stack[top]
        apart = False
        for k in range(3):
            low = min(boxes[node, k], boxes_before[node, k])
            high = max(boxes[node, 3 + k], boxes_before[node, 3 + k])
            apart |= max(p[k], q[k]) < low or min(p[k], q[k]) > high
        if apart:
            continue
        if node < first_leaf:
            stack[top] = 2 * node + 1
            stack[top + 1] = 2 * node + 2
            top += 2
            continue
        leaf = node - first_leaf
        for t in range((leaf * n) >> depth, ((leaf + 1) * n) >> depth):
            s = _meets(before, x, triangles[t], p, q)
            if s < best_s or (s == best_s and s < 2.0 and t < best):
                best_s, best = s, t
    return best, best_s


@exact_kernel()
def _collide(skin, before, boxes_before, start, thickness, x, normal, met):
    """See `MeshCollider.collide`; `skin` is a `_Skin`."""
    x_skin, triangles, depth, boxes, dipoles, state = skin
    closest = np.empty(3)
    for i in range(x.shape[0]):
        p = x[i]
        if not np.isfinite(p[0] + p[1] + p[2] + start[i, 0] + start[i, 1] + start[i, 2]):
            continue
        hit, s = _first_met(x_skin, triangles, depth, boxes, before, boxes_before, start[i], p)
        if hit >= 0:
            _return_to(before, x_skin, triangles[hit], start[i], s, p)
            met[i] = hit
            normal[i] = face_normal(x_skin, triangles[hit])
        if box_distance2(boxes[0], p[0], p[1], p[2]) > thickness * thickness:
            continue
        keep = thickness
        for k in range(_ROUNDS):
            if k == _ROUNDS // 2:
                keep = 0.0  # no room in a crease: out, if not that far
            d2, nearest, side = _closest_outer(
                x_skin, triangles, depth, boxes, dipoles, state, k > 1, p, closest
            )
            inside = side < 0
            if side == 0:
                inside = winding(x_skin, triangles, depth, dipoles, p[0], p[1], p[2]) > INSIDE
            far = np.sqrt(d2)
            if nearest < 0 or (not inside and far >= keep * (1.0 - 1e-6)):
                break
            out = (closest - p if inside else p - closest) / max(far, 1e-300)
            if far < 1e-7:
                out = face_normal(x_skin, triangles[nearest])
            met[i] = nearest
            normal[i] = out
            # A hair more than needed, so that rounding does not count as inside.
            p[:] = closest + (keep + 1e-7) * out


@exact_kernel(inner=True)
def _return_to(before, x, triangle, p, s, q):
    """Move the end q of a path to where the point that it met at the share s is in the end."""
    _, v, w = _shares(before, x, triangle, p, q, s)
    v = min(max(v, 0.0), 1.0)
    w = min(max(w, 0.0), 1.0 - v)
    a, b, c = x[triangle[0]], x[triangle[1]], x[triangle[2]]
    q[:] = a + v * (b - a) + w * (c - a) + 1e-7 * face_normal(x, triangle)
