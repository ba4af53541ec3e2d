"""The examples do what they say; those on real data where there is any."""

import ast
import importlib.util
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SKIRT = {"version": 1, "garments": [{"name": "skirt", "generator": "short_skirt"}]}


def example(name):
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.main


def figures(text):
    return [float(number) for number in re.findall(r"-?\d+\.\d+", text)]


def test_sheet_on_a_ball(capsys):
    simulation = example("sheet_on_a_ball")(seconds=1.5, edge=0.04)
    top, hem = figures(capsys.readouterr().out)
    assert top == pytest.approx(0.152, abs=0.005)
    assert hem < -0.05
    distance = np.linalg.norm(simulation["sheet"].positions, axis=1)
    assert distance.min() > 0.15


def test_flag_in_the_wind(capsys):
    calm = example("flag_in_the_wind")(seconds=1.0, edge=0.08, wind=0.0)
    assert np.abs(calm["sheet"].positions[:, 1]).max() < 0.01
    blown = example("flag_in_the_wind")(seconds=1.0, edge=0.08)
    assert blown["sheet"].positions[:, 1].max() > 0.1
    top = blown["sheet"].garment.pins
    np.testing.assert_allclose(blown["sheet"].positions[top][:, 2], 0.2, atol=1e-6)
    assert len(figures(capsys.readouterr().out)) == 2


def test_moving_shapes():
    simulation = example("moving_shapes")(seconds=0.5, edge=0.06)  # half-way the curtain is hit
    curtain = simulation["sheet"]
    x = curtain.positions
    # It ends where it began, on one side; whatever touches it stays outside of it.
    axis = np.array([0.0, -0.3, -0.1])
    away = x - axis
    away[:, 0] = np.maximum(np.abs(x[:, 0]) - 0.4, 0.0)
    assert np.linalg.norm(away, axis=1).min() > 0.05 - 1e-3
    assert np.isfinite(x).all()


def test_dressed_walk(capsys):
    simulation = example("dressed_walk")(seconds=0.1, method="capsules")
    said = capsys.readouterr().out
    assert re.search(r"skirt: fastest .* touch the body", said)
    assert re.search(r"tshirt: fastest .* touch the body", said)
    assert all(garment.health.contacts > 0 for garment in simulation)
    assert simulation.time == pytest.approx(0.1)


def test_collect(tmp_path, capsys):
    out = tmp_path / "walk.npz"
    example("collect")(str(out), seconds=0.1, method="capsules")
    assert "short_skirt_x" in capsys.readouterr().out
    with np.load(out) as arrays:
        x, triangles = arrays["short_skirt_x"], arrays["short_skirt_triangles"]
    assert x.shape == (7, 1687, 3)
    assert triangles.max() == 1686
    assert 0.0 < np.linalg.norm(x[-1] - x[0], axis=1).mean() < 0.3


@pytest.fixture
def body(data_file, tmp_path):
    """A copy: the fit is kept beside it."""
    return str(shutil.copy(data_file("bodies", "mh_female_young.glb"), tmp_path))


def test_own_body_and_motion(body, data_file, capsys):
    clip = str(data_file("mocap", "deepmimic_walk.bvh"))
    simulation = example("own_body_and_motion")(body, clip, SKIRT, seconds=0.1)
    assert "assumed: " in capsys.readouterr().out
    assert simulation.names == ("skirt",)
    assert simulation["skirt"].health.resets == 0


def test_own_garment(body, data_file, capsys):
    mesh = str(data_file("garments", "skirt_short_female.obj"))
    simulation = example("own_garment")(body, mesh, seconds=0.1)
    assert " pinned" in capsys.readouterr().out
    assert simulation["mine"].garment.material.thickness == 0.003  # denim
    assert simulation["mine"].garment.pins.size > 10


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda p: p.stem)
def test_each_is_short_says_how_to_run_it_and_uses_no_private_names(path):
    text = path.read_text()
    assert len(text.splitlines()) < 40
    tree = ast.parse(text)
    assert f"python examples/{path.name}" in ast.get_docstring(tree)
    private = [n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute)]
    assert not [name for name in private if name.startswith("_")]
    imported = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert not [name for name in imported if name.startswith("garment_sim_ros")]
