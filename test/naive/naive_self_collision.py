"""Self-collision again, in float64 and with a look at everything; only tests and bench run it."""

import numpy as np
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.topology import mesh_topology
from naive.naive_layers import closest_weights

Contact = tuple[float, FloatArray, FloatArray, bool] | None
"""Depth, unit normal, coefficients of the four particles, and whether it went through."""


def crossings(x: FloatArray, triangles: IntArray) -> IntArray:
    """Edges that pass through triangles that they share no corner with: ends, corners, [c, 5]."""
    x = np.asarray(x, np.float64)
    edges = mesh_topology(triangles).edges
    middle, centre = x[edges].mean(axis=1), x[triangles].mean(axis=1)
    reach = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1).max() / 2
    reach += np.linalg.norm(x[triangles] - centre[:, None], axis=2).max()
    near = cKDTree(centre).query_ball_point(middle, reach)
    edge = np.repeat(np.arange(len(edges)), [len(n) for n in near])
    pairs = np.hstack([edges[edge], triangles[np.concatenate(near).astype(int)]])
    apart = (pairs[:, :2, None] != pairs[:, None, 2:]).all(axis=(1, 2))
    pairs = pairs[apart]
    a, b, i, j, k = (x[pairs[:, c]] for c in range(5))
    n = np.cross(j - i, k - i)
    ha, hb = ((a - i) * n).sum(axis=1), ((b - i) * n).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        p = a - i + (ha / (ha - hb))[:, None] * (b - a)
        area = (n * n).sum(axis=1)
        u = (np.cross(p, k - i) * n).sum(axis=1) / area
        w = (np.cross(j - i, p) * n).sum(axis=1) / area
    return pairs[(ha * hb < 0.0) & (u >= 0.0) & (w >= 0.0) & (u + w <= 1.0)]


def edge_weights(x: FloatArray, ab: IntArray, cd: IntArray) -> tuple[float, float]:
    """Weights of b and d where two edges are nearest to each other.

    The best of where the lines are, if that is between all ends, and of every end against the
    other edge.
    """
    a, e = x[ab[0]], x[ab[1]] - x[ab[0]]
    c, f = x[cd[0]], x[cd[1]] - x[cd[0]]
    found = [(s, float(np.clip((a + s * e - c) @ f / (f @ f), 0, 1))) for s in (0.0, 1.0)]
    found += [(float(np.clip((c + t * f - a) @ e / (e @ e), 0, 1)), t) for t in (0.0, 1.0)]
    (s, t), *_ = np.linalg.lstsq(np.stack([e, -f], axis=1), c - a, rcond=None)
    if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
        return float(s), float(t)
    return min(found, key=lambda w: float(np.linalg.norm(a + w[0] * e - c - w[1] * f)))


def point_gap(x: FloatArray, p: int, triangle: IntArray) -> float:
    """Distance of a particle to a triangle."""
    return float(np.linalg.norm(x[p] - closest_weights(x[triangle], x[p]) @ x[triangle]))


def edge_gap(x: FloatArray, ab: IntArray, cd: IntArray) -> float:
    """Distance of two edges."""
    s, t = edge_weights(x, ab, cd)
    return float(np.linalg.norm(np.array([1 - s, s]) @ x[ab] - np.array([1 - t, t]) @ x[cd]))


def _plane(x: FloatArray, p: int, triangle: IntArray) -> tuple[FloatArray, float]:
    i, j, k = x[triangle]
    n = np.cross(j - i, k - i)
    n /= np.linalg.norm(n)
    return n, float((x[p] - i) @ n)


def point_contact(
    before: FloatArray, x: FloatArray, p: int, triangle: IntArray, limit: float
) -> Contact:
    """A particle that came too near to a triangle, or through it, in a step."""
    n, h = _plane(x, p, triangle)
    _, h0 = _plane(before, p, triangle)
    if h0 * h < 0.0:
        then = before + h0 / (h0 - h) * (x - before)
        i, j, k = then[triangle]
        b, c = np.linalg.lstsq(np.stack([j - i, k - i], axis=1), then[p] - i, rcond=None)[0]
        if b >= 0.0 and c >= 0.0 and b + c <= 1.0:
            return limit + abs(h), np.sign(h0) * n, np.array([1, b + c - 1, -b, -c]), True
    w = closest_weights(x[triangle], x[p])
    away = x[p] - w @ x[triangle]
    gap = float(np.linalg.norm(away))
    if gap >= limit:
        return None
    return limit - gap, away / gap, np.array([1.0, *-w]), False


