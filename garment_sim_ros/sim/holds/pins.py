"""Pins: particles that follow bones, and give way to body parts that close on them.

A waist band follows the hips. A thigh that is kicked up takes the place of its front: in the
motion body parts overlap. A pin that stayed there would be on the wrong side of the thigh, and so
would the cloth that hangs on it, with nothing that could bring it back. A pin in a shape of
another bone, deeper than it was at rest, moves out of it, and goes home as soon as it can. Pins
leave a shape in one direction, the mean one out of it: each by its own nearest way, those on one
flank and on the other would be torn apart. Their neighbours follow (`sim.holds.pin_edges`).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.packed import PackedShapes, PosedShapes, pose
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.contact.sides import LET_GO, PASSING
from garment_sim_ros.geometry.transforms import quaternion_from_matrix, rotate
from garment_sim_ros.jit import compiled, kernel
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.holds.pin_edges import PinEdges, keep_together
from garment_sim_ros.sim.model import ClothModel

_SPARED = 0.01
"""How deep a pin may be in a shape before it gives way [m]: joints that bend close on seams."""
_RETURN = 1.5
"""Speed at which it goes home [m/s]."""
_HOME = 1e-9
"""Nearer than this it is home [m]."""
_ROUNDS = 8
_ALONG = np.float32(0.2)
"""Least cosine of the way out and the mean way."""
_NEVER = np.float32(-np.inf)


class Given(NamedTuple):
    """The same as `Pins`, and scratch.

    Attributes:
        x: Where pins are to be, relative to the local origin [m], shape [p, 3].
        away: How far they are from home then [m], shape [p].
        out: Mean way out of each shape, shape [m, 3].
    """

    collider: IntArray
    home: FloatArray
    place: FloatArray
    step: FloatArray
    least: SingleArray
    edges: PinEdges
    x: FloatArray
    away: FloatArray
    out: SingleArray


class Followed(NamedTuple):
    """World poses of all colliders, and the world position of the local origin."""

    position: FloatArray
    orientation: FloatArray
    origin: FloatArray


@dataclass(kw_only=True, eq=False)
class Pins:
    """The pinned particles of one garment.

    Attributes:
        collider: Collider of the set that each follows, shape [p].
        home: Its place in that collider's frame [m], shape [p, 3].
        place: The same now, where it may have given way, shape [p, 3].
        step: How far that moves in each sub-step [m], shape [p, 3].
        least: Distance to each shape below which each gives way [m], shape [m, p].
        edges: Edges of the mesh between two of them.
    """

    collider: IntArray
    home: FloatArray
    place: FloatArray
    step: FloatArray
    least: SingleArray
    edges: PinEdges
    _x: FloatArray = field(default_factory=lambda: np.zeros((0, 3)), repr=False)
    _away: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)
    _out: SingleArray = field(default_factory=lambda: np.zeros((0, 3), np.float32), repr=False)
    _code: Callable[..., Any] | None = field(default=None, repr=False)

    @classmethod
    def of(cls, model: ClothModel) -> "Pins":
        """Those of a garment, which give way to nothing."""
        return cls(
            collider=model.pin_collider,
            home=model.pin_position,
            place=model.pin_position.copy(),
            step=np.zeros_like(model.pin_position),
            least=np.zeros((0, len(model.pin_collider)), np.float32),
            edges=PinEdges.of(model),
        )

    def give_way_to(
        self,
        colliders: ColliderSet,
        shapes: PackedShapes,
        T_world_rest: FloatArray,
        x: FloatArray,
        side: NDArray[np.int8],
    ) -> None:
        """Finds what they give way to.

        Args:
            colliders: The body's colliders.
            shapes: Those that can be touched, m.
            T_world_rest: Rest transforms of all colliders, NaN where unknown, shape [c, 4, 4].
            x: The pins in that pose [m], shape [p, 3].
            side: The side of each shape for each pin, see `contact.sides.Sides`, shape [m, p].
        """
        known = np.asarray(np.isfinite(T_world_rest).all(axis=(1, 2)))
        T = np.where(known[:, None, None], T_world_rest, np.eye(4))
        rest = ColliderPoses(
            position=np.ascontiguousarray(T[:, :3, 3]),
            orientation=quaternion_from_matrix(T[:, :3, :3]),
        )
        posed = PosedShapes.room_for(shapes)
        pose(shapes, rest, rest, np.zeros(3), posed)
        bone = np.array([c.bone for c in colliders.colliders])
        gives = (side != PASSING) & (side != LET_GO) & known[shapes.collider, None]
        gives &= bone[shapes.collider][:, None] != bone[self.collider]
        least = np.ascontiguousarray(np.where(gives, -_SPARED, _NEVER), np.float32)
        if gives.any():
            spare_rest(shapes, posed, np.ascontiguousarray(x, np.float32), least)
        self.least = least
        self._x, self._away = np.zeros((len(x), 3)), np.zeros(len(x))
        self._out = np.zeros((len(least), 3), np.float32)

    def forget(self) -> None:
        """The garment was put elsewhere: they are home."""
        self.place[:] = self.home
        self.step[:] = 0.0

    def follow(self, colliders: ColliderState, dt: float, sub_steps: int) -> None:
        """Finds where they are to be after sub-steps of dt [s], for whose end shapes are posed."""
        if not self.least.size:
            return
        now = colliders.now
        given = (
            Given(
                *(self.collider, self.home, self.place, self.step, self.least, self.edges),
                *(self._x, self._away, self._out),
            ),
            Followed(now.position, now.orientation, colliders.origin),
            *(colliders.shapes, colliders.posed),
            *(_RETURN * dt * sub_steps, 1.0 / sub_steps),
        )
        if self._code is None:
            self._code = compiled(give_way, *given)
        self._code(*given)


@kernel()
def spare_rest(shapes, posed, x, least):
    """Lets pins be as deep in shapes as they were at rest, and deeper by as much as is spared.

    Args:
        shapes: `PackedShapes`.
        posed: The same at rest.
        x: The pins there [m], shape [p, 3].
        least: Distance below which each gives way, changed in place [m], shape [m, p].
    """
    zero = np.float32(0.0)
    for k in range(least.shape[0]):
        for p in range(least.shape[1]):
            if least[k, p] > _NEVER:
                d, _, _, _ = shape_distance(
                    shapes, posed, np.int64(k), x[p, 0], x[p, 1], x[p, 2], zero
                )
                least[k, p] += min(d, zero)


@kernel()
def give_way(pins, poses, shapes, posed, far, share):
    """Where pins are to be at the end of an interval; see `Pins`.

    Args:
        pins: `Given`; `step` is output.
        poses: World poses of all colliders, and the local origin: `Followed`.
        shapes: `PackedShapes`.
        posed: The same, posed.
        far: How far they can go home [m].
        share: The part of the interval that a sub-step is.
    """
    collider, home, place, step = pins.collider, pins.home, pins.place, pins.step
    position, orientation, origin = poses.position, poses.orientation, poses.origin
    pins.out[:] = 0.0
    is_home = True
    for p in range(collider.size):
        c = collider[p]
        for k in range(3):
            step[p, k] = home[p, k] - place[p, k]
        way = np.sqrt(step[p, 0] ** 2 + step[p, 1] ** 2 + step[p, 2] ** 2)
        if way < _HOME:
            for k in range(3):
                place[p, k] = home[p, k]
                step[p, k] = 0.0
        part = 1.0 if way <= far else far / way
        is_home = is_home and part == 1.0
        for k in range(3):
            step[p, k] *= part
        q = orientation[c]
        ax, ay, az = place[p, 0] + step[p, 0], place[p, 1] + step[p, 1], place[p, 2] + step[p, 2]
        turned = rotate(q[0], q[1], q[2], q[3], ax, ay, az)
        for k in range(3):
            pins.x[p, k] = turned[k] + position[c, k] - origin[k]
        _, _, _ = _leave(pins, shapes, posed, p, True)
    for k in range(len(pins.out)):
        size = np.sqrt(pins.out[k, 0] ** 2 + pins.out[k, 1] ** 2 + pins.out[k, 2] ** 2)
        is_home = is_home and not size > np.float32(0.0)
        for axis in range(3):
            pins.out[k, axis] /= max(size, np.float32(1e-12))
    if not is_home:
        for p in range(collider.size):
            way_out = _leave(pins, shapes, posed, p, False)
            c, q = collider[p], orientation[collider[p]]
            turned = rotate(q[0], q[1], q[2], q[3], home[p, 0], home[p, 1], home[p, 2])
            squared = 0.0
            for k in range(3):
                pins.x[p, k] += way_out[k]
                squared += (pins.x[p, k] - turned[k] - position[c, k] + origin[k]) ** 2
            pins.away[p] = np.sqrt(squared)
        keep_together(pins.x, pins.away, pins.edges)
    for p in range(collider.size):
        if not is_home:
            c, q = collider[p], orientation[collider[p]]
            x = pins.x[p, 0] + origin[0] - position[c, 0]
            y = pins.x[p, 1] + origin[1] - position[c, 1]
            z = pins.x[p, 2] + origin[2] - position[c, 2]
            turned = rotate(-q[0], -q[1], -q[2], q[3], x, y, z)
            for k in range(3):
                step[p, k] = turned[k] - place[p, k]
        for k in range(3):
            step[p, k] *= share


@kernel(inner=True)
def _leave(pins, shapes, posed, p, looks):
    """The way of pin p out of what it gives way to [m].

    Args:
        pins: `Given`.
        shapes: `PackedShapes`.
        posed: The same, posed.
        p: The pin.
        looks: Whether it only adds its way out of the deepest shape to the mean one.
    """
    zero = np.float32(0.0)
    x, y, z = np.float32(pins.x[p, 0]), np.float32(pins.x[p, 1]), np.float32(pins.x[p, 2])
    sx = sy = sz = zero
    for _ in range(_ROUNDS):
        below, k, nx, ny, nz = _deepest(shapes, posed, pins.least, p, x + sx, y + sy, z + sz)
        if not below < zero:
            break
        ox, oy, oz = pins.out[k, 0], pins.out[k, 1], pins.out[k, 2]
        if looks:
            pins.out[k, 0] = ox - below * nx
            pins.out[k, 1] = oy - below * ny
            pins.out[k, 2] = oz - below * nz
            break
        along = ox * nx + oy * ny + oz * nz
        if along > np.float32(0.0):
            below /= max(along, _ALONG)
            nx, ny, nz = ox, oy, oz
        sx -= below * nx
        sy -= below * ny
        sz -= below * nz
    return sx, sy, sz


@kernel(inner=True)
def _deepest(shapes, posed, least, p, x, y, z):
    """By how much pin p is too deep in a shape, at most; the shape, and the way out of it."""
    zero = np.float32(0.0)
    deepest, which, nx, ny, nz = zero, np.int64(-1), zero, zero, zero
    for k in range(least.shape[0]):
        if not least[k, p] > _NEVER:
            continue
        apart_x = (x < posed.box[k, 0]) | (x > posed.box[k, 3])
        apart_y = (y < posed.box[k, 1]) | (y > posed.box[k, 4])
        apart_z = (z < posed.box[k, 2]) | (z > posed.box[k, 5])
        if apart_x | apart_y | apart_z:
            continue
        d, ox, oy, oz = shape_distance(shapes, posed, np.int64(k), x, y, z, zero)
        below = d - least[k, p]
        if below < deepest:
            deepest, which, nx, ny, nz = below, np.int64(k), ox, oy, oz
    return deepest, which, nx, ny, nz
