"""A clip's channel values at any time.

The three angles of a ball joint are interpolated as a rotation (spherical linear interpolation)
and written back as angles on the branch nearest to the samples around, so that neither a step from
179 to -179 degrees nor a change of Euler branch makes a joint turn the wrong way. Everything else
is interpolated linearly, single rotations the short way round.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.rig import ROTATION
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.transforms import quaternion_multiply, slerp
from garment_sim_ros.jit import kernel
from garment_sim_ros.mocap.channels import ball_joints, local_rotations
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.euler import euler_near
from garment_sim_ros.mocap.root_motion import RootMotion

REPEATS = ("once", "loop", "carry")
_RATES = (1.0, 1000.0)
"""Samples per second that clips are played at [Hz]."""
_RATE_OF_STILLS = 60.0
_TURN = 2.0 * np.pi
_SAME = 1e-3
"""Rotations [rad] and lengths [m] that close a loop when they differ by less."""


class ClipSampler:
    """Channel values of one clip at any time; allocates once.

    Args:
        clip: The clip.
        repeat: What happens after the last sample. ``once``: it stays. ``loop``: the clip begins
            again at its first sample. ``carry``: as ``loop``, but place and heading go on from
            where they were, so that a walk walks on.
        fade: Time before the seam over which a clip whose end does not meet its beginning is led
            there [s]; at most half of the clip. Clips that loop by themselves need none.

    Raises:
        ParameterError: An option is outside its range.
    """

    def __init__(self, clip: Clip, repeat: str = "once", fade: float = 0.4) -> None:
        if repeat not in REPEATS:
            raise ParameterError("repeat", f"is {repeat!r}", f"allowed: {', '.join(REPEATS)}")
        if not 0.0 <= fade <= 10.0:
            raise ParameterError("fade", f"is {fade} s", "allowed: 0 to 10 s")
        rig = clip.rig
        joints = ball_joints(rig)
        self.clip = clip
        self._times = np.ascontiguousarray(clip.times, dtype=np.float64)
        self._values = np.ascontiguousarray(clip.values, dtype=np.float64)
        self._channels, self._axes, self._single = joints.channels, joints.axes, joints.single
        # Continuous values wrap; a joint with limits never passes through its back.
        is_turn = (rig.dofs.kind == ROTATION) & ~np.isfinite(rig.dofs.lower)
        self._wraps = is_turn[self._single]
        self._rotations = local_rotations(rig, self._values)
        _align_signs(self._rotations)
        self._q = np.zeros(len(rig.dofs))
        self._repeats = repeat != "once" and clip.duration > 0.0
        self._fade = 0.0 if clip.loops else min(fade, 0.5 * clip.duration)
        self._root = RootMotion(clip) if repeat == "carry" else None
        if self._repeats and self._fade > 0.0:
            self._lead_end_to_start()

    def sample(self, t: float) -> FloatArray:
        """Channel values at a time.

        Args:
            t: Time since the first sample [s]; before it the clip stands still.

        Returns:
            Values [rad or m], shape [d], a new array.
        """
        times = self._times
        cycle = 0
        if self._repeats and t > 0.0:
            cycle = int(t // times[-1])
            t -= cycle * times[-1]
        i = int(np.searchsorted(times, t, side="right")) - 1
        i = min(max(i, 0), max(len(times) - 2, 0))
        j = min(i + 1, len(times) - 1)
        s = 0.0 if i == j else (t - times[i]) / (times[j] - times[i])
        q = self._q
        _interpolate(
            self._values, self._rotations, self._channels, self._axes, self._single, self._wraps,
            i, j, min(max(s, 0.0), 1.0), q,
        )  # fmt: skip
        if self._root is not None:
            self._root.advance(q, cycle)
        return q.copy()

    def _lead_end_to_start(self) -> None:
        """Turn the last samples gradually so that the last one is the first one, one cycle on."""
        times, rotations = self._times, self._rotations
        values = self._values = self._values.copy()
        target = values[0].copy()
        if self._root is not None:
            self._root.advance(target, 1)
        gap = target - values[-1]
        turns = self._single[self._wraps]
        gap[turns] -= _TURN * np.round(gap[turns] / _TURN)
        wanted = local_rotations(self.clip.rig, target[None])[0]
        start = times[-1] - self._fade
        first = max(int(np.searchsorted(times, start)), 1)
        s = (times[first:] - start) / self._fade
        weight = s * s * (3.0 - 2.0 * s)
        values[first:, self._single] += weight[:, None] * gap[self._single]
        _lead(values, rotations, self._channels, self._axes, wanted, first, weight)


def sample(clip: Clip, t: float, repeat: str = "once") -> FloatArray:
    """Channel values of a clip at one time; `ClipSampler` is faster for many times."""
    return ClipSampler(clip, repeat).sample(t)


def rate_of(clip: Clip) -> float:
    """Samples per second of a clip, within what is played [Hz]."""
    if len(clip.times) < 2:
        return _RATE_OF_STILLS
    return float(np.clip(1.0 / np.median(np.diff(clip.times)), *_RATES))


def closes(clip: Clip) -> bool:
    """Whether the last sample is the first one again, place and pose."""
    if len(clip.times) < 2:
        return False
    ends = clip.values[[0, -1]]
    rotations = local_rotations(clip.rig, ends)
    single = ball_joints(clip.rig).single
    same_turns = np.abs((rotations[0] * rotations[1]).sum(axis=-1)) > np.cos(0.5 * _SAME)
    return bool(same_turns.all() and (np.abs(ends[1] - ends[0])[single] < _SAME).all())


def _align_signs(rotations: FloatArray) -> None:
    """Choose of q and -q the one nearer to the sample before, in place."""
    opposite = np.einsum("kbi,kbi->kb", rotations[1:], rotations[:-1]) < 0.0
    rotations[1:] *= np.where(np.cumsum(opposite, axis=0) % 2, -1.0, 1.0)[..., None]


@kernel()
def _lead(values, rotations, channels, axes, wanted, first, weight):
    """Turn samples by a growing part of the rotation that leads the last one to `wanted`."""
    for b in range(channels.shape[0]):
        a = wanted[b]
        c = rotations[-1, b]
        gx, gy, gz, gw = quaternion_multiply(a[0], a[1], a[2], a[3], -c[0], -c[1], -c[2], c[3])
        for k in range(first, rotations.shape[0]):
            px, py, pz, pw = slerp(0.0, 0.0, 0.0, 1.0, gx, gy, gz, gw, weight[k - first])
            r = rotations[k, b]
            x, y, z, w = quaternion_multiply(px, py, pz, pw, r[0], r[1], r[2], r[3])
            before = rotations[k - 1, b]
            sign = 1.0
            if x * before[0] + y * before[1] + z * before[2] + w * before[3] < 0.0:
                sign = -1.0
            r[0], r[1], r[2], r[3] = sign * x, sign * y, sign * z, sign * w
            near = values[k - 1][channels[b]]
            angles = np.empty(3)
            euler_near(r, axes[b], near, angles)
            for i in range(3):
                values[k, channels[b, i]] = angles[i]


@kernel()
def _interpolate(values, rotations, channels, axes, single, wraps, i, j, s, q):
    for k in range(single.shape[0]):
        c = single[k]
        change = values[j, c] - values[i, c]
        if wraps[k]:
            change -= _TURN * np.round(change / _TURN)
        q[c] = values[i, c] + s * change
    nearer = i if s < 0.5 else j
    near = np.empty(3)
    out = np.empty(3)
    rotation = np.empty(4)
    for b in range(channels.shape[0]):
        if s == 0.0 or s == 1.0:  # a sample: its own angles, not others for the same rotation
            for k in range(3):
                q[channels[b, k]] = values[nearer, channels[b, k]]
            continue
        a = rotations[i, b]
        c = rotations[j, b]
        x, y, z, w = slerp(a[0], a[1], a[2], a[3], c[0], c[1], c[2], c[3], s)
        rotation[0], rotation[1], rotation[2], rotation[3] = x, y, z, w
        for k in range(3):
            near[k] = values[nearer, channels[b, k]]
        euler_near(rotation, axes[b], near, out)
        for k in range(3):
            q[channels[b, k]] = out[k]
