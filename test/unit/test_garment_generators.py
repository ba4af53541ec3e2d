"""Built-in garments on the mannequin: shape, fit, attachments."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms, world_from_local
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.colliders.capsules.capsules import fit_capsules
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.errors import GeometryError, ParameterError
from garment_sim_ros.garment.generators import long_skirt, short_skirt, tshirt
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import (
    boundary_loops,
    mesh_topology,
    non_manifold_edges,
    vertex_normals,
)
from garment_sim_ros.geometry.transforms import invert_transform, transform_from
from test.bodies import scaled, with_yoke

MAKERS = {"short_skirt": short_skirt, "long_skirt": long_skirt, "tshirt": tshirt}


@cache
def body(source="mannequin:vertices=2000"):
    return load_body(source)


@cache
def made(name, source="mannequin:vertices=2000"):
    return MAKERS[name](body(source))


def edge_lengths(garment, x=None):
    edges = mesh_topology(garment.triangles).edges
    x = garment.vertices if x is None else x
    return np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)


def gaps(garment, wearer):
    """Signed distances of a garment to the skin, positive outside [m]."""
    x = skin_vertices(wearer.skin, rest_transforms(wearer.rig))
    return MeshDistance(x, wearer.skin.triangles).signed_distance(garment.vertices)[0]


@pytest.mark.parametrize(
    ("name", "vertices", "triangles", "openings"),
    [
        ("short_skirt", 1687, 3264, 2),
        ("long_skirt", 2235, 4338, 2),
        ("tshirt", 1503, 2908, 4),
    ],
)
def test_size_and_topology(name, vertices, triangles, openings):
    """The first paper's numbers: vertices exactly, triangles within 1 %."""
    garment = made(name)
    assert len(garment.vertices) == vertices
    assert len(garment.triangles) == pytest.approx(triangles, rel=0.01)
    assert len(np.unique(garment.triangles)) == vertices
    assert not len(non_manifold_edges(garment.triangles))
    assert mesh_topology(garment.triangles).triangle_count.max() == 2
    assert len(boundary_loops(garment.triangles)) == openings


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize(
    "source",
    [
        "mannequin:vertices=2000",
        "mannequin:height=1.5,sex=1.0,build=1.0,vertices=1000",
        "mannequin:height=2.0,sex=0.0,build=0.0",
    ],
)
def test_fits_any_figure(name, source):
    garment, wearer = made(name, source), body(source)
    gap = gaps(garment, wearer) * 1.65 / Measures(wearer).height
    assert gap.min() > 0.002
    if name != "long_skirt":  # which hangs clear of the legs
        assert np.median(gap) < 0.04
    # Outward: the nearest skin lies behind every triangle.
    x = garment.vertices[garment.triangles]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    skin = skin_vertices(wearer.skin, rest_transforms(wearer.rig))
    _, closest, _ = MeshDistance(skin, wearer.skin.triangles).signed_distance(x.mean(axis=1))
    behind = np.einsum("ti,ti->t", normal, x.mean(axis=1) - closest) > 0.0
    assert behind.mean() > (0.9 if name == "long_skirt" else 0.97)


@pytest.mark.parametrize("name", MAKERS)
def test_even_edges(name):
    length = edge_lengths(made(name))
    assert length.max() < 1.8 * np.median(length)
    assert length.min() > 0.4 * np.median(length)


@pytest.mark.parametrize(
    ("name", "count"), [("short_skirt", 60), ("tshirt", 333), ("tshirt", 4001)]
)
def test_any_resolution(name, count):
    garment = MAKERS[name](body(), vertices=count)
    assert len(garment.vertices) == count
    assert gaps(garment, body()).min() > 0.0
    length = edge_lengths(garment)
    assert length.max() < 2.2 * np.median(length)


def test_a_shirt_s_ease_is_its_distance_from_the_trunk():
    wearer = body()
    low = Measures(wearer).shoulders - 0.15
    found = []
    for ease in (0.01, 0.04):
        shirt = tshirt(wearer, vertices=800, ease=ease)
        trunk = (shirt.vertices[:, 2] < low) & (np.abs(shirt.vertices[:, 1]) < 0.12)
        found.append(np.median(gaps(shirt, wearer)[trunk]))
    assert found[1] - found[0] == pytest.approx(0.03, abs=0.005)


def openings(garment):
    """Hem and neckline, as vertices in order."""
    loops = sorted(boundary_loops(garment.triangles), key=lambda v: garment.vertices[v, 2].mean())
    return loops[0], loops[-1]


