"""A garment that does not pass through itself.

After each of the solver's steps, particles are kept a distance apart from triangles, and edges
from edges; what would have passed through in the step is put back. Pairs that can meet are looked
for only every few steps, or as soon as particles have strayed from the ways that were expected of
them. What is tangled all the same, from the start or because a body part pushed it through, comes
free by way of shorter intersection contours.
"""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.collide import Contacts
from garment_sim_ros.geometry.topology import edge_table, mesh_topology, triangles_across
from garment_sim_ros.params import Material
from garment_sim_ros.sim.holds.constraint import Constraint
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.self_collision.expected_motion import drift, expect
from garment_sim_ros.sim.self_collision.near_pairs import find_pairs
from garment_sim_ros.sim.self_collision.self_contact import keep_apart
from garment_sim_ros.sim.self_collision.untangling import mark_tangled, untangle
from garment_sim_ros.sim.state import State

_STEPS = 4
"""Steps that a search serves at most."""
_MARGIN = 0.3
"""How far two particles together may stray from their expected ways until then, in edges."""
_PAIRS = 32
"""Pairs of each kind that there is room for, per triangle."""
_PASSES = 4
"""Most passes over all pairs in a step."""
_PATCH = 12
"""Triangles of a patch."""
_UNTANGLING_SPEED = 0.3
"""Speed at which what is tangled comes free [m/s]."""
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


class Swept(NamedTuple):
    """Scratch arrays of a search, for triangles and for patches of them.

    Attributes:
        boxes: Boxes that triangles sweep, low and high [m], shape [t, 6].
        normal: Their unit normals, shape [t, 3].
        centre: Their centres [m], shape [t, 3].
        rest_centre: The same at rest.
        radius: How far their corners are from there [m], shape [t].
        mean_way: Mean ways of their corners [m], shape [t, 3].
        sway: How far those of corners are from that [m], shape [t].
        patch_boxes: Boxes of patches, and of all [m], shape [p + 1, 6].
        axis: Means of their normals, of unit length, shape [p, 3].
        spread: The greatest angle of a normal to that [rad], shape [p].
        patch_centre: Their centres [m], shape [p, 3].
        patch_rest_centre: The same at rest.
        patch_way: Their mean ways [m], shape [p, 3].
        flutter: How far those of corners are from that [m], shape [p].
        reach: How far from each other triangles, and patches, are neighbours at rest; and what
            they may move against each other to stay side by side [m], shape [3].
    """

    boxes: SingleArray
    normal: SingleArray
    centre: SingleArray
    rest_centre: SingleArray
    radius: SingleArray
    mean_way: SingleArray
    sway: SingleArray
    patch_boxes: SingleArray
    axis: SingleArray
    spread: SingleArray
    patch_centre: SingleArray
    patch_rest_centre: SingleArray
    patch_way: SingleArray
    flutter: SingleArray
    reach: SingleArray

    @classmethod
    def room_for(
        cls, rest: SingleArray, triangles: IntArray, first: IntArray, edge: np.float32
    ) -> "Swept":
        """For a mesh of particles with a mean edge [m]."""
        t, p = len(triangles), len(first) - 1
        centre = rest[triangles].mean(axis=1)
        patch = np.add.reduceat(centre, first[:-1]) / np.diff(first)[:, None]
        rest_of = {"rest_centre": centre, "patch_rest_centre": patch.astype(np.float32)}
        widths = {"boxes": 6, "normal": 3, "centre": 3, "mean_way": 3}
        patch_widths = {"axis": 3, "patch_centre": 3, "patch_way": 3}
        return cls(
            **{name: np.zeros((t, width), np.float32) for name, width in widths.items()},
            **{name: np.zeros((p, width), np.float32) for name, width in patch_widths.items()},
            **rest_of,
            patch_boxes=np.zeros((p + 1, 6), np.float32),
            radius=np.zeros(t, np.float32),
            sway=np.zeros(t, np.float32),
            spread=np.zeros(p, np.float32),
            flutter=np.zeros(p, np.float32),
            reach=edge * np.array([4.0, 2.0 * np.sqrt(0.5 * _PATCH), 0.5], np.float32),
        )


