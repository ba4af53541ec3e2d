"""Bones found by name: one test per convention, conflicts, overrides and their files."""

from itertools import pairwise

import numpy as np
import pytest

from garment_sim_ros.body.humanoid import humanoid_map, load_humanoid_overrides
from garment_sim_ros.body.skin import HUMANOID_BONES
from garment_sim_ros.errors import InputFileError, ParameterError


def _tree(text):
    """Names and parents from an indented outline, two spaces per level."""
    names, parent, stack = [], [], []
    for line in text.strip("\n").splitlines():
        depth = (len(line) - len(line.lstrip())) // 2
        del stack[depth:]
        parent.append(stack[-1] if stack else -1)
        stack.append(len(names))
        names.append(line.strip())
    return names, np.array(parent)


def _map(text, overrides=None):
    return humanoid_map(*_tree(text), overrides)


MIXAMO = """
mixamorig:Hips
  mixamorig:Spine
    mixamorig:Spine1
      mixamorig:Spine2
        mixamorig:Neck
          mixamorig:Head
        mixamorig:LeftShoulder
          mixamorig:LeftArm
            mixamorig:LeftForeArm
              mixamorig:LeftHand
                mixamorig:LeftHandIndex1
  mixamorig:RightUpLeg
    mixamorig:RightLeg
      mixamorig:RightFoot
        mixamorig:RightToeBase
"""


def test_mixamo_with_its_prefix():
    assert _map(MIXAMO) == {
        "hips": "mixamorig:Hips",
        "spine": "mixamorig:Spine",
        "chest": "mixamorig:Spine1",
        "upperChest": "mixamorig:Spine2",
        "neck": "mixamorig:Neck",
        "head": "mixamorig:Head",
        "leftShoulder": "mixamorig:LeftShoulder",
        "leftUpperArm": "mixamorig:LeftArm",
        "leftLowerArm": "mixamorig:LeftForeArm",
        "leftHand": "mixamorig:LeftHand",
        "rightUpperLeg": "mixamorig:RightUpLeg",
        "rightLowerLeg": "mixamorig:RightLeg",
        "rightFoot": "mixamorig:RightFoot",
        "rightToes": "mixamorig:RightToeBase",
    }


def test_left_shoulder_is_the_clavicle_above_an_arm_and_the_arm_above_an_elbow():
    above_arm = _map("Hips\n  Spine\n    LeftShoulder\n      LeftArm\n        LeftForeArm\n")
    assert above_arm["leftShoulder"] == "LeftShoulder"
    above_elbow = _map("Hips\n  Chest\n    LeftCollar\n      LeftShoulder\n        LeftElbow\n")
    assert above_elbow["leftShoulder"] == "LeftCollar"
    assert above_elbow["leftUpperArm"] == "LeftShoulder"


def test_vrm_names_map_to_themselves():
    chains = (
        ("hips", "spine", "chest", "upperChest", "neck", "head"),
        *(
            ("upperChest", *(s + p for p in ("Shoulder", "UpperArm", "LowerArm", "Hand")))
            for s in ("left", "right")
        ),
        *(
            ("hips", *(s + p for p in ("UpperLeg", "LowerLeg", "Foot", "Toes")))
            for s in ("left", "right")
        ),
    )
    names, parent = ["hips"], [-1]
    for chain in chains:
        for above, bone in pairwise(chain):
            parent.append(names.index(above))
            names.append(bone)
    assert humanoid_map(names, parent) == {bone: bone for bone in HUMANOID_BONES}


def test_ros4hri_links_of_any_person():
    def outline(person):
        return "\n".join(
            line and f"{line}_{person}"
            for line in (
                "body",
                "  waist",
                "    torso",
                "      r_head",
                "        y_head",
                "          p_head",
                "            head",
                "      l_y_shoulder",
                "        l_p_shoulder",
                "          l_shoulder",
                "            l_elbow",
                "              l_wrist",
                "  r_y_hip",
                "    r_p_hip",
                "      r_hip",
                "        r_knee",
                "          r_ankle",
            )
        )

    for person in ("human", "a3_f2b"):
        expected = {
            "hips": "body",
            "spine": "waist",
            "chest": "torso",
            "head": "p_head",
            "leftUpperArm": "l_shoulder",
            "leftLowerArm": "l_elbow",
            "leftHand": "l_wrist",
            "rightUpperLeg": "r_hip",
            "rightLowerLeg": "r_knee",
            "rightFoot": "r_ankle",
        }
        assert _map(outline(person)) == {b: f"{j}_{person}" for b, j in expected.items()}


def test_unknown_joints_stay_unmapped():
    assert _map("thing\n  gadget\n    Left_Flipper\n") == {}


def test_a_joint_outside_its_chain_is_not_taken():
    mapping = _map("Hips\n  LeftUpLeg\n    LeftLeg\n  RightUpLeg\n  RightLeg\n    RightFoot\n")
    assert mapping["leftLowerLeg"] == "LeftLeg"
    assert "rightLowerLeg" not in mapping
    assert "rightFoot" not in mapping


def test_overrides_win_and_null_removes():
    mapping = _map(MIXAMO, {"head": "mixamorig:Neck", "neck": None})
    assert mapping["head"] == "mixamorig:Neck"
    assert "neck" not in mapping


@pytest.mark.parametrize("overrides", [{"tail": "mixamorig:Hips"}, {"head": "Kopf"}])
def test_wrong_overrides_are_named(overrides):
    with pytest.raises(ParameterError, match=r"tail|Kopf"):
        _map(MIXAMO, overrides)


def test_override_file(tmp_path):
    path = tmp_path / "map.yaml"
    path.write_text("head: Kopf\nneck: null\n")
    assert load_humanoid_overrides(path) == {"head": "Kopf", "neck": None}


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"- head\n",
        b"head: [1, 2]\n",
        b"tail: Hips\n",
        b"head: !!python/object/apply:os.system ['true']\n",
        b"head: \xff\xfe\x00\n",
        b"{" * 5000,
        b"a: " + b"x" * 200_000,
    ],
)
def test_bad_override_files_are_refused(tmp_path, content):
    path = tmp_path / "map.yaml"
    path.write_bytes(content)
    with pytest.raises(InputFileError, match=r"map\.yaml"):
        load_humanoid_overrides(path)


def test_missing_override_file(tmp_path):
    with pytest.raises(InputFileError, match="does not exist"):
        load_humanoid_overrides(tmp_path / "none.yaml")
