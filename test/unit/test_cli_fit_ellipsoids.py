"""`fit --method ellipsoids`."""

import json

import numpy as np
import pytest
import trimesh
from PIL import Image

from garment_sim_ros.cli import main as cli
from garment_sim_ros.colliders.description import load_colliders

WORDS = ["fit", "mannequin:vertices=2000", "--method", "ellipsoids", "--max-ellipsoids", "30"]


def test_writes_ellipsoids_and_what_was_assumed(tmp_path, capsys):
    out = tmp_path / "c.json"
    picture = tmp_path / "regions.png"
    words = ["--mu", "left_calf=0.005", "--preview-regions", str(picture), "--out", str(out)]
    assert cli.main([*WORDS, *words, "--json"]) == 0
    colours = np.asarray(Image.open(picture).convert("HSV"))[..., :2].reshape(-1, 2)
    strong = np.unique(colours[colours[:, 1] > 90, 0] // 8)
    assert len(strong) > 10
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("assumed: joints of the rig") for line in lines)
    kinds = [c.kind for c in load_colliders(out).colliders]
    assert kinds.count("ellipsoid") == 30
    report = json.loads((tmp_path / "c.report.json").read_text())
    assert report["ellipsoid_fit"]["segmentation"]["confidence"] > 0.3
    # The report measures on a mesh of each ellipsoid, which lies a little inside it.
    assert report["outside_mm_max"] < 0.5
    assert json.loads(lines[-1])["ellipsoid_fit"]["ellipsoids"] == 30


def test_regions_are_drawn_as_ellipsoids_are_fitted_to_them(tmp_path):
    """The columns of Table 1 and the two kinds of ways give other regions, so other pictures."""
    pictures = []
    for n, words in enumerate(([], ["--sex", "male"], ["--paths", "edges"])):
        picture = tmp_path / f"{n}.png"
        words += ["--segmentation", "table1", "--max-ellipsoids", "15"]
        words += ["--preview-regions", str(picture)]
        assert cli.main([*WORDS, *words, "--out", str(tmp_path / "c.json")]) == 0
        pictures.append(np.asarray(Image.open(picture), int))
    changed = [(abs(p - pictures[0]) > 8).any(axis=2).mean() for p in pictures[1:]]
    assert min(changed) > 1e-3


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--mu", "tail=0.1"], "tail"),
        (["--mu", "head=wide"], "head=wide"),
        (["--mu-torso", "-1"], "mu_torso"),
        (["--max-ellipsoids", "2"], "max_ellipsoids"),
    ],
)
def test_bad_options_exit_2_with_one_line(words, named, tmp_path, capsys):
    assert cli.main([*WORDS, *words, "--out", str(tmp_path / "c.json")]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1
    assert named in error[0]
    assert list(tmp_path.iterdir()) == []


def test_reports_the_skin_outside_over_a_clip(tmp_path, capsys):
    words = ["fit", "mannequin:vertices=1500", "--method", "ellipsoids", "--clip", "walk"]
    out = tmp_path / "c.json"
    assert cli.main([*words, "--max-ellipsoids", "30", "--out", str(out), "--json"]) == 0
    printed = capsys.readouterr().out
    assert "over the clip" in printed
    assert "without refitting" in printed
    motion = json.loads((tmp_path / "c.report.json").read_text())["motion"]
    assert motion["poses"] == 30
    assert 0.0 <= motion["outside_mm_mean"] < motion["static"]["outside_mm_mean"]
    assert motion["outside_mm_max"] <= motion["static"]["outside_mm_max"]
    refitted = [c for c in load_colliders(out).colliders if "points" in c.geometry]
    assert refitted
    assert cli.main([*words, "--no-refit", "--out", str(out)]) == 0
    assert "static" not in json.loads((tmp_path / "c.report.json").read_text())["motion"]


def test_a_missing_clip_is_an_error(tmp_path, capsys):
    words = ["fit", "mannequin:vertices=1500", "--method", "capsules", "--clip", "none.bvh"]
    assert cli.main([*words, "--out", str(tmp_path / "c.json")]) == 2
    assert "none.bvh" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_no_human_is_an_error_and_none_takes_it(tmp_path, capsys):
    path = tmp_path / "cube.obj"
    trimesh.creation.box((1.0, 1.0, 1.0)).subdivide().subdivide().subdivide().export(path)
    words = ["fit", str(path), "--method", "ellipsoids", "--out", str(tmp_path / "c.json")]
    assert cli.main(words) == 2
    assert "human" in capsys.readouterr().err
    assert cli.main([*words, "--segmentation", "none"]) == 0
