"""Surfaces that are hard or wrong: a report that says so, or an error, never a silent guess."""

import json

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.cli import main as cli
from garment_sim_ros.colliders.ellipsoids.thresholds import REGIONS
from garment_sim_ros.colliders.segmentation.segmentation import segment
from garment_sim_ros.errors import GeometryError


def with_arms_down(body):
    """The skin with both arms nearly at its sides."""
    T = rest_transforms(body.rig)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        root = body.rig.index(body.humanoid[f"{side}UpperArm"])
        a = -sign * np.radians(35.0)
        R = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        pivot, below = T[root, :3, 3].copy(), {root}
        for j in range(root, len(T)):
            if j == root or int(body.rig.parent[j]) in below:
                below.add(j)
                T[j, :3, :3] = R @ T[j, :3, :3]
                T[j, :3, 3] = R @ (T[j, :3, 3] - pivot) + pivot
    return skin_vertices(body.skin, T).astype(np.float64)


def numbers_of(*words):
    return [i for i, name in enumerate(REGIONS) if any(w in name for w in words)]


@pytest.mark.parametrize(("sides", "share"), [("", 1.0), ("left", 1.0), ("", 0.05)])
def test_arms_fused_to_the_body(sides, share):
    """Triangles between arms and trunk, all along or here and there, as scans have them."""
    body = load_body("mannequin:vertices=4000")
    x, t = with_arms_down(body), body.skin.triangles
    region = segment(x, t).region
    arm = numbers_of(f"{sides}_forearm", f"{sides}_upper_arm") if sides else numbers_of("arm")
    trunk = np.flatnonzero(np.isin(region, numbers_of("chest", "waist", "hip", "thigh")))
    on_arm = t[np.isin(region[t], arm).all(axis=1)]
    distance, nearest = cKDTree(x[trunk]).query(x[on_arm[:, 0]])
    near = np.flatnonzero(distance < 0.05)
    near = near[np.random.default_rng(0).uniform(size=len(near)) < share]
    assert len(near) > 5
    web = np.stack([on_arm[near, 0], on_arm[near, 1], trunk[nearest[near]]], axis=1)
    with pytest.raises(GeometryError, match="Arms fused"):
        segment(x, np.concatenate([t, web.astype(np.int32)]))


@pytest.mark.parametrize("cell", [0.05, 0.09, 0.14])
def test_about_a_hundred_vertices(cell):
    """All vertices of a cell in one: the same regions about, a doubt, or an error."""
    body = load_body("mannequin:vertices=2000")
    x, t = body.skin.vertices, body.skin.triangles
    _, number = np.unique(np.round(x / cell), axis=0, return_inverse=True)
    number = number.reshape(-1)
    count = np.bincount(number)[:, None]
    coarse = np.stack([np.bincount(number, x[:, k]) for k in range(3)], axis=1) / count
    kept = number[t]
    kept = kept[
        (kept[:, 0] != kept[:, 1]) & (kept[:, 1] != kept[:, 2]) & (kept[:, 2] != kept[:, 0])
    ]
    assert len(coarse) < 800
    try:
        result = segment(coarse, kept.astype(np.int32))
    except GeometryError:
        return
    same = (result.region[number] == segment(x, t).region).mean()
    doubt = result.confidence < 0.5 or result.report()["assumed"]
    assert same > 0.75 or doubt


@pytest.mark.slow  # about a minute
def test_a_million_vertices():
    body = load_body("mannequin:vertices=4000")
    x, t = body.skin.vertices, body.skin.triangles
    for _ in range(4):
        x, t = trimesh.remesh.subdivide(x, t)
    assert len(x) > 1_000_000
    fine = segment(x, t.astype(np.int32))
    base = segment(body.skin.vertices, body.skin.triangles)
    # Subdivision keeps the vertices and puts new ones after them.
    assert (fine.region[: len(base.region)] == base.region).mean() > 0.98


@pytest.mark.parametrize(("scale", "unit"), [(100.0, "centimetre"), (1000.0, "millimetre")])
def test_units_are_taken_from_the_height_and_said(scale, unit, tmp_path, capsys):
    body = load_body("mannequin:vertices=1500")
    path, out = tmp_path / "body.obj", tmp_path / "c.json"
    mesh = trimesh.Trimesh(scale * body.skin.vertices, body.skin.triangles, process=False)
    mesh.export(path)
    words = ["fit", str(path), "--method", "ellipsoids", "--max-ellipsoids", "20"]
    assert cli.main([*words, "--out", str(out)]) == 0
    report = json.loads((tmp_path / "c.report.json").read_text())
    assert any(unit in note for note in report["assumed"])
    assert f"unit taken as {unit}" in capsys.readouterr().out
    height = report["ellipsoid_fit"]["segmentation"]["height_m"]
    assert height == pytest.approx(np.ptp(body.skin.vertices[:, 2]), rel=1e-3)


def test_no_unit_fits_and_several_bodies_are_errors(tmp_path, capsys):
    body = load_body("mannequin:vertices=1500")
    x, t = body.skin.vertices, body.skin.triangles
    for vertices, triangles, named in (
        (0.01 * x, t, "unit"),
        (
            np.concatenate([x, x + np.array([0.0, 1.5, 0.0])]),
            np.concatenate([t, t + len(x)]),
            "several bodies",
        ),
    ):
        path = tmp_path / "body.obj"
        trimesh.Trimesh(vertices, triangles, process=False).export(path)
        words = ["fit", str(path), "--method", "ellipsoids", "--out", str(tmp_path / "c.json")]
        assert cli.main(words) == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1
        assert named in lines[0]
    assert not (tmp_path / "c.json").exists()
