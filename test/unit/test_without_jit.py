"""Kernels as plain Python: what compiled code reads beyond an array's end is an error there."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
TWINS = [
    REPOSITORY / "test" / "property" / f"test_{name}.py"
    for name in (
        *("attached_twins", "cloth_twins", "implicit_twins", "layers_twin", "limit_twins"),
        *("self_collision_twin", "skinning_twin", "step_twins", "xpbd_twins"),
    )
]
"""Those of every step; all twins take three times as long."""


def run(*words):
    return subprocess.run(
        [sys.executable, *words],
        cwd=REPOSITORY,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_kernels_are_then_plain_functions():
    code = """
from garment_sim_ros.geometry.transforms import rotate
from garment_sim_ros.jit import compiled
assert type(rotate).__name__ == "function"
assert compiled(rotate, 0.0) is rotate
"""
    done = run("-c", code)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_twins_agree_without_compiling():
    words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    done = run(*words, *map(str, TWINS))
    assert done.returncode == 0, done.stdout[-3000:]
    assert " skipped" not in done.stdout