@pytest.mark.parametrize("length", [0.2, 0.8, 1.0])
def test_a_shirt_s_length_is_where_its_hem_is(length):
    shirt, measures = tshirt(body(), vertices=800, length=length), Measures(body())
    hem, _ = openings(shirt)
    wanted = measures.waist - length * (measures.waist - measures.hips)
    assert np.abs(shirt.vertices[hem, 2] - wanted).max() < 0.003


@pytest.mark.parametrize("height", [1.45, 1.65, 2.0])
def test_a_shirt_s_neckline_lies_on_the_base_of_the_neck(height):
    """All around the neck, close to the skin, lower in front, and no wider than shirts are."""
    wearer = body(f"mannequin:vertices=2000,height={height}")
    shirt, measures = tshirt(wearer), Measures(wearer)
    _, neckline = openings(shirt)
    x, neck = shirt.vertices[neckline], measures.neck_base
    gap = MeshDistance(wearer.skin.vertices, wearer.skin.triangles).signed_distance(x)[0]
    assert gap.min() > 0.002
    assert gap.max() < 0.017 * measures.unit
    front, back = x[np.argmax(x[:, 0])], x[np.argmin(x[:, 0])]
    assert 0.04 * measures.unit < back[2] - front[2] < 0.09 * measures.unit
    apart = np.linalg.norm(x[:, :2] - neck.centre[:2], axis=1)
    assert 0.9 * neck.radius < apart.min()
    assert apart.max() < 2.0 * neck.radius
    angle = np.sort(np.arctan2(x[:, 1] - neck.centre[1], x[:, 0] - neck.centre[0]))
    assert np.diff(angle, append=angle[0] + 2.0 * np.pi).max() < 1.0


def test_a_neckline_on_flat_shoulders_is_about_the_neck():
    """A puppet's chest is a shell as high as the neck's joint, as wide as the shoulders."""
    top = Measures(body()).neck + 0.02
    wearer = with_yoke(body(), top - 0.1, top)
    shirt, neck = tshirt(wearer), Measures(wearer).neck_base
    _, neckline = openings(shirt)
    x = shirt.vertices[neckline]
    apart = np.linalg.norm(x[:, :2] - neck.centre[:2], axis=1)
    assert 0.9 * neck.radius < apart.min()
    assert apart.max() < 2.0 * neck.radius
    assert neck.centre[2] > top


@pytest.mark.parametrize("name", MAKERS)
def test_pins(name):
    garment = made(name)
    measures = Measures(body())
    share = len(garment.pins) / len(garment.vertices)
    assert 0.0 < share < 0.06
    assert len(set(garment.pin_frame.tolist())) == 1
    height = garment.vertices[garment.pins, 2]
    if name == "tshirt":
        assert height.min() > measures.shoulders
        y = np.sort(garment.vertices[garment.pins, 1])
        assert y[: len(y) // 2].max() < 0.0 < y[len(y) // 2 :].min()
        assert garment.frames[garment.pin_frame[0]] == body().humanoid["upperChest"]
    else:
        assert height == pytest.approx(measures.waist)
        assert garment.frames[garment.pin_frame[0]] in {
            body().humanoid[bone] for bone in ("hips", "spine")
        }


@pytest.mark.parametrize("bone", ["spine", "chest", "upperChest"])
@pytest.mark.parametrize("degrees", [-15.0, 15.0])
def test_shoulder_pins_stay_over_the_skin_as_the_trunk_bends(bone, degrees):
    garment, wearer = made("tshirt"), body()
    joint = wearer.rig.index(wearer.humanoid[bone])
    T_local = wearer.rig.T_parent_joint.copy()
    T_local[joint, :3, :3] @= Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    T = world_from_local(wearer.rig, T_local)
    skin = MeshDistance(skin_vertices(wearer.skin, T), wearer.skin.triangles)
    frames = [wearer.rig.index(name) for name in garment.frames]
    rigid = T[frames] @ invert_transform(garment.T_world_frame_rest)
    x = np.column_stack([garment.vertices[garment.pins], np.ones(len(garment.pins))])
    pins = np.einsum("pij,pj->pi", rigid[garment.pin_frame], x)[:, :3]
    assert skin.signed_distance(pins)[0] == pytest.approx(
        gaps(garment, wearer)[garment.pins], abs=4e-3
    )


@pytest.mark.parametrize("name", MAKERS)
def test_frames_and_weights(name):
    garment = made(name)
    rig = body().rig
    assert garment.frame_index.shape == garment.frame_weight.shape
    assert garment.frame_index.shape[1] <= 4
    assert np.allclose(garment.frame_weight.sum(axis=1), 1.0)
    assert garment.frame_weight.min() >= 0.0
    T = rest_transforms(rig)
    for frame, rest in zip(garment.frames, garment.T_world_frame_rest):
        assert np.allclose(rest, T[rig.index(frame)])
    # Weights change slowly along the cloth, also from leg to leg.
    dense = np.zeros((len(garment.vertices), len(garment.frames)))
    np.add.at(dense, (np.arange(len(dense))[:, None], garment.frame_index), garment.frame_weight)
    edges = mesh_topology(garment.triangles).edges
    assert np.abs(dense[edges[:, 0]] - dense[edges[:, 1]]).max() < 0.35
    legs = {body().humanoid[bone] for bone in ("leftUpperLeg", "rightUpperLeg")}
    arms = {body().humanoid[bone] for bone in ("leftUpperArm", "rightUpperArm")}
    assert (arms if name == "tshirt" else legs) <= set(garment.frames)
    if name != "tshirt":
        assert not arms & set(garment.frames)
        assert arms <= set(garment.passed_by)
    assert body().humanoid["head"] in garment.passed_by


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("factor", [2.0**-10, 2.0**6])
def test_scales_with_the_body(name, factor):
    """A wearer of 1.7 mm or 109 m gets the same garment at that size."""
    garment = made(name)
    other = MAKERS[name](scaled(body(), factor))
    assert np.array_equal(other.triangles, garment.triangles)
    assert np.allclose(other.vertices / factor, garment.vertices, rtol=0, atol=1e-9)
    assert np.array_equal(other.pins, garment.pins)
    if other.frames == garment.frames:  # bones merge where joints are less than 1 mm apart
        assert np.allclose(other.frame_weight, garment.frame_weight, atol=1e-9)


def test_same_twice():
    first, second = made("tshirt"), tshirt(body())
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.triangles, second.triangles)


