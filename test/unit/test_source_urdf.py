"""The URDF of a clip: the same joints, the same motion, and the reference that it carries."""

import dataclasses
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.source_urdf import reference_from_urdf, urdf_from_clip
from garment_sim_ros.mocap.walk import walk


def _odd_clip():
    """Rotated rest transforms, limits, a follower, a joint without channels, ugly names."""
    names = ('root "<&', "slider", "fixed one", "hinge", "ball")
    T = np.tile(np.eye(4), (5, 1, 1))
    rng = np.random.default_rng(0)
    T[:, :3, :3] = Rotation.random(5, random_state=1).as_matrix()
    T[:, :3, 3] = rng.normal(size=(5, 3))
    channels = [(0, 1), (0, 0), (1, 1), (3, 0), (3, 0), (4, 0), (4, 0), (4, 0)]
    d = len(channels)
    axis = rng.normal(size=(d, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    lower = np.full(d, -np.inf)
    lower[[2, 3]] = -0.5
    rig = Rig(
        joint_names=names,
        parent=np.array([-1, 0, 1, 2, 2], np.int32),
        T_parent_joint=T,
        dofs=Dofs(
            names=(*(f"c{i}" for i in range(d - 1)), "hinge"),
            joint=np.array([j for j, _ in channels], np.int32),
            kind=np.array([TRANSLATION if k else ROTATION for _, k in channels], np.int8),
            axis=axis,
            lower=lower,
            upper=-lower,
            mimic_source=np.array([-1] * 4 + [3] + [-1] * 3, np.int32),
            mimic_multiplier=np.array([1.0] * 4 + [-2.0] + [1.0] * 3),
            mimic_offset=np.array([0.0] * 4 + [0.1] + [0.0] * 3),
        ),
    )
    T_world_file = np.eye(4)
    T_world_file[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    return Clip(
        name="odd & <clip>",
        rig=rig,
        times=np.arange(2.0),
        values=rng.normal(size=(2, d)),
        T_world_file=T_world_file,
        reference=rng.normal(size=d),
        end_sites=(("ball", (0.1, 0.2, 0.3)),),
        hinges=(("ball", (0.0, 1.0, 0.0)),),
        soles=(('root "<&', (0.0, 0.0, 1.0)),),
        ankle_height=0.085,
    )


@pytest.mark.parametrize("make", [walk, _odd_clip])
def test_the_rig_that_is_read_back_moves_alike(make):
    clip = make()
    rig = parse_urdf(urdf_from_clip(clip))
    assert rig.dofs.names == clip.rig.dofs.names
    index = [rig.index(name) for name in clip.rig.joint_names]
    ours, theirs = ForwardKinematics(clip.rig), ForwardKinematics(rig)
    for q in (clip.values[0], clip.values[-1], np.zeros(len(clip.rig.dofs))):
        np.testing.assert_allclose(
            theirs.from_dofs(q)[index], ours.from_dofs(q, clip.T_world_file), atol=1e-12
        )
    np.testing.assert_array_equal(rig.dofs.mimic_source, clip.rig.dofs.mimic_source)
    limited = np.isfinite(clip.rig.dofs.lower)
    np.testing.assert_array_equal(rig.dofs.lower[limited], clip.rig.dofs.lower[limited])


def test_it_has_exactly_the_channels_and_one_fixed_joint():
    clip = walk()
    robot = ET.fromstring(urdf_from_clip(clip))
    joints = robot.findall("joint")
    assert [j.get("name") for j in joints if j.get("type") != "fixed"] == list(clip.rig.dofs.names)
    assert [j.find("parent").get("link") for j in joints if j.get("type") == "fixed"] == ["world"]
    links = {link.get("name"): link for link in robot.findall("link")}
    assert set(links) > set(clip.rig.joint_names)
    assert not any(len(link) for link in links.values())  # massless, no geometry
    for joint in joints:
        if joint.get("type") == "prismatic":
            assert joint.find("limit") is not None


def test_the_reference_comes_back():
    clip = _odd_clip()
    found = reference_from_urdf(urdf_from_clip(clip))
    expected = clip.source_reference
    assert found.values == expected.values
    assert found.ankle_height == expected.ankle_height
    for name in ("end_sites", "hinges", "soles"):
        ours, theirs = getattr(expected, name), getattr(found, name)
        assert ours.keys() == theirs.keys()
        for key in ours:
            np.testing.assert_array_equal(ours[key], theirs[key])


def test_a_rig_that_was_read_from_a_urdf_is_not_wrapped_again():
    clip = _odd_clip()
    rig = parse_urdf(urdf_from_clip(clip))
    again = dataclasses.replace(
        clip, rig=rig, T_world_file=np.eye(4), reference=None, values=clip.values
    )
    twice = parse_urdf(urdf_from_clip(again))
    assert twice.joint_names == rig.joint_names
    assert twice.dofs.names == rig.dofs.names


def test_joints_called_world_do_not_clash():
    clip = walk()
    names = tuple({"spine": "world", "head": "file_axes"}.get(n, n) for n in clip.rig.joint_names)
    rig = dataclasses.replace(clip.rig, joint_names=names)
    read = parse_urdf(urdf_from_clip(dataclasses.replace(clip, rig=rig, end_sites=())))
    assert read.dofs.names == clip.rig.dofs.names
    assert set(names) < set(read.joint_names)


def test_other_urdfs_have_the_empty_reference():
    found = reference_from_urdf('<robot name="r"><link name="a"/></robot>')
    assert not found.values
    assert found.ankle_height is None


@pytest.mark.parametrize(
    "inner",
    [
        '<pose joint="a"/>',
        '<pose joint="a" value="nan"/>',
        '<pose joint="" value="1"/>',
        '<pose value="1"/>',
        '<hinge link="a" xyz="1 2"/>',
        '<end_site link="a" xyz="1 2 inf"/>',
    ],
)
def test_damaged_references_are_refused(inner):
    text = (
        f'<robot name="r"><link name="a"/><garment_sim_reference>{inner}'
        "</garment_sim_reference></robot>"
    )
    with pytest.raises(InputFileError, match="robot_description"):
        reference_from_urdf(text)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no xml",
        '<!DOCTYPE r [<!ENTITY a "aa">]><robot name="r">&a;</robot>',
        "<html/>",
        '<robot name="r"><garment_sim_reference ankle_height="x"/></robot>',
    ],
)
def test_text_that_is_no_urdf_is_refused(text):
    with pytest.raises(InputFileError):
        reference_from_urdf(text)
