"""What breaks garments on purpose, for `bench/breaking.py`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.shapes import ColliderPoses

Wearer = Any
"""The one of `breaking`: garments, colliders, body, simulation, stepper and what was shown."""


@dataclass(frozen=True)
class Cause:
    """Something that breaks garments.

    Attributes:
        lasts: For how long [s].
        state: Changes the simulation once, when it begins.
        poses: Poses in the place of those of a frame, while it lasts.
        every: While it lasts, frames from one call of the cloth to the next; 0: none.
        sends: Whether poses are sent while it lasts.
        on_teleport: See `cloth_node`.
        limb: The bone that does it, and part of the name of the garment that it does it to.
    """

    lasts: float = 0.0
    state: Callable[[Wearer], None] | None = None
    poses: Callable[[ColliderPoses, int], ColliderPoses] | None = None
    every: int = 1
    sends: bool = True
    on_teleport: str = "reset"
    limb: tuple[str, str] | None = None


def _not_finite(share: float) -> Callable[[Wearer], None]:
    def act(wearer: Wearer) -> None:
        random = np.random.default_rng(1)
        for g in wearer.garments:
            x = wearer.simulation.state(g.name).x
            x[random.random(len(x)) < share] = np.nan

    return act


def _moved(wearer: Wearer) -> None:
    for g in wearer.garments:
        free = wearer.simulation.model(g.name).free_count
        wearer.simulation.state(g.name).x[:free, 0] += 0.3
        wearer.simulation.state(g.name).x[:free, 1] += 0.1


def _old(wearer: Wearer) -> None:
    for g in wearer.garments:
        then = wearer.shown[-18][g.name] - wearer.simulation.origin
        model = wearer.simulation.model(g.name)
        wearer.simulation.state(g.name).x[:] = then[model.vertex]


def _near(wearer: Wearer, bone: str) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the longest core of a bone, relative to the local origin."""
    cores = Cores.of(wearer.colliders)
    ends = cores.posed(wearer.stepper.poses) - wearer.simulation.origin
    name = wearer.body.humanoid.get(bone, bone)
    mine = [k for k, b in enumerate(cores.bone) if b in (bone, name)]
    best = max(mine, key=lambda k: np.linalg.norm(ends[k, 1] - ends[k, 0]))
    return ends[best, 0], ends[best, 1]


def _dragged(bone: str, garment: str, reach: float) -> Callable[[Wearer], None]:
    """The cloth nearest to a limb is dragged over it, to its other side."""

    def act(wearer: Wearer) -> None:
        a, b = _near(wearer, bone)
        g = next(g for g in wearer.garments if garment in g.name)
        model = wearer.simulation.model(g.name)
        x = wearer.simulation.state(g.name).x[: model.free_count]
        d = b - a
        s = np.clip((x - a) @ d / (d @ d), 0.0, 1.0)
        to = a + s[:, None] * d - x
        away = np.linalg.norm(to, axis=1)
        if away.min() > 2 * reach:
            print(f"  {bone} is {away.min():.2f} m from {g.name}")
        k = int(np.argmin(away))
        way = to[k] + 0.08 * to[k] / max(away[k], 1e-6)
        part = np.linalg.norm(x - x[k], axis=1)
        x += (np.clip(1.5 - part / reach, 0.0, 1.0)[:, None] * way).astype(np.float32)

    return act


def _wound(bone: str, garment: str) -> Callable[[Wearer], None]:
    """The hem nearest to a limb is wound once around it."""

    def act(wearer: Wearer) -> None:
        a, b = _near(wearer, bone)
        g = next(g for g in wearer.garments if garment in g.name)
        model = wearer.simulation.model(g.name)
        x = wearer.simulation.state(g.name).x[: model.free_count]
        axis = (b - a) / np.linalg.norm(b - a)
        to = x - a
        radial = to - (to @ axis)[:, None] * axis
        away = np.linalg.norm(x - (a + b) / 2, axis=1)
        k = int(np.argmin(np.linalg.norm(radial, axis=1) + (away > 0.3)))
        part = np.linalg.norm(x - x[k], axis=1)
        turn = 1.5 * np.pi * np.clip(1.0 - part / 0.15, 0.0, 1.0)
        side = np.cross(axis, radial)
        x += ((np.cos(turn) - 1)[:, None] * radial + np.sin(turn)[:, None] * side).astype("f4")

    return act


def _changed(poses: ColliderPoses, position: np.ndarray, turn: np.ndarray | None = None):
    result = poses.copy()
    result.position[:] = position
    if turn is not None:
        result.orientation[:] = turn
    return result


def _inside_out(poses: ColliderPoses, n: int) -> ColliderPoses:
    return _changed(poses, 2.0 * poses.position[0] - poses.position)


def _collapsed(poses: ColliderPoses, n: int) -> ColliderPoses:
    return _changed(poses, poses.position[0] + 0.0 * poses.position)


def _random(poses: ColliderPoses, n: int) -> ColliderPoses:
    random = np.random.default_rng(n)
    turn = random.normal(size=poses.orientation.shape)
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    return _changed(poses, poses.position + random.normal(0.0, 0.3, poses.position.shape), turn)


def _shaken(poses: ColliderPoses, n: int) -> ColliderPoses:
    random = np.random.default_rng(n)
    return _changed(poses, poses.position + random.normal(0.0, 0.05, poses.position.shape))


def _jumped(way: float) -> Callable[[ColliderPoses, int], ColliderPoses]:
    return lambda poses, n: _changed(poses, poses.position + np.array([way, 0.5 * way, 0.0]))


def _by_limb(act: Callable, bone: str, garment: str, *reach: float) -> Cause:
    return Cause(state=act(bone, garment, *reach), limb=(bone, garment))


CAUSES: dict[str, Cause] = {
    "nan_some": Cause(state=_not_finite(0.05)),
    "nan_most": Cause(state=_not_finite(0.5)),
    "moved": Cause(state=_moved),
    "old": Cause(state=_old),
    "hand_through_skirt": _by_limb(_dragged, "leftHand", "skirt", 0.12),
    "thigh_through_skirt": _by_limb(_dragged, "leftUpperLeg", "skirt", 0.15),
    "shin_through_skirt": _by_limb(_dragged, "leftLowerLeg", "skirt", 0.15),
    "arm_through_sleeve": _by_limb(_dragged, "leftUpperArm", "shirt", 0.06),
    "wound_on_arm": _by_limb(_wound, "leftLowerArm", "skirt"),
    "wound_on_thigh": _by_limb(_wound, "leftUpperLeg", "skirt"),
    "jump_below": Cause(lasts=0.5, poses=_jumped(0.25)),
    "jump_above": Cause(lasts=0.5, poses=_jumped(1.0)),
    "jump_kept": Cause(lasts=0.5, poses=_jumped(1.0), on_teleport="keep"),
    "stall_0.3": Cause(lasts=0.3, every=0),
    "stall_0.9": Cause(lasts=0.9, every=0),
    "no_input_0.3": Cause(lasts=0.3, sends=False),
    "overload": Cause(lasts=1.0, every=12),
    "inside_out": Cause(lasts=0.5, poses=_inside_out),
    "collapsed": Cause(lasts=0.5, poses=_collapsed),
    "random": Cause(lasts=0.5, poses=_random),
    "shaken": Cause(lasts=0.5, poses=_shaken),
}
