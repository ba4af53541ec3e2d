"""How well avatars of one process run: rate, late frames, latency, processor time."""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from garment_sim_ros.ros.avatar_nodes import AvatarNodes

_COUNTED = ("frames", "late_frames", "skipped_s")


class Measurement:
    """From now on, of the avatars that are added."""

    def __init__(self) -> None:
        self._before: dict[AvatarNodes, tuple[float, Mapping[str, Any]]] = {}
        self._began, self._processor = time.monotonic(), time.process_time()

    def add(self, avatar: AvatarNodes) -> None:
        """Measure an avatar from now on."""
        avatar.cloth.shown.ages.clear()
        self._before[avatar] = time.monotonic(), _values(avatar)

    def drop(self, avatar: AvatarNodes) -> None:
        """Forget an avatar."""
        self._before.pop(avatar, None)

    def figures(self) -> dict[str, Any]:
        """What there was so far.

        Returns:
            `seconds`; `processor_percent` of one core, of the whole process; `avatars`, by
            namespace: `rate_hz`, `due_frames`, `frames` that were published, `late_frames` as
            `quality` counts them, with those that were left out, `skipped_s`,
            `latency_ms_median` and `latency_ms_p95`, from the time of the joint states that a
            frame shows until it was published.
        """
        seconds = time.monotonic() - self._began
        processor = time.process_time() - self._processor
        return {
            "seconds": round(seconds, 2),
            "processor_percent": round(100.0 * processor / max(seconds, 1e-9), 1),
            "avatars": {
                avatar.namespace or "/": _of_one(avatar, began, before)
                for avatar, (began, before) in self._before.items()
            },
        }


def _values(avatar: AvatarNodes) -> Mapping[str, Any]:
    """What the cloth says of itself in its diagnostics."""
    return avatar.cloth.condition().values


def _of_one(avatar: AvatarNodes, began: float, before: Mapping[str, Any]) -> dict[str, Any]:
    now, seconds = _values(avatar), time.monotonic() - began
    counted = {name: now.get(name, 0) - before.get(name, 0) for name in _COUNTED}
    ages = list(avatar.cloth.shown.ages) or [0.0]
    return {
        "rate_hz": round(counted["frames"] / max(seconds, 1e-9), 2),
        "due_frames": round(avatar.cloth.parameters.rate * seconds),
        **{name: round(value, 3) for name, value in counted.items()},
        "latency_ms_median": round(float(np.median(ages)), 2),
        "latency_ms_p95": round(float(np.percentile(ages, 95.0)), 2),
    }