def in_patches(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles in the order of connected patches, and the first of each patch, shape [p + 1]."""
    beyond = triangles_across(triangles)
    taken = np.zeros(len(triangles), bool)
    order: list[int] = []
    first = [0]
    seeds = deque(range(len(triangles)))
    while seeds:
        seed = seeds.popleft()
        if taken[seed]:
            continue
        taken[seed] = True
        order.append(seed)
        place = first[-1]
        while place < len(order) and len(order) - first[-1] < _PATCH:
            for u in beyond[order[place]]:
                if u >= 0 and not taken[u] and len(order) - first[-1] < _PATCH:
                    taken[u] = True
                    order.append(int(u))
            place += 1
        # The next patch begins beside this one, so that none is left between.
        seeds.extendleft(
            int(u) for t in order[first[-1] :] for u in beyond[t] if u >= 0 and not taken[u]
        )
        first.append(len(order))
    return np.ascontiguousarray(triangles[order]), np.array(first, np.int32)


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
        self._triangles, self._first = in_patches(model.particle_triangles)
        self._wing = _wings(self._triangles)
        self._owned = _owned(self._triangles)
        self._inverse_mass = model.inverse_mass
        self._friction = np.float32(model.material.friction)
        self._contacts = contacts
        self._rest = model.rest.astype(np.float32)
        edges = mesh_topology(self._triangles).edges
        length = np.linalg.norm(model.rest[edges[:, 0]] - model.rest[edges[:, 1]], axis=1).mean()
        self._distance = np.float32(distance)
        self._margin = np.float32(_MARGIN * length)
        n, t = len(model), len(self._triangles)
        self._before, self._start, self._place, self._speed, self._way = (
            np.zeros((n, 3), np.float32) for _ in range(5)
        )
        self._swept = Swept.room_for(self._rest, self._triangles, self._first, np.float32(length))
        self._grid = np.zeros(2 * t + 66, np.int32), np.zeros(4 * t + 64, np.int32)
        self._points, self._edges = (np.zeros((_PAIRS * t, 4), np.int32) for _ in range(2))
        self._limits = np.zeros((2, _PAIRS * t), np.float32)
        self._crossings = np.zeros((2 * t, 7), np.int32)
        self._counts = np.zeros(3, np.int64)
        self._tangled = np.zeros(n, np.bool_)
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
        points, edges, crossings = (int(c) for c in self._counts)
        touched = 0
        if crossings:
            self.crossings = int(mark_tangled(before, self._crossings, crossings, self._tangled))
            touched += untangle(
                x,
                v,
                self._inverse_mass,
                self._crossings,
                crossings,
                np.float32(_UNTANGLING_SPEED * dt),
                np.float32(_SOFTNESS),
            )
        met, self.through = keep_apart(
            before,
            x,
            v,
            self._inverse_mass,
            self._contacts.shape,
            self._contacts.normal,
            self._tangled,
            self._points,
            self._limits[0],
            points,
            self._edges,
            self._limits[1],
            edges,
            self._friction,
            _PASSES,
        )
        np.copyto(before, x)
        return touched + int(met)

    def _search(self, x: SingleArray, v: SingleArray, dt: np.float32) -> bool:
        """Looks for pairs that can meet in this step, which is over, and in some to come.

        Returns:
            Whether velocities are finite; else there is nothing to look for.
        """
        room = (len(self._points), len(self._edges), len(self._crossings))
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
                self._rest,
                self._triangles,
                self._wing,
                self._owned,
                self._first,
                self._swept,
                self._grid,
                self._distance,
                self._margin if self._ahead else np.float32(0.0),
                self._points,
                self._limits[0],
                self._edges,
                self._limits[1],
                self._crossings,
                self._counts,
            )
            self.dropped = int(np.maximum(self._counts - room, 0).sum())
            if self.dropped == 0 or self._ahead == 0:
                break
        np.minimum(self._counts, room, out=self._counts)
        if not self._counts[2]:
            self.crossings = 0
            self._tangled[:] = False
        self._since = 0
        self.searches += 1
        return True


def _wings(triangles: IntArray) -> IntArray:
    """The corner across edges ab, bc, ca, -1 at a border, shape [t, 3]."""
    beyond = triangles_across(triangles)
    wing = np.full((len(triangles), 3), -1, np.int32)
    for k in range(3):
        t = np.flatnonzero(beyond[:, k] >= 0)
        there = triangles[beyond[t, k]]
        ends = triangles[t][:, [k, (k + 1) % 3]]
        off = (there[:, :, None] != ends[:, None, :]).all(axis=2)
        wing[t, k] = there[np.arange(len(t)), off.argmax(axis=1)]
    return wing


def _owned(triangles: IntArray) -> NDArray[np.uint8]:
    """Corners (bits 0 to 2) and edges (bits 3 to 5) that each triangle is the first to have."""
    owned = np.zeros(3 * len(triangles), np.uint8)
    corner = np.arange(3 * len(triangles)) % 3
    _, first = np.unique(triangles, return_index=True)
    owned[first] |= (1 << corner[first]).astype(np.uint8)
    _, first = np.unique(edge_table(triangles)[1], return_index=True)
    owned[first] |= (8 << corner[first]).astype(np.uint8)
    return np.bitwise_or.reduce(owned.reshape(-1, 3), axis=1)
