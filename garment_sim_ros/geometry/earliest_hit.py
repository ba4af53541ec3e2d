"""Moving particles against moving ellipsoids: the earliest hit decides (Gong et al., 4).

The motion of a particle is met with every ellipsoid, in the space in which that one is the unit
ball, where it is a straight line; of all hits the earliest counts. Nothing depends on the order of
the
ellipsoids: ties go to the way out that is smaller in its coordinates.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.contact_ellipsoid import nearest_on_ellipsoid
from garment_sim_ros.geometry.jit import kernel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

RESPONSES = ("surface", "inelastic", "reflection")
_BLOCK = 16
_ON_SURFACE = 1e-7
"""A zeta that is less than 1 by this is on the surface: particles are put there by hits."""
_NEVER = 2.0
_INSIDE = -1.0
_PROJECTIONS = 12
_MARCHING = 60


@dataclass(frozen=True)
class PosedEllipsoids:
    """Ellipsoids at one instant.

    Attributes:
        centre: Centres [m], shape [m, 3].
        axes: Half-axis directions as columns, shape [m, 3, 3].
        radii: Half-axis lengths [m], shape [m, 3].
    """

    centre: FloatArray
    axes: FloatArray
    radii: FloatArray

    def __post_init__(self) -> None:
        m = len(self.centre)
        shapes = {"centre": (m, 3), "axes": (m, 3, 3), "radii": (m, 3)}
        for name, shape in shapes.items():
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise GeometryError(f"{name} of ellipsoids must be finite, shape {shape}")
            object.__setattr__(self, name, array)
        if (self.radii <= 0.0).any():
            raise GeometryError("radii of ellipsoids must be positive")

    def inflated(self, thickness: float) -> "PosedEllipsoids":
        """The same with all radii larger by `thickness` [m]."""
        return PosedEllipsoids(self.centre, self.axes, self.radii + thickness)


def collide_earliest(
    start: PosedEllipsoids,
    end: PosedEllipsoids,
    x_start: FloatArray,
    x: FloatArray,
    velocity: FloatArray,
    dt: float,
    *,
    response: str = "surface",
    restitution: float = 0.0,
    friction: float = 0.3,
) -> IntArray:
    """Moves particles out of ellipsoids after one step.

    A particle that starts inside leaves by the shortest way that does not enter another ellipsoid,
    before its motion is met with the ellipsoids.

    Args:
        start: The ellipsoids when the step starts, inflated by the cloth's thickness.
        end: The same when it ends.
        x_start: Particles at the start [m], shape [n, 3]; neighbours should be near each other.
        x: Proposed positions at the end, corrected in place [m], shape [n, 3].
        velocity: Velocities, corrected in place [m/s], shape [n, 3].
        dt: Duration of the step [s].
        response: ``surface``: by the surface's normal, with restitution and friction, the rest of
            the motion slides; ``inelastic``: the same without either; ``reflection``: equation
            (9), along the ray from the centre, while approaching, and the motion ends at the hit.
        restitution: Share of the normal velocity that is given back.
        friction: Coulomb coefficient.

    Returns:
        The ellipsoid that each particle met, -1 for none, shape [n].

    Raises:
        GeometryError: An unknown response, or arrays that do not fit.
    """
    if response not in RESPONSES:
        raise GeometryError(f"response {response!r}; allowed: {RESPONSES}")
    if len(start.centre) != len(end.centre) or not x_start.shape == x.shape == velocity.shape:
        raise GeometryError("start and end must hold the same ellipsoids and particles")
    hit = np.full(len(x), -1, dtype=np.int32)
    m = len(start.centre)
    if m == 0 or len(x) == 0:
        return hit
    boxes = np.empty((m, 6))
    nearby = np.empty((2, m), dtype=np.int32)
    nearby[1] = np.arange(m)
    ball0, ball1 = np.empty((m, 3, 3)), np.empty((m, 3, 3))
    if response == "inelastic":
        restitution = friction = 0.0
    _collide(
        (start.centre, start.axes, start.radii, ball0),
        (end.centre, end.axes, end.radii, ball1),
        boxes,
        nearby,
        np.ascontiguousarray(x_start, dtype=np.float64),
        x,
        velocity,
        dt,
        response == "reflection",
        restitution,
        friction,
        hit,
    )
    return hit


@kernel()
def _prepare(pose, box, first):
    """Maps to the unit balls and boxes around the ellipsoids."""
    centre, axes, radii, ball = pose
    for k in range(centre.shape[0]):
        for r in range(3):
            half = 0.0
            for c in range(3):
                ball[k, r, c] = axes[k, c, r] / radii[k, r]
                half += (axes[k, r, c] * radii[k, c]) ** 2
            half = np.sqrt(half)
            low, high = centre[k, r] - half, centre[k, r] + half
            box[k, r] = low if first else min(box[k, r], low)
            box[k, 3 + r] = high if first else max(box[k, 3 + r], high)


@kernel(forceinline=True)
def _to_ball(pose, k, px, py, pz):
    """A point where ellipsoid k is the unit ball."""
    centre, _, _, ball = pose
    A = ball[k]
    dx, dy, dz = px - centre[k, 0], py - centre[k, 1], pz - centre[k, 2]
    return (
        A[0, 0] * dx + A[0, 1] * dy + A[0, 2] * dz,
        A[1, 0] * dx + A[1, 1] * dy + A[1, 2] * dz,
        A[2, 0] * dx + A[2, 1] * dy + A[2, 2] * dz,
    )


@kernel(forceinline=True)
def _from_ball(pose, k, qx, qy, qz):
    """The inverse of `_to_ball`."""
    centre, axes, radii, _ = pose
    R = axes[k]
    qx, qy, qz = qx * radii[k, 0], qy * radii[k, 1], qz * radii[k, 2]
    return (
        centre[k, 0] + R[0, 0] * qx + R[0, 1] * qy + R[0, 2] * qz,
        centre[k, 1] + R[1, 0] * qx + R[1, 1] * qy + R[1, 2] * qz,
        centre[k, 2] + R[2, 0] * qx + R[2, 1] * qy + R[2, 2] * qz,
    )


@kernel(forceinline=True)
def _inside_any(pose, candidates, px, py, pz, but):
    """Whether a candidate other than `but` holds the point."""
    for c in range(candidates.size):
        k = candidates[c]
        if k != but:
            qx, qy, qz = _to_ball(pose, k, px, py, pz)
            if qx * qx + qy * qy + qz * qz < 1.0 - _ON_SURFACE:
                return True
    return False


@kernel()
def _way_out(pose, k, px, py, pz):
    """Nearest point of the surface of ellipsoid k, its normal, and how far that is."""
    centre, axes, radii, _ = pose
    R = axes[k]
    dx, dy, dz = px - centre[k, 0], py - centre[k, 1], pz - centre[k, 2]
    sx, sy, sz, nx, ny, nz = nearest_on_ellipsoid(
        R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz,
        R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz,
        R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz,
        radii[k, 0],
        radii[k, 1],
        radii[k, 2],
    )
    wx = centre[k, 0] + R[0, 0] * sx + R[0, 1] * sy + R[0, 2] * sz
    wy = centre[k, 1] + R[1, 0] * sx + R[1, 1] * sy + R[1, 2] * sz
    wz = centre[k, 2] + R[2, 0] * sx + R[2, 1] * sy + R[2, 2] * sz
    mx = R[0, 0] * nx + R[0, 1] * ny + R[0, 2] * nz
    my = R[1, 0] * nx + R[1, 1] * ny + R[1, 2] * nz
    mz = R[2, 0] * nx + R[2, 1] * ny + R[2, 2] * nz
    way = np.sqrt((wx - px) ** 2 + (wy - py) ** 2 + (wz - pz) ** 2)
    return wx, wy, wz, mx, my, mz, way


@kernel(forceinline=True)
def _smaller(a0, a1, a2, a3, b0, b1, b2, b3):
    """Whether the first four numbers come before the other four, compared in order."""
    if a0 != b0:
        return a0 < b0
    if a1 != b1:
        return a1 < b1
    if a2 != b2:
        return a2 < b2
    return a3 < b3


@kernel()
def leave(pose, candidates, px, py, pz):
    """Moves a point out of the union of the candidates.

    By the shortest way to the surface of one of them that does not end in another; where every
    such way does, out of the deepest one again and again, which ends at the crease between them,
    and at last on in the mean direction of those ways.

    Returns:
        The point, and the last ellipsoid that it left, -1 if it was in none.
    """
    left = -1
    sx = sy = sz = 0.0
    for attempt in range(_PROJECTIONS + _MARCHING):
        best = np.inf
        bx = by = bz = 0.0
        chosen = -1
        deepest = -1.0
        ex = ey = ez = 0.0
        mx = my = mz = 0.0
        last = -1
        for c in range(candidates.size):
            k = candidates[c]
            qx, qy, qz = _to_ball(pose, k, px, py, pz)
            if qx * qx + qy * qy + qz * qz >= 1.0 - _ON_SURFACE:
                continue
            wx, wy, wz, nx, ny, nz, way = _way_out(pose, k, px, py, pz)
            if attempt < _PROJECTIONS and (way <= best):
                better = _smaller(way, wx, wy, wz, best, bx, by, bz)
                if better and not _inside_any(pose, candidates, wx, wy, wz, k):
                    best, bx, by, bz = way, wx, wy, wz
                    chosen = k
            if last < 0 or _smaller(-way, wx, wy, wz, -deepest, ex, ey, ez):
                deepest, ex, ey, ez = way, wx, wy, wz
                mx, my, mz = nx, ny, nz
                last = k
        if last < 0:
            return px, py, pz, left
        if chosen >= 0:
            return bx, by, bz, chosen
        left = last
        sx += mx
        sy += my
        sz += mz
        if attempt < _PROJECTIONS:
            px, py, pz = ex, ey, ez
        else:
            length = np.sqrt(sx * sx + sy * sy + sz * sz)
            if length < 1e-6:
                sx, sy, sz, length = mx, my, mz, 1.0
            along = max((sx * mx + sy * my + sz * mz) / length, 0.1)
            step = (deepest + 1e-7) / along / length
            px += step * sx
            py += step * sy
            pz += step * sz
    return px, py, pz, left


@kernel()
def _hit_times(start, end, near, way, count, time):
    """When each particle of a block meets each near ellipsoid, from 0 to 1.

    Without branches, so that it runs over several particles at once. Written to `time`: `_NEVER`
    for no hit, `_INSIDE` for a start inside.

    Args:
        start: The ellipsoids when the step starts.
        end: The same when it ends.
        near: Indices of the ellipsoids to ask.
        way: Coordinates of starts and ends, shape [6, block].
        count: Particles in the block.
        time: Output, shape [at least near.size + 1, block]; the last row holds the earliest.
    """
    last = time.shape[0] - 1
    for p in range(count):
        time[last, p] = _NEVER
    for c in range(near.size):
        k = near[c]
        A = start[3][k]
        a00, a01, a02 = A[0, 0], A[0, 1], A[0, 2]
        a10, a11, a12 = A[1, 0], A[1, 1], A[1, 2]
        a20, a21, a22 = A[2, 0], A[2, 1], A[2, 2]
        B = end[3][k]
        b00, b01, b02 = B[0, 0], B[0, 1], B[0, 2]
        b10, b11, b12 = B[1, 0], B[1, 1], B[1, 2]
        b20, b21, b22 = B[2, 0], B[2, 1], B[2, 2]
        ax, ay, az = start[0][k, 0], start[0][k, 1], start[0][k, 2]
        bx, by, bz = end[0][k, 0], end[0][k, 1], end[0][k, 2]
        for p in range(count):
            x, y, z = way[0, p] - ax, way[1, p] - ay, way[2, p] - az
            px = a00 * x + a01 * y + a02 * z
            py = a10 * x + a11 * y + a12 * z
            pz = a20 * x + a21 * y + a22 * z
            x, y, z = way[3, p] - bx, way[4, p] - by, way[5, p] - bz
            dx = b00 * x + b01 * y + b02 * z - px
            dy = b10 * x + b11 * y + b12 * z - py
            dz = b20 * x + b21 * y + b22 * z - pz
            along = px * dx + py * dy + pz * dz
            outside = px * px + py * py + pz * pz - 1.0
            squared = dx * dx + dy * dy + dz * dz
            above = outside if outside > 0.0 else 0.0
            root = along * along - squared * above
            # Without cancellation where the start is close to the surface.
            t = above / (np.sqrt(root if root > 0.0 else 0.0) - along)
            t = t if (along < 0.0) & (root >= 0.0) & (t <= 1.0) else _NEVER
            t = _INSIDE if outside < -_ON_SURFACE else t
            time[c, p] = t
            time[last, p] = t if t < time[last, p] else time[last, p]


@kernel(forceinline=True)
def _earliest(start, end, near, way, p, time):
    """The first ellipsoid that particle p of a block meets.

    Returns:
        Its index, -1 without a hit or -2 if the particle starts inside one; and the hit, where it
        is the unit ball.
    """
    found = -1
    first = time[time.shape[0] - 1, p]
    hx = hy = hz = 0.0
    if first == _INSIDE:
        return -2, hx, hy, hz
    tx = ty = tz = 0.0
    for c in range(near.size):
        t = time[c, p]
        if t != first or t == _NEVER:
            continue
        k = near[c]
        px, py, pz = _to_ball(start, k, way[0, p], way[1, p], way[2, p])
        qx, qy, qz = _to_ball(end, k, way[3, p], way[4, p], way[5, p])
        px, py, pz = px + t * (qx - px), py + t * (qy - py), pz + t * (qz - pz)
        wx, wy, wz = _from_ball(end, k, px, py, pz)
        if found < 0 or _smaller(0.0, wx, wy, wz, 0.0, tx, ty, tz):
            found = k
            tx, ty, tz = wx, wy, wz
            hx, hy, hz = px, py, pz
    return found, hx, hy, hz


@kernel()
def _collide(
    start,
    end,
    box,
    nearby,
    x_start,
    x,
    velocity,
    dt,
    reflect,
    restitution,
    friction,
    hit,
):
    """See `collide_earliest`."""
    _prepare(start, box, True)
    _prepare(end, box, False)
    n = x.shape[0]
    m = box.shape[0]
    everything = nearby[1]
    way = np.empty((6, _BLOCK))
    one = np.empty((6, 1))
    time = np.empty((m + 1, _BLOCK))
    all_times = np.empty((m + 1, 1))
    low = np.empty(3)
    high = np.empty(3)
    for begin in range(0, n, _BLOCK):
        stop = min(begin + _BLOCK, n)
        for r in range(3):
            low[r] = np.inf
            high[r] = -np.inf
            for p in range(begin, stop):
                low[r] = min(low[r], x[p, r], x_start[p, r])
                high[r] = max(high[r], x[p, r], x_start[p, r])
        # Room for a way out that does not lead past the shapes of this block.
        margin = 0.004 + 0.125 * max(high[0] - low[0], high[1] - low[1], high[2] - low[2])
        for r in range(3):
            low[r] -= margin
            high[r] += margin
        found = 0
        for k in range(m):
            if (
                box[k, 0] <= high[0]
                and box[k, 3] >= low[0]
                and box[k, 1] <= high[1]
                and box[k, 4] >= low[1]
                and box[k, 2] <= high[2]
                and box[k, 5] >= low[2]
            ):
                nearby[0, found] = k
                found += 1
        if found == 0:
            continue
        near = nearby[0, :found]
        for p in range(begin, stop):
            for r in range(3):
                way[r, p - begin] = x_start[p, r]
                way[3 + r, p - begin] = x[p, r]
        _hit_times(start, end, near, way, stop - begin, time)
        for p in range(begin, stop):
            i = p - begin
            if time[m, i] == _NEVER:
                continue
            bx, by, bz = x[p, 0], x[p, 1], x[p, 2]
            k, hx, hy, hz = _earliest(start, end, near, way, i, time)
            if k == -2:
                one[0, 0], one[1, 0], one[2, 0], _ = leave(
                    start, everything, way[0, i], way[1, i], way[2, i]
                )
                one[3, 0], one[4, 0], one[5, 0] = bx, by, bz
                _hit_times(start, end, everything, one, 1, all_times)
                k, hx, hy, hz = _earliest(start, end, everything, one, 0, all_times)
            if k == -2:
                # No way out was found at the start: out of where the motion ends.
                wx, wy, wz, k = leave(end, everything, bx, by, bz)
                x[p, 0], x[p, 1], x[p, 2] = wx, wy, wz
                hit[p] = k
                continue
            if k < 0:
                continue
            hit[p] = k
            # The hit rides on the ellipsoid to the end of the step.
            cx, cy, cz = _from_ball(end, k, hx, hy, hz)
            ox, oy, oz = _from_ball(start, k, hx, hy, hz)
            ball = end[3][k]
            nx = ball[0, 0] * hx + ball[1, 0] * hy + ball[2, 0] * hz
            ny = ball[0, 1] * hx + ball[1, 1] * hy + ball[2, 1] * hz
            nz = ball[0, 2] * hx + ball[1, 2] * hy + ball[2, 2] * hz
            if reflect:
                nx, ny, nz = cx - end[0][k, 0], cy - end[0][k, 1], cz - end[0][k, 2]
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx / length, ny / length, nz / length
            # Velocity relative to the surface.
            sx, sy, sz = (cx - ox) / dt, (cy - oy) / dt, (cz - oz) / dt
            ux, uy, uz = velocity[p, 0] - sx, velocity[p, 1] - sy, velocity[p, 2] - sz
            normal = ux * nx + uy * ny + uz * nz
            if reflect:
                if normal < 0.0:
                    velocity[p, 0] -= 2.0 * normal * nx
                    velocity[p, 1] -= 2.0 * normal * ny
                    velocity[p, 2] -= 2.0 * normal * nz
                wx, wy, wz = cx, cy, cz
            else:
                ux, uy, uz = ux - normal * nx, uy - normal * ny, uz - normal * nz
                slip = np.sqrt(ux * ux + uy * uy + uz * uz)
                kept = 1.0
                if normal < 0.0:
                    lost = friction * (1.0 + restitution) * -normal
                    kept = 0.0 if lost >= slip else 1.0 - lost / slip
                    normal = -restitution * normal
                velocity[p, 0] = sx + kept * ux + normal * nx
                velocity[p, 1] = sy + kept * uy + normal * ny
                velocity[p, 2] = sz + kept * uz + normal * nz
                # The rest of the motion, along the surface.
                rx, ry, rz = bx - cx, by - cy, bz - cz
                depth = rx * nx + ry * ny + rz * nz
                rx, ry, rz = rx - depth * nx, ry - depth * ny, rz - depth * nz
                slip = np.sqrt(rx * rx + ry * ry + rz * rz)
                held = friction * max(-depth, 0.0)
                kept = 0.0 if held >= slip else 1.0 - held / slip
                wx, wy, wz = cx + kept * rx, cy + kept * ry, cz + kept * rz
            if _inside_any(end, near, wx, wy, wz, -1):
                wx, wy, wz, _ = leave(end, near, wx, wy, wz)
            if max(abs(wx - bx), abs(wy - by), abs(wz - bz)) > margin:
                wx, wy, wz, _ = leave(end, everything, wx, wy, wz)
            x[p, 0], x[p, 1], x[p, 2] = wx, wy, wz
