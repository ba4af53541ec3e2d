"""A garment that does not pass through itself.

After each of the solver's steps, particles are kept a distance apart from triangles, and edges
from edges; what would have passed through in the step is put back. Pairs that can meet are looked
for only every few steps, or as soon as particles have strayed from the ways that were expected of
them. What is tangled all the same, from the start or because a body part pushed it through, comes
free by way of shorter intersection contours. A knot, where that does not help, gets looser: more
and more around it is let through itself.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import Material
from garment_sim_ros.sim.holds.constraint import Constraint
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.self_collision.expected_motion import drift, expect
from garment_sim_ros.sim.self_collision.near_pairs import Pairs, find_pairs
from garment_sim_ros.sim.self_collision.patches import Mesh, Swept
from garment_sim_ros.sim.self_collision.self_contact import Lying, keep_apart
from garment_sim_ros.sim.self_collision.untangling import mark_tangled, spread, untangle
from garment_sim_ros.sim.state import State

_STEPS = 4
"""Steps that a search serves at most."""
_MARGIN = 0.3
"""How far two particles together may stray from their expected ways until then, in edges."""
_PAIRS = 32
"""Pairs of each kind that there is room for, per triangle."""
_PASSES = 4
"""Most passes over all pairs in a step."""
_UNTANGLING_SPEED = 0.3
"""Speed at which what is tangled comes free [m/s]."""
_KNOT = 0.1
"""Passages through triangles, for each edge of the garment, below which they are a knot."""
_LOOSER = 0.5
"""Time after which one more ring of neighbours of a knot is let through itself [s]."""
_SOFTNESS = 0.3
"""Gradients of a contour's length below this move by less than that; a border's is 1."""
_SPACING = (0.1, 0.15)
"""Distance to keep, at least and at most, in edge lengths."""


def own_distance(vertices: FloatArray, triangles: IntArray, material: Material) -> float:
    """The distance that a garment keeps from itself unless told otherwise [m].

    Its thickness, but at least 0.1 and at most 0.15 of its mean edge.
    """
    edges = mesh_topology(np.asarray(triangles)).edges
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1).mean()
    return float(np.clip(material.thickness, *(np.array(_SPACING) * length)))


class SelfCollision(Constraint):
    """Keeps one garment off itself.

    A search for pairs takes longer than a step of the solver: three of them for each frame cost
    half as much again, one look at all pairs in each of 18 sub-steps two and a half times as much.

    Attributes:
        searches: Searches for pairs so far.
        crossings: Edges that passed through triangles when that was last looked at.
        dropped: Pairs that there was no room for in the last search.

    Args:
        model: The garment.
        distance: To keep between its parts [m].
    """

    once_a_step = True

    def __init__(self, model: ClothModel, distance: float, contacts: Contacts) -> None:
        self._mesh = Mesh.of(model.particle_triangles, model.rest.astype(np.float32))
        self._lying = Lying(model.inverse_mass, contacts.shape, contacts.normal)
        self._friction = np.float32(model.material.friction)
        edges = mesh_topology(self._mesh.triangles).edges
        length = np.linalg.norm(model.rest[edges[:, 0]] - model.rest[edges[:, 1]], axis=1).mean()
        self._distance = np.float32(distance)
        self._margin = np.float32(_MARGIN * length)
        n, t = len(model), len(self._mesh.triangles)
        self._knot = _KNOT * len(edges)
        self._before, self._start, self._place, self._speed, self._way = (
            np.zeros((n, 3), np.float32) for _ in range(5)
        )
        self._swept = Swept.room_for(self._mesh, np.float32(length))
        self._grid = np.zeros(2 * t + 66, np.int32), np.zeros(4 * t + 64, np.int32)
        self._pairs = Pairs.room_for(_PAIRS * t, 2 * t)
        self._tangled, self._scratch = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
        self.searches = 0
        self.crossings = 0
        self.dropped = 0
        self.through = 0
        self.forget()

    def shift(self, by: SingleArray) -> None:
        """The local origin has moved: coordinates change by [m], shape [3]."""
        self._before += by

    def forget(self) -> None:
        """What follows does not depend on what was before."""
        self._known = False
        self._since = self._ahead = 0
        self._knotted = 0.0

    def hold(self, state: State, left: float, dt: float) -> int:
        """Moves apart what came too near, after a step.

        Args:
            state: Motion of the garment, changed in place.
            left: Not used.
            dt: The step [s].

        Returns:
            Number of pairs that touched.
        """
        x, v, before = state.x, state.v, self._before
        h = np.float32(dt)
        if not self._known:
            np.copyto(before, x)
            self._known = True
        self._since += 1
        strayed = drift(x, self._place, self._speed, np.float32(self._since) * h)
        late = self._since > self._ahead or not strayed <= np.float32(0.5) * self._margin
        if late and not (np.isfinite(strayed) and self._search(x, v, h)):
            return 0  # not finite: `recovery` puts it back
        pairs = self._pairs
        crossings = int(pairs.counts[2])
        touched = 0
        if crossings:
            self.crossings = int(mark_tangled(before, pairs.crossings, crossings, self._tangled))
            self._knotted = self._knotted + dt if self.crossings < self._knot else 0.0
            rings = int(self._knotted / _LOOSER)
            spread(self._mesh.triangles, self._tangled, rings, self._scratch)
            touched += untangle(
                x,
                v,
                self._lying.inverse_mass,
                pairs.crossings,
                crossings,
                np.float32(_UNTANGLING_SPEED * dt),
                np.float32(_SOFTNESS),
            )
        met, self.through = keep_apart(
            before, x, v, self._lying, self._tangled, pairs, self._friction, _PASSES
        )
        np.copyto(before, x)
        return touched + int(met)

    def _search(self, x: SingleArray, v: SingleArray, dt: np.float32) -> bool:
        """Looks for pairs that can meet in this step, which is over, and in some to come.

        Returns:
            Whether velocities are finite; else there is nothing to look for.
        """
        pairs = self._pairs
        room = (len(pairs.points), len(pairs.edges), len(pairs.crossings))
        for ahead in (_STEPS - 1, 0):
            self._ahead = expect(
                self._before,
                x,
                v,
                dt,
                ahead,
                self._margin,
                self._start,
                self._place,
                self._speed,
                self._way,
            )
            if self._ahead < 0:
                return False
            find_pairs(
                self._start,
                self._way,
                self._mesh,
                self._swept,
                self._grid,
                self._distance,
                self._margin if self._ahead else np.float32(0.0),
                pairs,
            )
            self.dropped = int(np.maximum(pairs.counts - room, 0).sum())
            if self.dropped == 0 or self._ahead == 0:
                break
        np.minimum(pairs.counts, room, out=pairs.counts)
        if not pairs.counts[2]:
            self.crossings = 0
            self._knotted = 0.0
            self._tangled[:] = False
        self._since = 0
        self.searches += 1
        return True
