"""A real body in motion of a real person, where the data is."""

import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT
from garment_sim_ros.mocap.clip_poses import retargeter
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.stability.dressed import dressed
from garment_sim_ros.stability.extremes import Scene

VARIABLE = "GARMENT_SIM_DATA"
"""Environment variable that names the folder of the data."""
_BODY = Path("bodies") / "mh_female_young.glb"
_RATE = 60.0
_RUNS = (
    ("short skirt, cartwheel", DEFAULT_OUTFIT, "deepmimic_cartwheel.bvh", 2.7),
    ("short skirt, jumping jacks", DEFAULT_OUTFIT, "cmu_14_14_jumping_jacks_30fps.bvh", 3.0),
    ("long skirt, kick", "tshirt_long_skirt", "deepmimic_spinkick.bvh", 1.25),
)
"""What it wears and does, its clip, and how much of that [s]."""


def real_cells() -> Iterator[tuple[str, str, Callable[[], Scene]]]:
    """What it does, why that cannot be tried (empty where it can), and the scene."""
    folder = os.environ.get(VARIABLE, "")
    for name, outfit, clip, seconds in _RUNS:
        files = [Path(folder) / _BODY, Path(folder) / "mocap" / clip]
        absent = f"{VARIABLE} is not set" if not folder else ""
        for file in files:
            if folder and not file.is_file():
                absent = f"{file} is not there"
        yield name, absent, partial(_moving, outfit, files[0], files[1], seconds)


def _moving(outfit: str, body: Path, clip: Path, seconds: float) -> Scene:
    """Moves as in the clip, then holds its last pose."""
    worn = dressed(outfit, source=str(body))
    motion = load_clip(clip)
    to_body, sampler = retargeter(motion, worn.body), ClipSampler(motion)
    times = np.arange(round(seconds * _RATE) + 1) / _RATE
    poses = [
        worn.poser.poses(to_body.world_joints(sampler.sample(float(t)), float(t))).copy()
        for t in times
    ]

    def moving(t: float) -> ColliderPoses:
        return poses[min(max(round(t * _RATE), 0), len(poses) - 1)].copy()

    return worn.scene(moving, busy=float(times[-1]), calm=15.0 if "long" in outfit else 6.0)
