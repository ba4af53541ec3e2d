"""A dressed mannequin driven to extremes."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.avatar import Avatar
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import ELLIPSOIDS, HULLS, MESH, SDF
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.constants import PERSON_HEIGHT
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.declaration import declarations, validated
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT, read_outfit
from garment_sim_ros.params import Environment
from garment_sim_ros.presets import preset_values
from garment_sim_ros.stability.extremes import Motion, Scene, spinning
from garment_sim_ros.stability.wearer import Wearer

_RATE = 3000.0 * np.pi / 180
_RAISED = np.radians(60.0)
_LENGTHS = ("radius", "radius0", "radius1", "length", "radii", "vertices")


_LONG_SKIRT = "tshirt_long_skirt"
_PRESETS = ("fast", "accurate", "sun2007", "gong2018")
"""Those that are not the defaults."""
APART = 0.004
"""Distance that a garment's parts keep from each other where it meets itself [m]."""


class Dressed(NamedTuple):
    """A body with its colliders, in garments.

    Attributes:
        body: The body.
        colliders: What cloth meets.
        garments: What it wears.
        poser: Poses the colliders.
    """

    body: Body
    colliders: ColliderSet
    garments: tuple[Garment, ...]
    poser: ColliderPoser

    def standing(self, t: float) -> ColliderPoses:
        """It stands still, as it was dressed."""
        return self.poser.poses(rest_transforms(self.body.rig)).copy()

    def scene(self, motion: Motion, scale: float = 1.0, **asked: object) -> Scene:
        """A scene in which it moves, at its own size."""
        wearer = Wearer(self.body, self.colliders, self.garments, scale)
        size = float(np.ptp(self.body.skin.vertices[:, 2]))
        asked = {"size": size, "calm": 6.0, "wearer": wearer, **asked}
        return Scene(
            garments=self.garments,
            colliders=self.colliders,
            motion=motion,
            **asked,  # type: ignore[arg-type]
        )


@cache
def dressed(
    outfit: str = DEFAULT_OUTFIT, method: str = HULLS, source: str = "mannequin", preset: str = ""
) -> Dressed:
    """A body in an outfit.

    Args:
        outfit: As `load_outfit` takes it.
        method: How its colliders are fitted.
        source: As `load_body` takes it.
        preset: Whose colliders, skinning and attachments it has instead, if any.
    """
    if preset:
        avatar = Avatar.load(source, preset=preset)
        body, colliders = avatar.body, avatar.colliders
        garments = avatar.dress(outfit).garments
    else:
        body = load_body(source)
        colliders = fit_colliders(body, replace(read_outfit(outfit).colliders, method=method))
        garments = load_outfit(outfit, body, colliders=colliders).garments
    return Dressed(body, colliders, tuple(garments), ColliderPoser(colliders, body))


def dressed_cells() -> Iterator[tuple[str, str, Callable[[], Scene]]]:
    """What is driven to an extreme, how far, and the scene."""
    body = "dressed body"
    yield "self-collision", f"{body}, turns at 1000 deg/s", _apart
    yield body, "turns at 3000 deg/s", partial(_turning, _RATE)
    yield body, "arms at 3000 deg/s", _flapping
    for mode in ("reset", "keep", "ignore"):
        yield body, f"teleport 100 m, {mode}", partial(_teleport, mode)
    for tall in (1e-3, 100.0):
        yield body, f"{tall:g} m tall", partial(_turned, tall)
    for step in (3, 15, 30):
        told = partial(_turned, PERSON_HEIGHT, solver_step=1 / step, frame=1 / step)
        yield body, f"step 1/{step} s", told
    long = partial(_turned, PERSON_HEIGHT, outfit=_LONG_SKIRT)
    yield "long skirt", "turns at 1000 deg/s", partial(_turning, _RATE / 3, _LONG_SKIRT, 15.0)
    yield "long skirt", "step 1/30 s", partial(long, solver_step=1 / 30, frame=1 / 30, calm=15.0)
    for method in (ELLIPSOIDS, SDF, MESH):
        yield "colliders", method, partial(_turned, PERSON_HEIGHT, method=method)
    for preset in _PRESETS:
        yield "preset", f"{preset}, turns half around", partial(of_preset, preset, _turned)
        yield "preset", f"{preset}, arms at 3000 deg/s", partial(of_preset, preset, _flapping)


