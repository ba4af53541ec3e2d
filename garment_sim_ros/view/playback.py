"""A recording as a source of frames: played, paused and scrubbed."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.recording.metrics import GarmentMesh
from garment_sim_ros.recording.shown import Shown, read_shown
from garment_sim_ros.view.frame import Cloth, Frame

_MOST_FRAMES = 36_000
_MOST_BYTES = 2**30
_FARTHEST = 1e6
"""Largest coordinate [m]."""
_MOST_STRAINS = 200
_STRAIN_BUDGET = 2_000_000
"""Vertices, over all frames, of which the strain is worked out at the start."""
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


class Playback:
    """Frames of a bag at a time that goes on, stands, or is set.

    Args:
        path: A rosbag2 folder.
        body: The body that was recorded; empty leaves it out.
        bone_names: YAML file of its bones' names.
        shown: What is in it, where that is read already.

    Attributes:
        cloths: As recorded.
        colliders: As recorded.
        duration: From the first frame to the last [s].
        time: The present, 0 to `duration` [s].
        playing: Whether it goes on by itself.
        speed: Of playing, as a multiple of real time.

    Raises:
        InputFileError: The bag cannot be read, or has no garments.
    """

    def __init__(
        self, path: Path, body: str = "", bone_names: str = "", shown: Shown | None = None
    ) -> None:
        if shown is None:
            shown = read_shown(path, most_frames=_MOST_FRAMES, most_bytes=_MOST_BYTES)
        if not len(shown.stamp):
            raise InputFileError(path, "has no frame of all garments", "needed: one at least")
        for name, track in shown.garments.items():
            # Not a number compares as false.
            if not np.abs(track.positions).max(initial=0.0) < _FARTHEST:
                raise InputFileError(
                    path, f"{name} is not finite or too far", f"allowed: up to {_FARTHEST:g} m"
                )
        self.shown = shown
        self._body = (body, bone_names) if body else None
        self.cloths: Mapping[str, Cloth] = {
            name: Cloth(
                vertices=shown.garments[name].vertices, triangles=shown.garments[name].triangles
            )
            for name in _in_order(shown)
        }
        self.colliders: ColliderSet | None = (
            None if shown.colliders is None else shown.colliders.colliders
        )
        self.duration = 1e-9 * float(shown.stamp[-1] - shown.stamp[0])
        self.time = 0.0
        self.playing = True
        self.speed = 1.0
        self._given = -1

    def advance(self, seconds: float) -> None:
        """Let time pass; at the end it begins again."""
        if self.playing and self.duration > 0.0 and math.isfinite(seconds):
            self.time = (self.time + self.speed * max(seconds, 0.0)) % self.duration

    def seek(self, time: float) -> None:
        """Set the time [s]; what is no number changes nothing."""
        if math.isfinite(time):
            self.time = min(max(time, 0.0), self.duration)

    def frame(self) -> Frame | None:
        """The last frame up to the present, None where it was given before."""
        stamps = self.shown.stamp
        now = int(stamps[0]) + round(1e9 * self.time)
        k = max(int(np.searchsorted(stamps, now, side="right")) - 1, 0)
        if k == self._given:
            return None
        self._given = k
        stamp = int(stamps[k])
        track = self.shown.colliders
        return Frame(
            stamp=stamp,
            positions={name: self.shown.garments[name].positions[k] for name in self.cloths},
            poses=None if track is None else track.at(stamp),
            quality=self._figures(stamp),
        )

    def body(self) -> tuple[str, str] | None:
        """As given."""
        return self._body

    def words(self) -> str:
        """Where the present is."""
        return f"{self.time:.2f} of {self.duration:.2f} s"

    def rates(self) -> tuple[FloatArray, FloatArray]:
        """Time [s] and rate of the recorded frames [Hz], second by second."""
        arrival = min((t.arrival for t in self.shown.garments.values()), key=len)
        since = 1e-9 * (arrival - arrival[0])
        counts = np.bincount(since.astype(np.int64)) if len(since) else np.zeros(0)
        whole = counts[:-1] if len(counts) > 1 else counts
        seconds: FloatArray = np.arange(0.5, len(whole))
        return seconds, whole.astype(np.float64)

    def errors(self, key: str) -> tuple[FloatArray, FloatArray]:
        """Time [s] and largest value of a figure over the garments, frame by frame.

        Where the strain was not recorded it is worked out, at fewer frames.
        """
        if key == "strain_p95" and not any(key in keys for keys in self.shown.quality.values()):
            return self._strain()
        times = 1e-9 * (self.shown.quality_stamp - self.shown.stamp[0])
        rows = [keys[key] for keys in self.shown.quality.values() if key in keys]
        if not rows or not len(times):
            return np.zeros(0), np.zeros(0)
        return times, np.max(np.nan_to_num(rows), axis=0)

    def _strain(self) -> tuple[FloatArray, FloatArray]:
        """Time [s] and 95th percentile of the edges' strain, the largest of the garments'."""
        meshes = {
            name: GarmentMesh.from_rest(cloth.vertices, cloth.triangles)
            for name, cloth in self.cloths.items()
        }
        size = sum(mesh.vertices for mesh in meshes.values())
        count = min(max(_STRAIN_BUDGET // size, 2), _MOST_STRAINS, len(self.shown.stamp))
        chosen = np.unique(np.linspace(0, len(self.shown.stamp) - 1, count).astype(np.int64))
        strain: FloatArray = np.zeros(len(chosen))
        with np.errstate(divide="ignore", invalid="ignore"):  # an edge without length
            for row, k in enumerate(chosen):
                strain[row] = max(
                    np.percentile(
                        np.nan_to_num(
                            mesh.strain(self.shown.garments[name].positions[k].astype(np.float64))
                        ),
                        95.0,
                    )
                    for name, mesh in meshes.items()
                )
        times: FloatArray = 1e-9 * (self.shown.stamp[chosen] - self.shown.stamp[0])
        return times, strain

    def _figures(self, stamp: int) -> dict[str, dict[str, float]]:
        times = self.shown.quality_stamp
        k = int(np.searchsorted(times, stamp, side="right")) - 1
        if k < 0:
            return {}
        return {
            name: {key: float(values[k]) for key, values in keys.items()}
            for name, keys in self.shown.quality.items()
        }


def _in_order(shown: Shown) -> list[str]:
    """Names of the garments, inner ones first as far as `quality` tells."""
    told = [name for name in shown.quality if name in shown.garments]
    return told + sorted(set(shown.garments) - set(told))