def test_hanging_arms_are_raised():
    """A shirt for arms along the trunk is made in a pose with room between them."""
    wearer = body()
    measures = Measures(wearer)
    T = measures.T_world_joint.copy()
    local = wearer.rig.T_parent_joint.copy()
    for side, sign in (("left", -1.0), ("right", 1.0)):
        joint = wearer.rig.index(wearer.humanoid[f"{side}UpperArm"])
        axis = measures.joint(f"{side}LowerArm") - measures.joint(f"{side}UpperArm")
        angle = sign * (np.arctan2(abs(axis[1]), -axis[2]) - np.radians(4.0))
        turn = np.eye(4)
        turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        world = T[joint, :3, :3]
        local[joint, :3, :3] = local[joint, :3, :3] @ world.T @ turn[:3, :3] @ world
    rig = dataclasses.replace(wearer.rig, T_parent_joint=local)
    hanging = dataclasses.replace(wearer, rig=rig)
    arm = Measures(hanging).joint("leftLowerArm") - Measures(hanging).joint("leftUpperArm")
    assert np.degrees(np.arctan2(arm[1], -arm[2])) == pytest.approx(4.0, abs=0.5)
    garment = tshirt(hanging)
    assert len(garment.vertices) == 1503
    T_rest = rest_transforms(hanging.rig)
    i = garment.frames.index(wearer.humanoid["leftUpperArm"])
    assert not np.allclose(garment.T_world_frame_rest[i], T_rest[rig.index(garment.frames[i])])


def test_a_shirt_goes_around_clothes_of_the_body_s_file():
    """An open coat, standing off the trunk from the hips to the armpits, has no inside."""
    bare = body()
    skin = bare.skin
    normal = np.empty_like(skin.vertices)
    vertex_normals(skin.vertices, skin.triangles, normal)
    z = skin.vertices[:, 2]
    trunk = (z > 0.8) & (z < 1.2) & (Measures(bare).trunk_share > 0.9)
    covered = skin.triangles[trunk[skin.triangles].all(axis=1)]
    used, coat = np.unique(covered, return_inverse=True)
    off = skin.vertices[used] + 0.05 * normal[used]
    coat = (coat.reshape(-1, 3) + len(skin.vertices)).astype(np.int32)
    x = np.concatenate([skin.vertices, off])
    dressed = dataclasses.replace(
        skin,
        vertices=x,
        triangles=np.concatenate([skin.triangles, coat]),
        bone=np.concatenate([skin.bone, skin.bone[used]]),
        weight=np.concatenate([skin.weight, skin.weight[used]]),
    )
    garment = tshirt(dataclasses.replace(bare, skin=dressed))
    assert len(boundary_loops(garment.triangles)) == 4
    assert np.abs(MeshDistance(x, coat).signed_distance(garment.vertices)[0]).min() > 0.01
    assert gaps(garment, bare).min() > 0.002


