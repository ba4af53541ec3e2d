"""Subscribers of the examples and documents, beside real nodes."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

from ros_input.collider import nanoseconds

from garment_sim_ros.ros.topics import GARMENT_POINTS

pytestmark = pytest.mark.ros

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE, DOCUMENT = ROOT / "examples" / "subscribe.py", ROOT / "docs" / "rviz.md"
SOURCE = ROOT / "test" / "ros_input" / "listener.cpp"
NAMESPACE = "/example_test"
LOADED = "from rclpy.impl.implementation_singleton import rclpy_implementation"
"""Loads libraries that are elsewhere than ROS 2's."""
OUTFIT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 500}}
"""


@pytest.fixture(scope="module", autouse=True)
def avatar(start_node, tmp_path_factory):
    outfit = tmp_path_factory.mktemp("outfit") / "outfit.yaml"
    outfit.write_text(OUTFIT)
    for name, parameters in (
        ("mocap_player", {}),
        ("collider_node", {"method": "capsules"}),
        ("cloth_node", {"outfit": str(outfit)}),
    ):
        start_node(name, NAMESPACE, **parameters)


def test_garments_arrive_as_arrays():
    words = [sys.executable, str(EXAMPLE), "skirt", "120", "--ros-args", "-r"]
    done = subprocess.run(
        [*words, f"__ns:={NAMESPACE}"], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    frames = re.findall(r"(\d+) ns: 500 vertices about \[(.*)\] m", done.stdout)
    assert len(frames) >= 120
    stamps = [int(stamp) for stamp, _ in frames]
    # On a busy machine a frame may be published again, some times over: never an older one.
    assert stamps == sorted(stamps)
    assert len(set(stamps)) > 1
    assert all(0.3 < float(place.split()[2]) < 1.5 for _, place in frames)
    assert re.search(r"triangles: \(\d{3}, 3\)", done.stdout)


@pytest.fixture(scope="module")
def listener(tmp_path_factory):
    """The documents' subscriber in C++, compiled; all of it but `main`, which needs rclcpp."""
    headers, libraries = Path(sys.prefix) / "include", Path(sys.prefix) / "lib"
    if not (shutil.which("g++") and (headers / "rcl").exists()):
        pytest.skip("no compiler, or no headers of rcl")
    (code,) = re.findall(r"```cpp\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    part = code.partition("int main")[0].replace("#include <rclcpp/rclcpp.hpp>\n", "")
    folder = tmp_path_factory.mktemp("cpp")
    (folder / "message_part.hpp").write_text(part)
    found = [f"-isystem{f}" for f in (headers, *headers.iterdir())]
    supports = ("", "_fastrtps", "_introspection")  # the latter two are asked for by name
    names = ("sensor_msgs", "std_msgs", "builtin_interfaces")
    messages = [f"{name}__rosidl_typesupport{s}_cpp" for name in names for s in supports]
    linked = [f"-l{name}" for name in ("rcl", "rcutils", "rosidl_runtime_c", *messages)]
    warnings = ["-Wall", "-Wextra", "-Werror", "-std=c++17"]
    # A library, as some of ROS 2's own ask for symbols of Python.
    program = [f"-I{folder}", str(SOURCE), "-fPIC", "-shared", "-o", str(folder / "listener.so")]
    paths = [f"-L{libraries}", f"-Wl,-rpath,{libraries}", "-Wl,--no-as-needed"]
    subprocess.run(["g++", *warnings, *found, *program, *paths, *linked], check=True)
    return folder / "listener.so"


def test_subscriber_in_cpp_reads_what_python_reads(listener, make_probe, until):
    probe = make_probe(NAMESPACE)
    name = probe.listen(GARMENT_POINTS, "skirt")
    until(lambda: probe.received(name), "the skirt")
    call = (
        "ctypes.CDLL(sys.argv[1]).main(4, (ctypes.c_char_p * 4)(*map(str.encode, sys.argv[1:])))"
    )
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            f"{LOADED}; import ctypes, sys; {call}",
            listener,
            NAMESPACE,
            name,
            "5",
        ],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    assert len(lines) == 5
    for stamp, height in lines:
        message = until(lambda at=int(stamp): find(probe.received(name), at), f"frame {stamp}")
        z = np.frombuffer(message.data, np.float32).reshape(message.width, -1)[:, 2]
        assert abs(float(height) - z.mean(dtype=np.float64)) < 1e-8


def find(messages, stamp):
    """The message of a time [ns]; None where it is not there."""
    return next((m for m in messages if nanoseconds(m) == stamp), None)
