"""What a skeleton lacks is told in one line, before anything is fitted; files can name it."""

import dataclasses

import pytest

from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.missing_bones import missing_bones_of
from garment_sim_ros.cli import main as cli
from garment_sim_ros.errors import InputFileError, ParameterError

URDF = """<robot name="odd">
{links}
{joints}
</robot>
"""
CHAIN = {  # joint: parent, where it is from there, and its bone
    "Becken": (None, (0, 0, 1.0), "hips"),
    "Rumpf": ("Becken", (0, 0, 0.2), "chest"),
    "Kopf": ("Rumpf", (0, 0, 0.4), "head"),
    **{
        name: place
        for side, y in (("left", 0.2), ("right", -0.2))
        for name, place in {
            f"Oberarm_{side}": ("Rumpf", (0, y, 0.3), f"{side}UpperArm"),
            f"Elle_{side}": (f"Oberarm_{side}", (0, y, -0.25), f"{side}LowerArm"),
            f"Pfote_{side}": (f"Elle_{side}", (0, y, -0.25), f"{side}Hand"),
            f"Schenkel_{side}": ("Becken", (0, 0.5 * y, 0), f"{side}UpperLeg"),
            f"Wade_{side}": (f"Schenkel_{side}", (0, 0, -0.45), f"{side}LowerLeg"),
            f"Fuss_{side}": (f"Wade_{side}", (0, 0, -0.45), f"{side}Foot"),
        }.items()
    },
}


@pytest.fixture
def odd(tmp_path):
    """A URDF body whose links have German names."""
    links, joints = [], []
    for name, (parent, place, _) in CHAIN.items():
        links.append(
            f'<link name="{name}"><visual><geometry><box size="0.1 0.1 0.2"/></geometry></visual>'
            "</link>"
        )
        if parent:
            joints.append(
                f'<joint name="j_{name}" type="continuous"><parent link="{parent}"/>'
                f'<child link="{name}"/><origin xyz="{" ".join(map(str, place))}"/>'
                '<axis xyz="0 1 0"/></joint>'
            )
    path = tmp_path / "odd.urdf"
    path.write_text(URDF.format(links="\n".join(links), joints="\n".join(joints)))
    return path


@pytest.fixture
def names(tmp_path):
    path = tmp_path / "names.yaml"
    path.write_text("".join(f"{bone}: {joint}\n" for joint, (*_, bone) in CHAIN.items()))
    return path


def test_a_whole_body_lacks_nothing():
    assert missing_bones_of(load_body("mannequin:vertices=1500")) == ""


def test_what_is_missing_is_named_with_the_joints_that_may_be_it():
    body = load_body("mannequin:vertices=1500")
    joints = [name.replace("leftLowerArm", "Elle") for name in body.rig.joint_names]
    body = dataclasses.replace(
        body,
        rig=dataclasses.replace(body.rig, joint_names=tuple(joints)),
        humanoid=humanoid_map(joints, body.rig.parent),
    )
    line = missing_bones_of(body, "--bone-names")
    assert line.startswith(f"{body.name}: no joint is known to be leftLowerArm; ")
    assert "joints without a known bone: Elle; --bone-names" in line


def test_bones_of_a_body_are_named_in_a_file(odd, names):
    body = load_body(odd)
    assert body.humanoid == {}
    line = missing_bones_of(body)
    assert "hips, spine/chest/upperChest, neck/head, leftUpperArm" in line
    assert "Kopf" in line
    assert "\n" not in line
    told = load_body(odd, bone_names=names)
    assert told.humanoid == {
        bone: joint for joint, (*_, bone) in CHAIN.items() if bone in told.humanoid
    }
    assert missing_bones_of(told) == ""


def test_names_in_a_file_hold_for_every_kind_of_body(tmp_path):
    path = tmp_path / "names.yaml"
    path.write_text("leftToes: null\n")
    assert "leftToes" not in load_body("mannequin:vertices=1500", bone_names=path).humanoid
    path.write_text("head: Kopf\n")
    with pytest.raises(ParameterError, match="Kopf"):
        load_body("mannequin:vertices=1500", bone_names=path)
    with pytest.raises(InputFileError, match=r"none\.yaml"):
        load_body("mannequin:vertices=1500", bone_names=tmp_path / "none.yaml")


def test_fit_tells_before_it_fits_and_takes_names(tmp_path, capsys, odd, names):
    words = ["fit", str(odd), "--method", "capsule", "--out", str(tmp_path / "c.json")]
    assert cli.main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "no joint is known to be hips" in lines[0]
    assert cli.main([*words, "--bone-names", str(names)]) == 0
    assert "no joint is known" not in capsys.readouterr().out
