"""The scenes that speed and accuracy are measured on, as data."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.avatar import Avatar
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.collider_params import HULLS
from garment_sim_ros.contact.plain_shapes import sphere
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.transforms import transform_from
from garment_sim_ros.tradeoff.axes import collider_arguments
from garment_sim_ros.tradeoff.sewn import sewn_on
from garment_sim_ros.tradeoff.waisted_limb import lying_limb

VARIABLE = "GARMENT_SIM_DATA"
"""Environment variable that names the folder of real bodies and clips."""
PLAIN = "plain"
"""What the colliders of a scene without a body are called in the grid."""

_SHAPES: Mapping[str, Callable[..., Collider]] = {"sphere": sphere, "limb": lying_limb}
_WEAVE = {
    "areal_density": 0.2,
    "stretch_stiffness_warp": 2000.0,
    "stretch_stiffness_weft": 2000.0,
    "shear_stiffness": 500.0,
    "damping": 4.0,
}


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One scene, as data.

    Attributes:
        text: What happens.
        seconds: How long it moves [s].
        still: How long the last pose is then held, for the garments to come to rest [s].
        frame: Time between two poses [s].
        sheet: Of a scene without a body: arguments of `Garment.sheet`.
        shapes: Of a scene without a body: shapes and their arguments, see `plain_shapes`, and
            `waisted_limb`.
        body: As `Avatar.load` takes it, or a file in ``bodies`` of the data; empty without.
        clip: As `load_clip` takes it, or a file in ``mocap`` of the data; empty: the rest pose.
        wear: As `Avatar.dress` takes it, or a file in ``garments`` of the data.
        pattern: In place of `wear`: name of a sewing pattern of our own.
        turning: Rate at which the whole body turns about the world's z axis [rad/s].
        environment: Values of `Environment` by name.
    """

    text: str
    seconds: float
    still: float = 6.0
    frame: float = 1 / 60
    sheet: Mapping[str, Any] = field(default_factory=dict)
    shapes: tuple[tuple[str, Mapping[str, Any]], ...] = ()
    body: str = ""
    clip: str = ""
    wear: str | Mapping[str, Any] = ""
    pattern: str = ""
    turning: float = 0.0
    environment: Mapping[str, Any] = field(default_factory=dict)

    @property
    def rests(self) -> bool:
        """Whether its garments come to rest in the end: in gusts they do not."""
        return not self.environment.get("gust")

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """Folder and name of the files of the data that it needs."""
        mesh = self.wear if isinstance(self.wear, str) else ""
        asked = (("bodies", self.body), ("mocap", self.clip), ("garments", mesh))
        return tuple((folder, name) for folder, name in asked if "." in name.split(":")[0])

    @property
    def absent(self) -> str:
        """Why it cannot be tried here; empty where it can."""
        folder = os.environ.get(VARIABLE, "")
        if self.files and not folder:
            return f"{VARIABLE} is not set"
        lost = [Path(folder, *file) for file in self.files if not Path(folder, *file).is_file()]
        return f"{lost[0]} is not there" if lost else ""


_FIG_9 = "mannequin:vertices=1425"
_WIDE_DRESS = {
    "version": 1,
    "garments": [
        {
            "name": "skirt",
            "generator": "long_skirt",
            "options": {"vertices": 2235, "flare": 0.5},
            "material": "polyester",
        },
        {
            "name": "tshirt",
            "generator": "tshirt",
            "options": {"vertices": 1503},
            "material": {"preset": "cotton_jersey", "thickness": 0.006},
            "layer": 1,
        },
    ],
}
_TIGHT = {
    "version": 1,
    "garments": [
        {
            "name": "tshirt",
            "generator": "tshirt",
            "options": {"vertices": 1503, "ease": 0.006},
            "material": "cotton_jersey",
        },
    ],
}