def of_preset(preset: str, scene: Callable[..., Scene]) -> Scene:
    """A scene with a preset's solver, settings, rate, detail, colliders and outer forces."""
    made = scene(worn=dressed(preset=preset))
    of = preset_values(preset, "cloth_node")
    forces = validated(Environment, {k: of[k] for k in declarations(Environment) if k in of})
    frame = 1.0 / of.get("rate", 60.0)
    return replace(made, preset=preset, frame=frame, disturbed=forces, environment=forces)


def _apart() -> Scene:
    """Both garments are kept from passing through themselves."""
    made = _turning(_RATE / 3, calm=15.0)
    garments = tuple(replace(garment, self_collision=APART) for garment in made.garments)
    return replace(made, garments=garments)


def _turning(rate: float, outfit: str = DEFAULT_OUTFIT, calm: float = 6.0) -> Scene:
    worn = dressed(outfit)
    return worn.scene(spinning(worn.standing, 2, rate, 0.96), busy=0.96, calm=calm)


def _flapping(worn: Dressed | None = None) -> Scene:
    """Both upper arms go up and down through 60 degrees."""
    worn = worn or dressed()
    body, poser = worn.body, worn.poser
    rest = rest_transforms(body.rig)
    arms = [
        (body.rig.index(body.humanoid[f"{side}UpperArm"]), sign)
        for side, sign in (("left", 1.0), ("right", -1.0))
    ]

    def motion(t: float) -> ColliderPoses:
        sweep = (_RATE * min(t, 0.96)) % (2 * _RAISED)
        angle = min(sweep, 2 * _RAISED - sweep) if t < 0.96 else 0.0
        T = rest.copy()
        for joint, sign in arms:
            about_x = _about_x(-sign * angle, rest[joint, :3, 3])
            below = _descendants(body, joint)
            T[below] = about_x @ rest[below]
        return poser.poses(T).copy()

    return worn.scene(motion, busy=1.0)


def _about_x(angle: float, centre: FloatArray) -> FloatArray:
    """Transform that turns about an axis along x through a point, shape [4, 4]."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.eye(4)
    T[1:3, 1:3] = [[c, -s], [s, c]]
    T[:3, 3] = centre - T[:3, :3] @ centre
    return T


def _descendants(body: Body, joint: int) -> list[int]:
    below = {joint}
    for child, parent in enumerate(body.rig.parent):
        if int(parent) in below:
            below.add(child)
    return sorted(below)


def _teleport(mode: str) -> Scene:
    worn = dressed()

    def motion(t: float) -> ColliderPoses:
        poses = worn.standing(t)
        if t > 0.5:
            poses.position += np.array([60.0, 80.0, 0.0])
        return poses

    return worn.scene(motion, jump=(0.5, mode))


def _turned(
    tall: float = PERSON_HEIGHT,
    outfit: str = DEFAULT_OUTFIT,
    method: str = HULLS,
    worn: Dressed | None = None,
    **asked: float,
) -> Scene:
    """Turns by half a turn within a second, at any size."""
    worn = worn or dressed(outfit, method)
    scale = tall / PERSON_HEIGHT
    busy = max(1.0, float(np.sqrt(scale)))
    turning = spinning(worn.standing, 2, np.pi / busy, busy)

    def motion(t: float) -> ColliderPoses:
        poses = turning(t)
        poses.position *= scale
        return poses

    # With long frames, too, the ten that are judged come after six seconds.
    calm = 6.0 * max(1.0, busy) + 10.0 * float(asked.get("frame", 0.0))
    scene = worn.scene(motion, scale, **{"size": tall, "busy": busy, "calm": calm, **asked})
    if scale == 1.0:
        return scene
    return replace(
        scene,
        garments=tuple(_scaled(garment, scale) for garment in scene.garments),
        colliders=replace(
            scene.colliders,
            colliders=tuple(_scaled_shape(c, scale) for c in scene.colliders.colliders),
            thickness=scene.colliders.thickness * scale,
        ),
    )


def _scaled(garment: Garment, scale: float) -> Garment:
    T = garment.T_world_frame_rest.copy()
    T[:, :3, 3] *= scale
    return replace(
        garment,
        vertices=garment.vertices * scale,
        T_world_frame_rest=T,
        material=replace(garment.material, thickness=garment.material.thickness * scale),
        skin_limits={name: limit * scale for name, limit in garment.skin_limits.items()},
    )


def _scaled_shape(collider: Collider, scale: float) -> Collider:
    geometry = dict(collider.geometry)
    for key in _LENGTHS:
        if key in geometry:
            geometry[key] = np.multiply(geometry[key], scale)  # type: ignore[call-overload]
    return replace(collider, position=collider.position * scale, geometry=geometry)
