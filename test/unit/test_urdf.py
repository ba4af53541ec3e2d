"""URDF: joint trees, channels, visual geometry, and files that are not usable."""

import numpy as np
import pytest
import trimesh

from garment_sim_ros.body.kinematics import ForwardKinematics, rest_transforms
from garment_sim_ros.body.loaders.urdf import body_from_urdf, load_urdf, parse_urdf
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.rig import ROTATION, TRANSLATION
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.errors import InputFileError

GRIPPER = """<?xml version="1.0"?>
<robot name="gripper">
  <garment_sim_reference>ignored</garment_sim_reference>
  <link name="finger_right"/><link name="base"/>
  <link name="finger_left"><visual><origin xyz="0 0 0.5"/>
    <geometry><box size="0.1 0.2 1"/></geometry></visual></link>
  <link name="tip"><visual><geometry><sphere radius="0.2"/></geometry></visual></link>
  <link name="wheel"><visual><geometry><cylinder radius="0.1" length="0.4"/></geometry></visual>
  </link>
  <joint name="left" type="prismatic"><parent link="base"/><child link="finger_left"/>
    <origin xyz="0 1 0" rpy="0 0 1.5707963267948966"/><axis xyz="0 2 0"/>
    <limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="right" type="prismatic"><parent link="base"/><child link="finger_right"/>
    <axis xyz="0 1 0"/><mimic joint="left" multiplier="-1" offset="0.25"/></joint>
  <joint name="glue" type="fixed"><parent link="finger_left"/><child link="tip"/>
    <origin xyz="0 0 1"/></joint>
  <joint name="roll" type="continuous"><parent link="tip"/><child link="wheel"/></joint>
</robot>"""


def test_joints_are_links_and_channels_are_joints():
    rig = parse_urdf(GRIPPER)
    assert rig.joint_names == ("base", "finger_left", "tip", "wheel", "finger_right")
    assert rig.parent.tolist() == [-1, 0, 1, 2, 0]
    assert rig.dofs.names == ("left", "roll", "right")
    assert rig.dofs.joint.tolist() == [1, 3, 4]
    assert rig.dofs.kind.tolist() == [TRANSLATION, ROTATION, TRANSLATION]
    np.testing.assert_allclose(rig.dofs.axis, [[0, 1, 0], [1, 0, 0], [0, 1, 0]])
    assert rig.dofs.lower.tolist() == [-0.5, -np.inf, -np.inf]
    assert rig.dofs.mimic_source.tolist() == [-1, -1, 0]


