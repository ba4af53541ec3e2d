"""Small scenes that can be driven to extremes: what is worn on what, how it moves, what is asked.

Each scene is disturbed for a while and then left alone. Lengths are those of a body of normal
size; `scale` makes the same scene for a tiny or a huge one.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.constants import USUAL_STEP
from garment_sim_ros.contact.kinds.capsule import CAPSULE
from garment_sim_ros.contact.kinds.frame import FRAME
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.kinds.sphere import SPHERE
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.transforms import matrix_from_quaternion, quaternion_multiply
from garment_sim_ros.params import Environment, Material
from garment_sim_ros.sim.world.wind_field import CHANGE
from garment_sim_ros.stability.wearer import Wearer

Motion = Callable[[float], ColliderPoses]

SIDE = 0.6
"""Length of the square sheet's sides [m]."""
_SHEET = 13


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A garment, what it is worn on, and what happens to it.

    Attributes:
        garments: The garments.
        colliders: What they are worn on.
        motion: World poses of the colliders at a time [s]; they stand still from `busy` on.
        size: Length that tolerances are measured by [m].
        disturbed: Outer forces while it moves.
        environment: Outer forces from then on; wind takes a while to change.
        busy: How long the disturbance lasts [s].
        calm: How long the garment then has to come to rest [s].
        frame: Time between two poses that are given to the simulation [s].
        solver_step: Longest step of the solver [s].
        passes: Sweeps or iterations of the solver; None for its default.
        unique: Whether there is one shape only that the garment can be at rest in.
        jump: At which time the body jumps [s], and what is done about it, as `on_teleport`.
        broken: Whether poses are NaN while it is disturbed.
        wearer: The body in it, where there is one.
        preset: Whose solver, settings and detail it runs with, if any.
        forced: Stretch of edges that the scene itself asks for, such as by pins inside of a
            collider; then cloth at its pins is inside, too.
    """

    garments: tuple[Garment, ...]
    colliders: ColliderSet
    motion: Motion
    size: float = SIDE
    disturbed: Environment = field(default_factory=Environment)
    environment: Environment = field(default_factory=Environment)
    busy: float = 1.0
    calm: float = 25.0
    frame: float = 1 / 60
    solver_step: float = USUAL_STEP
    passes: int | None = None
    unique: bool = False
    jump: tuple[float, str] | None = None
    broken: bool = False
    wearer: Wearer | None = None
    preset: str = ""
    forced: float = 0.0

    @property
    def moves_until(self) -> float:
        """End of the frame in which the motion ends [s]: no frame after it has any."""
        return self._end_of_frame(self.busy)

    @property
    def still_from(self) -> float:
        """End of the frame in which all of the disturbance ends, a change of the wind, too [s]."""
        blows = self.disturbed != self.environment
        return self._end_of_frame(self.moves_until + (CHANGE if blows else 0.0))

    def _end_of_frame(self, t: float) -> float:
        return math.ceil(t / self.frame - 1e-6) * self.frame


def sheet(
    rows: int = _SHEET, columns: int = _SHEET, side: float = SIDE
) -> tuple[FloatArray, IntArray]:
    """A flat square in the x-y plane, rows along y, each quad split along the other diagonal.

    Returns:
        Vertices [m], shape [rows * columns, 3], the row y = 0 first; triangles.
    """
    return woven(np.linspace(0.0, side, rows), np.linspace(-side / 2, side / 2, columns))


def woven(y: FloatArray, x: FloatArray) -> tuple[FloatArray, IntArray]:
    """A flat piece with threads at y and x [m], split like a chequerboard."""
    across, along = np.meshgrid(x, y)
    vertices = np.stack([across, along, np.zeros_like(across)], axis=-1).reshape(-1, 3)
    index = np.arange(len(vertices), dtype=np.int32).reshape(len(y), len(x))
    a, b = index[:-1, :-1], index[:-1, 1:]
    c, d = index[1:, 1:], index[1:, :-1]
    even = (np.add.outer(np.arange(len(y) - 1), np.arange(len(x) - 1)) % 2 == 0)[..., None]
    first = np.where(even, np.stack([a, b, c], -1), np.stack([a, b, d], -1))
    second = np.where(even, np.stack([a, c, d], -1), np.stack([b, c, d], -1))
    return vertices, np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])


def hanging(vertices: FloatArray) -> FloatArray:
    """The same with its y axis turned down: what had y = 0 is on top."""
    return vertices[:, [0, 2, 1]] * np.array([1.0, 1.0, -1.0])


def garment(
    vertices: FloatArray,
    triangles: IntArray,
    pins: Sequence[int] = (),
    *,
    name: str = "cloth",
    layer: int = 0,
    **material: Any,
) -> Garment:
    """A garment attached to the bone called ``bone``."""
    return Garment.from_mesh(
        vertices,
        triangles,
        name=name,
        material=Material(**material),
        pins=pins,
        bone="bone",
        layer=layer,
    )


def box(name: str, half: tuple[float, float, float]) -> Collider:
    """A hull with right angles, half as long along each axis as given [m]."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [[f[0], f[i], f[i + 1]] for f in faces for i in (1, 2)]
    geometry = {"vertices": corners, "faces": np.array(triangles, np.int32)}
    return Collider(name=name, kind=HULL.name, bone=name, geometry=geometry)


def ball(name: str, radius: float) -> Collider:
    """A sphere on a bone of its own."""
    return Collider(name=name, kind=SPHERE.name, bone=name, geometry={"radius": radius})


def worn_on(*shapes: Collider) -> ColliderSet:
    """Shapes after the frame of the bone called ``bone``."""
    return ColliderSet(colliders=(Collider(name="bone", kind=FRAME.name, bone="bone"), *shapes))


