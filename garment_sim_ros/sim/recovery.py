"""Recovery of a garment whose particles are not finite or moved absurdly far.

Whatever comes in (a state that was written to, forces that are not numbers, a solver that
diverges), every step begins with a garment of which each particle is finite and did not go an
absurd way. A few bad particles are put where their neighbours went; a garment with many goes back
to where it was before the step.
"""

import math

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.sanity import keep_good
from garment_sim_ros.sim.state import State

_FARTHEST = 100.0
"""What goes so many times the garment's size in one step, or spreads so far, is lost."""
_FEW = 0.1
"""Share of bad particles up to which the others are worth keeping."""


class Recovery:
    """Finds and mends bad particles of one garment.

    Args:
        model: The garment.
    """

    def __init__(self, model: ClothModel) -> None:
        self._model = model
        self._size = float(np.linalg.norm(np.ptp(model.rest, axis=0)))
        self._farthest = np.float32(_FARTHEST * self._size)

    def keep(self, state: State, good: State, dt: float) -> bool:
        """Makes a state the last good one, if it is.

        Args:
            state: Motion now.
            good: Motion a step ago at most, without bad particles; changed in place.
            dt: Step [s].

        Returns:
            Whether it is good; pins that went far are worth a look, too.
        """
        return bool(
            keep_good(
                state.x.reshape(-1),
                state.v.reshape(-1),
                good.x.reshape(-1),
                good.v.reshape(-1),
                self._farthest,
                np.float32(self._farthest / dt),
            )
        )

    def is_believed(self, motion: NDArray[np.float64], dt: float) -> bool:
        """Whether a step of dt [s] that measured this motion, see `Workspace`, can be right."""
        return math.isfinite(motion[0]) and bool(motion[1] <= (self._farthest / dt) ** 2)

    def is_lost(self, state: State, motion: NDArray[np.float64], dt: float) -> bool:
        """Whether a garment is spread absurdly far; looks only where something is that fast."""
        if motion[1] * dt * dt < self._size**2:
            return False
        return bool(np.ptp(state.x[: self._model.free_count], axis=0).max() > self._farthest)

    def mend(self, state: State, good: State, dt: float) -> int:
        """Puts bad particles to where their neighbours went since they were good.

        Those with good neighbours come first, then those that these are neighbours of. The mean
        of what they moved, added to where the particle was, keeps its place among them.

        Args:
            state: Motion now, changed in place.
            good: Motion a step ago at most, without bad particles.
            dt: Step [s].

        Returns:
            How many particles were bad, or -1 if there were too many: then the whole garment is
            put back to `good`, at rest, moved on as its pins have moved.
        """
        free = self._model.free_count
        pinned = ~(np.isfinite(state.x[free:]) & np.isfinite(state.v[free:])).all(axis=1)
        state.x[free:][pinned] = good.x[free:][pinned]
        state.v[free:][pinned] = 0.0
        bad = self._bad(state, good, dt)
        count = int(bad.sum())
        if count > max(1.0, _FEW * free):
            self._put_back(state, good)
            return -1
        pairs = self._model.springs.particles.reshape(-1, 2).astype(np.int64)
        both = np.concatenate([pairs, pairs[:, ::-1]])
        moved = np.where(bad[:, None], 0.0, state.x.astype(np.float64) - good.x)
        v = np.where(bad[:, None], 0.0, state.v.astype(np.float64))
        left = bad.copy()
        while left.any():
            of, by = both[left[both[:, 0]] & ~left[both[:, 1]]].T
            if not len(of):
                break  # no good neighbour anywhere: they stay where they were, at rest
            degree = np.bincount(of, minlength=len(left))
            reached = degree > 0
            for values in (moved, v):
                total = np.zeros_like(values)
                np.add.at(total, of, values[by])
                values[reached] = total[reached] / degree[reached, None]
            left &= ~reached
        state.x[bad] = good.x[bad] + moved[bad]
        state.v[bad] = v[bad]
        if self._bad(state, good, dt).any():
            self._put_back(state, good)
            return -1
        return count + int(pinned.sum())

    def _bad(self, state: State, good: State, dt: float) -> NDArray[np.bool_]:
        """Which free particles are bad, as `keep_good` has it, shape [n]."""
        with np.errstate(invalid="ignore", over="ignore"):
            near = np.abs(state.x - good.x) <= self._farthest
            slow = np.abs(state.v) <= np.float32(self._farthest / dt)
        bad: NDArray[np.bool_] = ~(near & slow).all(axis=1)
        bad[self._model.free_count :] = False
        return bad

    def _put_back(self, state: State, good: State) -> None:
        free = self._model.free_count
        way = np.zeros(3)
        if free < len(self._model):
            way = (state.x[free:].astype(np.float64) - good.x[free:]).mean(axis=0)
        state.x[:free] = good.x[:free] + way
        state.v[:] = 0.0
