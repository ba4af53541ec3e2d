"""The last minute of what a running avatar says: rate and errors."""

import threading
from collections import deque

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.view.frame import Frame

_SPAN = 60.0
_MOST = 4000
ERRORS = ("strain_p95", "inside")
"""Keys of `quality` that are drawn; both are shares."""


class History:
    """Frames as they came."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, float, float]] = deque(maxlen=_MOST)
        self._arrivals: deque[float] = deque(maxlen=_MOST)
        self._lock = threading.Lock()

    def arrive(self, now: float, frames: int) -> None:
        """So many frames of the cloth came since the last call; `now` is a time [s]."""
        with self._lock:
            self._arrivals.extend([now] * min(frames, _MOST))

    def add(self, now: float, frame: Frame) -> None:
        """Keep a frame's errors, the largest of its garments."""
        strain, inside = (
            max((_finite(own.get(key, 0.0)) for own in frame.quality.values()), default=0.0)
            for key in ERRORS
        )
        with self._lock:
            self._rows.append((now, strain, inside))

    def rate(self, now: float) -> float:
        """Frames in the last second."""
        with self._lock:
            return float(sum(now - 1.0 <= t <= now for t in self._arrivals))

    def rates(self, now: float) -> tuple[FloatArray, FloatArray]:
        """Seconds before now, as negative numbers, and frames in each [Hz]."""
        with self._lock:
            since = np.array(self._arrivals) - now
        since = since[since > -_SPAN]
        if not len(since):
            return np.zeros(0), np.zeros(0)
        seconds = np.arange(np.ceil(since.min()), 0.0)
        counts = np.histogram(since, np.append(seconds, 0.0))[0] if len(seconds) else np.zeros(0)
        return seconds + 0.5, counts.astype(np.float64)

    def errors(self, now: float) -> tuple[FloatArray, ...]:
        """Seconds before now, as negative numbers, and each of `ERRORS`."""
        with self._lock:
            rows = np.array(self._rows).reshape(-1, 1 + len(ERRORS))
        rows = rows[rows[:, 0] > now - _SPAN]
        return rows[:, 0] - now, *rows[:, 1:].T


def _finite(value: float) -> float:
    return value if np.isfinite(value) else 0.0
