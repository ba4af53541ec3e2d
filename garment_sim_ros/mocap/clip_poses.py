"""A clip as poses of a body: what measures a body over a motion starts here."""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skin import Body
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.sampling import sample

FloatArray = NDArray[np.float64]


def retargeter(clip: Clip, body: Body) -> Retargeter:
    """What turns a clip's channel values into poses of a body.

    Raises:
        GeometryError: One of the two has no known hips, or no pair of hips or shoulders.
    """
    return Retargeter(
        clip.rig, body, T_world_source=clip.T_world_file, reference=clip.source_reference
    )


def clip_poses(clip: Clip, body: Body, count: int) -> list[FloatArray]:
    """A body in evenly spaced poses of a clip, its first and last among them.

    Args:
        clip: The motion.
        body: Rig and skin.
        count: Number of poses.

    Returns:
        World transforms of the rig's joints in each pose, shape [n, 4, 4].

    Raises:
        GeometryError: One of the two has no known hips, or no pair of hips or shoulders.
    """
    to_body = retargeter(clip, body)
    times = np.linspace(clip.times[0], clip.times[-1], count)
    return [to_body.world_joints(sample(clip, float(t))).copy() for t in times]
