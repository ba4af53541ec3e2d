"""Garments that run through each other come free, whichever lies over the other there.

Parting by the order of layers needs particles that know their side. Where cloth is folded over or
is thrown over a hem none does, and edges pass between particles that are all on their sides. There
the contours along which the garments cut each other are made shorter (Volino & Magnenat-Thalmann
2006), as a garment's own are, see `self_collision.untangling`.
"""

from typing import TYPE_CHECKING

import numpy as np

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.sim.layers.crossings import Boxes, find_crossings, leave_out
from garment_sim_ros.sim.layers.kernels import keep_to_side
from garment_sim_ros.sim.piece import Piece
from garment_sim_ros.sim.self_collision.patches import Mesh
from garment_sim_ros.sim.self_collision.untangling import untangle

if TYPE_CHECKING:
    from garment_sim_ros.sim.layers.pair import Meeting

_LOOK_EVERY = 3
"""Steps between two looks for crossings where there were none."""
_SPEED = 0.3
"""How fast what is through comes free [m/s]."""
_RESTS = 1.0
"""How long body and air rest before what is still through is left, and how long that takes [s]."""
_SOFTNESS = 0.3
"""Gradients of a contour's length below this move by less than that; a border's is 1."""
_ROOM = 4
"""Crossings that there is room for: one for so many triangles."""


class Untangled:
    """Two garments in one set of arrays.

    Args:
        first: One of them; its state and workspace stay in the same arrays.
        second: The other one; likewise.

    Attributes:
        crossings: Edges that ran through the other garment at the last look.
    """

    def __init__(self, first: Piece, second: Piece) -> None:
        models = first.model, second.model
        n, count = len(models[0]), len(models[0]) + len(models[1])
        self._parts = (first, slice(0, n)), (second, slice(n, count))
        triangles = [models[0].particle_triangles, models[1].particle_triangles + n]
        rest = np.concatenate([model.rest for model in models]).astype(np.float32)
        self._mesh = Mesh.of(np.concatenate(triangles).astype(np.int32), rest)
        t = len(self._mesh.triangles)
        self._split = int((self._mesh.triangles[self._mesh.first[:-1], 0] < n).sum())
        self._boxes = Boxes.room_for(self._mesh)
        self._found = np.zeros((max(t // _ROOM, 1), 7), np.int32)
        self._x, self._v = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32)
        self._w, self._touches = np.zeros(count, np.float32), np.zeros(count, np.bool_)
        self._first_is_still = False
        self.forget()

    def forget(self) -> None:
        """Look anew in the next step: the garments were put elsewhere."""
        self._steps = self.crossings = 0
        self._rested = 0.0

    def keep_first_still(self, still: bool) -> None:
        """Whether only the second garment gives way."""
        self._first_is_still = still

    def crossings_at(self, first: SingleArray, second: SingleArray) -> int:
        """Edges that would run through the other garment with vertices there [m], shape [v, 3]."""
        for (piece, part), x in zip(self._parts, (first, second)):
            self._x[part] = x[piece.model.vertex]
        many = find_crossings(self._x, self._mesh, self._split, self._boxes, self._found)
        return min(many, len(self._found))

    def part(self, dt: float, rests: bool, meetings: "tuple[Meeting, Meeting]") -> None:
        """Shortens the contours after a step, but where they are on cloth that touches a shape.

        Args:
            dt: The step [s].
            rests: Whether neither body nor air moved in it. What does not come free soon would
                then shake for ever: each step moves it, and edges draw it back.
            meetings: What the order of layers knows of the first and of the second garment: a
                shorter contour may lead particles away from their side, which is taken back.
        """
        # Cloth that is settled is not at rest yet.
        self._rested = self._rested + dt if rests and not self._first_is_still else 0.0
        effort = min(max(2.0 - self._rested / _RESTS, 0.0), 1.0)
        looks = (self.crossings > 0 and effort > 0.0) or self._steps % _LOOK_EVERY == 0
        self._steps += 1
        if not looks:
            return
        for piece, part in self._parts:
            self._x[part] = piece.state.x
        many = find_crossings(self._x, self._mesh, self._split, self._boxes, self._found)
        self.crossings = min(many, len(self._found))
        for piece, part in self._parts:
            self._v[part] = piece.state.v
            self._w[part] = piece.model.inverse_mass
            shape = piece.workspace.contacts.shape
            free = slice(part.start, part.start + len(shape))
            np.greater_equal(shape, 0, out=self._touches[free])
        if self._first_is_still:
            self._w[self._parts[0][1]] = 0.0
        # Pushed on, cloth that lies on the body goes into it, and limbs come through.
        left = leave_out(self._touches, self._found, self.crossings)
        # All of it in any case, so that it is compiled before it is needed.
        untangle(
            *(self._x, self._v, self._w, self._found, left),
            *(np.float32(effort * _SPEED * dt), np.float32(_SOFTNESS)),
        )
        for (piece, part), meeting in zip(self._parts, meetings):
            keep_to_side(meeting, self._x[part], self._v[part])
            if left and effort > 0.0:
                piece.state.x[:], piece.state.v[:] = self._x[part], self._v[part]