def test_let_out_over_colliders():
    """Where colliders stand off the skin the cut is wider; it starts outside and unstretched."""
    colliders = fit_capsules(body(), delta=0.015)
    garment = short_skirt(body(), colliders=colliders)
    poses = ColliderPoser(colliders, body()).poses(rest_transforms(body().rig))
    depth = np.full(len(garment.vertices), -np.inf)
    for i, shape in enumerate(colliders.colliders):
        if shape.kind == "frame" or shape.bone in garment.passed_by:
            continue
        T = transform_from(poses.position[i], poses.orientation[i])
        local = (garment.vertices - T[:3, 3]) @ T[:3, :3]
        g = {key: float(value) for key, value in shape.geometry.items()}
        if shape.kind == "sphere":
            inside = g["radius"] - np.linalg.norm(local, axis=1)
        else:
            t = np.clip(local[:, 2], 0.0, g["length"])
            radius = g["radius0"] + (g["radius1"] - g["radius0"]) * t / g["length"]
            inside = radius - np.hypot(np.hypot(local[:, 0], local[:, 1]), local[:, 2] - t)
        depth = np.maximum(depth, inside)
    assert depth.max() < 0.0
    assert gaps(garment, body()).min() > 0.0
    cut = made("short_skirt")
    assert edge_lengths(garment).sum() > edge_lengths(cut).sum()
    assert np.array_equal(garment.triangles, cut.triangles)
    assert edge_lengths(garment).max() < 2.0 * np.median(edge_lengths(garment))


@pytest.mark.parametrize(
    ("name", "missing"),
    [
        ("short_skirt", "leftUpperLeg"),
        ("short_skirt", "rightLowerLeg"),
        ("tshirt", "leftUpperArm"),
        ("tshirt", "rightLowerArm"),
    ],
)
def test_missing_bones_are_named(name, missing):
    humanoid = {k: v for k, v in body().humanoid.items() if k != missing}
    with pytest.raises(GeometryError, match=f"no bone {missing}"):
        MAKERS[name](dataclasses.replace(body(), humanoid=humanoid))


def test_no_skeleton_no_trunk_lying_down():
    with pytest.raises(GeometryError, match="no bone"):
        short_skirt(dataclasses.replace(body(), humanoid={}))
    skin = body().skin
    share = Measures(body()).share("hips") - Measures(body()).share(
        "leftUpperArm", "rightUpperArm"
    )
    limbs = skin.triangles[(share[skin.triangles] < 0.5).all(axis=1)]
    with pytest.raises(GeometryError, match="too little skin"):
        tshirt(dataclasses.replace(body(), skin=dataclasses.replace(skin, triangles=limbs)))
    local = body().rig.T_parent_joint.copy()
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    local[0] = turn @ local[0]
    lying = dataclasses.replace(body().rig, T_parent_joint=local)
    with pytest.raises(GeometryError, match="upright rest pose"):
        short_skirt(dataclasses.replace(body(), rig=lying))


@pytest.mark.parametrize(
    ("name", "option", "value"),
    [
        ("short_skirt", "vertices", 10),
        ("short_skirt", "flare", float("nan")),
        ("long_skirt", "length", 2.0),
        ("tshirt", "vertices", 10**9),
        ("tshirt", "vertices", "many"),
        ("tshirt", "collar", 1),
    ],
)
def test_bad_options_are_named(name, option, value):
    with pytest.raises(ParameterError, match=option):
        MAKERS[name](body(), **{option: value})


@pytest.mark.parametrize("name", ["mannequin", "mh_female_young.glb", "CesiumMan.glb"])
def test_a_long_skirt_ends_above_the_feet(name, data_file):
    """Toes that are in the hem at rest come out through it in the first step."""
    wearer = load_body(name if name == "mannequin" else data_file("bodies", name))
    skirt = long_skirt(wearer)
    feet = wearer.skin.vertices[Measures(wearer).share("leftFoot", "rightFoot") > 0.5]
    assert feet[:, 2].max() + 0.01 < skirt.vertices[:, 2].min() < feet[:, 2].max() + 0.04
