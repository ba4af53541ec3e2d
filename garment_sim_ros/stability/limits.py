"""How far a scene may stretch and crush its cloth: from the fabric and from what acts on it.

No run is compared with another one, which may be broken itself. A fabric of stiffness k [N/m]
that carries T newtons on each metre stretches by T / k. What it may have to carry at most is its
weight, its inertia where the body takes it along, and the wind, on all of its length; what hits it
at a speed v stretches it by v / c, with the speed c of sound in it. Limits are multiples of that,
and some points for what a mesh cannot do better.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.triangles import triangle_areas
from garment_sim_ros.params import Environment, Material
from garment_sim_ros.sim.placement import blend, find_frames
from garment_sim_ros.stability.extremes import Scene

POINTS, MOST = 0.05, 0.5
"""Stretch at rest that any fabric may have: 95 % of its edges, and each one."""
CRUSHED = 0.10
"""Share of their length by which 5 % of the edges may be too short at rest."""
LIVELY = 2.0
"""While it moves edges may be so many times more stretched at rest, and what acts counts double:
loads that come suddenly stretch twice as far."""
FEW = 4.0
"""Times that single edges may be stretched more than the fabric by what acts: few of them carry
what hangs below a corner."""
CRUSHED_MEANWHILE = 0.5
"""As `CRUSHED`, while it moves."""
BREAKS = 1.0
"""Stretch at which knitwear breaks: contact may be dropped, and limbs go through it, where what
acts would stretch it farther than that."""
SAGS = 0.15
"""How far a garment as a whole comes down per stretch by its weight, in heights of the body: it is
less than half as long as that, and its middle comes down by a third of its end."""
AIR = 1.2
"""Density of air [kg/m^3]."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Of one phase of a scene.

    Attributes:
        most: Stretch that 95 % of the edges may have.
        largest: Stretch that a single edge may have.
        crushed: Share of their length by which 5 % of the edges may be too short.
    """

    most: float
    largest: float
    crushed: float


def at_rest(scene: Scene) -> Limits:
    """When the scene has come to rest."""
    stretch = hanging(scene)
    return Limits(
        most=POINTS + stretch + scene.forced,
        largest=MOST + FEW * stretch + scene.forced,
        crushed=min(CRUSHED + stretch, 1.0),
    )


def meanwhile(scene: Scene) -> Limits:
    """While it is disturbed, and before it has come to rest."""
    stretch = LIVELY * acting(scene)
    return Limits(
        most=LIVELY * POINTS + stretch + scene.forced,
        largest=LIVELY * MOST + FEW * stretch + scene.forced,
        crushed=min(CRUSHED_MEANWHILE + stretch, 1.0),
    )


def hanging(scene: Scene) -> float:
    """Stretch along the softer threads by the cloth's weight."""
    return max(
        _load(scene, garment, scene.environment, 0.0) / _stiffness(garment.material)
        for garment in scene.garments
    )


def acting(scene: Scene) -> float:
    """Stretch of the softest direction of the fabric by what acts while it is disturbed."""
    most = 0.0
    for garment in scene.garments:
        speed, acceleration = _motion(scene, garment)
        forces = (scene.disturbed, scene.environment)
        load = max(_load(scene, garment, e, acceleration) for e in forces)
        soft = _softest(garment.material)
        sound = math.sqrt(soft / garment.material.areal_density)
        most = max(most, load / max(soft, 1e-300) + speed / max(sound, 1e-300))
    return most


def _stiffness(material: Material) -> float:
    """Along the softer threads [N/m]."""
    return max(min(material.stretch_stiffness_warp, material.stretch_stiffness_weft), 1e-300)


def _softest(material: Material) -> float:
    """In the softest direction [N/m]: along the threads, or at 45 degrees between them."""
    three = (
        material.stretch_stiffness_warp,
        material.stretch_stiffness_weft,
        material.shear_stiffness,
    )
    if min(three) <= 0.0:
        return 0.0
    return min(*three[:2], 4.0 / sum(1.0 / k for k in three))


def _load(scene: Scene, garment: Garment, forces: Environment, acceleration: float) -> float:
    """What a metre of it may have to carry [N/m]: as if others lay on it with all their weight."""
    pull = math.hypot(*forces.gravity) + acceleration
    area = {g.name: float(triangle_areas(g.vertices, g.triangles).sum()) for g in scene.garments}
    weight = sum(g.material.areal_density * area[g.name] for g in scene.garments)
    wind = math.hypot(*forces.wind) + 2.0 * forces.gust
    pressure = 0.5 * AIR * wind**2 * (forces.wind_drag + forces.wind_lift)
    extent = float(np.ptp(garment.vertices, axis=0).max())
    return (weight / area[garment.name] * pull + pressure) * extent


def _motion(scene: Scene, garment: Garment) -> tuple[float, float]:
    """Highest speed [m/s] of colliders and of where cloth would be as skin, and acceleration."""
    frames = find_frames(garment.name, garment.frames, scene.colliders)
    count = max(2, round(scene.moves_until / scene.frame))
    speed, acceleration = 0.0, 0.0
    before = None
    for n, m in pairwise(range(count + 1)):
        start, end = n * scene.frame, m * scene.frame
        if scene.jump is not None and start <= scene.jump[0] < end:
            before = None
            continue
        poses = scene.motion(start), scene.motion(end)
        skin = [blend(garment, frames.world(p)) for p in poses]
        v = (skin[1] - skin[0]) / scene.frame
        of_shapes = (poses[1].position - poses[0].position) / scene.frame
        every = np.concatenate([v, of_shapes])
        speed = max(speed, float(np.linalg.norm(every, axis=1).max()))
        if before is not None:
            change = np.linalg.norm(v - before, axis=1).max() / scene.frame
            acceleration = max(acceleration, float(change))
        before = v
    return speed, acceleration
