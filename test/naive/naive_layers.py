"""`layers.kernels` again, in float64 and with a look at every triangle; only tests run this."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray


def closest_weights(corners: FloatArray, point: FloatArray) -> FloatArray:
    """Weights [3] of a triangle's corners [3, 3] at the point closest to `point` [3].

    The foot of the perpendicular where it is inside, else the best point of the three edges.
    """
    a, b, c = corners
    edges = np.stack([b - a, c - a], axis=1)
    s, t = np.linalg.lstsq(edges, point - a, rcond=None)[0]
    if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
        return np.array([1.0 - s - t, s, t])
    best, found = np.inf, np.zeros(3)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        way = corners[j] - corners[i]
        u = float(np.clip((point - corners[i]) @ way / max(way @ way, 1e-30), 0.0, 1.0))
        distance = float(np.linalg.norm(point - corners[i] - u * way))
        if distance < best:
            best, found = distance, np.zeros(3)
            found[i], found[j] = 1.0 - u, u
    return found


def nearest_triangle(
    point: FloatArray, x: FloatArray, triangles: IntArray, reach: float
) -> tuple[int, FloatArray]:
    """The triangle nearest to a point and the weights there; -1 where none is in reach."""
    best, found, weights = reach, -1, np.zeros(3)
    for t, corners in enumerate(x[triangles]):
        w = closest_weights(corners, point)
        distance = float(np.linalg.norm(point - w @ corners))
        if distance < best:
            best, found, weights = distance, t, w
    return found, weights


def separate(
    mine: tuple[FloatArray, FloatArray, FloatArray],
    other: tuple[FloatArray, FloatArray, FloatArray],
    own: IntArray,
    triangles: IntArray,
    border: set[tuple[int, int]],
    *,
    only: int,
    side: float,
    thickness: float,
    friction: float,
    reach: float,
    way: float,
    pushed: FloatArray,
) -> bool:
    """Positions, velocities and inverse masses of both garments; changes the first two in place.

    Args:
        mine: Of the particles.
        other: Of the garment whose triangles they meet.
        own: A triangle of their own mesh at each particle.
        triangles: Those triangles.
        border: Its border's edges, lower particle first.
        only: The particle that meets them; others are not looked at.
        side: 1 where the particles belong outside, -1 inside.
        thickness: Distance to keep [m].
        friction: Coulomb coefficient.
        reach: Farthest triangle that is met [m].
        way: Farthest that both move apart at once [m].
        pushed: How far each particle was pushed without coming free [m], changed in place.

    Returns:
        Whether it touched.
    """
    (x, v, m), (y, u, n) = mine, other
    p = only
    if np.linalg.norm(v[p]) > 0.5:
        pushed[p] = 0.0  # it may have come free by itself
    t, w = nearest_triangle(x[p], y, triangles, reach)
    if t < 0:
        pushed[p] = 0.0
        return False
    corner = triangles[t]
    on = [int(i) for i in corner[w > 0.0]]
    if len(on) < 3 and any(set(on) <= set(edge) for edge in border):
        return False
    a, b, c = y[corner]
    outward = np.cross(b - a, c - a)
    d, e, f = x[own[p]]
    mine_there = np.cross(e - d, f - d)
    alike = outward @ mine_there
    if alike < 0.0:
        return False
    normal = side * outward / np.linalg.norm(outward)
    depth = thickness - (x[p] - w @ y[corner]) @ normal
    total = m[p] + (w**2 * n[corner]).sum()
    if depth <= -thickness:
        pushed[p] = 0.0
        return False
    is_through = depth > thickness + way
    if not is_through:
        pushed[p] = max(pushed[p] - 0.25 * way, 0.0)
    left = 1.0 - pushed[p] / (2.0 * reach)
    if left <= 0.0:
        return False
    pushed[p] += way * is_through
    if depth <= 0.0 or total == 0.0:
        return False
    relative = v[p] - w @ u[corner]
    closing = max(-relative @ normal, 0.0)
    slip = relative - (relative @ normal) * normal
    length = np.linalg.norm(slip)
    held = 1.0 if length <= friction * closing else friction * closing / length
    impulse = (closing * normal - held * slip) / total
    moved = min(depth, left * way)
    push = moved / total * normal
    x[p] += m[p] * push
    v[p] += m[p] * impulse
    for i, wi in zip(corner, w):
        y[i] -= wi * n[i] * push
        u[i] -= wi * n[i] * impulse
    if alike > 0.5 * np.linalg.norm(outward) * np.linalg.norm(mine_there):
        # The outer garment alone goes on, by no more than its height.
        rest = max(min(depth - moved, thickness - depth + moved), 0.0) * normal
        theirs = w * n[corner]
        if side > 0.0:
            x[p] += (m[p] > 0.0) * rest
        elif theirs.any():
            y[corner] -= theirs[:, None] / (w @ theirs) * rest
    return True
