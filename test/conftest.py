"""Fixtures that all tests share."""

import importlib
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.params import Material

_LONGEST_NAME = 60
REPOSITORY = Path(__file__).resolve().parents[1]


def pytest_configure(config: pytest.Config) -> None:
    """Hear SIGINT, and so do the processes that tests start; let files be spread in our order.

    A runner in the background of a shell ignores SIGINT, and what it starts would, too. And
    pytest-xdist would begin with the files of most tests, which are not those that take longest.
    """
    config.option.loadscopereorder = False
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One more than cores, 4 at most: tests with nodes wait as often as they work."""
    return min(4, len(os.sched_getaffinity(0)) + 1)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the files with nodes evenly among the others, which begin with the longest.

    Tests with nodes wait as often as they work. Two of them at once wait for the same kernels to
    be compiled, and take each other's processors where they simulate in real time.
    """
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    nodes = [file for file in files if "ros" in file.parts]
    others = [file for file in files if "ros" not in file.parts]
    others.sort(key=lambda file: "verification" not in file.parts)
    place = {file: n / len(nodes) for n, file in enumerate(nodes)}
    place |= {file: (n + 0.5) / len(others) for n, file in enumerate(others)}
    items[:] = [item for file in sorted(files, key=place.__getitem__) for item in files[file]]


def pytest_make_parametrize_id(val: object) -> str | None:
    """Short names for long values: whole files, 50,000 brackets."""
    if isinstance(val, str | bytes) and len(val) > _LONGEST_NAME:
        return f"{val[:_LONGEST_NAME]!a}..."
    return None


@pytest.fixture(scope="session")
def data_file() -> Callable[..., Path]:
    """Path of a real data file, `data_file("bodies", "x.glb")`; skips the test where absent."""
    root = Path(os.environ.get("GARMENT_SIM_DATA") or REPOSITORY.parent / "shared" / "data")

    def data_file(*parts: str) -> Path:
        path = root.joinpath(*parts)
        if not path.exists():
            pytest.skip(f"{'/'.join(parts)} is not in {root}; set GARMENT_SIM_DATA")
        return path

    return data_file


@pytest.fixture(scope="session")
def bench() -> Callable[[str], ModuleType]:
    """A module of the benches, which are no package, by name; skips the test without them."""
    folder = REPOSITORY / "bench"
    if not folder.is_dir():
        pytest.skip("no bench")

    def bench(name: str) -> ModuleType:
        sys.path.insert(0, str(folder))
        try:
            return importlib.import_module(name)
        finally:
            sys.path.remove(str(folder))

    return bench


class Cloth:
    """Small pieces of cloth for tests."""

    @staticmethod
    def grid(rows: int, columns: int, spacing: float = 0.02):
        """A flat cloth in the x-y plane, centred, its quads split one way.

        Returns:
            Vertices [m], shape [rows * columns, 3], row by row along x; triangles.
        """
        x = (np.arange(rows) - (rows - 1) / 2) * spacing
        y = (np.arange(columns) - (columns - 1) / 2) * spacing
        plane = np.meshgrid(x, y, indexing="ij")
        vertices = np.stack([*plane, np.zeros((rows, columns))], axis=-1).reshape(-1, 3)
        index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
        a, b = index[:-1, :-1].ravel(), index[1:, :-1].ravel()
        c, d = index[1:, 1:].ravel(), index[:-1, 1:].ravel()
        return vertices, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])

    @staticmethod
    def tube(radius: float, top: float, length: float, rings: int, around: int):
        """A tube that hangs from a height, closed on itself, its uppermost ring first.

        Returns:
            Vertices [m], shape [rings * around, 3]; triangles.
        """
        angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
        ring = radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
        vertices = np.tile(ring, (rings, 1))
        vertices[:, 2] = top - np.linspace(0.0, length, rings).repeat(around)
        i = np.arange(around)
        j = (i + 1) % around
        two = np.concatenate([np.c_[i, i + around, j], np.c_[j, i + around, j + around]])
        triangles = np.concatenate([two + k * around for k in range(rings - 1)])
        return vertices, triangles.astype(np.int32)

    @staticmethod
    def rod() -> Collider:
        """An upright one, 10 cm in radius, from 0.2 to 1.4 m, on the bone called `bone`."""
        return Collider(
            name="rod",
            kind="capsule",
            bone="bone",
            position=[0.0, 0.0, 0.2],
            orientation=[0.0, 0.0, 0.0, 1.0],
            geometry={"radius0": 0.1, "radius1": 0.1, "length": 1.2},
        )

    @staticmethod
    def garment(vertices, triangles, pins=(), *, name="cloth", frame="bone", **material):
        """A garment that follows one frame, whose rest transform is the identity."""
        values = {"damping": 0.0, "air_drag": 0.0, "friction": 0.0, **material}
        return Garment.from_mesh(
            vertices, triangles, name=name, material=Material(**values), pins=pins, bone=frame
        )

    @staticmethod
    def colliders(*shapes: Collider) -> ColliderSet:
        """The shapes given, after one frame on the bone called `bone`."""
        return ColliderSet(
            colliders=(Collider(name="frame_bone", kind="frame", bone="bone"), *shapes)
        )


@pytest.fixture(scope="session")
def cloth() -> type[Cloth]:
    """Builders of small pieces of cloth."""
    return Cloth
