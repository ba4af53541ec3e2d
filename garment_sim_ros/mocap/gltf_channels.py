"""What an animation of a glTF file moves, at any time.

Follows the Khronos glTF 2.0 specification, section 3.11 and appendix C: linear, stepped and cubic
samplers of translation, rotation and scale.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.loaders.gltf_file import GltfFile

_WIDTH = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}
_WAYS = ("LINEAR", "STEP", "CUBICSPLINE")
_MAX_NUMBERS = 20_000_000
"""In the keys of all channels of an animation."""
_STEP = 1.0 / 60.0
_LONGEST_STEP = 1.0 / 20.0
"""Between keys that are frames [s]."""
_UNEVEN = 0.02
"""How far they may be from where they were if they were even, as a share of their distance."""
_NEAR = np.cos(1e-4)
"""Cosine of half the angle under which the chord is as good as the arc."""


@dataclass(frozen=True)
class Channel:
    """One property of one node over time.

    Attributes:
        node: The node.
        path: ``translation``, ``rotation`` or ``scale``.
        way: LINEAR, STEP or CUBICSPLINE.
        times: Of the keys [s], shape [k], increasing.
        values: Of the keys, shape [k, w]; with tangents [k, 3, w] where the way is CUBICSPLINE.
    """

    node: int
    path: str
    way: str
    times: FloatArray
    values: FloatArray

    def at(self, t: FloatArray) -> FloatArray:
        """The property at some times, shape [f, w]; rotations are unit quaternions."""
        times = self.times
        last = len(times) - 1
        i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, max(last - 1, 0))
        j = np.minimum(i + 1, last)
        length = np.where(j > i, times[j] - times[i], 1.0)
        s = np.clip((t - times[i]) / length, 0.0, 1.0)[:, None]
        if self.way == "STEP":
            return self.values[np.where(s[:, 0] >= 1.0, j, i)]
        if self.way == "CUBICSPLINE":
            return self._unit(self._cubic(i, j, s, length[:, None]))
        a, b = self.values[i], self.values[j]
        if self.path != "rotation":
            return a + s * (b - a)
        return self._unit(_slerp(a, b, s))

    def _cubic(self, i: Any, j: Any, s: FloatArray, length: FloatArray) -> FloatArray:
        """Hermite's cubic between two keys (appendix C.5)."""
        p, q = self.values[i], self.values[j]
        s2, s3 = s * s, s * s * s
        return np.asarray(
            (2 * s3 - 3 * s2 + 1) * p[:, 1]
            + length * (s3 - 2 * s2 + s) * p[:, 2]
            + (3 * s2 - 2 * s3) * q[:, 1]
            + length * (s3 - s2) * q[:, 0]
        )

    def _unit(self, values: FloatArray) -> FloatArray:
        return unit_quaternions(values) if self.path == "rotation" else values


def unit_quaternions(q: FloatArray) -> FloatArray:
    """Quaternions of length 1; what has no direction is no turn."""
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(length > 1e-9, q / np.maximum(length, 1e-9), (0.0, 0.0, 0.0, 1.0))


def _slerp(a: FloatArray, b: FloatArray, s: FloatArray) -> FloatArray:
    """Spherical linear interpolation of unit quaternions, the short way round."""
    cosine = (a * b).sum(axis=1, keepdims=True)
    b = np.where(cosine < 0.0, -b, b)
    angle = np.arccos(np.minimum(np.abs(cosine), 1.0))
    sine = np.sin(angle)
    straight = np.abs(cosine) > _NEAR
    sine[straight] = 1.0
    left = np.where(straight, 1.0 - s, np.sin((1.0 - s) * angle) / sine)
    right = np.where(straight, s, np.sin(s * angle) / sine)
    return np.asarray(left * a + right * b)


def read_channels(file: GltfFile, animation: dict[str, Any]) -> list[Channel]:
    """The channels of an animation that move nodes.

    Morph targets are left out, and so is what extensions move.

    Raises:
        InputFileError: A channel or sampler is malformed.
    """
    samplers = file.items(animation, "samplers", dict)
    nodes = len(file.list_of("nodes"))
    channels: list[Channel] = []
    taken: set[tuple[int, str]] = set()
    numbers = 0
    for channel in file.items(animation, "channels", dict):
        target = channel.get("target")
        if not isinstance(target, dict):
            raise file.error("an animation's channel has no target", "allowed: a JSON object")
        path = target.get("path")
        if not isinstance(path, str) or path not in _WIDTH or "node" not in target:
            continue
        node = file.index(target, "node", nodes)
        if (node, path) in taken:
            raise file.error(f"an animation has the {path} of node {node} twice")
        taken.add((node, path))
        sampler = samplers[file.index(channel, "sampler", len(samplers))]
        channels.append(Channel(node, path, *_keys(file, sampler, path)))
        numbers += channels[-1].times.size + channels[-1].values.size
        if numbers > _MAX_NUMBERS:
            raise file.error(f"has an animation of over {_MAX_NUMBERS} numbers")
    return channels


def _keys(
    file: GltfFile, sampler: dict[str, Any], path: str
) -> tuple[str, FloatArray, FloatArray]:
    """How a sampler goes from key to key, the keys' times, and their values."""
    way = sampler.get("interpolation", "LINEAR")
    if way not in _WAYS:
        raise file.error(f"an animation's sampler is {way!r:.60}", f"allowed: {', '.join(_WAYS)}")
    times = file.accessor(sampler, "input", "SCALAR").astype(np.float64)
    values = file.accessor(sampler, "output", _WIDTH[path]).astype(np.float64)
    each = 3 if way == "CUBICSPLINE" else 1
    if len(values) != each * len(times):
        raise file.error(
            f"an animation's sampler has {len(times)} times and {len(values)} values",
            f"allowed: {each} for each time",
        )
    if not (np.isfinite(times).all() and (np.diff(times) > 0.0).all()):
        raise file.error("an animation's times do not increase")
    if not np.isfinite(values).all():
        raise file.error("an animation has values that are not finite")
    if each == 3:
        return way, times, values.reshape(len(times), 3, -1)
    if path == "rotation":
        values = unit_quaternions(values)
    return way, times, values


def frame_times(channels: Sequence[Channel]) -> tuple[float, int, float]:
    """When to take samples, so that what lies between them is told well by straight ways.

    Keys that are evenly spaced, as a program writes them that has worked out all frames, are the
    frames. Others are sampled at 60 Hz.

    Returns:
        The first time [s], the number of frames, and from one to the next [s].
    """
    first = min(float(channel.times[0]) for channel in channels)
    last = max(float(channel.times[-1]) for channel in channels)
    longest = max(channels, key=lambda channel: len(channel.times)).times
    steps = len(longest) - 1
    if steps > 0 and (longest[0], longest[-1]) == (first, last):
        step = (last - first) / steps
        grid = first + step * np.arange(steps + 1, dtype=np.float64)
        if step <= _LONGEST_STEP and all(_on(channel.times, grid, step) for channel in channels):
            return first, steps + 1, step
    count = max(int(np.ceil((last - first) / _STEP - 1e-6)), 0) + 1
    return first, count, (last - first) / max(count - 1, 1)


def _on(times: FloatArray, grid: FloatArray, step: float) -> bool:
    """Whether all times are on an even grid, but for rounding."""
    k = np.clip(np.round((times - grid[0]) / step).astype(np.int64), 0, len(grid) - 1)
    return bool(np.abs(times - grid[k]).max() <= _UNEVEN * step)
