"""The command `dress`: what it writes, and what it says of what it cannot use."""

import json
import re

import numpy as np
import pytest
import yaml

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.cli.main import main
from garment_sim_ros.garment.mesh import load_garment_mesh
from garment_sim_ros.sim.simulation import Simulation


def test_a_skirt_is_sewn_written_and_worn(tmp_path, capsys):
    out = tmp_path / "new" / "skirt.yaml"
    assert (
        main(
            [
                "dress",
                "--garment",
                "short_skirt",
                "--edge-length",
                "0.05",
                "--steps",
                str(tmp_path / "steps.png"),
                "--out",
                str(out),
                "--json",
            ]
        )
        == 0
    )
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    figures = said["garments"]["short_skirt"]
    assert figures["panels"] == 2
    assert figures["pierced"] == 0.0
    assert sorted(p.name for p in out.parent.iterdir()) == [
        "skirt.png",
        "skirt.yaml",
        "skirt_short_skirt.glb",
    ]
    assert (tmp_path / "steps.png").read_bytes().startswith(b"\x89PNG")
    content = yaml.safe_load(out.read_text())
    assert content["garments"][0]["mesh"] == "skirt_short_skirt.glb"  # relative
    mesh = load_garment_mesh(out.parent / "skirt_short_skirt.glb")
    assert len(mesh.vertices) == figures["vertices"]
    avatar = Avatar.load("mannequin")
    outfit = avatar.dress(str(out))
    (garment,) = outfit.garments
    assert garment.flat is not None
    simulation = Simulation(outfit, avatar.colliders)
    simulation.step(avatar.poses())
    moved = np.abs(simulation["short_skirt"].positions - mesh.vertices).max()
    assert moved < 0.05  # it was at rest there


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--garment", "cape"], "--garment: found 'cape'"),
        (["--garment", "tshirt", "--garment", "tshirt"], "given twice"),
        (["--garment", "tshirt", "--edge-length", "3"], "edge_length.*larger than panel"),
        (["--garment", "tshirt", "--edge-length", "-1"], "edge_length"),
        (["--garment", "tshirt", "--body", "nobody.glb"], "nobody.glb"),
        (["--garment", "tshirt", "--shortest-edge", "0.01"], "--shortest-edge: given without a"),
        (["--garment", "tshirt", "--unit", "cm"], "--unit: given without a mesh"),
        (["--garment", "tshirt", "--made-on", "mannequin"], "--made-on: given without a mesh"),
        (["--garment", "tshirt", "--deviation", "0.01"], "--deviation: given without --shortest"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_line(tmp_path, capsys, arguments, words):
    out = tmp_path / "outfit.yaml"
    assert main(["dress", *arguments, "--out", str(out)]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert re.search(words, said[-1])
    assert said[-1].startswith("error: ")
    assert not list(tmp_path.iterdir())


def far_pattern(data_file, folder):
    """A shirt that is 3 m beside the body."""
    content = json.loads(data_file("patterns", "shirt_mean_specification.json").read_text())
    for panel in content["pattern"]["panels"].values():
        panel["translation"][0] += 300.0
    file = folder / "far.json"
    file.write_text(json.dumps(content))
    return file


def test_a_pattern_that_is_not_for_the_body_is_named_with_its_file(tmp_path, capsys, data_file):
    """Also where that is seen after it was read."""
    file = far_pattern(data_file, tmp_path)
    assert main(["dress", "--garment", str(file), "--out", str(tmp_path / "o.yaml")]) == 2
    (said,) = capsys.readouterr().err.strip().splitlines()
    assert said.startswith(f"error: {file}: pattern 'far': panel 'left_btorso' is ")
    assert [p.name for p in tmp_path.iterdir()] == ["far.json"]


def test_a_body_that_lies_down_is_told_with_what_does_not_fit(tmp_path, capsys, data_file):
    body = load_body("mannequin:vertices=1500").skin
    lying = body.vertices[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
    lines = ["v {:.5f} {:.5f} {:.5f}".format(*x) for x in lying.tolist()]
    lines += ["f {} {} {}".format(*corners) for corners in (body.triangles + 1).tolist()]
    (tmp_path / "lying.obj").write_text("\n".join(lines))
    file = far_pattern(data_file, tmp_path)
    dress = ["dress", "--body", str(tmp_path / "lying.obj"), "--garment", str(file)]
    assert main([*dress, "--out", str(tmp_path / "o.yaml")]) == 2
    (said,) = capsys.readouterr().err.strip().splitlines()
    assert said.startswith(f"error: {file}: ")
    assert re.search("; and the body cannot be measured: lying.*allowed: a body that stands", said)


def test_the_outfit_is_a_yaml_file(tmp_path, capsys):
    assert main(["dress", "--garment", "tshirt", "--out", str(tmp_path / "a.png")]) == 2
    assert "allowed: a .yaml file" in capsys.readouterr().err


def test_a_mesh_is_fitted_and_written(tmp_path, data_file):
    mesh = data_file("garments", "skirt_short_female.obj")
    body = data_file("bodies", "mh_female_young.glb")
    out = tmp_path / "mesh.yaml"
    assert main(["dress", "--body", str(body), "--garment", str(mesh), "--out", str(out)]) == 0
    avatar = Avatar.load(body)
    (garment,) = avatar.dress(str(out)).garments
    assert len(garment.vertices) > 395


def test_edges_of_a_mesh_are_shorter_where_it_bends(tmp_path, capsys, data_file):
    """`dress --shortest-edge` does what `remesh: curved` of an outfit does, as `info` tells."""
    mesh = data_file("garments", "tshirt_female.obj")
    body = data_file("bodies", "mh_female_young.glb")
    out = tmp_path / "mesh.yaml"
    asked = ["--edge-length", "0.03", "--shortest-edge", "0.01", "--deviation", "0.001"]
    worn = ["dress", "--body", str(body), "--garment", str(mesh), "--out", str(out)]
    assert main([*worn, "--no-preview", *asked, "--json"]) == 0
    lines = capsys.readouterr().out.splitlines()
    made = json.loads(lines[-1])["garments"]["tshirt_female"]["vertices"]
    assert any("meshed anew" in line and f"became {made};" in line for line in lines)
    own = tmp_path / "own.yaml"
    options = "remesh: curved, edge_length: 0.03, shortest_edge: 0.01, deviation: 0.001"
    own.write_text(
        f"version: 1\ngarments:\n  - name: shirt\n    mesh: {mesh}\n    options: {{{options}}}\n"
    )
    picture = tmp_path / "p.png"
    capsules = ["--set", "collider_node.method=capsules"]  # quickly fitted; the mesh is the same
    for outfit, more in ((out, capsules), (own, [*capsules, "--preview", str(picture)])):
        code = main(["info", "--body", str(body), "--outfit", str(outfit), *more])
        told = capsys.readouterr()
        assert code == 0, told.err
        assert f": {made} vertices" in told.out
    assert picture.read_bytes().startswith(b"\x89PNG")
    own.write_text(own.read_text().replace("edge_length: 0.03", "edge_length: 0.005"))
    assert main(["info", "--body", str(body), "--outfit", str(own)]) == 2
    said = capsys.readouterr().err
    assert "garment 'shirt'.shortest_edge: found 0.01 m; allowed: up to edge_length" in said
