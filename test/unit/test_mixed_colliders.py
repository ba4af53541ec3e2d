"""`fit --method auto`: the tightest kind for each part at equal cost, and no skin left bare."""

import json

import numpy as np
import pytest
import trimesh

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.cli import main as cli
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders import mixed
from garment_sim_ros.colliders.description import load_colliders
from garment_sim_ros.colliders.ellipsoids.ellipsoids import PARTS
from garment_sim_ros.colliders.report.fit_report import skin_distance

BODY = "mannequin:vertices=1500"


@pytest.mark.parametrize("split", [0.005, 0.2])
def test_the_tightest_that_may_is_chosen_and_all_skin_is_covered(split):
    body = load_body(BODY)
    colliders, report = mixed.fit_mixed(body, HullSettings(split=split))
    assert tuple(report["parts"]) == PARTS
    for part in report["parts"].values():
        limit = 1.25 * part["hull"]["cost_ns"]
        able = [k for k in ("hull", "ellipsoid", "capsule") if part[k]["cost_ns"] <= limit]
        assert part["chosen"] == min(able, key=lambda k: part[k]["mean_mm"])
    kinds = {part["chosen"] for part in report["parts"].values()}
    if split == 0.2:
        # With few hulls the head is tighter in capsules, which leave the throat bare.
        assert kinds == {"hull", "capsule"}
        assert report["added"]
        assert report["whole"]["mixed"]["mean_mm"] < report["whole"]["hull"]["mean_mm"]
    assert report["bare"] == 0
    # On the shapes' meshes, which lie a little inside round ones.
    assert skin_distance(body, colliders).max() < 5e-4
    assert sum(c.kind == "frame" for c in colliders.colliders) > 10


def test_command_says_what_each_part_got(tmp_path, capsys):
    out = tmp_path / "c.json"
    words = ["fit", BODY, "--method", "auto", "--segmentation", "surface", "--max-faces", "60"]
    assert cli.main([*words, "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    for part in PARTS:
        assert f"\n{part}: " in f"\n{printed}"
    report = json.loads((tmp_path / "c.report.json").read_text())["auto"]
    assert report["query_ns"]["hull"] > 0.0
    assert len(load_colliders(out).colliders) == report["whole"]["mixed"]["shapes"] + sum(
        c.kind == "frame" for c in load_colliders(out).colliders
    )


def test_what_is_no_human_is_one_part(tmp_path):
    path = tmp_path / "cube.obj"
    trimesh.creation.box((1.0, 1.0, 1.0)).subdivide().subdivide().export(path)
    colliders, report = mixed.fit_mixed(load_body(path))
    assert list(report["parts"]) == ["body"]
    assert report["parts"]["body"]["chosen"] == "hull"
    assert any("human" in text for text in report["assumed"])
    assert report["bare"] == 0
    assert np.isfinite(colliders.colliders[0].position).all()
