"""What is exported: the garments of a bag over time, and the body that wore them."""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.garment.colours import Colour, garment_colour
from garment_sim_ros.recording.bags import Recording, read_recording
from garment_sim_ros.recording.replay import Replay
from garment_sim_ros.recording.tracks import ColliderTrack

SKIN_COLOUR: Colour = (0.80, 0.68, 0.60)
_MOST_FRAMES = 100_000
_FARTHEST = 1e4
"""Largest coordinate [m]."""
_ANOTHER_BODY = 0.05
"""Median distance of recorded colliders from a body's [m] above which it is not the one."""
_COMPARED = 10
_NAME = re.compile(r"[a-z][a-z0-9_]*")

Progress = Callable[[Iterable[Any], str, int], Iterable[Any]]


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A mesh over time.

    Attributes:
        name: Of the file or object, ``body`` or ``garments/<name>``.
        triangles: Vertex indices, shape [t, 3].
        colour: As screens take it.
        at: Vertices of a frame in the world, z up [m], shape [v, 3], float32.
    """

    name: str
    triangles: IntArray
    colour: Colour
    at: Callable[[int], FloatArray]


@dataclass(frozen=True, kw_only=True)
class Frames:
    """A recording to export, world, z up.

    Attributes:
        times: Of the frames, from 0 on, increasing [s], shape [m].
        garments: Surfaces by name.
        positions: Of each garment's vertices [m], shape [m, v, 3], float32.
        body: What wore them; None where it is left out.
        joints: World transforms of the body's joints, shape [m, n, 4, 4].
    """

    times: FloatArray
    garments: dict[str, Surface]
    positions: dict[str, Any]
    body: Body | None
    joints: FloatArray

    @property
    def rate(self) -> float:
        """Frames in a second: of the median time between two [Hz]."""
        return 1.0 / float(np.median(np.diff(self.times))) if len(self.times) > 1 else 60.0

    @property
    def uneven(self) -> bool:
        """Whether frames come at other times than a constant rate has them (half a period)."""
        even = np.arange(len(self.times)) / self.rate
        return bool(np.abs(self.times - even).max() > 0.5 / self.rate)

    def surfaces(self) -> Iterator[Surface]:
        """The garments and, posed by its joints, the skin."""
        yield from self.garments.values()
        if self.body is not None:
            skinner = Skinner.of(self.body)
            yield Surface(
                name="body",
                triangles=self.body.skin.triangles,
                colour=SKIN_COLOUR,
                at=lambda k: skinner.vertices(self.joints[k]).astype(np.float32),
            )


def read_frames(
    path: Path,
    body: Body | None,
    *,
    rate: float | None = None,
    progress: Progress = lambda items, text, total: items,
) -> Frames:
    """Read a bag for export.

    Args:
        path: A rosbag2 folder.
        body: The avatar that was recorded; None leaves it out.
        rate: Frames in a second [Hz], linear between recorded ones; None takes these as they are.
        progress: Passes items on and shows how far it is: a text, and of a total.

    Raises:
        InputFileError: The bag cannot be read, has nothing to export, or another body's colliders.
    """
    recording = read_recording(path, most_frames=_MOST_FRAMES, dressed=False)
    _check(path, recording, body)
    stamps = recording.stamp
    positions = {name: track.positions for name, track in recording.garments.items()}
    if rate is not None:
        count = int(1e-9 * (int(stamps[-1]) - int(stamps[0])) * rate + 1e-6) + 1
        at = stamps[0] + np.rint(np.arange(count) * (1e9 / rate)).astype(np.int64)
        positions = {name: _between(stamps, x, at) for name, x in positions.items()}
        stamps = at
    joints = np.zeros((len(stamps), 0, 4, 4))
    if body is not None:
        replay = Replay(recording, body)
        joints = np.array(
            [replay.joints(int(s)).copy() for s in progress(stamps, "posing", len(stamps))]
        )
        if recording.colliders is not None:
            _check_body(path, recording.colliders, body, stamps, joints)
    return Frames(
        times=1e-9 * (stamps - stamps[0]),
        garments={
            name: Surface(
                name=f"garments/{name}",
                triangles=track.triangles,
                colour=garment_colour(number),
                at=positions[name].__getitem__,
            )
            for number, (name, track) in enumerate(recording.garments.items())
        },
        positions=positions,
        body=body,
        joints=joints,
    )


def _check(path: Path, recording: Recording, body: Body | None) -> None:
    """Whether there is something that can be exported, under names that can be files'."""
    if not len(recording.stamp):
        raise InputFileError(path, "has no frame of all garments", "needed: one at least")
    if not recording.garments and body is None:
        raise InputFileError(path, "has no garments", "needed: garments, or a body")
    for name, track in recording.garments.items():
        if not _NAME.fullmatch(name):
            raise InputFileError(
                path, f"has a garment named {name!r}", "allowed: a to z, 0 to 9 and _"
            )
        # Not a number compares as false.
        if not np.abs(track.positions).max() < _FARTHEST:
            raise InputFileError(
                path, f"{name} is not finite or too far", f"allowed: up to {_FARTHEST:g} m"
            )


def _between(stamps: Any, positions: Any, at: Any) -> Any:
    """Positions at other times [ns], linear between frames, shape [len(at), v, 3], float32."""
    after = np.clip(np.searchsorted(stamps, at), 1, max(len(stamps) - 1, 1))
    out = np.empty((len(at), *positions.shape[1:]), np.float32)
    for k, (stamp, j) in enumerate(zip(at, after)):
        if len(stamps) == 1:
            out[k] = positions[0]
            continue
        part = float(stamp - stamps[j - 1]) / float(stamps[j] - stamps[j - 1])
        out[k] = positions[j - 1] + np.float32(part) * (positions[j] - positions[j - 1])
    return out


def _check_body(
    path: Path, track: ColliderTrack, body: Body, stamps: Any, joints: FloatArray
) -> None:
    """Whether a body's colliders would be where those were that were recorded."""
    needed = "needed: --body with the one that was recorded, or none"
    try:
        poser = ColliderPoser(track.colliders, body)
    except GeometryError as error:
        raise InputFileError(path, f"was recorded with another body ({error})", needed) from None
    apart = []
    for k in np.unique(np.linspace(0, len(stamps) - 1, _COMPARED).astype(int)):
        poses = track.at(int(stamps[k]))
        if poses is not None:
            d = poser.poses(joints[k]).position - poses.position
            apart.append(np.sqrt((d * d).sum(axis=1)))
    if apart and (median := float(np.median(np.concatenate(apart)))) > _ANOTHER_BODY:
        raise InputFileError(
            path, f"was recorded with another body, {100 * median:.0f} cm from this one", needed
        )
