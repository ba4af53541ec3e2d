"""The package installs from a fresh checkout: with pip, and with colcon as ament_python."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
EXECUTABLES = {"garment-sim", "mocap_player", "collider_node", "cloth_node"}

pytestmark = pytest.mark.slow


def clean_environment(*first_on_path: Path) -> dict[str, str]:
    """This process's environment without what its own rclpy put there."""
    dropped = {"_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH", "PYTHONPATH", "VIRTUAL_ENV"}
    kept = {key: value for key, value in os.environ.items() if key not in dropped}
    return {**kept, "PATH": os.pathsep.join([*map(str, first_on_path), kept["PATH"]])}


def run(*words, cwd, env=None):
    env = env or clean_environment()
    done = subprocess.run(
        list(map(str, words)), cwd=cwd, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture
def checkout(tmp_path):
    """What git would give to a newcomer, in a colcon workspace."""
    target = tmp_path / "ws" / "src" / "garment_sim_ros"
    listed = run("git", "ls-files", "-co", "--exclude-standard", "-z", cwd=REPOSITORY)
    for name in filter(None, listed.split("\0")):
        if (REPOSITORY / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(REPOSITORY / name, target / name)
    return target


@pytest.fixture
def environment(tmp_path):
    """A bare virtual environment."""
    run(sys.executable, "-m", "venv", tmp_path / "venv", cwd=tmp_path)
    return tmp_path / "venv"


def test_pip_install_with_ros_extra_runs_the_commands(checkout, environment, tmp_path):
    python = environment / "bin" / "python"
    run(python, "-m", "pip", "install", "--quiet", ".[ros]", cwd=checkout)
    assert {p.name for p in (environment / "bin").iterdir()} >= EXECUTABLES
    assert "example:" in run(environment / "bin" / "garment-sim", "--help", cwd=tmp_path)
    run(python, "-c", "import rclpy, garment_sim_ros.ros.cloth_node", cwd=tmp_path)
    outfits = "from garment_sim_ros.garment.outfit_file import *; assert builtin_outfits()"
    run(python, "-c", outfits, cwd=tmp_path)
    share = environment / "share"
    assert (share / "garment_sim_ros" / "package.xml").exists()
    assert (share / "ament_index" / "resource_index" / "packages" / "garment_sim_ros").exists()
    run(python, "-m", "pip", "check", cwd=tmp_path)


@pytest.mark.parametrize("layout", [[], ["--symlink-install"]])
@pytest.mark.parametrize("setuptools", ["68.1.2", "79.0.1"])  # of Ubuntu 24.04; newest for colcon
def test_colcon_builds_it_as_ament_python(checkout, environment, setuptools, layout):
    tools = ["colcon-common-extensions", "colcon-ros", f"setuptools=={setuptools}"]
    run(environment / "bin" / "python", "-m", "pip", "install", "--quiet", *tools, cwd=checkout)
    env = clean_environment(environment / "bin")
    workspace = checkout.parents[1]
    listed = run("colcon", "list", cwd=workspace, env=env)
    assert listed.split() == ["garment_sim_ros", "src/garment_sim_ros", "(ros.ament_python)"]
    run("colcon", "build", *layout, cwd=workspace, env=env)

    prefix = workspace / "install" / "garment_sim_ros"
    assert {p.name for p in (prefix / "lib" / "garment_sim_ros").iterdir()} == EXECUTABLES
    share = prefix / "share"
    assert (share / "ament_index" / "resource_index" / "packages" / "garment_sim_ros").exists()
    assert (share / "garment_sim_ros" / "package.xml").exists()
    for folder, pattern in (("launch", "*.py"), ("config", "*.*")):
        for path in (REPOSITORY / folder).glob(pattern):
            assert (share / "garment_sim_ros" / folder / path.name).exists()
    call = "source install/setup.bash && install/garment_sim_ros/lib/garment_sim_ros/garment-sim"
    assert "example:" in run("bash", "-c", f"{call} --help", cwd=workspace, env=env)