def test_motion_follows_origin_axis_and_mimic():
    T = ForwardKinematics(parse_urdf(GRIPPER)).from_dofs(np.array([0.4, np.pi / 2, 7.0]))
    # The left finger's y axis is the base's -x after the quarter turn about z.
    np.testing.assert_allclose(T[1, :3, 3], [-0.4, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(T[4, :3, 3], [0.0, -0.4 + 0.25, 0.0], atol=1e-12)
    np.testing.assert_allclose(T[2, :3, 3], [-0.4, 1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(T[3, :3, 2], [1.0, 0.0, 0.0], atol=1e-12)  # z turned about x


def test_visuals_become_a_rigid_skin():
    body = body_from_urdf(GRIPPER)
    mesh = trimesh.Trimesh(body.skin.vertices, body.skin.triangles, process=False)
    parts = mesh.split(only_watertight=True)
    assert sorted(round(p.volume, 3) for p in parts) == [0.012, 0.02, 0.032]
    box = body.skin.vertices[body.skin.bone[:, 0] == 1]
    np.testing.assert_allclose(box.min(axis=0), [-0.1, 0.95, 0.0], atol=1e-12)
    np.testing.assert_allclose(box.max(axis=0), [0.1, 1.05, 1.0], atol=1e-12)
    x = skin_vertices(body.skin, ForwardKinematics(body.rig).from_dofs(np.array([0.4, 0.0, 0.0])))
    np.testing.assert_allclose(
        x - body.skin.vertices, np.tile([-0.4, 0, 0], (len(x), 1)), atol=1e-9
    )


def test_human_of_the_ros4hri_project(data_file):
    body = load_urdf(data_file("urdf", "human_1m65.urdf"))
    assert len(body.rig) == 27
    assert len(body.rig.dofs) == 20
    T = rest_transforms(body.rig)
    assert T[body.rig.index("l_shoulder_human"), 2, 3] == pytest.approx(0.605)
    assert T[body.rig.index("r_ankle_human"), 2, 3] == pytest.approx(-0.770)
    bones = major_bones(body)
    assert bones.names[0] == "body_human"
    assert {"torso_human", "p_head_human", "l_shoulder_human", "r_knee_human"} <= set(bones.names)
    assert len(bones) == 11
    bend = np.zeros(20)
    bend[body.rig.dofs.names.index("l_elbow_human")] = 1.5
    wrist = ForwardKinematics(body.rig).from_dofs(bend)[body.rig.index("l_wrist_human"), :3, 3]
    assert np.linalg.norm(wrist - T[body.rig.index("l_wrist_human"), :3, 3]) > 0.2


@pytest.fixture
def box_robot(tmp_path):
    """Writes a robot whose one link shows the mesh `filename`; returns the URDF's path."""
    folder = tmp_path / "robot_description"
    (folder / "meshes").mkdir(parents=True)
    trimesh.creation.box(extents=(0.2, 0.4, 0.6)).export(folder / "meshes" / "box.stl")
    trimesh.creation.box(extents=(0.2, 0.4, 0.6)).export(folder / "meshes" / "box.obj")

    def write(filename, scale="1 1 1"):
        urdf = folder / "urdf" / "robot.urdf"
        urdf.parent.mkdir(exist_ok=True)
        urdf.write_text(
            f'<robot name="r"><link name="l"><visual><geometry><mesh filename="{filename}" '
            f'scale="{scale}"/></geometry></visual></link></robot>'
        )
        return urdf

    return write


@pytest.mark.parametrize(
    "filename", ["../meshes/box.stl", "package://robot_description/meshes/box.obj"]
)
def test_mesh_files_are_found_and_welded(box_robot, filename):
    body = load_urdf(box_robot(filename, scale="1 -1 2"))
    mesh = trimesh.Trimesh(body.skin.vertices, body.skin.triangles, process=False)
    assert len(mesh.vertices) == 8
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.2 * 0.4 * 1.2)


def test_packages_of_the_ament_index_are_found(box_robot, tmp_path, monkeypatch):
    share = tmp_path / "install" / "share" / "other"
    share.mkdir(parents=True)
    trimesh.creation.icosphere(radius=0.3).export(share / "ball.ply")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    assert len(load_urdf(box_robot("package://other/ball.ply")).skin.vertices) == 642


def test_collada_is_read_where_its_reader_is_installed(box_robot, tmp_path):
    pytest.importorskip("collada")
    urdf = box_robot("box.dae")
    trimesh.creation.box(extents=(0.2, 0.4, 0.6)).export(urdf.parent / "box.dae")
    assert np.ptp(load_urdf(urdf).skin.vertices, axis=0) == pytest.approx([0.2, 0.4, 0.6])


@pytest.mark.parametrize(
    ("filename", "content", "problem"),
    [
        ("gone.stl", None, "not there"),
        ("https://example.org/a.stl", None, "allowed: files"),
        ("http://[", None, "not there"),
        ("x" * 5000, None, "not there"),
        ("a.fbx", b"x", "ending"),
        ("a.stl", b"", "empty"),
        ("a.stl", b"solid nothing", "a.stl"),
        ("a.stl", b"\0" * 80 + b"\xff\xff\xff\xff" + b"\0" * 50, "a.stl"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 99999999999\n", "a.ply"),
        ("a.dae", b'<!DOCTYPE x [<!ENTITY a "a">]><COLLADA>&a;</COLLADA>', "a.dae"),
    ],
)
def test_unusable_meshes_are_one_clear_error(box_robot, filename, content, problem):
    urdf = box_robot(filename)
    if content is not None:
        (urdf.parent / filename).write_bytes(content)
    with pytest.raises(InputFileError, match=problem):
        load_urdf(urdf)


def tree(joints, links="ab"):
    names = "".join(f'<link name="{link}"/>' for link in links)
    return f'<robot name="r">{names}{joints}</robot>'


def joint(parent, child, inside="", kind="revolute", name="j"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{inside}</joint>"
    )


BOMB = (
    '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
    '<robot name="r"><link name="&b;"/></robot>'
)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "XML"),
        ("<robot name='r'><link name='a'/>", "XML"),
        ("\0", "XML"),
        (BOMB, "XML"),
        ('<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot/>', "XML"),
        ("<sdf/>", "root element <sdf>"),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>',
            "xacro macros",
        ),
        ("<robot name='r'/>", "0 links"),
        ("<robot><link/></robot>", "without name"),
        (tree("", "aa"), "two links called 'a'"),
        (tree("", "ab"), "2 links without parent"),
        (tree(joint("a", "c")), "child link 'c'"),
        (tree(joint("a", "b") + joint("a", "b", name="k")), "two parents"),
        (tree(joint("a", "b") + joint("b", "a", name="k")), "its own ancestor"),
        (tree(joint("a", "b", kind="hinge")), "type 'hinge'"),
        (tree(joint("a", "b", '<axis xyz="0 0 0"/>')), "no axis"),
        (tree(joint("a", "b", '<axis xyz="0 nan 0"/>')), "3 finite numbers"),
        (tree(joint("a", "b", '<origin xyz="0 1"/>')), "3 finite numbers"),
        (tree(joint("a", "b", '<origin rpy="0 1 ${pi}"/>')), "3 finite numbers"),
        (tree(joint("a", "b", '<limit lower="inf"/>')), "1 finite numbers"),
        (
            tree(
                joint("a", "b", '<mimic joint="k"/>') + joint("b", "c", kind="fixed", name="k"),
                "abc",
            ),
            "mimics 'k'",
        ),
        (tree(joint("a", "b", '<mimic joint="j"/>')), "mimics itself"),
    ],
)
def test_unusable_descriptions_are_one_clear_error(text, problem):
    with pytest.raises(InputFileError, match=problem) as raised:
        parse_urdf(text, "bad.urdf")
    assert str(raised.value).startswith("bad.urdf: ")


