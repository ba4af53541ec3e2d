"""Releases overstretched cloth from colliders that should only brush the garment.

A hand along a skirt pushes it aside. But cloth that was thrown over an elbow, or that a hand took
along, would stay there for ever, stretched several times over, and shake. Where edges are far
longer than any fabric bears, such colliders pass through the garment until they are clear of it.
"""

from collections.abc import Callable

import numpy as np

from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.sides import LET_GO, PASSING, Sides
from garment_sim_ros.jit import compiled, kernel
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.state import State

_BEARS = 2.0
"""Strain of an edge beyond which its particles are let go of. Knitwear breaks at about 1, but
where body parts press cloth between them single edges are longer for a moment, and come back."""


class LettingGo:
    """Looks after one garment that something passes by.

    Args:
        model: The garment.
        sides: On which side of its free particles the shapes are; changed when it looks.
    """

    def __init__(self, model: ClothModel, sides: Sides) -> None:
        first = model.springs.bending
        self._particles = model.springs.particles[2 * first :]
        bears = (1.0 + _BEARS) * model.springs.rest_length[first:].astype(np.float64)
        self._longest = (bears**2).astype(np.float32)
        self._side = sides.side
        self._passing = np.flatnonzero((sides.side == PASSING).any(axis=1)).astype(np.int32)
        self._strained = np.zeros(len(model), np.bool_)
        self._gone = np.zeros(model.free_count, np.bool_)
        self._code: Callable[..., None] | None = None

    @property
    def count(self) -> int:
        """How many particles are let go of."""
        return int(np.count_nonzero(self._gone))

    def look(self, state: State, colliders: ColliderState, thickness: float) -> None:
        """Lets go of what is overstretched, and is there again for what is clear.

        Args:
            state: Motion of the garment.
            colliders: The colliders as they were posed last.
            thickness: Distance to keep from surfaces [m].
        """
        given = (
            state.x,
            self._particles,
            self._longest,
            colliders.shapes,
            colliders.posed,
            self._side,
            self._passing,
            np.float32(thickness),
            self._strained,
            self._gone,
        )
        if self._code is None:
            self._code = compiled(_look, *given)
        self._code(*given)

    def forget(self) -> None:
        """The garment was put elsewhere: nothing is let go of."""
        self._gone[:] = False
        self._side[self._side == LET_GO] = PASSING


@kernel()
def _look(x, particles, longest, shapes, posed, side, passing, thickness, strained, gone):
    """See `LettingGo.look`.

    Args:
        x: Positions [m], shape [n, 3].
        particles: Ends of the edges, flat, shape [2 e].
        longest: Squared lengths that they bear [m^2], shape [e].
        shapes: Packed shapes.
        posed: The same, posed.
        side: See `Sides`, changed in place, shape [m, free].
        passing: The shapes that pass, shape [k].
        thickness: Distance to keep from surfaces [m].
        strained: Scratch, shape [n].
        gone: Which particles are let go of, changed in place, shape [free].
    """
    strained[:] = False
    for e in range(longest.size):
        i, j = particles[2 * e], particles[2 * e + 1]
        dx, dy, dz = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
        if dx * dx + dy * dy + dz * dz > longest[e]:
            strained[i] = True
            strained[j] = True
    for p in range(gone.size):
        if strained[p] == gone[p]:
            continue
        if gone[p]:
            clear = True
            for k in passing:
                d, _, _, _ = shape_distance(shapes, posed, k, x[p, 0], x[p, 1], x[p, 2], thickness)
                clear = clear and not d < thickness
            if not clear:
                continue
        gone[p] = strained[p]
        for k in passing:
            if side[k, p] == PASSING or side[k, p] == LET_GO:
                side[k, p] = LET_GO if gone[p] else PASSING
