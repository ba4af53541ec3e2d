"""What the levels of the preset `auto` cost on this machine."""

import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.avatar import Avatar
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.garment.outfit import Outfit
from garment_sim_ros.params import XpbdSettings
from garment_sim_ros.sim.auto.levels import LEVELS, Level
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.strain import StrainMeter

SECONDS = 3.0
_FRAMES = 60
"""In a second."""
_FIRST = 10
"""So many frames do not count: they load and prepare."""
Progress = Callable[[Iterable[Any], str, int], Iterable[Any]]


class Walker:
    """The demo's garments on the walking mannequin at one level.

    Args:
        avatar: The mannequin.
        outfit: What it wears.
        level: The level.
        poses: Of its colliders, for each frame.
    """

    def __init__(
        self, avatar: Avatar, outfit: Outfit, level: Level, poses: list[ColliderPoses]
    ) -> None:
        self._poses = poses
        self._at = 0
        self.simulation = Simulation(
            outfit,
            avatar.colliders,
            preset="balanced",
            settings=level.settings(XpbdSettings()),
            detail=level.detail,
        )
        self._strain = [(StrainMeter(view.model), view.state) for view in self.simulation]
        self.times: list[float] = []
        self.stretch: list[float] = []
        self.simulation.reset(poses[0])

    def frame(self) -> None:
        """A frame as a node takes it."""
        began = time.thread_time()
        start, self._at = self._at, self._at + 1
        self.simulation.advance(self._poses[start], self._poses[self._at], 1 / _FRAMES)
        self.times.append(1e3 * (time.thread_time() - began))
        self.stretch.append(max(meter.read(state).p95 for meter, state in self._strain))


def calibrate(
    seconds: float = SECONDS, progress: Progress = lambda items, text, total: items
) -> tuple[FloatArray, FloatArray]:
    """Measure all levels, frame by frame in turns, so that their ratios hold on a busy machine.

    Args:
        seconds: Of the walk [s].
        progress: Passes items on and shows how far it is.

    Returns:
        Of each level the median processor time of a frame [ms], and the 95th percentile over edges
        of the stretch, in the worst frame.
    """
    avatar = Avatar.load("mannequin", preset="balanced")
    frames = max(2 * _FIRST, round(seconds * _FRAMES))
    joints = avatar.joints("walk", _FRAMES, seconds=(frames + 1) / _FRAMES, repeat="loop")
    poses = [avatar.poses(T).copy() for T in joints]
    outfit = avatar.dress("tshirt_short_skirt")
    walkers = [
        Walker(avatar, outfit, level, poses) for level in progress(LEVELS, "dressing", len(LEVELS))
    ]
    for _ in progress(range(frames), "measuring", frames):
        for walker in walkers:
            walker.frame()
    cost = np.array([np.median(walker.times[_FIRST:]) for walker in walkers])
    return cost, np.array([max(walker.stretch[_FIRST:]) for walker in walkers])
