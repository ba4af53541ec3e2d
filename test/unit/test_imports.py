"""The layers of the package, and that it is usable without ROS."""

import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


def test_imports_go_one_way():
    pytest.importorskip("importlinter")  # comes with the checks, not with the tests
    cli = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports())"
    done = subprocess.run(
        [sys.executable, "-c", cli], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_modules_outside_ros_do_not_load_rclpy():
    code = """
import importlib, pkgutil, sys, garment_sim_ros
for module in pkgutil.walk_packages(garment_sim_ros.__path__, "garment_sim_ros."):
    if not module.name.startswith("garment_sim_ros.ros"):
        importlib.import_module(module.name)
assert "rclpy" not in sys.modules and "std_msgs" not in sys.modules
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_benches_find_what_they_import():
    """In one process, without running any of them."""
    benches = sorted(path.stem for path in (REPOSITORY / "bench").glob("*.py"))
    code = "import sys; sys.path.insert(0, sys.argv[1])\n" + "\n".join(
        f"import {name}" for name in benches
    )
    command = [sys.executable, "-c", code, str(REPOSITORY / "bench")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-500:]
