"""A smooth body surface as the zero level of a field: lofted parts under smooth unions.

A loft is a stack of cross-sections along a straight axis. A section is four quarter
super-ellipses with their own half-axes, so that front and back, left and right may differ;
between stations all section figures follow a smooth curve. The field of a part is about the
distance to its surface (negative inside); parts are joined by the cubic smooth minimum, whose
radius is the part's own, so that an armpit may be tight and a shoulder soft.

Smooth minimum and its use on distance fields: Quilez, "Smooth minimum", iquilezles.org.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.jit import kernel

_KNOTS = 64
_SMOOTHING = 2.0  # knots; takes the corners off the outline
_BLOCK = 4  # nodes along the side of a grid block
_COLUMNS = 7  # centre u, centre v, half-axes +u, -u, +v, -v, exponent


@dataclass(frozen=True, kw_only=True)
class Loft:
    """One part of a body.

    Attributes:
        origin: Start of the axis [m], shape [3].
        frame: Rows are the section's u and v directions and the axis direction, shape [3, 3].
        stations: Positions along the axis [m], increasing, shape [s].
        sections: Per station: centre u, centre v, half-axes along +u, -u, +v, -v [m], exponent of
            the super-ellipse, shape [s, 7].
        caps: Lengths of the half-ellipsoid that closes each end [m].
        blend: Radius over which this part melts into those before it [m].
        mirrored: Whether a twin exists on the other side of the plane y = 0.
        twin_blend: Radius over which a part and its twin melt into each other [m].
        carved: Whether the part is taken away instead of added.
    """

    origin: FloatArray
    frame: FloatArray
    stations: FloatArray
    sections: FloatArray
    caps: tuple[float, float]
    blend: float
    mirrored: bool = False
    twin_blend: float = 0.0
    carved: bool = False


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Parts packed for the kernels; part 0 is the base that the others join.

    Attributes:
        frame: Origins and frames, shape [p, 4, 3].
        span: First and last station, lower and upper cap, blend radii, shape [p, 6].
        knots: Section figures at evenly spaced knots, shape [p, knots, 7].
        ball: Bounding balls: centre and radius, shape [p, 4].
        flags: Mirrored, carved, shape [p, 2].
        floor_blend: Radius of the edge between the soles and the floor plane z = 0 [m].
    """

    frame: FloatArray
    span: FloatArray
    knots: FloatArray
    ball: FloatArray
    flags: NDArray[np.bool_]
    floor_blend: float

    def __call__(self, points: FloatArray) -> FloatArray:
        """Field at points [n, 3]: about the signed distance [m], negative inside, shape [n]."""
        out = np.empty(len(points))
        _field(
            self.frame,
            self.span,
            self.knots,
            self.ball,
            self.flags,
            self.floor_blend,
            np.ascontiguousarray(points),
            out,
        )
        return out

    def without(self, parts: Sequence[int]) -> "Surface":
        """The surface without some of its parts."""
        kept = np.delete(np.arange(len(self.span)), parts)
        return Surface(
            frame=self.frame[kept],
            span=self.span[kept],
            knots=self.knots[kept],
            ball=self.ball[kept],
            flags=self.flags[kept],
            floor_blend=self.floor_blend,
        )

    def part(self, index: int, points: FloatArray) -> FloatArray:
        """Field of one part without its twin at points [n, 3], shape [n]."""
        out = np.empty(len(points))
        _part_field(self.frame[index], self.span[index], self.knots[index], points, out)
        return out

    def project(self, points: FloatArray) -> FloatArray:
        """Points moved by one Newton step towards the surface, shape [n, 3].

        Points of the middle plane stay in it: the field is even in y.
        """
        step = 1e-4
        shifted = points + step * np.concatenate([np.zeros((1, 1, 3)), np.eye(3)[:, None]])
        value = self(shifted.reshape(-1, 3)).reshape(4, -1)
        gradient = (value[1:] - value[0]).T / step
        gradient[points[:, 1] == 0.0, 1] = 0.0
        squared = np.maximum((gradient**2).sum(axis=1), 0.04)
        return points - (value[0] / squared)[:, None] * gradient

    def sample(self, origin: FloatArray, spacing: float, shape: tuple[int, ...]) -> FloatArray:
        """Field on a grid; exact near the surface, only the sign is right far from it.

        Args:
            origin: Position of node (0, 0, 0) [m], shape [3].
            spacing: Distance of the nodes [m].
            shape: Number of nodes along x, y, z.
        """
        corner = np.stack(
            np.meshgrid(*(np.arange(0, n, _BLOCK) for n in shape), indexing="ij"), -1
        )
        centre = self((origin + spacing * (corner + 0.5 * (_BLOCK - 1))).reshape(-1, 3))
        centre = centre.reshape(corner.shape[:3])
        # The field is no exact distance: blocks within twice their own radius are evaluated.
        near = np.abs(centre) < np.sqrt(3.0) * _BLOCK * spacing
        node = np.stack(np.meshgrid(*3 * (np.arange(_BLOCK),), indexing="ij"), -1)
        blocks = np.empty((*centre.shape, _BLOCK, _BLOCK, _BLOCK))
        blocks[:] = centre[..., None, None, None]
        points = origin + spacing * (corner[near][:, None, None, None] + node)
        blocks[near] = self(points.reshape(-1, 3)).reshape(-1, _BLOCK, _BLOCK, _BLOCK)
        grid = blocks.transpose(0, 3, 1, 4, 2, 5).reshape(_BLOCK * np.array(corner.shape[:3]))
        return np.ascontiguousarray(grid[tuple(slice(n) for n in shape)])


