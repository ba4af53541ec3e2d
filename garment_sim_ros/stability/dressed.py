"""A dressed mannequin driven to extremes."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT, read_outfit
from garment_sim_ros.stability.extremes import Motion, Scene, spinning
from garment_sim_ros.stability.wearer import Wearer

_RATE = 3000.0 * np.pi / 180
_RAISED = np.radians(60.0)
_LENGTHS = ("radius", "radius0", "radius1", "length", "radii", "vertices")


@cache
def _dressed() -> tuple[Body, ColliderSet, tuple[Garment, ...], ColliderPoser]:
    body = load_body("mannequin")
    colliders = fit_colliders(body, read_outfit(DEFAULT_OUTFIT).colliders)
    garments = load_outfit(DEFAULT_OUTFIT, body, colliders=colliders).garments
    return body, colliders, tuple(garments), ColliderPoser(colliders, body)


def dressed_cells() -> Iterator[tuple[str, Callable[[], Scene]]]:
    """What happens, and its scene."""
    yield "turns at 3000 deg/s", _turning
    yield "arms at 3000 deg/s", _flapping
    for mode in ("reset", "keep", "ignore"):
        yield f"teleport 100 m, {mode}", partial(_teleport, mode)
    for tall in (1e-3, 100.0):
        yield f"{tall:g} m tall", partial(_turned, tall)
    yield "step 1/3 s", partial(_turned, 1.65, solver_step=1 / 3, frame=1 / 3)
    yield "step 1/15 s", partial(_turned, 1.65, solver_step=1 / 15, frame=1 / 15)


def _scene(motion: Motion, **asked: object) -> Scene:
    _, colliders, garments, _ = _dressed()
    asked = {"size": 1.65, "calm": 6.0, "wearer": _wearer(1.0), **asked}
    return Scene(garments=garments, colliders=colliders, motion=motion, **asked)  # type: ignore[arg-type]


def _wearer(scale: float) -> Wearer:
    body, colliders, garments, _ = _dressed()
    return Wearer(body, colliders, garments, scale)


def _standing(t: float) -> ColliderPoses:
    body, _, _, poser = _dressed()
    return poser.poses(rest_transforms(body.rig)).copy()


def _turning() -> Scene:
    return _scene(spinning(_standing, 2, _RATE, 0.96), busy=0.96)


def _flapping() -> Scene:
    """Both upper arms go up and down through 60 degrees."""
    body, _, _, poser = _dressed()
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

    return _scene(motion, busy=1.0)


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
    def motion(t: float) -> ColliderPoses:
        poses = _standing(t)
        if t > 0.5:
            poses.position += np.array([60.0, 80.0, 0.0])
        return poses

    return _scene(motion, jump=(0.5, mode))


def _turned(tall: float, **asked: float) -> Scene:
    """Turns by half a turn within a second, at any size."""
    scale = tall / 1.65
    busy = max(1.0, float(np.sqrt(scale)))
    turning = spinning(_standing, 2, np.pi / busy, busy)

    def motion(t: float) -> ColliderPoses:
        poses = turning(t)
        poses.position *= scale
        return poses

    # With long frames, too, the ten that are judged come after six seconds.
    calm = 6.0 * max(1.0, busy) + 10.0 * float(asked.get("frame", 0.0))
    scene = _scene(motion, size=tall, busy=busy, calm=calm, **asked)
    if scale == 1.0:
        return scene
    return replace(
        scene,
        wearer=_wearer(scale),
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