SCENES: Mapping[str, Scene] = {
    "drape": Scene(
        text="a sheet of 1 m x 1 m falls on a sphere of radius 0.3 m and drapes",
        seconds=2.0,
        sheet={"width": 1.0, "height": 1.0, "edge": 0.04, "at": (0.0, 0.0, 0.35)}
        | {"material": _WEAVE},
        shapes=(("sphere", {"radius": 0.3}),),
    ),
    "hung": Scene(
        text="a sheet of 1 m x 1 m, held flat by two corners, is let go and swings",
        seconds=2.0,
        sheet={"width": 1.0, "height": 1.0, "edge": 0.04, "pins": "top corners"}
        | {"material": _WEAVE},
    ),
    "limb": Scene(
        text="a sheet of 1 m x 1 m falls on a waisted limb of 508 triangles, which lies",
        seconds=2.0,
        sheet={"width": 1.0, "height": 1.0, "edge": 1.0 / 49.0, "at": (0.0, 0.0, 0.03)}
        | {"material": _WEAVE | {"friction": 0.5}},
        shapes=(("limb", {}),),
    ),
    "walk": Scene(
        text="a body of 1,425 vertices walks in a T-shirt and a short skirt",
        seconds=2.0,
        body=_FIG_9,
        clip="walk",
        wear="tshirt_short_skirt",
    ),
    "walk_33ms": Scene(
        text="the same in frames of 0.033 s, the step of the first paper",
        seconds=1.98,
        frame=0.033,
        body=_FIG_9,
        clip="walk",
        wear="tshirt_short_skirt",
    ),
    "dance": Scene(
        text="a lively dance in a long skirt, in frames of 0.033 s",
        seconds=3.96,
        frame=0.033,
        still=10.0,
        body=_FIG_9,
        clip="rokoko_jesse_dance.bvh",
        wear="tshirt_long_skirt",
    ),
    "dance_330ms": Scene(
        text="the same in frames of 0.33 s, as the first paper prints it",
        seconds=3.96,
        frame=0.33,
        still=9.9,
        body=_FIG_9,
        clip="rokoko_jesse_dance.bvh",
        wear="tshirt_long_skirt",
    ),
    "wind": Scene(
        text="a T-shirt and a wide long skirt on a body that stands in a wind of 4 m/s",
        seconds=3.0,
        body=_FIG_9,
        wear=_WIDE_DRESS,
        environment={"wind": (4.0, 1.0, 0.0), "wind_drag": 1.2, "wind_lift": 0.4},
    ),
    "dress": Scene(
        text="a sewn wide dress on a body that stands in a gusty wind of 3 m/s",
        seconds=3.0,
        body=_FIG_9,
        pattern="wide_dress",
        environment={"wind": (3.0, 1.0, 0.0), "wind_drag": 1.2, "wind_lift": 0.4, "gust": 1.0},
    ),
    "tight": Scene(
        text="a body walks in a T-shirt that is 6 mm wider than it",
        seconds=2.0,
        body=_FIG_9,
        clip="walk",
        wear=_TIGHT,
    ),
    "spin": Scene(
        text="a standing body in a short skirt turns by 360 degrees a second",
        seconds=2.0,
        body=_FIG_9,
        wear="tshirt_short_skirt",
        turning=2.0 * np.pi,
    ),
    **{
        name: Scene(
            text=f"a real body in a T-shirt and a short skirt: {name}",
            seconds=seconds,
            body="mh_female_young.glb",
            clip=f"deepmimic_{name}.bvh",
            wear="tshirt_short_skirt",
        )
        for name, seconds in (("run", 0.8), ("jump", 1.75), ("cartwheel", 2.7))
    },
    **{
        name: Scene(
            text=f"a real body in a real garment, {mesh}: {clip}",
            seconds=seconds,
            body="mh_female_young.glb",
            clip=f"deepmimic_{clip}.bvh",
            wear=f"{mesh}.obj",
        )
        for name, mesh, clip, seconds in (
            ("trousers", "trousers_female", "spinkick", 1.2),
            ("tight_skirt", "skirt_long_female", "walk", 1.2),
        )
    },
}
"""The scenes by name."""