def surface(parts: Sequence[Loft], floor_blend: float) -> Surface:
    """Packs parts; the order is the order of the smooth unions."""
    p = len(parts)
    frame = np.empty((p, 4, 3))
    span = np.empty((p, 6))
    knots = np.empty((p, _KNOTS, _COLUMNS))
    ball = np.empty((p, 4))
    flags = np.empty((p, 2), np.bool_)
    for i, part in enumerate(parts):
        first, last = part.stations[0], part.stations[-1]
        frame[i, 0], frame[i, 1:] = part.origin, part.frame
        span[i] = first, last, *part.caps, part.blend, part.twin_blend
        t = np.linspace(first, last, _KNOTS)
        if len(part.stations) > 2:
            outline = PchipInterpolator(part.stations, part.sections)(t)
            knots[i] = gaussian_filter1d(outline, _SMOOTHING, axis=0, mode="nearest")
        else:
            knots[i] = part.sections[0]
        reach = np.abs(knots[i, :, :2]).max(axis=0) + np.array(
            [knots[i, :, 2:4].max(), knots[i, :, 4:6].max()]
        )
        half = 0.5 * (last - first) + max(part.caps)
        ball[i, :3] = part.origin + 0.5 * (first + last) * part.frame[2]
        ball[i, 3] = np.sqrt(half**2 + (reach**2).sum())
        flags[i] = part.mirrored, part.carved
    return Surface(
        frame=frame, span=span, knots=knots, ball=ball, flags=flags, floor_blend=floor_blend
    )


@kernel(inner=True)
def _loft(frame, span, knots, x, y, z):
    """Field of one loft at one point."""
    x -= frame[0, 0]
    y -= frame[0, 1]
    z -= frame[0, 2]
    u = frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z
    v = frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z
    t = frame[3, 0] * x + frame[3, 1] * y + frame[3, 2] * z
    clamped = min(max(t, span[0]), span[1])
    beyond = t - clamped
    last = knots.shape[0] - 1
    s = (clamped - span[0]) / (span[1] - span[0]) * last
    i = min(int(s), last - 1)
    s -= i
    # Catmull-Rom weights of the four knots around the point.
    w0 = 0.5 * s * (-1.0 + s * (2.0 - s))
    w1 = 1.0 + 0.5 * s * s * (-5.0 + 3.0 * s)
    w2 = 0.5 * s * (1.0 + s * (4.0 - 3.0 * s))
    w3 = 0.5 * s * s * (s - 1.0)
    k0 = max(i - 1, 0)
    k3 = min(i + 2, last)
    du = u - _blend(knots, k0, i, k3, 0, w0, w1, w2, w3)
    dv = v - _blend(knots, k0, i, k3, 1, w0, w1, w2, w3)
    half_u = _blend(knots, k0, i, k3, 2 if du > 0.0 else 3, w0, w1, w2, w3)
    half_v = _blend(knots, k0, i, k3, 4 if dv > 0.0 else 5, w0, w1, w2, w3)
    n = _blend(knots, k0, i, k3, 6, w0, w1, w2, w3)
    q = (np.abs(du / half_u) ** n + np.abs(dv / half_v) ** n) ** (2.0 / n)
    if beyond != 0.0:
        cap = span[2] if beyond < 0.0 else span[3]
        q += (beyond / cap) ** 2
    if q < 1e-12:
        return -min(half_u, half_v)
    return np.sqrt(du * du + dv * dv + beyond * beyond) * (1.0 - 1.0 / np.sqrt(q))


@kernel(inner=True)
def _blend(knots, k0, i, k3, column, w0, w1, w2, w3):
    return (
        w0 * knots[k0, column]
        + w1 * knots[i, column]
        + w2 * knots[i + 1, column]
        + w3 * knots[k3, column]
    )


@kernel(inner=True)
def _smooth_minimum(a, b, k):
    h = k - abs(a - b)
    if h <= 0.0 or k == 0.0:
        return min(a, b)
    h /= k
    return min(a, b) - h * h * h * k / 6.0


@kernel(inner=True)
def _near_loft(frame, span, knots, ball, x, y, z, limit):
    """Field of one loft where it may be under the limit, a large number elsewhere."""
    dx, dy, dz = x - ball[0], y - ball[1], z - ball[2]
    if np.sqrt(dx * dx + dy * dy + dz * dz) - ball[3] > limit:
        return 1e9
    return _loft(frame, span, knots, x, y, z)


@kernel(inner=True)
def _point_field(frame, span, knots, ball, flags, floor_blend, x, y, z):
    """Field of the whole body at one point."""
    d = 1e9
    for p in range(frame.shape[0]):
        blend = span[p, 4]
        sign = -1.0 if flags[p, 1] else 1.0
        limit = blend + sign * d
        part = _near_loft(frame[p], span[p], knots[p], ball[p], x, y, z, limit)
        if flags[p, 0]:
            twin = _near_loft(frame[p], span[p], knots[p], ball[p], x, -y, z, limit)
            part = _smooth_minimum(part, twin, span[p, 5])
        d = sign * _smooth_minimum(sign * d, part, blend)
    return -_smooth_minimum(-d, z, floor_blend)


@kernel()
def _field(frame, span, knots, ball, flags, floor_blend, points, out):
    for i in range(points.shape[0]):
        out[i] = _point_field(
            frame, span, knots, ball, flags, floor_blend, points[i, 0], points[i, 1], points[i, 2]
        )


@kernel()
def _part_field(frame, span, knots, points, out):
    for i in range(points.shape[0]):
        out[i] = _loft(frame, span, knots, points[i, 0], points[i, 1], points[i, 2])
