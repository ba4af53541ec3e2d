"""`fit` writes colliders that read back, a report that adds up, and a picture."""

import json
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.cli import main as cli
from garment_sim_ros.colliders.description import load_colliders
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.report.fit_report import fit_report, skin_distance
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.params import ColliderOptions


def test_fit_writes_colliders_report_and_picture(tmp_path, capsys):
    out, picture = tmp_path / "c.json", tmp_path / "sub" / "c.png"
    words = ["fit", "mannequin", "--out", str(out), "--preview", str(picture), "--json"]
    assert cli.main(words) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    colliders = load_colliders(out)
    report = json.loads((tmp_path / "c.report.json").read_text())
    assert sum(report["colliders"].values()) == len(colliders)
    assert report["colliders"]["frame"] == len(report["regions"])
    assert sum(r["vertices"] for r in report["regions"].values()) == report["vertices"]
    assert summary["outside_mm_max"] == report["outside_mm_max"]
    assert report["outside_mm_max"] == max(r["outside_mm_max"] for r in report["regions"].values())
    assert report["outside_share"] < 0.1
    assert np.asarray(Image.open(picture)).std() > 10.0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c.json", "c.report.json", "sub"]


def test_hulls_leave_no_skin_outside_and_are_reported_one_by_one(tmp_path, capsys):
    out, picture = tmp_path / "h.json", tmp_path / "h.png"
    words = ["fit", "mannequin:vertices=1500", "--method", "hull", "--max-faces", "60", "--json"]
    words += ["--delta", "0.004", "--out", str(out), "--preview", str(picture)]
    assert cli.main(words) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert summary["outside_share"] == 0.0
    assert 0.0 < summary["volume_excess"] < 0.5
    assert "shapes" not in summary
    report = json.loads((tmp_path / "h.report.json").read_text())
    furthest = max(s.get("to_skin_mm_max", 0.0) for s in report["shapes"].values())
    assert furthest == report["collider_to_skin_mm_max"]
    colliders = load_colliders(out)
    hulls = [c for c in colliders.colliders if c.kind == "hull"]
    assert len(hulls) == sum(s["kind"] == "hull" for s in report["shapes"].values()) > 14
    for hull in hulls:
        told = report["shapes"][hull.name]
        assert told["faces"] == len(hull.geometry["faces"]) <= 90
        assert told["outside"] == 0
        if "to_skin_mm_max" in told:  # not within others altogether
            assert told["to_skin_mm_mean"] < told["to_skin_mm_max"]
        assert told["map"]["mean"] < told["map"]["longest"] < told["faces"]
    assert np.asarray(Image.open(picture)).std() > 10.0


@pytest.mark.parametrize("words", [["--delta", "-1"], ["--max-faces", "3"], ["--split", "x"]])
def test_hull_options_out_of_range_are_usage_errors(tmp_path, capsys, words):
    out = tmp_path / "h.json"
    arguments = ["fit", "mannequin", "--method", "hull", "--out", str(out), *words]
    with pytest.raises(SystemExit, match="2"):
        sys.exit(cli.main(arguments))
    assert "allowed" in (told := capsys.readouterr().err) or "invalid" in told
    assert not out.exists()


def test_distance_is_that_to_the_nearest_surface():
    body = load_body("mannequin")
    joint = body.rig.joint_names[0]
    centre = np.linalg.inv(body.skin.T_bone_bind)[0, :3, 3]
    ball = Collider(name="ball", kind="sphere", bone=joint, geometry={"radius": 0.5})
    distance = skin_distance(body, ColliderSet(colliders=(ball,)))
    expected = np.linalg.norm(body.skin.vertices - centre, axis=1) - 0.5
    assert distance == pytest.approx(expected, abs=1e-3)
    report = fit_report(body, ColliderSet(colliders=(ball,)))
    assert report["outside_mm_max"] == pytest.approx(1e3 * distance.max(), abs=0.1)


@pytest.mark.parametrize(
    "collider",
    [
        Collider(name="s", kind="sphere", bone="b", geometry={"radius": 0.2}),
        Collider(
            name="c",
            kind="capsule",
            bone="b",
            geometry={"radius0": 0.1, "radius1": 0.2, "length": 0.5},
        ),
    ],
)
def test_surface_is_closed_and_outward(collider):
    vertices, triangles = surface(collider)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    volume = (np.cross(a, b) * c).sum() / 6.0
    g = collider.geometry
    if collider.kind == "sphere":
        expected = 4.0 / 3.0 * np.pi * g["radius"] ** 3
        assert volume == pytest.approx(expected, rel=0.03)
    else:
        assert volume > np.pi * g["length"] / 3.0 * (0.1**2 + 0.1 * 0.2 + 0.2**2) * 0.97
    edges = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    )
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def test_interrupt_leaves_nothing(tmp_path):
    code = (
        "import sys; from garment_sim_ros.cli import fit, main\n"
        "def stop(*a): raise KeyboardInterrupt\n"
        "fit.fit_report = stop\n"
        "sys.exit(main.main(sys.argv[1:]))"
    )
    words = ["fit", "mannequin", "--out", str(tmp_path / "a" / "c.json")]
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, check=False)
    assert done.returncode == 130
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("method", ["hull", "capsule", "sphere", "ellipsoid", "sdf", "mesh"])
def test_fits_what_the_node_fits(method, tmp_path):
    """The same options give the same geometry, `delta` included."""
    words = ["--method", method, "--delta", "0.006", "--voxel", "0.03", "--max-ellipsoids", "20"]
    out = tmp_path / "c.json"
    assert cli.main(["fit", "mannequin:vertices=1000", *words, "--out", str(out)]) == 0
    plural = method if method in ("sdf", "mesh") else f"{method}s"
    options = ColliderOptions(method=plural, delta=0.006, voxel=0.03, max_ellipsoids=20)
    expected = fit_colliders(load_body("mannequin:vertices=1000"), options)
    assert load_colliders(out).revision == expected.revision


def test_methods_in_both_spellings_and_options_that_do_nothing(tmp_path, capsys):
    written = {}
    for method in ("sphere", "spheres"):
        out = tmp_path / f"{method}.json"
        words = ["fit", "mannequin:vertices=1000", "--method", method, "--out", str(out)]
        assert cli.main([*words, "--voxel", "0.02"]) == 0
        assert "voxel: found 0.02, which does nothing; it acts with method sdf" in (
            capsys.readouterr().out
        )
        written[method] = out.read_bytes()
    assert written["sphere"] == written["spheres"]