@dataclass(frozen=True, kw_only=True)
class Staged:
    """A scene with one kind of colliders, ready to be simulated.

    Attributes:
        scene: Its data.
        garments: The garments.
        colliders: What they meet.
        poses: World poses of the colliders at the start and after each frame.
        avatar: The body; None without.
        joints: World transforms of its joints at the same times, shape [n, 4, 4].
    """

    scene: Scene
    garments: tuple[Garment, ...]
    colliders: ColliderSet
    poses: tuple[ColliderPoses, ...]
    avatar: Avatar | None = None
    joints: tuple[FloatArray, ...] = ()

    @property
    def frames(self) -> int:
        """Number of frames in which it moves."""
        return len(self.poses) - 1

    @property
    def still_frames(self) -> int:
        """Number of frames in which the last pose is then held."""
        return max(10, round(self.scene.still / self.scene.frame))


def scene_named(name: str) -> Scene:
    """A scene by its name.

    Raises:
        ParameterError: There is none, or its files are not there.
    """
    if name not in SCENES:
        raise ParameterError("scene", f"found {name!r}", f"allowed: {', '.join(SCENES)}")
    if SCENES[name].absent:
        there = ", ".join(n for n, scene in SCENES.items() if not scene.absent)
        raise ParameterError(
            "scene", f"found {name!r}: {SCENES[name].absent}", f"allowed: {there}"
        )
    return SCENES[name]


@cache
def staged_scene(name: str, kind: str, seconds: float = 0.0) -> Staged:
    """A scene with colliders of a kind; of those without a body, with their own.

    Args:
        name: Of the scene.
        kind: Colliders of its body, see `axes.collider_arguments`.
        seconds: Only so much of its motion [s]; 0: all.

    Raises:
        ParameterError: There is no such scene, or its files are not there.
    """
    return staged(scene_named(name), kind, seconds)


def staged(scene: Scene, kind: str = HULLS, seconds: float = 0.0) -> Staged:
    """As `staged_scene`, of a scene that has no name."""
    length = min(seconds, scene.seconds) if seconds > 0.0 else scene.seconds
    count = max(1, round(length / scene.frame))
    if not scene.body:
        colliders = ColliderSet.of(*(_SHAPES[shape](**of) for shape, of in scene.shapes))
        return Staged(
            scene=scene,
            garments=(Garment.sheet(**scene.sheet),),
            colliders=colliders,
            poses=(colliders.poses(),) * (count + 1),
        )
    avatar = Avatar.load(_found("bodies", scene.body), **collider_arguments(kind))
    joints = tuple(_joints(scene, avatar, count))
    wear = scene.wear
    if isinstance(wear, str):
        wear = _found("garments", wear)
    worn = sewn_on(avatar, scene.pattern) if scene.pattern else avatar.dress(wear)
    return Staged(
        scene=scene,
        garments=tuple(worn.garments),
        colliders=avatar.colliders,
        poses=tuple(avatar.poses(T) for T in joints),
        avatar=avatar,
        joints=joints,
    )


def _found(folder: str, name: str) -> str:
    """A file of the data, or what is built in."""
    built_in = "." not in name.split(":")[0]
    return name if built_in else str(Path(os.environ.get(VARIABLE, ""), folder, name))


def _joints(scene: Scene, avatar: Avatar, count: int) -> list[FloatArray]:
    """World transforms of the joints at the start and after each frame."""
    if scene.clip:
        clip, rate = _found("mocap", scene.clip), 1.0 / scene.frame
        return list(avatar.joints(clip, rate, seconds=count / rate, repeat="loop"))
    rest = rest_transforms(avatar.body.rig)
    turned = []
    for n in range(count + 1):
        half = 0.5 * scene.turning * n * scene.frame
        turn = np.array([0.0, 0.0, np.sin(half), np.cos(half)])
        turned.append(transform_from(np.zeros(3), turn) @ rest)
    return turned
