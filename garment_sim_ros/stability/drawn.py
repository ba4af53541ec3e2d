"""Extremes of everything at once: scenes drawn at random from all ranges of the map."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from garment_sim_ros.constants import GRAVITY
from garment_sim_ros.params import Environment
from garment_sim_ros.stability.extremes import SIDE, Scene, curtain, sheet, spinning

COUNT = 20
"""Scenes that are drawn."""
_CALM = 40.0
"""Time to come to rest, at least [s]. Damping alone takes what swings down to an e-th in 4 s: what
moves by ten sizes a second, as small cloth does, is at rest after 34 s."""


def drawn_cells(seed: int) -> Iterator[tuple[str, Callable[[], Scene]]]:
    """What was drawn, and the scene.

    Args:
        seed: Equal seeds give equal scenes.
    """
    for number in range(COUNT):
        rng = np.random.default_rng([seed, number])
        step = _between(rng, 1e-3, 1 / 3)
        stiffness = _between(rng, 1e2, 1e6)
        density = _between(rng, 0.03, 3.0)
        scale = _between(rng, 1e-2, 10.0)
        gravity = _between(rng, 0.1, 30.0)
        wind = float(rng.choice([0.0, _between(rng, 1.0, 30.0)]))
        turning = float(rng.choice([0.0, _between(rng, 30.0, 1000.0)]))
        rows = int(rng.integers(7, 22))
        told = (
            f"{number + 1}: {1e3 * step:.3g} ms, {stiffness:.2g} N/m, {density:.2g} kg/m^2, "
            f"{SIDE * scale:.2g} m, {rows} rows, {gravity:.2g} g, {wind:.2g} m/s, "
            f"{turning:.3g} deg/s"
        )
        material = {
            "stretch_stiffness_warp": stiffness,
            "stretch_stiffness_weft": stiffness * _between(rng, 0.3, 3.0),
            "shear_stiffness": stiffness * _between(rng, 0.01, 0.3),
            "bending_stiffness": _between(rng, 1e-7, 1e-3),
            "areal_density": density,
            "friction": _between(rng, 0.05, 1.0),
        }
        force = Environment(gravity=(0.0, 0.0, -GRAVITY * gravity), wind_drag=1.2, wind_lift=0.4)
        blown = replace(force, wind=(0.3 * wind, wind, 0.0), gust=0.2 * wind)
        yield (
            told,
            partial(_scene, scale, rows, material, (force, blown), step=step, turning=turning),
        )


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number of which each order of magnitude is as likely as any other."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def _scene(
    scale: float,
    rows: int,
    material: dict[str, Any],
    forces: tuple[Environment, Environment],
    *,
    step: float,
    turning: float,
) -> Scene:
    """A sheet that hangs by its upper edge; its rod shakes and turns, a ball goes through."""
    busy = max(1.0, math.sqrt(scale))
    turns = max(1, round(turning / 360.0 * busy)) if turning else 0
    cloth, colliders, motion = curtain(
        scale, busy=busy, mesh=sheet(rows, rows), pins=range(rows), **material
    )
    if turns:
        motion = spinning(motion, 2, 2.0 * math.pi * turns / busy, busy)
    frame = max(step, 1 / 60)
    return Scene(
        garments=(cloth,),
        colliders=colliders,
        motion=motion,
        size=SIDE * scale,
        disturbed=forces[1],
        environment=forces[0],
        busy=busy,
        calm=_CALM + 5.0 * busy,
        frame=frame,
        solver_step=step,
    )
