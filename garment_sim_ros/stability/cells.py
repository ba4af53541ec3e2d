"""The extremes of the stability map: one scene for each value of each."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from garment_sim_ros.constants import GRAVITY, PERSON_HEIGHT
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.params import Environment, Material
from garment_sim_ros.stability.drawn import drawn_cells
from garment_sim_ros.stability.dressed import APART, dressed_cells
from garment_sim_ros.stability.extremes import (
    SIDE,
    Motion,
    Scene,
    box,
    cape,
    curtain,
    garment,
    hanging,
    moving,
    press,
    sheet,
    sleeve,
    spinning,
    swallowed,
    worn_on,
    woven,
)
from garment_sim_ros.stability.real import real_cells

DEGREES = math.pi / 180


@dataclass(frozen=True)
class Cell:
    """One value of one extreme.

    Attributes:
        extreme: What is driven to an extreme.
        value: How far.
        scene: Makes the scene.
        absent: Why it cannot be tried; empty where it can.
    """

    extreme: str
    value: str
    scene: Callable[[], Scene]
    absent: str = ""

    @property
    def name(self) -> str:
        """As it is chosen by."""
        return f"{self.extreme}: {self.value}"


def cells(seed: int = 1) -> Iterator[Cell]:
    """All cells, extreme by extreme.

    Args:
        seed: Of those that are drawn at random.
    """
    for step in (1e-4, 1e-3, 1 / 240, 1 / 60, 1 / 30, 1 / 15, 1 / 3):
        scene = partial(_stepped, step)
        yield Cell("step", f"{1e3 * step:.3g} ms", scene)
    for passes in (1, 3, 20, 200):
        yield Cell("iterations", f"{passes}", partial(_curtain, passes=passes))
    for stiffness in (0.0, 1.0, 1e2, 1e4, 1e6, 1e9):
        yield Cell("stiffness", f"{stiffness:g} N/m", partial(_stiff, stiffness))
    for ratio in (1e2, 1e4, 1e6):
        yield Cell("mass ratio", f"{ratio:g}, graded mesh", partial(_graded, ratio))
    yield Cell("mass ratio", "1e6, layers", _weighed_down)
    for g in (0.0, 1.0, 10.0, 100.0):
        yield Cell("gravity", f"{g:g} g", partial(_heavy, g))
    for speed in (10.0, 30.0, 100.0):
        yield Cell("wind", f"{speed:g} m/s", partial(_windy, speed))
    for axis, name in ((2, "upright"), (1, "overhead")):
        for rate in (360.0, 1000.0, 3000.0):
            yield Cell("turning", f"{rate:g} deg/s, {name}", partial(_turning, rate, axis))
    yield Cell("turning", "3000 deg/s, sleeve", _whirled_sleeve)
    for far in (1.0, 100.0):
        for mode in ("reset", "keep", "ignore"):
            yield Cell("teleport", f"{far:g} m, {mode}", partial(_teleport, far, mode))
    for tall in (1e-3, 0.1, PERSON_HEIGHT, 10.0, 100.0):
        yield Cell("body height", f"{tall:g} m", partial(_tall, tall))
    yield Cell("pins", "inside a collider", partial(_still, cape(), calm=10.0, forced=1.4))
    for gap in (0.01, 0.0, -0.02):
        yield Cell("closing colliders", f"gap of {1e3 * gap:g} mm", partial(_pressed, gap))
    for fault in ("zero-area triangles", "duplicate triangles", "duplicate vertices", "needles"):
        yield Cell("mesh", fault, partial(_faulty, fault))
    yield Cell("start", "inside a collider", partial(_still, swallowed(), calm=10.0, size=0.3))
    yield Cell("NaN input", "1 s of poses", partial(_curtain, broken=True))
    yield Cell("self-collision", "whirled at 1000 deg/s", partial(_turning, 1000.0, 2, apart=True))
    yield Cell("self-collision", "in a heap", _heap)
    for extreme, value, on_body in dressed_cells():
        yield Cell(extreme, value, on_body)
    for value, absent, real in real_cells():
        yield Cell("real body and clip", value, real, absent)
    for value, drawn in drawn_cells(seed):
        yield Cell("drawn at random", value, drawn)


def _still(worn: tuple[Garment, ColliderSet, Motion], **asked: Any) -> Scene:
    cloth, colliders, motion = worn
    return Scene(garments=(cloth,), colliders=colliders, motion=motion, **asked)


def _curtain(**asked: Any) -> Scene:
    return _still(curtain(), **{"unique": True, **asked})


def _stepped(step: float) -> Scene:
    # The shortest steps are many.
    rows = 7 if step < 1e-3 else 13
    worn = curtain(mesh=sheet(rows, rows), pins=range(rows))
    return _still(worn, unique=True, solver_step=step, frame=max(step, 1 / 60))


def _stiff(k: float) -> Scene:
    bending = Material().bending_stiffness * k / Material().stretch_stiffness_warp
    cloth, colliders, motion = curtain(
        stretch_stiffness_warp=k,
        stretch_stiffness_weft=k,
        shear_stiffness=k * 0.03,
        bending_stiffness=min(bending, 1e3),
        floor=k < 100.0,
    )
    # Cloth that gives way reaches the floor, where it may lie in many ways.
    return _still((cloth, colliders, motion), unique=k >= 100.0)


def _graded(ratio: float) -> Scene:
    """Threads ever closer towards the upper edge: the heaviest particles hang by the lightest."""
    n = 13
    closer = np.geomspace(1.0, 1.0 / math.sqrt(ratio), n - 1)[::-1]
    y = np.concatenate([[0.0], np.cumsum(closer)])
    x = np.concatenate([[0.0], np.cumsum(closer)])
    mesh = woven(SIDE * y / y[-1], SIDE * (x / x[-1] - 0.5))
    return _still(curtain(mesh=mesh, pins=range(n)), unique=ratio <= 1e4)


def _weighed_down() -> Scene:
    """A heavy sheet on a thin one that is held by its border."""
    vertices, triangles = sheet(11)
    border = np.flatnonzero(
        (np.abs(vertices[:, 0]) > 0.499 * SIDE)
        | (np.abs(vertices[:, 1] - SIDE / 2) > 0.499 * SIDE)
    )
    hammock = garment(vertices, triangles, border.tolist(), name="inner", areal_density=1e-3)
    x, t = sheet(4, side=0.3)
    load = garment(x + np.array([0.0, 0.15, 0.01]), t, name="outer", layer=1, areal_density=10.0)

    def motion(t: float) -> ColliderPoses:
        poses = ColliderPoses.identity(2)
        poses.position[0, 0] = 0.01 * np.sin(4 * np.pi * min(t, 1.0))
        poses.position[1, 2] = -1.0
        return poses

    floor = worn_on(box("floor", (3.0, 3.0, 0.25)))
    return Scene(garments=(hammock, load), colliders=floor, motion=motion)


def _heavy(g: float) -> Scene:
    pull = Environment(gravity=(0.0, 0.0, -GRAVITY * g))
    # Stretched by more than a percent it is drawn in at the sides and ripples, to and fro.
    return _curtain(disturbed=pull, environment=pull, unique=g == 1.0)


def _windy(speed: float) -> Scene:
    cloth, colliders, motion = curtain(shake=0.0)
    air = Environment(wind_drag=1.2, wind_lift=0.4)
    wind = replace(air, wind=(0.3 * speed, speed, 0.0), gust=0.2 * speed)
    return _still((cloth, colliders, motion), unique=True, disturbed=wind, environment=air)


def _turning(rate: float, axis: int, apart: bool = False) -> Scene:
    cloth, colliders, motion = curtain(shake=0.02)  # Not in one plane all the time.
    if apart:
        cloth = replace(cloth, self_collision=APART)

    # Whole turns, so that it hangs from its edge in the end.
    turns = max(1, round(rate / 360.0))
    busy = 360.0 * turns / rate
    spun = spinning(_only_bone(motion), axis, rate * DEGREES, busy)
    return _still((cloth, colliders, spun), busy=busy, unique=True)


def _heap() -> Scene:
    """A sheet that stands on its edge and falls into folds; the floor shakes."""
    vertices, triangles = sheet(25, 25)
    cloth = replace(garment(hanging(vertices), triangles), self_collision=APART)

    def floor(t: float, poses: ColliderPoses) -> None:
        poses.position[1, 2] = -SIDE - 0.26
        poses.position[1, 0] = 0.02 * np.sin(4 * np.pi * min(t, 1.0))

    below = worn_on(box("floor", (3.0, 3.0, 0.25)))
    return _still((cloth, below, moving(2, floor)))


def _only_bone(motion: Motion) -> Motion:
    """The same with all else far away."""

    def alone(t: float) -> ColliderPoses:
        poses = motion(t)
        poses.position[1:, 2] -= 10.0
        return poses

    return alone


def _whirled_sleeve() -> Scene:
    cloth, colliders, motion = sleeve()
    whirled = spinning(motion, 2, 3000.0 * DEGREES, 0.96)
    return _still((cloth, colliders, whirled), size=0.4, busy=0.96)


def _teleport(far: float, mode: str) -> Scene:
    cloth, colliders, motion = curtain(shake=0.0)

    def jumping(t: float) -> ColliderPoses:
        poses = motion(t)
        if t > 0.5:
            poses.position += np.array([0.6, 0.8, 0.0]) * far
        return poses

    return _still((cloth, colliders, jumping), unique=True, jump=(0.5, mode))


def _tall(height: float) -> Scene:
    scale = height / PERSON_HEIGHT
    busy = max(1.0, math.sqrt(scale))
    worn, calm = curtain(scale, busy=busy), 20.0 + 2.0 * busy
    return _still(worn, size=SIDE * scale, busy=busy, calm=calm, unique=True)


def _pressed(gap: float) -> Scene:
    return _still(press(gap), busy=2.0, unique=True)


def _faulty(fault: str) -> Scene:
    vertices, triangles = sheet()
    if fault == "zero-area triangles":
        # Corners of one row of vertices: they span nothing.
        triangles = np.concatenate([triangles, [[40, 41, 42], [70, 71, 72]]]).astype(np.int32)
    elif fault == "duplicate triangles":
        triangles = np.concatenate([triangles, triangles[50:60]])
    elif fault == "duplicate vertices":
        # A second vertex at the same place in some of the triangles around it.
        vertices = np.concatenate([vertices, vertices[[58, 84]]])
        triangles = triangles.copy()
        for old, new in ((58, len(vertices) - 2), (84, len(vertices) - 1)):
            rows = np.flatnonzero((triangles == old).any(axis=1))[:2]
            triangles[rows] = np.where(triangles[rows] == old, new, triangles[rows])
    else:
        vertices = vertices.copy()
        inner = np.flatnonzero(
            (vertices[:, 1] > 0.1) & (vertices[:, 1] < 0.5) & (np.abs(vertices[:, 0]) < 0.2)
        )
        # Every other vertex almost meets its neighbour.
        vertices[inner[::2], 0] += 0.999 * SIDE / 12
    # A slit's corners curl to either side.
    return _still(curtain(mesh=(vertices, triangles)), unique=fault != "duplicate vertices")
