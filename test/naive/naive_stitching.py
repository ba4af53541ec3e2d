"""Stitches in float64, one vertex at a time."""

import numpy as np


def draw_together(x, v, weight, groups, gap, share, calm, dt):
    """As `sim.holds.stitching.draw_together`; `groups` lists the particles of each stitch."""
    moved = 0
    for group, largest, part in zip(groups, gap, share):
        mass = 1.0 / np.maximum(weight[group], 1e-12)
        centre = (mass[:, None] * x[group]).sum(axis=0) / mass.sum()
        mean = (mass[:, None] * v[group]).sum(axis=0) / mass.sum()
        way = x[group] - centre
        farthest = np.linalg.norm(way, axis=1).max()
        limit = part * largest
        factor = limit / farthest if farthest > limit else 1.0
        v[group] = mean + calm * (v[group] - mean) - (1.0 - factor) / dt * way
        if factor < 1.0:
            x[group] = centre + factor * way
            moved += len(group)
    return moved
