"""Kernels are compiled anew when anything that they are made of changes, and only then."""

import pytest

from garment_sim_ros.jit import version_of

FILES = {
    "__init__.py": "",
    "jit.py": "kernel = None",
    "constants.py": "from garment_sim_ros.deeper import SIDE\nLENGTH = 2.0 * SIDE",
    "deeper.py": "SIDE = 1.0",
    "shapes/__init__.py": "",
    "shapes/ball.py": "RADIUS = 1.0",
    "kernels.py": (
        "from garment_sim_ros.constants import (\n    LENGTH,\n)\n"
        "from garment_sim_ros.shapes import ball\n@kernel()\ndef f(): ..."
    ),
    "node.py": "from garment_sim_ros.kernels import f\nRATE = 1.0",
}


@pytest.fixture
def package(tmp_path):
    folder = tmp_path / "garment_sim_ros"
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


@pytest.mark.parametrize("name", ["kernels.py", "constants.py", "deeper.py", "shapes/ball.py"])
def test_a_change_of_what_kernels_come_from_is_another_version(package, name):
    """A constant that a kernel takes from a file without kernels, too."""
    before = version_of(package)
    (package / name).write_text(FILES[name] + "\nMORE = 1")
    assert version_of(package) != before
    (package / name).write_text(FILES[name])
    assert version_of(package) == before


def test_a_change_of_what_uses_kernels_is_none(package):
    before = version_of(package)
    (package / "node.py").write_text("RATE = 2.0")
    assert version_of(package) == before


def test_a_file_that_moved_is_another_version(package):
    before = version_of(package)
    (package / "kernels.py").rename(package / "elsewhere.py")
    assert version_of(package) != before
