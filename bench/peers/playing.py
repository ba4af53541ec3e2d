"""Plays a scene with one simulator, in that simulator's own environment: needs numpy alone.

Each peer is a script that calls `main` with a function which makes its cloth. What a frame takes
is processor time of the whole process, over F (three sweeps of plain C, `springs.c`) measured
between frames; both go to the result, with the positions of every frame.
"""

import argparse
import ctypes
import json
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Protocol

import numpy as np

MOST, LOOKED = 40.0, 10
"""Longest processor time of a run [s]; one whose first frames foretell more ends after these."""


class Cloth(Protocol):
    """One simulator with the scene in it."""

    def step(self, n: int) -> None:
        """Go on by one frame, to the shape's pose number n."""

    def positions(self) -> np.ndarray:
        """Where the vertices are [m], shape [v, 3], z up."""


def load(path: Path) -> SimpleNamespace:
    """A scene of `scenes.py`: arrays as arrays, numbers as numbers."""
    with np.load(path) as file:
        values = {k: file[k] if file[k].ndim else file[k].item() for k in file.files}
    return SimpleNamespace(**values)


def rotated(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors turned by a quaternion (x, y, z, w), shape [v, 3]."""
    u = 2.0 * np.cross(q[:3], v)
    return v + q[3] * u + np.cross(q[:3], u)


def pinned(scene: SimpleNamespace, n: int, part: float = 1.0) -> np.ndarray:
    """Where pins are at pose n, or a part of the way there from the one before, shape [p, 3]."""
    first = scene.vertices[scene.pins] - scene.position[0]
    position, q = pose(scene, n, part)
    return position + rotated(q, first)


def pose(scene: SimpleNamespace, n: int, part: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Position and orientation of the shape, a part of the way from pose n - 1 to n."""
    before = max(n - 1, 0)
    position = (1.0 - part) * scene.position[before] + part * scene.position[n]
    q = (1.0 - part) * scene.orientation[before] + part * scene.orientation[n]
    return position, q / np.linalg.norm(q)


def springs_timed(scene: SimpleNamespace, library: Path) -> Callable[[int], float]:
    """Median time of three C sweeps over some rounds [s], as a function of the rounds."""
    sweep = ctypes.CDLL(str(library)).correct_springs
    arrays = (scene.spring_x, scene.spring_particles, scene.spring_rest, scene.spring_share)
    pointers = [ctypes.c_void_p(a.ctypes.data) for a in arrays]  # the scene keeps the arrays
    counts = ctypes.c_int64(len(scene.spring_rest)), ctypes.c_int64(3)

    def measure(rounds: int) -> float:
        times = []
        for _ in range(rounds):
            start = time.thread_time()
            sweep(*pointers, *counts)
            times.append(time.thread_time() - start)
        return float(np.median(times))

    return measure


def play(scene: SimpleNamespace, cloth: Cloth, library: Path) -> dict[str, np.ndarray]:
    """All frames: positions [m], times and F of each [s]."""
    measure = springs_timed(scene, library)
    measure(40)
    found, times, units = [], [], []
    for n in range(1, scene.frames + 1):
        units.append(measure(3))
        start = time.process_time()
        cloth.step(n)
        times.append(time.process_time() - start)
        found.append(np.array(cloth.positions(), np.float32))
        foretold = np.median(times) * scene.frames if n == LOOKED else 0.0
        if not np.isfinite(found[-1]).all() or max(foretold, sum(times)) > MOST:
            break
    return {"x": np.array(found), "time": np.array(times), "unit": np.array(units)}


def main(make: Callable[..., Cloth], version: str) -> None:
    """Plays what the command line says: scene, settings as JSON, library of F, result."""
    parser = argparse.ArgumentParser()
    parser.add_argument("scene", type=Path)
    parser.add_argument("settings", type=json.loads)
    parser.add_argument("library", type=Path)
    parser.add_argument("result", type=Path)
    options = parser.parse_args()
    scene = load(options.scene)
    settings: dict[str, Any] = options.settings
    found = play(scene, make(scene, **settings), options.library)
    np.savez(options.result, version=version, **found)