def edge_contact(
    before: FloatArray, x: FloatArray, ab: IntArray, cd: IntArray, limit: float
) -> Contact:
    """Two edges that came too near to each other between their ends, or through, in a step."""

    def common(x: FloatArray) -> tuple[FloatArray, float]:
        n = np.cross(x[ab[1]] - x[ab[0]], x[cd[1]] - x[cd[0]])
        n /= np.linalg.norm(n)
        return n, float((x[cd[0]] - x[ab[0]]) @ n)

    def coefficients(s: float, t: float) -> FloatArray:
        return np.array([s - 1, -s, 1 - t, t])

    n, h = common(x)
    _, h0 = common(before)
    if h0 * h < 0.0:
        then = before + h0 / (h0 - h) * (x - before)
        s, t = edge_weights(then, ab, cd)
        gap = edge_gap(then, ab, cd)
        inside = 0.0 < s < 1.0 and 0.0 < t < 1.0
        if inside and gap <= 0.25 * (abs(h) + abs(h0)):
            return limit + abs(h), np.sign(h0) * n, coefficients(s, t), True
    s, t = edge_weights(x, ab, cd)
    if abs(h) >= limit or not (0.0 < s < 1.0 and 0.0 < t < 1.0):
        return None
    return limit - abs(h), np.sign(h) * n, coefficients(s, t), False


def part(
    x: FloatArray,
    v: FloatArray,
    inverse_mass: FloatArray,
    particles: IntArray,
    contact: Contact,
    friction: float,
) -> None:
    """Moves four particles apart; positions and velocities change in place."""
    if contact is None:
        return
    depth, n, c, _ = contact
    w = inverse_mass[particles] * c
    total = max(float(c @ w), 0.25 * inverse_mass[particles].max())
    if total == 0.0:
        return
    u = c @ v[particles]
    slip = u - (u @ n) * n
    most = friction * max(-float(u @ n), 0.0)
    length = float(np.linalg.norm(slip))
    held = 1.0 if length <= most else most / length
    x[particles] += np.outer(w, depth / total * n)
    v[particles] -= np.outer(w, ((u @ n) * n + held * slip) / total)


def crossing(
    x: FloatArray, ab: IntArray, triangle: IntArray
) -> tuple[FloatArray, FloatArray] | None:
    """Where an edge passes through a triangle: coefficients of the five, and the unit normal."""
    i, j, k = x[triangle]
    way = x[ab[1]] - x[ab[0]]
    sides = np.stack([way, i - j, i - k], axis=1)
    if np.linalg.matrix_rank(sides) < 3:
        return None
    s, u, w = np.linalg.solve(sides, i - x[ab[0]])
    if not (0.0 < s < 1.0 and u >= 0.0 and w >= 0.0 and u + w <= 1.0):
        return None
    normal = np.cross(j - i, k - i)
    return np.array([1 - s, s, u + w - 1, -u, -w]), normal / np.linalg.norm(normal)


def _contour(x: FloatArray, ab: IntArray, corner: int, normal: FloatArray) -> FloatArray:
    """Unit direction of the contour from an edge into its triangle with that corner."""
    a, b = x[ab]
    own = np.cross(b - a, x[corner] - a)
    along = np.cross(own, normal)
    length = float(np.linalg.norm(along))
    if length <= 1e-12:
        return np.zeros(3)
    return along / length * (1.0 if along @ np.cross(own, b - a) > 0.0 else -1.0)


def untangle(
    x: FloatArray,
    v: FloatArray,
    inverse_mass: FloatArray,
    ab: IntArray,
    corners: IntArray,
    triangle: IntArray,
    far: float,
    softness: float,
) -> bool:
    """Displaces an edge and what it passes through, Volino & Magnenat-Thalmann 2006, section 3.

    The contour's length changes by the gradient ``R - 2 (E R) / (E N) N``, E along the edge, N
    across the triangle, R the sum of the contour's directions into the edge's triangles.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        inverse_mass: Shape [n] [1/kg].
        ab: Ends of the edge.
        corners: The third corner of each of its triangles, one or two.
        triangle: What it passes through.
        far: Displacement where the way out is clear [m].
        softness: See `self_collision.untangling.untangle`.

    Returns:
        Whether it was displaced.
    """
    found = crossing(x, ab, triangle)
    if found is None:
        return False
    c, normal = found
    five = np.concatenate([ab, triangle])
    R = sum((_contour(x, ab, o, normal) for o in corners), np.zeros(3))
    E = x[ab[1]] - x[ab[0]]
    G = R - 2.0 * (E @ R) / (E @ normal) * normal
    squared = float(G @ G)
    w = inverse_mass[five] * c
    total = max(float(c @ w), 0.25 * float(inverse_mass[five].max()))
    if squared == 0.0 or total == 0.0:
        return False
    closing = min(float(c @ v[five] @ G), 0.0)
    x[five] += np.outer(w, far / np.sqrt(squared + softness**2) / total * G)
    v[five] -= np.outer(w, closing / squared / total * G)
    return True