def moving(count: int, *tracks: Callable[[float, ColliderPoses], None]) -> Motion:
    """A motion of `count` colliders; each track writes its part of the poses at a time."""

    def motion(t: float) -> ColliderPoses:
        poses = ColliderPoses.identity(count)
        for track in tracks:
            track(t, poses)
        return poses

    return motion


def spinning(motion: Motion, axis: int, rate: float, busy: float) -> Motion:
    """The same motion, all of it turning about a world axis.

    Args:
        motion: What turns.
        axis: 0, 1 or 2.
        rate: Turning rate [rad/s].
        busy: How long it turns [s].
    """

    def spun(t: float) -> ColliderPoses:
        poses = motion(t)
        q = np.zeros(4)
        q[axis] = np.sin(0.5 * rate * min(t, busy))
        q[3] = np.cos(0.5 * rate * min(t, busy))
        poses.position[:] = poses.position @ matrix_from_quaternion(q).T
        poses.orientation[:] = np.stack(quaternion_multiply(*q, *poses.orientation.T), axis=-1)
        return poses

    return spun


def curtain(
    scale: float = 1.0,
    *,
    shake: float = 0.1,
    busy: float = 1.0,
    mesh: tuple[FloatArray, IntArray] | None = None,
    pins: Sequence[int] = range(_SHEET),
    floor: bool = False,
    **material: Any,
) -> tuple[Garment, ColliderSet, Motion]:
    """A sheet that hangs by its upper edge; its rod shakes and a ball goes through.

    Args:
        scale: Of all lengths.
        shake: How far the rod moves to either side [m].
        busy: How long [s].
        mesh: Another mesh than a square sheet.
        pins: Vertices of the upper edge.
        floor: Whether there is a floor under it, for cloth that gives way, at scale 1.
        **material: As `Material`.
    """
    vertices, triangles = mesh or sheet()
    thickness = material.pop("thickness", Material().thickness) * scale
    cloth = garment(hanging(vertices) * scale, triangles, pins, thickness=thickness, **material)
    below = box("floor", (3.0, 3.0, 0.25)) if floor else ball("stone", 0.1 * scale)

    def rod(t: float, poses: ColliderPoses) -> None:
        s = min(t / busy, 1.0)
        poses.position[0, 1] = scale * shake * np.sin(4 * np.pi * s)
        poses.position[0, 0] = 0.5 * scale * shake * np.sin(2 * np.pi * s)

    def obstacles(t: float, poses: ColliderPoses) -> None:
        s = min(t / busy, 1.0)
        poses.position[1, 2] = -1.6 * scale
        poses.position[2] = np.array([0.05, 1.6 * s - 0.8, -0.5]) * scale

    return cloth, worn_on(below, ball("ball", 0.12 * scale)), moving(3, rod, obstacles)


def press(gap: float, busy: float = 2.0) -> tuple[Garment, ColliderSet, Motion]:
    """A curtain between two slabs that close on it to a gap [m], negative to overlap, and open."""
    vertices, triangles = sheet()
    cloth = garment(hanging(vertices), triangles, range(_SHEET))
    half = 0.05

    def slabs(t: float, poses: ColliderPoses) -> None:
        closed = np.sin(np.pi * min(t / busy, 1.0)) ** 2
        apart = half + (1.0 - closed) * 0.3 + closed * gap / 2
        poses.position[1:, 2] = -0.35
        poses.position[1, 1], poses.position[2, 1] = apart, -apart

    slab = (0.4, half, 0.2)
    return cloth, worn_on(box("left", slab), box("right", slab)), moving(3, slabs)


def cape(radius: float = 0.12) -> tuple[Garment, ColliderSet, Motion]:
    """A curtain whose upper edge is inside a ball."""
    vertices, triangles = sheet()
    cloth = garment(hanging(vertices), triangles, range(_SHEET))
    return cloth, worn_on(ball("ball", radius)), moving(2)


def swallowed() -> tuple[Garment, ColliderSet, Motion]:
    """A loose sheet that begins inside a large ball on a floor."""
    vertices, triangles = sheet(side=0.3)
    cloth = garment(vertices - np.array([0.02, 0.13, 0.0]), triangles)

    def floor(t: float, poses: ColliderPoses) -> None:
        poses.position[2, 2] = -0.75

    return (
        cloth,
        worn_on(ball("ball", 0.5), box("floor", (3.0, 3.0, 0.25))),
        moving(3, floor),
    )


def sleeve(radius: float = 0.05) -> tuple[Garment, ColliderSet, Motion]:
    """A tube hung by one end on a forearm; poses have it stretched out along x."""
    around, along, length = 16, 9, 0.4
    angle = np.linspace(0.0, 2 * np.pi, around, endpoint=False)
    x = np.linspace(0.0, length, along)
    ring = np.stack([np.zeros(around), np.cos(angle), np.sin(angle)], axis=1) * (radius + 0.01)
    vertices = (ring[None] + np.stack([x, 0 * x, 0 * x], axis=1)[:, None]).reshape(-1, 3)
    index = np.arange(len(vertices), dtype=np.int32).reshape(along, around)
    a, b = index[:-1], index[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    triangles = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    cloth = garment(vertices, triangles, range(around))
    geometry = {"radius0": radius, "radius1": radius, "length": length}
    # A capsule lies along its own z axis.
    along_x = np.array([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    arm = Collider(
        name="arm", kind=CAPSULE.name, bone="bone", orientation=along_x, geometry=geometry
    )

    def carried(t: float, poses: ColliderPoses) -> None:
        poses.orientation[1] = along_x

    return cloth, worn_on(arm), moving(2, carried)