@pytest.mark.parametrize(
    ("shape", "problem"),
    [
        ("", "no visual geometry"),
        ("<visual/>", "without geometry"),
        ("<visual><geometry><cone/></geometry></visual>", "<cone>"),
        ('<visual><geometry><sphere radius="-1"/></geometry></visual>', "1e-06 to 100 m"),
        ('<visual><geometry><sphere radius="0"/></geometry></visual>', "no visual geometry"),
        ('<visual><geometry><capsule radius="1" length="0"/></geometry></visual>', "1e-06 to"),
        ('<visual><geometry><box size="0"/></geometry></visual>', "3 finite numbers"),
        ('<visual><geometry><box size="0 -5 1"/></geometry></visual>', "1e-06 to"),
        ('<visual><geometry><cylinder radius="0"/></geometry></visual>', "1e-06 to"),
        ('<visual><geometry><box size="1 1 1e9"/></geometry></visual>', "to 100 m"),
    ],
)
def test_unusable_shapes_are_one_clear_error(shape, problem):
    with pytest.raises(InputFileError, match=problem):
        body_from_urdf(f'<robot name="r"><link name="a">{shape}</link></robot>')


@pytest.mark.parametrize(
    "shape",
    ['<sphere radius="0.0"/>', '<box size="1 0 1"/>', '<cylinder radius="1" length="0"/>'],
)
def test_shapes_without_a_volume_are_left_out(shape):
    ball = '<visual><geometry><sphere radius="1"/></geometry></visual>'
    plain, more = (
        body_from_urdf(f'<robot name="r"><link name="a">{ball}{other}</link></robot>')
        for other in ("", f"<visual><geometry>{shape}</geometry></visual>")
    )
    np.testing.assert_array_equal(plain.skin.vertices, more.skin.vertices)
    assert more.notes == ("shapes without a volume, left out: 1",)


def test_a_joint_that_mimics_nothing_stays():
    text = (
        '<robot name="r"><link name="a"/>'
        '<link name="b"><visual><geometry><sphere radius="1"/></geometry></visual></link>'
        f"""{joint("a", "b", '<mimic joint="x"/>')}</robot>"""
    )
    body = body_from_urdf(text)
    assert body.notes == ("joints that mimic one that is not there stay where they are: j",)
    assert not len(body.rig.dofs)


def test_what_follows_a_joint_that_stays_stays_too():
    chain = [("a", "b", "x"), ("b", "c", "j0"), ("c", "d", "j1"), ("d", "e", "j4"), ("e", "f", "")]
    text = tree(
        "".join(
            joint(up, low, f'<mimic joint="{lead}"/>' if lead else "", name=f"j{k}")
            for k, (up, low, lead) in enumerate(chain)
        ),
        "abcdef",
    )
    assert parse_urdf(text).dofs.names == ("j3", "j4")


def test_collision_geometry_stands_in_for_missing_visuals():
    body = body_from_urdf(
        '<robot name="r"><link name="a"><collision><geometry><sphere radius="1"/></geometry>'
        "</collision></link></robot>"
    )
    assert "collision geometry" in body.notes[0]


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(InputFileError, match="does not exist"):
        load_urdf(tmp_path / "no.urdf")
    binary = tmp_path / "b.urdf"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputFileError, match="UTF-8"):
        load_urdf(binary)
