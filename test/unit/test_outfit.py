"""Outfit files: what they may say, and the garments that come of it."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.garment.materials import PRESETS, material_from
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import (
    DEFAULT_OUTFIT,
    GARMENT_KEYS,
    builtin_outfits,
    read_outfit,
)
from garment_sim_ros.params import Material, checked, declarations

SKIRT = "version: 1\ngarments:\n  - {name: skirt, generator: short_skirt}\n"


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin:vertices=1500")


def outfit(tmp_path, text, name="mine.yaml"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_builtin_outfits_are_read(body):
    assert DEFAULT_OUTFIT in builtin_outfits()
    for name in builtin_outfits():
        assert read_outfit(name).garments
    worn = load_outfit(DEFAULT_OUTFIT, body)
    assert [g.name for g in worn.garments] == ["skirt", "tshirt"]
    assert [len(g.vertices) for g in worn.garments] == [1687, 1503]
    assert worn.text == builtin_outfits()[DEFAULT_OUTFIT]


def test_what_holds_a_garment_beside_its_pins(tmp_path, body):
    text = (
        "version: 1\ngarments:\n"
        "  - name: skirt\n    generator: long_skirt\n    options: {vertices: 500}\n"
        "    attachments: [{bone: hips, vertices: [0, 1]}, {bone: hips, vertices: [9], "
        "stiffness: 50, damping: 2}, {bone: hips, vertices: [8], stiffness: .inf}]\n"
        "    attachment_stiffness: 300\n    tethers: true\n"
        "    max_distance: [{distance: 0.2}, {distance: 0.01, vertices: [4, 5]}]\n"
        "    backstop: [{distance: 0.03, vertices: [7]}]\n"
        "    self_collision: 0.003\n"
    )
    (skirt,) = load_outfit(outfit(tmp_path, text), body).garments
    assert skirt.pins.tolist() == [8]
    assert skirt.soft.vertices.tolist() == [0, 1, 9]
    assert skirt.soft.stiffness.tolist() == [300.0, 300.0, 50.0]
    assert skirt.soft.damping.tolist() == [0.0, 0.0, 2.0]
    assert {skirt.frames[f] for f in skirt.soft.frame} == {body.humanoid["hips"]}
    assert skirt.tethers == 0.02
    assert skirt.skin_limits["max_distance"][[3, 4, 5]].tolist() == [0.2, 0.01, 0.01]
    assert np.flatnonzero(np.isfinite(skirt.skin_limits["backstop"])).tolist() == [7]
    assert skirt.self_collision == 0.003
    plain = load_outfit(outfit(tmp_path, SKIRT), body).garments[0]
    assert plain.self_collision is None
    assert (plain.soft, plain.tethers, dict(plain.skin_limits)) == (None, None, {})


def test_options_material_and_attachments(tmp_path, body):
    text = (
        "version: 1\ngarments:\n"
        "  - name: skirt_2\n    generator: long_skirt\n    options: {vertices: 500, flare: 0.3}\n"
        "    material: {preset: denim, friction: 0.7}\n"
        "    attachments: [{bone: hips, vertices: [0, 1]}, {bone: leftUpperLeg, vertices: [9]}]\n"
        "colliders: {method: spheres, delta: 0.01}\n"
    )
    worn = load_outfit(outfit(tmp_path, text), body)
    (skirt,) = worn.garments
    assert worn.name == "mine"
    assert len(skirt.vertices) == 500
    assert skirt.material.friction == 0.7
    assert skirt.material.areal_density == PRESETS["denim"].material.areal_density
    assert skirt.pins.tolist() == [0, 1, 9]
    assert [skirt.frames[f] for f in skirt.pin_frame] == [
        body.humanoid[bone] for bone in ("hips", "hips", "leftUpperLeg")
    ]
    assert (worn.colliders.method, worn.colliders.delta) == ("spheres", 0.01)
    free = load_outfit(
        outfit(tmp_path, SKIRT.replace("_skirt}", "_skirt, attachments: none}")), body
    )
    assert len(free.garments[0].pins) == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("[1, 2]", "allowed: a mapping of names"),
        ("just text", "allowed: a mapping of names"),
        ("version: 1\ngarments: [", "is not plain YAML"),
        ("version: 2\ngarments: []", "version: found 2; allowed: 1"),
        (SKIRT.replace("version: 1\n", ""), "version: found None; allowed: 1"),
        ("version: 1\ngarments: []", "garments: found 0 entries; allowed: a list of 1 to 16"),
        ("version: 1\ngarments: 7", "garments: found 7"),
        ("version: 1", "garments: found None"),
        (SKIRT + "colour: red", "unknown key 'colour'; allowed: version, garments, colliders"),
        (SKIRT + "colliders: {method: boxes}", "method: found 'boxes'; allowed: hulls, capsules"),
        (SKIRT + "colliders: {delta: .nan}", "delta: found nan"),
        (SKIRT + "colliders: {mu: tail=0.01}", "mu: found the region 'tail'; allowed: head"),
        (SKIRT.replace("_skirt}", "_skirt, mu: head=-1}"), "garment 'skirt'.mu: found 'head=-1'"),
        (SKIRT.replace("_skirt}", "_skirt, mu: 0.03}"), "garment 'skirt'.mu: found 0.03"),
        (SKIRT + "  - {name: skirt, generator: tshirt}", "the name 'skirt' stands twice"),
        (SKIRT.replace("name: skirt", "name: Skirt"), "garments[0].name: found 'Skirt'"),
        (SKIRT.replace("name: skirt", "name: ../x"), "allowed: [a-z][a-z0-9_]*"),
        (SKIRT.replace("name: skirt", "name: 3"), "garments[0].name: found '3'"),
        (SKIRT.replace("name: skirt, ", ""), "garments[0].name: found 'None'"),
        (SKIRT.replace("short_skirt", "kilt"), "generator: found 'kilt'; allowed: short_skirt"),
        (SKIRT.replace("_skirt}", "_skirt, mesh: a.obj}"), "no source, or two"),
        (SKIRT.replace(", generator: short_skirt", ""), "no source, or two"),
        (SKIRT.replace("generator: short_skirt", "mesh: 5"), "mesh: found 5"),
        (SKIRT.replace("generator: short_skirt", "mesh: no.obj"), "no.obj: does not exist"),
        (
            SKIRT.replace("_skirt}", "_skirt, options: {vertices: 1}}"),
            "vertices: found 1; allowed",
        ),
        (SKIRT.replace("_skirt}", "_skirt, options: {vertices: 1e9}}"), "vertices: found"),
        (SKIRT.replace("_skirt}", "_skirt, options: {pleats: 3}}"), "pleats: unknown"),
        (SKIRT.replace("_skirt}", "_skirt, options: [1]}"), "options: found [1]"),
        (SKIRT.replace("_skirt}", "_skirt, size: 38}"), "unknown key 'size'"),
        (SKIRT.replace("_skirt}", "_skirt, layer: 16}"), "layer: found 16; allowed: a whole"),
        (
            SKIRT.replace("_skirt}", "_skirt, max_distance: 0}"),
            "max_distance: found 0; allowed: a",
        ),
        (SKIRT.replace("_skirt}", "_skirt, max_distance: far}"), "max_distance: found 'far'"),
        (SKIRT.replace("_skirt}", "_skirt, max_distance: .nan}"), "max_distance: found nan"),
        (SKIRT.replace("_skirt}", "_skirt, layer: -1}"), "layer: found -1"),
        (
            SKIRT.replace("_skirt}", "_skirt, self_collision: 0}"),
            "self_collision: found 0; allowed: true, false, or a distance of",
        ),
        (SKIRT.replace("_skirt}", "_skirt, self_collision: 1}"), "self_collision: found 1"),
        (SKIRT.replace("_skirt}", "_skirt, self_collision: no_}"), "self_collision: found 'no_'"),
        (SKIRT.replace("_skirt}", "_skirt, backstop: -0.1}"), "backstop: found -0.1; allowed: a"),
        (SKIRT.replace("_skirt}", "_skirt, backstop: [{vertices: [3]}]}"), "backstop: found None"),
        (
            SKIRT.replace("_skirt}", "_skirt, backstop: [{distance: 1, vertices: [99999]}]}"),
            "vertices [99999] do not exist",
        ),
        (SKIRT.replace("_skirt}", "_skirt, tethers: -0.1}"), "tethers: found -0.1; allowed: true"),
        (
            SKIRT.replace("_skirt}", "_skirt, tethers: true, attachments: none}"),
            "nothing that they could hang from",
        ),
        (
            SKIRT.replace("_skirt}", "_skirt, attachment_stiffness: hard}"),
            "attachment_stiffness: found 'hard'; allowed: a number of N/m",
        ),
        (SKIRT.replace("_skirt}", "_skirt, layer: true}"), "layer: found True"),
        (SKIRT.replace("_skirt}", "_skirt, layer: 0.5}"), "layer: found 0.5"),
        (SKIRT.replace("_skirt}", "_skirt, material: steel}"), "material: found 'steel'; allowed"),
        (SKIRT.replace("_skirt}", "_skirt, material: {preset: steel}}"), "found 'steel'"),
        (SKIRT.replace("_skirt}", "_skirt, material: {weight: 1}}"), "weight: unknown"),
        (SKIRT.replace("_skirt}", "_skirt, material: {friction: -1}}"), "friction: found -1"),
        (SKIRT.replace("_skirt}", "_skirt, material: {friction: .inf}}"), "friction: found inf"),
        (SKIRT.replace("_skirt}", "_skirt, material: [denim]}"), "material: found"),
        (SKIRT.replace("_skirt}", "_skirt, attachments: glue}"), "attachments: found 'glue'"),
        (
            SKIRT.replace("_skirt}", "_skirt, attachments: [{bone: hips, vertices: [a]}]}"),
            "a vertex is not a whole number",
        ),
        (
            SKIRT.replace("_skirt}", "_skirt, attachments: [{bone: hips, vertices: [99999]}]}"),
            "vertices [99999] do not exist",
        ),
        (
            SKIRT.replace("_skirt}", "_skirt, attachments: [{bone: hips, vertices: [3, 3]}]}"),
            "listed twice",
        ),
        (
            SKIRT.replace("_skirt}", "_skirt, attachments: [{bone: tail, vertices: [3]}]}"),
            "no joint 'tail'",
        ),
        ("!!python/object/apply:os.system ['true']", "is not plain YAML"),
        (SKIRT.replace("short_skirt", "!!python/name:os.system"), "is not plain YAML"),
        ("a: &a [x]\nb: *a\n" + SKIRT, "aliases are not allowed"),
        (SKIRT + "version: 1\n", "the key 'version' stands twice"),
        ("[" * 5000, "is not plain YAML"),
        ("? [1]\n: 2\n", "is not plain YAML"),
    ],
)
def test_refused(tmp_path, body, text, message):
    path = outfit(tmp_path, text)
    with pytest.raises(InputFileError) as error:
        load_outfit(path, body)
    assert message in str(error.value)
    assert "mine.yaml" in str(error.value) or "no.obj" in str(error.value)


def test_missing_and_unknown(tmp_path, body):
    with pytest.raises(
        InputFileError, match=r"allowed: a \.yaml file, or one of tshirt_long_skirt"
    ):
        load_outfit("tuxedo", body)
    with pytest.raises(InputFileError, match="does not exist"):
        load_outfit(tmp_path / "no.yaml", body)
    big = outfit(tmp_path, "#" * (2**20 + 1))
    with pytest.raises(InputFileError, match="allowed: at most 1048576 bytes"):
        load_outfit(big, body)


def test_mesh_garment_beside_its_outfit(tmp_path, body):
    """A tube around the hips, in millimetres, y up, its inside out, a few points too far in."""
    n, rows = 40, 8
    angle = 2 * np.pi * np.arange(n) / n
    lines = []
    for row in range(rows):
        r = 170 if row else 90  # the top is under the skin
        for a in angle:
            lines.append(f"v {r * np.cos(a):.4f} {1000 - 40 * row} {r * np.sin(a):.4f}")
    for row in range(rows - 1):
        for i in range(n):
            a, b = row * n + i + 1, row * n + (i + 1) % n + 1
            lines.append(f"f {a} {a + n} {b + n} {b}")
    (tmp_path / "tube.obj").write_text("\n".join(lines))
    text = (
        "version: 1\ngarments:\n  - name: tube\n    mesh: tube.obj\n"
        "    options: {unit: mm, up: y, edge_length: 0.03}\n"
    )
    worn = load_outfit(outfit(tmp_path, text), body)
    (tube,) = worn.garments
    notes = " ".join(worn.notes)
    assert "the inside was out" in notes
    assert tube.vertices[:, 2].max() == pytest.approx(1.0, abs=0.03)
    # The top loop is pinned.
    assert np.isin(tube.pins, np.flatnonzero(tube.vertices[:, 2] > 0.95)).all()
    assert len(tube.pins) == n
    a, b, c = np.moveaxis(tube.vertices[tube.triangles], 1, 0)
    outward = np.einsum("ti,ti->t", np.cross(b - a, c - a)[:, :2], (a + b + c)[:, :2])
    assert (outward > 0).mean() > 0.95

    far = text.replace("unit: mm", "unit: cm")
    with pytest.raises(InputFileError, match="with unit mm it is"):
        load_outfit(outfit(tmp_path, far), body)


def test_presets_are_valid_materials():
    for name, preset in PRESETS.items():
        assert preset.source
        for field, declaration in declarations(Material).items():
            value = getattr(preset.material, field)
            assert checked(declaration, value) == value, name
    assert material_from(None) == PRESETS["cotton_jersey"].material
    assert material_from("silk") == PRESETS["silk"].material
    with pytest.raises(ParameterError, match="allowed: values by name, or a preset of"):
        material_from(3)


def test_example_is_an_outfit():
    example = Path(__file__).parents[2] / "config" / "outfit_example.yaml"
    file = read_outfit(example)
    assert [g.name for g in file.garments] == ["skirt", "shirt"]
    assert file.garments[1].mesh == example.parent / "shirt.obj"
    assert file.garments[1].material.friction == 0.4
    entries = yaml.safe_load(example.read_text())["garments"]
    assert {key for entry in entries for key in entry} == set(GARMENT_KEYS)


@pytest.mark.parametrize("written", ["1e-5", "1E-5", "1.e-5", ".1e-4", "+1e-05", "'1e-5'"])
def test_numbers_with_an_exponent_need_no_point(tmp_path, written):
    """YAML 1.1, as its reader has it, takes these for text."""
    text = SKIRT.replace(
        "_skirt}",
        f"_skirt, material: {{bending_stiffness: {written}}}, attachment_stiffness: 2e3}}",
    )
    (skirt,) = read_outfit(outfit(tmp_path, text)).garments
    assert skirt.material.bending_stiffness == 1e-5
    assert skirt.holds.stiffness == 2000.0


def test_keys_that_do_nothing_are_told_and_misspelt_ones_get_the_nearest(tmp_path, body):
    text = SKIRT.replace("_skirt}", "_skirt, attachment_damping: 1}")
    notes = load_outfit(outfit(tmp_path, text + "colliders: {voxel: 0.02}\n"), body).notes
    assert any("attachment_damping: found 1, which does nothing" in n for n in notes)
    assert any("voxel: found 0.02, which does nothing" in n for n in notes)
    with pytest.raises(InputFileError, match="'tether', perhaps tethers"):
        read_outfit(outfit(tmp_path, SKIRT.replace("_skirt}", "_skirt, tether: true}")))
    with pytest.raises(InputFileError, match="friktion: unknown, perhaps friction"):
        read_outfit(outfit(tmp_path, SKIRT.replace("_skirt}", "_skirt, material: {friktion: 1}}")))


def test_a_wide_skirt_asks_for_fewer_ellipsoids_over_the_legs(tmp_path, body):
    """Thresholds by garment: where several name a region, the tightest counts."""
    # As many as it takes, so that no part has what another one leaves; rigid, which is quicker.
    ellipsoids = (
        "colliders: {method: ellipsoids, mu: head=0.03, mu_torso: 0.05, mu_limb: 0.016,"
        " max_ellipsoids: 400, refit: false}\n"
    )
    thighs = "left_thigh=0.03 right_thigh=0.03"
    loose = SKIRT.replace("_skirt}", f"_skirt, mu: {thighs}}}") + ellipsoids
    tights = "  - {name: tights, generator: short_skirt, mu: left_thigh=0.012}\n"
    count = {}
    for name, text in (
        ("plain", SKIRT + ellipsoids),
        ("loose", loose),
        ("both", loose.replace("colliders:", tights + "colliders:")),
    ):
        options = read_outfit(outfit(tmp_path, text)).colliders
        shapes = fit_colliders(body, options).colliders
        count[name] = [
            sum(c.name.startswith(region) for c in shapes)
            for region in ("left_thigh", "right_thigh", "left_calf")
        ]
    assert count["loose"][0] < count["plain"][0]
    assert count["loose"][1] < count["plain"][1]
    assert count["both"][0] > count["plain"][0]
    assert count["both"][1] == count["loose"][1]
    assert count["plain"][2] == count["loose"][2] == count["both"][2]
