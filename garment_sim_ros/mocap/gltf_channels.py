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


def key_times(channels: Sequence[Channel], step: float, apart: float) -> FloatArray:
    """The times of all keys, and some between those of cubic samplers.

    Args:
        channels: What moves.
        step: Between cubic keys [s].
        apart: Times that are nearer than this are one [s].

    Returns:
        Increasing times [s], shape [f].
    """
    found = [channel.times for channel in channels]
    cubic = [channel.times for channel in channels if channel.way == "CUBICSPLINE"]
    if cubic:
        first, last = min(t[0] for t in cubic), max(t[-1] for t in cubic)
        found.append(first + step * np.arange(1, int((last - first) / step) + 1))
    times = np.unique(np.concatenate(found))
    kept = np.concatenate([[True], np.diff(times) > apart])
    return np.asarray(times[kept])
