"""Cloth over skin that leaves the shapes, one vertex after the other in double precision."""

import numpy as np


def foot_on_triangle(corners, point):
    """Barycentric coordinates of the foot on the plane, cut off at 0 and made to sum to 1."""
    a, b, c = corners
    u, v, w = b - a, c - a, point - a
    gram = np.array([[u @ u, u @ v], [u @ v, v @ v]])
    s, t = np.linalg.solve(gram, [u @ w, v @ w])
    weight = np.array([1.0 - s - t, s, t])
    cut = np.maximum(weight, 0.0)
    return cut / cut.sum()


def lift(x, normal, skin, skin_normal, triangles, share, clear, deep, steep):
    """What each vertex is to be lifted by [m], by the triangle of all that it is nearest to."""
    found = np.zeros_like(x)
    for v, point in enumerate(x):
        best = np.inf
        for corners in triangles:
            weight = foot_on_triangle(skin[corners], point)
            way = point - weight @ skin[corners]
            if way @ way < best:
                best, over, by = way @ way, corners, weight
        way, out = point - by @ skin[over], by @ skin_normal[over]
        flat = np.cross(skin[over[1]] - skin[over[0]], skin[over[2]] - skin[over[0]])
        flat, out = flat / np.linalg.norm(flat), out / np.linalg.norm(out)
        if (
            way @ way < deep * deep
            and flat @ out > steep
            and normal[v] @ out > 0.0
            and way @ flat < clear
        ):
            found[v] = (by @ share[over]) * (clear * out - way)
    return found


def go_on(asked, keep, way, lifted):
    """Lifts after a time."""
    after = np.empty_like(lifted)
    for v, (there, now) in enumerate(zip(asked, lifted, strict=True)):
        if np.linalg.norm(there) < keep * np.linalg.norm(now):
            there = keep * now
        left = there - now
        far = np.linalg.norm(left)
        after[v] = now + left * min(1.0, way / far) if far > 0.0 else now
    return after


def spread(edges, step, lifts, passes):
    """Lifts of which neighbours have their share."""
    lifts = lifts.copy()
    for _ in range(passes):
        for (a, b), less in zip(edges, step, strict=True):
            for low, high in ((a, b), (b, a)):
                most = np.linalg.norm(lifts[high]) - less
                if most > np.linalg.norm(lifts[low]):
                    lifts[low] = lifts[high] * most / np.linalg.norm(lifts[high])
                    break
    return lifts


def even_out(x, edges, step, long, lifts, passes):
    """Lifts that differ by less from neighbour to neighbour."""
    lifts = lifts.copy()
    for _ in range(passes):
        for (a, b), most in zip(edges, step, strict=True):
            left = long * most - np.linalg.norm(x[a] - x[b])
            most = max(min(most, left), 0.0)
            apart = lifts[a] - lifts[b]
            far = np.linalg.norm(apart)
            if far > most:
                half = 0.5 * (far - most) / far * apart
                lifts[a] -= half
                lifts[b] += half
    return lifts


def keep_short(x, edges, step, long, lifts, passes):
    """Lifts that are alike at both ends of an edge that would be too long."""
    lifts = lifts.copy()
    for _ in range(passes):
        for (a, b), one in zip(edges, step, strict=True):
            now = np.linalg.norm(x[a] - x[b])
            then = np.linalg.norm(x[a] + lifts[a] - x[b] - lifts[b])
            if then > max(long * one, now) and (lifts[a] != lifts[b]).any():
                low, high = sorted((b, a), key=lambda v: np.linalg.norm(lifts[v]))
                lifts[high] = lifts[low]
    return lifts
