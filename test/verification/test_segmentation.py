"""Feature points and regions on real and built-in bodies in several poses, and on what is none."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.colliders.ellipsoids.thresholds import REGIONS
from garment_sim_ros.colliders.segmentation.body_surface import body_surface
from garment_sim_ros.colliders.segmentation.extremities import ENDS
from garment_sim_ros.colliders.segmentation.segmentation import rig_joints, segment
from garment_sim_ros.errors import GarmentSimError, GeometryError, ParameterError
from garment_sim_ros.geometry.geodesics import iso_line
from garment_sim_ros.geometry.topology import edge_table

FILES = (
    "mh_female_young.glb",
    "CesiumMan.glb",
    "f_smpl_average_A40.obj",
    "m_smpl_average_A40.obj",
    "mh_proxy_female1605.obj",
)
MANNEQUINS = ("mannequin", "mannequin:build=1,sex=1,vertices=3000", "mannequin:height=1.2,build=0")
LIMIT = {"neck": 0.05, "elbow": 0.04, "knee": 0.04}


def check_regions(vertices, triangles, result):
    """Each vertex in one of 15 regions, each connected, left on the left, in order of height."""
    assert result.region.shape == (len(vertices),)
    assert set(result.region.tolist()) == set(range(15))
    s = result.surface
    pairs = np.concatenate([edge_table(s.triangles)[0], s.bridges])
    for i, name in enumerate(REGIONS):
        mine = result.surface_region == i
        inside = pairs[mine[pairs].all(axis=1)]
        part = np.arange(len(mine))
        while True:  # union by the lowest number, until nothing changes
            before = part.copy()
            np.minimum.at(part, inside[:, 0], part[inside[:, 1]])
            np.minimum.at(part, inside[:, 1], part[inside[:, 0]])
            if (part == before).all():
                break
        assert len(set(part[mine].tolist())) == 1, name
    axes = result.features.ends.axes
    middle = {
        n: axes @ s.vertices[result.surface_region == i].mean(axis=0)
        for i, n in enumerate(REGIONS)
    }
    for part in ("upper_arm", "forearm", "thigh", "calf", "chest", "waist", "hip"):
        assert middle[f"left_{part}"][1] > middle[f"right_{part}"][1], part
    for side in ("left", "right"):
        heights = [
            middle[n][2]
            for n in ("head", *(f"{side}_{p}" for p in ("chest", "waist", "hip", "thigh", "calf")))
        ]
        assert (np.diff(heights) < 0.0).all()


def crotch_height(body):
    """Lowest level section of the body that holds both legs in one loop."""
    x, t = body.skin.vertices, body.skin.triangles
    H = np.ptp(x[:, 2])
    low, high = 0.3 * H, 0.6 * H
    for _ in range(12):
        z = 0.5 * (low + high)
        loops = [part.segments[..., 1] for part in iso_line(x, t, x[:, 2], z).parts()]
        one = any(y.min() < -0.03 * H and y.max() > 0.03 * H for y in loops)
        low, high = (low, z) if one else (z, high)
    return low


@pytest.mark.parametrize("name", [*FILES, *MANNEQUINS])
def test_real_bodies(name, data_file):
    body = load_body(name if name.startswith("mannequin") else data_file("bodies", name))
    result = segment(body.skin.vertices, body.skin.triangles)
    check_regions(body.skin.vertices, body.skin.triangles, result)
    assert result.confidence > 0.3
    points = result.features.point
    for joint, place in rig_joints(body).items():
        away = np.linalg.norm(points[joint] - place)
        assert away < LIMIT[joint.split("_")[-1]], (joint, away)
    assert points["crotch"][2] == pytest.approx(crotch_height(body), abs=0.03)
    assert abs(points["crotch"][1]) < 0.02
    if name == "mh_proxy_female1605.obj":
        assert any("holes were closed" in n for n in result.report()["assumed"])
        assert any("joined" in n for n in result.report()["assumed"])


def posed_arms(body, degrees_down):
    """The skin with its upper arms at an angle below the horizontal."""
    T = rest_transforms(body.rig)
    parent = body.rig.parent
    for side, sign in (("left", 1.0), ("right", -1.0)):
        root = body.rig.index(body.humanoid[f"{side}UpperArm"])
        elbow = body.rig.index(body.humanoid[f"{side}LowerArm"])
        way = T[elbow, :3, 3] - T[root, :3, 3]
        now = np.arctan2(-way[2], sign * way[1])
        a = sign * (now - np.radians(degrees_down))
        R = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        pivot = T[root, :3, 3].copy()
        below = {root}
        for j in range(root, len(parent)):
            if j == root or int(parent[j]) in below:
                below.add(j)
                T[j, :3, :3] = R @ T[j, :3, :3]
                T[j, :3, 3] = R @ (T[j, :3, 3] - pivot) + pivot
    joints = {
        n: T[body.rig.index(body.humanoid[b]), :3, 3]
        for n, b in (("left_elbow", "leftLowerArm"), ("right_elbow", "rightLowerArm"))
    }
    return skin_vertices(body.skin, T).astype(np.float64), joints


@pytest.mark.parametrize("name", ["mh_female_young.glb", "CesiumMan.glb", "mannequin"])
@pytest.mark.parametrize("degrees_down", [0.0, 78.0])
def test_t_pose_and_hanging_arms(name, degrees_down, data_file):
    body = load_body(name if name == "mannequin" else data_file("bodies", name))
    x, joints = posed_arms(body, degrees_down)
    result = segment(x, body.skin.triangles)
    check_regions(x, body.skin.triangles, result)
    for joint, place in joints.items():
        assert np.linalg.norm(result.features.point[joint] - place) < 0.04


TURNS = {
    "lying": np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]]),
    "upside down": np.diag([1.0, -1.0, -1.0]),
    "facing backwards": np.diag([-1.0, -1.0, 1.0]),
    "askew": Rotation.from_euler("xyz", [0.3, 1.1, 2.0]).as_matrix(),
}


@pytest.mark.parametrize("turn", ["lying", "upside down", "facing backwards"])
def test_orientation_is_found_and_said(turn):
    body = load_body("mannequin:vertices=2000")
    plain = segment(body.skin.vertices, body.skin.triangles)
    turned = segment(body.skin.vertices @ TURNS[turn].T, body.skin.triangles)
    assert not plain.report()["assumed"]
    expected = {"facing backwards": "does not face x"}.get(turn, turn)
    assert any(expected in note for note in turned.report()["assumed"])
    if turn != "facing backwards":
        assert turned.confidence <= 0.6


@pytest.mark.parametrize("name", [*FILES, "mannequin", "mannequin:vertices=2000"])
def test_regions_are_the_same_whichever_way_a_body_lies(name, data_file):
    """Symmetric bodies are full of ties, which roundings must not break one way or another."""
    body = load_body(name if name.startswith("mannequin") else data_file("bodies", name))
    x, triangles = body.skin.vertices, body.skin.triangles
    plain = segment(x, triangles).region
    for R in TURNS.values():
        turned = segment(x @ R.T + [1.0, 2.0, 3.0], triangles).region
        assert (plain == turned).mean() >= 0.999
    for size in (1e-14, 1e-10):  # rounding of another processor, and of a file
        moved = x + size * np.random.default_rng(0).normal(size=x.shape)
        assert (plain == segment(moved, triangles).region).mean() >= 0.999


def test_seams_are_welded_and_said():
    body = load_body("mannequin:vertices=2000")
    x = body.skin.vertices[body.skin.triangles].reshape(-1, 3)
    t = np.arange(len(x), dtype=np.int32).reshape(-1, 3)
    result = segment(x, t)
    plain = segment(body.skin.vertices, body.skin.triangles)
    assert (result.region == plain.region[body.skin.triangles].ravel()).all()
    assert any("welded" in note for note in result.report()["assumed"])


def test_mirrored_body_swaps_sides():
    body = load_body("mannequin:vertices=2000")
    x = body.skin.vertices * [1.0, -1.0, 1.0]
    mirrored = segment(x, body.skin.triangles[:, ::-1])
    plain = segment(body.skin.vertices, body.skin.triangles)
    swapped = [
        REGIONS.index(n.replace("left", "@").replace("right", "left").replace("@", "right"))
        for n in REGIONS
    ]
    assert (np.array(swapped)[plain.region] == mirrored.region).mean() > 0.97


def test_table_1_is_an_option_and_says_where_it_fails(data_file):
    body = load_body(data_file("bodies", "mh_female_young.glb"))
    result = segment(body.skin.vertices, body.skin.triangles, constants="table1")
    points, joints = result.features.point, rig_joints(body)
    assert np.linalg.norm(points["neck"] - joints["neck"]) < 0.06
    assert any("above the crotch" in note for note in result.report()["assumed"])
    assert np.linalg.norm(points["left_elbow"] - joints["left_elbow"]) > 0.1
    with pytest.raises(ParameterError, match="table1"):
        segment(body.skin.vertices, body.skin.triangles, constants="table2")


def test_rig_joints_are_used_where_given():
    body = load_body("mannequin")
    joints = rig_joints(body)
    result = segment(body.skin.vertices, body.skin.triangles, joints=joints)
    for name, place in joints.items():
        assert np.linalg.norm(result.features.point[name] - place) < 0.03
    assert any("rig" in note for note in result.report()["assumed"])


def _hand():
    fingers = [
        trimesh.creation.capsule(height=0.08, radius=0.008, count=[12, 12]).apply_translation(
            [0.02 * i, 0.0, 0.05]
        )
        for i in range(5)
    ]
    palm = trimesh.creation.icosphere(subdivisions=3, radius=0.055).apply_translation([0.04, 0, 0])
    return trimesh.util.concatenate([*fingers, palm])


def _chair():
    box = trimesh.creation.box
    legs = [
        box((0.04, 0.04, 0.5)).apply_translation([x, y, 0.25]) for x in (0, 0.4) for y in (0, 0.4)
    ]
    seat = box((0.44, 0.44, 0.04)).apply_translation([0.2, 0.2, 0.5])
    back = box((0.04, 0.44, 0.5)).apply_translation([0.0, 0.2, 0.75])
    chair = trimesh.util.concatenate([*legs, seat, back])
    return chair.subdivide().subdivide().subdivide()


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.box((1.0, 1.0, 1.0)).subdivide().subdivide().subdivide(),
        trimesh.creation.icosphere(subdivisions=4),
        trimesh.creation.capsule(height=1.5, radius=0.15, count=[24, 24]),
        _hand(),
        _chair(),
    ],
    ids=["cube", "sphere", "capsule", "hand", "chair"],
)
def test_not_a_human(mesh):
    x = np.array(mesh.vertices)
    for R in (np.eye(3), *TURNS.values()):
        with pytest.raises(GeometryError):
            segment(x @ R.T, np.array(mesh.faces))


def test_several_bodies_unit_mistakes_and_sizes():
    body = load_body("mannequin:vertices=2000")
    x, t = body.skin.vertices, body.skin.triangles
    two = np.concatenate([x, x + np.array([0.0, 2.0, 0.0])]), np.concatenate([t, t + len(x)])
    with pytest.raises(GeometryError, match="several bodies"):
        segment(*two)
    with pytest.raises(GeometryError, match="unit"):
        segment(100.0 * x, t)
    with pytest.raises(GeometryError, match="vertices"):
        segment(x[:30], t[(t < 30).all(axis=1)])
    with pytest.raises(GeometryError, match="finite"):
        segment(np.where(x > 1.6, np.nan, x), t)


@pytest.mark.parametrize("cut", ["forearm", "both arms", "leg"])
def test_missing_limbs_are_errors(cut):
    body = load_body("mannequin:vertices=3000")
    x, t = body.skin.vertices, body.skin.triangles
    region = segment(x, t).region
    gone = {
        "forearm": ["left_forearm"],
        "both arms": ["left_forearm", "right_forearm", "left_upper_arm", "right_upper_arm"],
        "leg": ["left_calf", "left_thigh"],
    }[cut]
    kept = t[~np.isin(region[t], [REGIONS.index(n) for n in gone]).any(axis=1)]
    with pytest.raises(GarmentSimError):
        segment(x, kept)


def test_coarse_body():
    body = load_body("mannequin:vertices=1000")
    mesh = trimesh.Trimesh(body.skin.vertices, body.skin.triangles, process=False)
    coarse = np.round(mesh.vertices / 0.12) * 0.12  # everything snaps to a coarse grid
    try:
        result = segment(coarse, body.skin.triangles)
    except GeometryError:
        return
    assert result.confidence < 0.9 or result.report()["assumed"]


def test_non_manifold_edges_are_said():
    body = load_body("mannequin:vertices=2000")
    x, t = body.skin.vertices, body.skin.triangles
    far = np.flatnonzero(x[:, 2] > 1.0)[0]
    extra = np.array([[t[0, 0], t[0, 1], far]], np.int32)
    surface = body_surface(x, np.concatenate([t, extra]))
    assert any("not manifold" in note for note in surface.notes)


def test_ends_are_told_apart():
    body = load_body("mannequin")
    ends = segment(body.skin.vertices, body.skin.triangles).features.ends
    place = dict(zip(ENDS, body.skin.vertices[ends.vertex]))
    assert place["head"][2] == pytest.approx(1.70, abs=0.01)
    assert place["left_hand"][1] > 0.4 > 0.0 > place["right_hand"][1]
    assert place["left_foot"][1] > 0.0 > place["right_foot"][1]
    assert place["left_foot"][0] > 0.1
    assert np.allclose(ends.axes, np.eye(3), atol=0.02)
