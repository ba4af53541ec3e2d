"""How far a garment's vertices are shown off the places that simulated ones give them.

Creases are round, see `round_creases`, and cloth lies over the shapes, see `over_shapes`.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.geometry.vectors import dot, length, less, plus, row
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.detail.surface import Surface
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.motion import to_file_order
from garment_sim_ros.sim.over_shapes import OverShapes, side_lengths
from garment_sim_ros.sim.round_creases import RoundCreases

_STRETCHED = 1.7
"""What lengthens an edge that is so many times as long as at rest is no matter of showing."""
_PASSES = 2
"""Vertices that are shown in their places leave others apart from them."""
_ZERO = np.float32(0.0)
_NOWHERE = np.zeros(3)


class Aside:
    """What a garment is shown off its places.

    Args:
        model: What of it is simulated.
        surface: All its vertices over those; None where they are the same.
        rest: Its vertices at rest [m], shape [v, 3].
        held: Vertices that stay, as pins do.

    Attributes:
        off: What each vertex is off its place [m], shape [v, 3].
        over: The part of it by which cloth lies over the shapes.
    """

    def __init__(
        self, model: ClothModel, surface: Surface | None, rest: FloatArray, held: IntArray
    ) -> None:
        self._model, self._surface, self._particle = model, surface, model.particle
        if surface is not None:
            nearest = surface.share.argmax(axis=1)
            self._particle = model.particle[surface.corner[np.arange(len(surface)), nearest]]
        self._triangles = model.triangles if surface is None else surface.triangles
        self._creases = RoundCreases(self._triangles, rest, held)
        self.over = OverShapes(model, surface)
        self.off, self._place, self._x = (np.zeros((len(rest), 3), np.float32) for _ in range(3))
        self._most = (_STRETCHED * side_lengths(rest[self._triangles])).astype(np.float32)
        self._left: NDArray[np.bool_] = np.zeros(len(rest), np.bool_)
        self._simulated: SingleArray = np.zeros((len(model), 3), np.float32)
        self._all = (
            *(self._place, self._triangles, self._most, self._left),
            *(self.off, self.over.lift),
        )

    def look(
        self,
        x: SingleArray,
        contacts: Contacts,
        kept: IntArray,
        colliders: ColliderState,
        thickness: float,
        time: float,
    ) -> None:
        """Finds where cloth is to be seen.

        Args:
            x: Positions of the particles [m], shape [n, 3].
            contacts: What the last search found for them.
            kept: What the guard keeps of the free ones, see `Guard`, shape [f].
            colliders: The shapes, posed.
            thickness: What particles keep from them [m].
            time: Since the last look [s].
        """
        if self._surface is None:
            to_file_order(x, self._model.vertex, _NOWHERE, self._place)
        else:
            to_file_order(x, self._model.vertex, _NOWHERE, self._simulated)
            self._surface.follow(self._simulated, _NOWHERE, self._place)
        self._x[:] = self._place
        self._creases.round(self._x)
        if self._surface is None:
            self._creases.stay_outside(
                *(self._x, self._place, self._particle, contacts, colliders),
                thickness,
            )
        self._creases.stay_where_kept(self._x, self._place, self._particle, kept)
        self.over.look(self._x, contacts, colliders, thickness, time)
        np.subtract(self._x, self._place, out=self.off)
        self.off += self.over.lift
        for _ in range(_PASSES):
            if not leave_stretched(*self._all):
                break

    def forget(self) -> None:
        """Shows all in its place until the next look."""
        self.off[:] = 0.0
        self.over.forget()


@lean_kernel()
def leave_stretched(x, triangles, most, left, off, lift):
    """Shows in their places the ends of edges that are stretched and would be lengthened.

    Where two parts of a body close on cloth, as thigh and belly, there is no place over both.

    Args:
        x: Positions of the vertices [m], shape [v, 3].
        triangles: The mesh, shape [t, 3].
        most: Length from which on each side is stretched, from its corner to the next [m],
            shape [t, 3].
        left: Scratch, shape [v].
        off: What each vertex is off its place, changed in place [m], shape [v, 3].
        lift: The part of it by which it is lifted, likewise.

    Returns:
        Whether there was any.
    """
    found = False
    for v in range(left.size):
        left[v] = False
    for t in range(triangles.shape[0]):
        for k in range(3):
            a, b = triangles[t, k], triangles[t, k - 2]
            apart = less(row(off, a), row(off, b))
            if dot(apart, apart) > _ZERO:
                edge = less(row(x, a), row(x, b))
                longer = length(plus(edge, apart))
                if longer > most[t, k] and longer > length(edge):
                    left[a] = left[b] = found = True
    if found:
        for v in range(left.size):
            if left[v]:
                off[v, 0], off[v, 1], off[v, 2] = _ZERO, _ZERO, _ZERO
                lift[v, 0], lift[v, 1], lift[v, 2] = _ZERO, _ZERO, _ZERO
    return found
