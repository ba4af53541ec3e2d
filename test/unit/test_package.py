"""What pip, rosdep and colcon are told agrees with what the code imports."""

import ast
import configparser
import importlib.util
import re
import sys
from pathlib import Path

import pytest
import yaml
from defusedxml.ElementTree import parse

from garment_sim_ros import __version__

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = "garment_sim_ros"

# Import name: (name on the package index, rosdep key).
PIP = {
    "PIL": ("pillow", "python3-pil"),
    "backports": ("backports.zstd", "python3-backports-zstd-pip"),
    "defusedxml": ("defusedxml", "python3-defusedxml"),
    "embreex": ("embreex", "python3-embreex-pip"),
    "llvmlite": ("llvmlite", "python3-llvmlite-pip"),
    "numba": ("numba", "python3-numba-pip"),
    "numpy": ("numpy", "python3-numpy"),
    "rosbags": ("rosbags", "python3-rosbags-pip"),
    "scipy": ("scipy", "python3-scipy"),
    "tqdm": ("tqdm", "python3-tqdm"),
    "trimesh": ("trimesh", "python3-trimesh-pip"),
    "yaml": ("pyyaml", "python3-yaml"),
}
ROS = {
    *("rclpy", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs"),
    *("rcl_interfaces", "rosgraph_msgs", "sensor_msgs", "shape_msgs", "std_msgs", "std_srvs"),
    *("rosidl_parser", "visualization_msgs"),
}
# Used where they are installed, never required.
OPTIONAL = {
    "launch",
    "launch_ros",
    "ament_index_python",
    "DracoPy",
    "distributed",
    "pxr",
    "tf2_msgs",
    "viser",
}


def imported(*folders: str) -> set[str]:
    """Top-level names that the Python files of `folders` import, without the standard library."""
    names = set()
    for folder in folders:
        for path in (REPOSITORY / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import):
                    names |= {alias.name.split(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and not node.level:
                    names.add(str(node.module).split(".")[0])
    return names - set(sys.stdlib_module_names) - {PACKAGE}


@pytest.fixture(scope="module")
def manifest():
    return parse(REPOSITORY / "package.xml").getroot()


@pytest.fixture(scope="module")
def setup_lists():
    """The module-level lists of setup.py, by name."""
    values = {}
    for node in ast.parse((REPOSITORY / "setup.py").read_text()).body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.List):
            values[node.targets[0].id] = ast.literal_eval(node.value)
    return values


def test_every_import_is_declared(manifest, setup_lists):
    required = {re.match(r"[\w.-]+", text).group() for text in setup_lists["REQUIRES"]}
    keys = {element.text for element in manifest.findall("exec_depend")}
    names = imported(PACKAGE, "launch") - OPTIONAL
    assert names <= set(PIP) | ROS, "add it to setup.py, package.xml and this test"
    for name in names & set(PIP):
        assert PIP[name][0] in required
        assert PIP[name][1] in keys
    assert names & ROS <= keys


def test_nothing_is_declared_in_vain(manifest, setup_lists):
    known = dict(PIP.values())
    required = {re.match(r"[\w.-]+", text).group() for text in setup_lists["REQUIRES"]}
    assert required <= set(known)
    keys = {element.text for element in manifest.findall("exec_depend")}
    assert keys == {known[name] for name in required} | ROS | {"launch", "launch_ros"}


def test_rosdep_file_defines_the_keys_that_need_pip(manifest):
    defined = yaml.safe_load((REPOSITORY / "rosdep.yaml").read_text())
    keys = {element.text for element in manifest.findall("exec_depend")}
    assert set(defined) <= keys
    assert {key for key in keys if key.endswith("-pip")} - set(defined) == {"python3-trimesh-pip"}


def test_manifest_is_one_that_colcon_takes(manifest):
    # catkin_pkg's pattern; an address that does not match makes colcon drop to plain Python.
    email = manifest.find("maintainer").get("email")
    assert re.fullmatch(r"[-a-zA-Z0-9_%+.]+@[-a-zA-Z0-9%.]+\.[a-zA-Z]{2,}", email)
    assert manifest.get("format") == "3"
    assert manifest.findtext("name") == PACKAGE
    assert manifest.findtext("export/build_type") == "ament_python"
    assert manifest.findtext("license") == "Apache-2.0"
    version = re.search(r'version="([^"]+)"', (REPOSITORY / "setup.py").read_text()).group(1)
    assert manifest.findtext("version") == version == __version__


def test_executables_are_where_ros2_run_looks():
    config = configparser.ConfigParser(interpolation=None)
    config.read(REPOSITORY / "setup.cfg")
    assert config["develop"]["script_dir"] == f"$base/lib/{PACKAGE}"
    assert config["install"]["install_scripts"] == f"$base/lib/{PACKAGE}"
    entries = re.findall(r'"[\w.-]+ = ([\w.]+):main"', (REPOSITORY / "setup.py").read_text())
    assert entries
    missing = [name for name in entries if importlib.util.find_spec(name) is None]
    assert not missing


def test_licence_is_whole():
    text = (REPOSITORY / "LICENSE").read_text()
    assert "Apache License" in text
    assert "END OF TERMS AND CONDITIONS" in text
