"""Where the ray from inside a convex hull through a point leaves it: outer maps.

Sun et al. 2007, section 2.4. A map sphere sends its rays from a centre; its cells are ranges of
longitude and polar angle. A map cylinder, for long hulls, sends them from the axis at right
angles; its cells are ranges of angle and height. Each cell lists the triangles that a ray of its
can hit.

The lists are exact. A range of longitude is a wedge of two half-spaces: a triangle is clipped to
it, and what is left covers one range of heights, or of polar angles: the extremes of these are at
corners, at the highest and lowest points of the great circles through edges, or at a pole that the
triangle holds.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.jit import exact_kernel

_ROUND = 2.0
"""A hull whose longest side is at most this multiple of the next one gets a map sphere."""
_TOUCH = 1e-12
"""Share of the size by which ranges are widened, so that rounding loses no triangle."""


class OuterMap(NamedTuple):
    """A map around the origin and the z axis.

    Attributes:
        is_sphere: 1 for a map sphere, 0 for a map cylinder.
        around: Ranges of angle about the axis.
        rows: Ranges of polar angle, or of height.
        low: Least height [m]; 0 for a sphere.
        per_row: Rows per height, or per polar angle.
        start: Where each cell's faces start in `face`, shape [around * rows + 1]; rows are
            fastest.
        face: Faces of the hull.
        plane: Their outward unit normals and offsets, shape [f, 4].
        first: Where the map's cells begin in `start`.
    """

    is_sphere: int
    around: int
    rows: int
    low: float
    per_row: float
    start: IntArray
    face: IntArray
    plane: FloatArray
    first: int


def outer_map(
    vertices: FloatArray,
    faces: IntArray,
    *,
    around: int = 12,
    rows: int = 8,
    kind: str = "auto",
) -> OuterMap:
    """Build the map of a hull in its own frame.

    Args:
        vertices: Corners; the longest side along z, about the origin [m], shape [n, 3].
        faces: Outward triangles, shape [f, 3].
        around: Ranges of angle, at least 3.
        rows: Ranges of polar angle or height, at least 1.
        kind: "sphere", "cylinder", or "auto" by shape: a sphere also needs the origin inside.

    Raises:
        GeometryError: A sphere was asked for about an origin that is not inside.
    """
    corner = vertices[faces]
    a, b, c = corner.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    offset = np.einsum("fk,fck->fc", normal, corner).max(axis=1)
    centred = bool((offset > 0.0).all())
    extent = np.sort(np.ptp(vertices, axis=0))
    if kind == "auto":
        kind = "sphere" if centred and extent[2] <= _ROUND * extent[1] else "cylinder"
    if kind == "sphere" and not centred:
        raise GeometryError("a map sphere needs its centre inside the hull")
    is_sphere = kind == "sphere"
    size = float(np.abs(vertices).max())
    low = 0.0 if is_sphere else float(vertices[:, 2].min())
    high = np.pi if is_sphere else float(vertices[:, 2].max())
    per_row = rows / (high - low)
    lists: list[list[int]] = [[] for _ in range(around * rows)]
    for i in range(around):
        left, right = (2.0 * np.pi * (i + k) / around for k in (0, 1))
        wedge = np.array([[-np.sin(left), np.cos(left)], [np.sin(right), -np.cos(right)]])
        for f in range(len(faces)):
            piece = _clipped(corner[f], wedge, -_TOUCH * size)
            if len(piece) == 0:
                continue
            bottom, top = _polar_range(piece) if is_sphere else _height_range(piece)
            margin = _TOUCH * (np.pi if is_sphere else size)
            first = int(np.floor((bottom - margin - low) * per_row))
            last = int(np.floor((top + margin - low) * per_row))
            for row in range(max(first, 0), min(last, rows - 1) + 1):
                lists[i * rows + row].append(f)
    return OuterMap(
        is_sphere=int(is_sphere),
        around=around,
        rows=rows,
        low=low,
        per_row=per_row,
        start=np.cumsum([0, *(len(faces) for faces in lists)]).astype(np.int32),
        face=np.array([f for faces in lists for f in faces], np.int32),
        plane=np.column_stack([normal, offset]),
        first=0,
    )


def _clipped(polygon: FloatArray, wedge: FloatArray, level: float) -> FloatArray:
    """The part of a convex polygon [n, 3] where both rows of `wedge` give at least `level`."""
    for inwards in wedge:
        height = polygon[:, :2] @ inwards - level
        kept = []
        for k in range(len(polygon)):
            p, q = polygon[k - 1], polygon[k]
            hp, hq = height[k - 1], height[k]
            if (hp >= 0.0) != (hq >= 0.0):
                kept.append((hq * p - hp * q) / (hq - hp))
            if hq >= 0.0:
                kept.append(q)
        if not kept:
            return np.zeros((0, 3))
        polygon = np.array(kept)
    return polygon


def _height_range(polygon: FloatArray) -> tuple[float, float]:
    return float(polygon[:, 2].min()), float(polygon[:, 2].max())


def _polar_range(polygon: FloatArray) -> tuple[float, float]:
    """Least and largest polar angle over a convex polygon that faces away from the origin."""
    z = np.array([0.0, 0.0, 1.0])
    directions = list(polygon)
    sides = []
    for k in range(len(polygon)):
        p, q = polygon[k - 1], polygon[k]
        across = np.cross(p, q)
        length = float(np.linalg.norm(across))
        if length == 0.0:
            continue
        across /= length
        sides.append(across)
        peak = z - across * across[2]
        for extreme in (peak, -peak):  # on the arc from p to q?
            if np.cross(p, extreme) @ across > 0.0 and np.cross(extreme, q) @ across > 0.0:
                directions.append(extreme)
    for pole in (z, -z):
        if sides and all(side @ pole >= 0.0 for side in sides):
            directions.append(pole)
    polar = [np.arctan2(np.hypot(d[0], d[1]), d[2]) for d in directions]
    return float(min(polar)), float(max(polar))


@exact_kernel(inner=True)
def ray_exit(table, x, y, z):
    """Where the response ray through a point leaves the hull.

    Returns:
        (distance from the ray's origin, face): infinity and -1 if the ray does not leave through
        any face of its cell, as beyond the ends of a map cylinder.
    """
    across = np.sqrt(x * x + y * y)
    angle = np.arctan2(y, x)
    if angle < 0.0:
        angle += 2.0 * np.pi
    column = min(int(angle * table.around / (2.0 * np.pi)), table.around - 1)
    if table.is_sphere:
        length = np.sqrt(across * across + z * z)
        height = np.arctan2(across, z)
        ox = oy = oz = 0.0
        scale = 1.0 / length if length > 0.0 else 0.0
        dx, dy, dz = x * scale, y * scale, z * scale
    else:
        height = z - table.low
        ox, oy, oz = 0.0, 0.0, z
        scale = 1.0 / across if across > 0.0 else 0.0
        dx, dy, dz = x * scale, y * scale, 0.0
    if scale == 0.0:  # at the origin, or on the axis: any ray will do
        dx, dy, dz = 1.0, 0.0, 0.0
        column = 0
        height = 0.5 * np.pi if table.is_sphere else height
    row = int(np.floor(height * table.per_row))
    if row == table.rows:
        row -= 1
    best = np.inf
    found = -1
    if row < 0 or row > table.rows - 1:
        return best, found
    cell = table.first + column * table.rows + row
    for k in range(table.start[cell], table.start[cell + 1]):
        f = table.face[k]
        n = table.plane[f]
        slope = n[0] * dx + n[1] * dy + n[2] * dz
        if slope > 0.0:
            t = (n[3] - n[0] * ox - n[1] * oy - n[2] * oz) / slope
            if t < best:
                best = t
                found = f
    return best, found


@exact_kernel(inner=True)
def exit_point(table, x, y, z):
    """The response point of a point: where its ray leaves the hull.

    Returns:
        The point and its face, -1 if the ray does not leave, see `ray_exit`.
    """
    t, face = ray_exit(table, x, y, z)
    if face < 0:
        return x, y, z, face
    height = z if table.is_sphere else 0.0
    length = np.sqrt(x * x + y * y + height * height)
    if length == 0.0:
        return t, 0.0, 0.0 if table.is_sphere else z, face
    scale = t / length
    return x * scale, y * scale, z * scale if table.is_sphere else z, face
