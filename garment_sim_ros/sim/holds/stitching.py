"""Stitches that draw the panels of a garment together.

Vertices that will be one are drawn to their common place at an even pace: the distance that each
may have from it falls from what it was at the start to nothing in a given time, and is a hard
limit. The highest stitches begin, so that what hangs from the shoulders lies on them first. How
far apart panels start does not matter, nor how stiff they are. Where a body part is in between,
the cloth is stretched, which whoever sews can see. What has met stays together.
"""

import numpy as np

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.holds.constraint import Constraint
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.state import State

CLOSING = 0.8
"""Time in which a stitch closes [s]."""
LATEST = 1.2
"""How much later than the highest stitches the lowest ones begin [s]."""
_CALM = np.float32(0.9)
"""Part of their relative velocity that vertices on their way to each other keep per sub-step."""


@kernel()
def draw_together(x, v, weight, member, start, gap, share, calm, dt):
    """Limits how far the vertices of each stitch are from their common place.

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        weight: Inverse masses [1/kg], shape [n].
        member: Particles of all stitches, one stitch after the other.
        start: First of each and the end, shape [s + 1].
        gap: Largest distance that any of a stitch had from its place at the start [m], shape [s].
        share: Part of it that each is allowed now, shape [s].
        calm: Part of the relative velocity that is kept.
        dt: Time since this was called last [s].

    Returns:
        Number of vertices that were moved.
    """
    moved = 0
    for s in range(gap.size):
        first, last = start[s], start[s + 1]
        total = np.float32(0.0)
        cx = cy = cz = ux = uy = uz = np.float32(0.0)
        for k in range(first, last):
            p = member[k]
            w = np.float32(1.0) / max(weight[p], np.float32(1e-12))
            total += w
            cx += w * x[p, 0]
            cy += w * x[p, 1]
            cz += w * x[p, 2]
            ux += w * v[p, 0]
            uy += w * v[p, 1]
            uz += w * v[p, 2]
        scale = np.float32(1.0) / total
        cx *= scale
        cy *= scale
        cz *= scale
        ux *= scale
        uy *= scale
        uz *= scale
        # One factor for all of them keeps their common place where it is.
        farthest = np.float32(0.0)
        for k in range(first, last):
            p = member[k]
            dx, dy, dz = x[p, 0] - cx, x[p, 1] - cy, x[p, 2] - cz
            farthest = max(farthest, np.float32(np.sqrt(dx * dx + dy * dy + dz * dz)))
        limit = share[s] * gap[s]
        part = limit / farthest if farthest > limit else np.float32(1.0)
        rate = (np.float32(1.0) - part) / dt
        for k in range(first, last):
            p = member[k]
            dx, dy, dz = x[p, 0] - cx, x[p, 1] - cy, x[p, 2] - cz
            v[p, 0] = ux + calm * (v[p, 0] - ux) - rate * dx
            v[p, 1] = uy + calm * (v[p, 1] - uy) - rate * dy
            v[p, 2] = uz + calm * (v[p, 2] - uz) - rate * dz
            if part < np.float32(1.0):
                x[p, 0] = cx + part * dx
                x[p, 1] = cy + part * dy
                x[p, 2] = cz + part * dz
                moved += 1
    return moved


class Stitching(Constraint):
    """Draws a garment's stitches together.

    Args:
        model: The garment.
        stitches: Number of the stitch of each vertex, -1 for none, shape [v].
    """

    def __init__(self, model: ClothModel, stitches: IntArray) -> None:
        of_particle = np.asarray(stitches)[model.vertex]
        sewn = np.flatnonzero(of_particle >= 0)
        member = sewn[np.argsort(of_particle[sewn], kind="stable")]
        count = np.unique(of_particle[member], return_counts=True)[1]
        several = count > 1
        kept = np.repeat(several, count)
        self.member = member[kept].astype(np.int32)
        self.start = np.concatenate([[0], np.cumsum(count[several])]).astype(np.int32)
        self.of_stitch = of_particle[member[kept]]
        self._weight = model.inverse_mass
        self._gap = np.zeros(int(several.sum()), np.float32)
        self._delay = np.zeros_like(self._gap)
        self._share = np.ones_like(self._gap)
        self.forget()

    def forget(self) -> None:
        """The garment was put elsewhere: stitches begin anew."""
        self._time = -1.0

    def gaps(self, x: SingleArray) -> SingleArray:
        """Largest distance of the vertices of each stitch from their common place [m]."""
        points = x[self.member].astype(np.float64)
        size = np.diff(self.start)
        owner = np.repeat(np.arange(len(size)), size)
        mass = 1.0 / np.maximum(self._weight[self.member].astype(np.float64), 1e-12)
        total = np.bincount(owner, mass)
        centre = np.stack([np.bincount(owner, mass * c) / total for c in points.T], axis=1)
        apart = np.linalg.norm(points - centre[owner], axis=1)
        return np.maximum.reduceat(apart, self.start[:-1]).astype(np.float32)

    def hold(self, state: State, left: float, dt: float) -> int:
        """Draws vertices together after a sub-step, see `Constraint.hold`."""
        if not len(self._gap):
            return 0
        if self._time < 0.0:
            self._gap[:] = self.gaps(state.x)
            top = np.maximum.reduceat(state.x[self.member, 2], self.start[:-1])
            self._delay[:] = LATEST * (top.max() - top) / max(float(np.ptp(top)), 1e-6)
            self._time = 0.0
        self._time += dt
        np.clip(1.0 - (self._time - self._delay) / CLOSING, 0.0, 1.0, out=self._share)
        return int(
            draw_together(
                state.x,
                state.v,
                self._weight,
                self.member,
                self.start,
                self._gap,
                self._share,
                _CALM,
                np.float32(dt),
            )
        )
