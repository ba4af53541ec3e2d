"""A clip as poses of a body: what measures a body over a motion starts here."""

import numpy as np
from numpy.typing import ArrayLike

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skin import Body
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.sampling import ClipSampler


def retargeter(clip: Clip, body: Body) -> Retargeter:
    """What turns a clip's channel values into poses of a body.

    Raises:
        GeometryError: One of the two has no known hips, or no pair of hips or shoulders.
    """
    return Retargeter(
        clip.rig, body, T_world_source=clip.T_world_file, reference=clip.source_reference
    )


def clip_poses(clip: Clip, body: Body, times: int | ArrayLike) -> list[FloatArray]:
    """A body in poses of a clip.

    Args:
        clip: The motion.
        body: Rig and skin.
        times: Since the clip's start [s]; or a number of poses, evenly spaced, the clip's first
            and last among them.

    Returns:
        World transforms of the rig's joints in each pose, shape [n, 4, 4].

    Raises:
        GeometryError: One of the two has no known hips, or no pair of hips or shoulders.
    """
    to_body, sampler = retargeter(clip, body), ClipSampler(clip, "once")
    if isinstance(times, int):
        times = np.linspace(clip.times[0], clip.times[-1], times)
    return [
        to_body.world_joints(sampler.sample(float(t))).copy()
        for t in np.asarray(times, np.float64)
    ]
