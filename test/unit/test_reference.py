"""The reference is built from docstrings without a warning."""

import os
import subprocess
import sys

import pytest

pytest.importorskip("pdoc")


def test_public_names_are_documented(tmp_path):
    words = ["-W", "error::UserWarning", "-m", "pdoc", "--docformat", "google"]
    done = subprocess.run(
        [sys.executable, *words, "--output-directory", str(tmp_path), "garment_sim_ros"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Warn" not in done.stderr
    page = (tmp_path / "garment_sim_ros.html").read_text()
    for name in ("Avatar.play", "Garment.sheet", "ColliderSet.of", "Simulation.step", "load_clip"):
        assert f'id="{name}"' in page
