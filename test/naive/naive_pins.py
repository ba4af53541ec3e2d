"""Pins that give way, written for clarity: `sim.holds.pins.give_way`."""

import numpy as np

from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from naive.naive import move_pins, signed_distance


def give_way(place, home, position, orientation, shapes, least, far, edges=()):
    """Places of pins at the end of an interval, in the frames that they follow, shape [p, 3].

    Args:
        place: Where they are there [m], shape [p, 3].
        home: Where they belong there [m], shape [p, 3].
        position: World positions of those frames [m], shape [p, 3].
        orientation: Their unit quaternions, shape [p, 4].
        shapes: Shapes as `naive.signed_distance` has them.
        least: Distance to each shape below which each gives way [m], shape [m, p].
        far: How far they can go home [m].
        edges: Two pins and the rest length [m] of each edge between pins.
    """
    way = home - place
    length = np.linalg.norm(way, axis=1, keepdims=True)
    asked = np.where(length > far, place + far * way / np.maximum(length, 1e-300), home)
    x = move_pins(asked, position, orientation)

    def deepest(p):
        below = [signed_distance(s, x[p])[0] - least[k, p] for k, s in enumerate(shapes)]
        k = int(np.argmin(below))
        return below[k], k, signed_distance(shapes[k], x[p])[1]

    mean = np.zeros((len(shapes), 3))
    for p in range(len(x)):
        below, k, out = deepest(p)
        mean[k] += max(-below, 0.0) * out
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    for p in range(len(x)):
        for _ in range(8):
            below, k, out = deepest(p)
            if below >= 0.0:
                break
            along = mean[k] @ out
            x[p] += -below / max(along, 0.2) * mean[k] if along > 0.0 else -below * out
    away = np.linalg.norm(x - move_pins(home, position, orientation), axis=1)
    keep_together(x, away, edges)
    turned = matrix_from_quaternion(orientation)
    return np.einsum("pji,pj->pi", turned, x - position)


def keep_together(x, away, edges):
    """Pins follow neighbours that are farther from home; see `sim.holds.pin_edges`."""
    for _ in range(30):
        for one, other, length in edges:
            near, far = sorted((one, other), key=lambda p: away[p])
            way = x[far] - x[near]
            excess = np.linalg.norm(way) - 1.3 * length
            if excess > 0.0 and away[far] > 0.0:
                x[near] += excess * way / np.linalg.norm(way)
                away[near] = min(away[near] + excess, away[far])
