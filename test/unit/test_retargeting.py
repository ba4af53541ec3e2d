"""Retargeting between figures made here: rest poses, proportions, frames of bones, bad input."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.anatomy import SourceReference
from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.kinematics import ForwardKinematics, rest_transforms
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.errors import GeometryError, ParameterError
from test.bodies import with_fingers

ARMS = {"tee": 0.0, "a_pose": 45.0, "hanging": 88.0}  # below the horizontal
SIDES = (("left", 1.0), ("right", -1.0))


def person(arms="tee", *, size=1.0, leg=0.42, turn=0.0, elbow=0.0):
    """Joint name, parent and rest position, z up, facing x (turned by `turn` degrees)."""
    c, s = np.cos(np.radians(ARMS[arms])), np.sin(np.radians(ARMS[arms]))
    bend = Rotation.from_euler("z", -elbow, degrees=True).as_matrix()
    hips = 2 * leg + 0.07
    joints = [
        ("hips", None, (0, 0, hips)),
        ("spine", "hips", (0, 0, hips + 0.1)),
        ("chest", "spine", (0, 0, hips + 0.25)),
        ("neck", "chest", (0, 0, hips + 0.5)),
        ("head", "neck", (0, 0, hips + 0.6)),
    ]
    for side, sign in SIDES:
        arm = np.array([0.0, c, -s])
        fore = bend @ arm
        shoulder = np.array([0.0, 0.18, hips + 0.45])
        mirror = np.array([1.0, sign, 1.0])
        for name, above, x in (
            ("UpperArm", "chest", shoulder),
            ("LowerArm", f"{side}UpperArm", shoulder + 0.28 * arm),
            ("Hand", f"{side}LowerArm", shoulder + 0.28 * arm + 0.25 * fore),
            ("UpperLeg", "hips", np.array([0, 0.09, hips])),
            ("LowerLeg", f"{side}UpperLeg", np.array([0, 0.09, hips - leg])),
            ("Foot", f"{side}LowerLeg", np.array([0, 0.09, hips - 2 * leg])),
            ("Toes", f"{side}Foot", np.array([0.14, 0.09, 0.02])),
        ):
            joints.append((side + name, above, x * mirror))
    R = Rotation.from_euler("z", turn, degrees=True).as_matrix()
    return [(n, a, size * R @ np.asarray(x, float)) for n, a, x in joints]


def rig_of(joints, *, rolls=None, channels=True):
    """A rig whose joints' axes are turned by `rolls` (rotation vectors) in rest pose."""
    names = [name for name, _, _ in joints]
    n = len(names)
    world = np.tile(np.eye(4), (n, 1, 1))
    world[:, :3, 3] = [x for _, _, x in joints]
    if rolls is not None:
        world[:, :3, :3] = Rotation.from_rotvec(rolls).as_matrix()
    parent = np.array([names.index(a) if a else -1 for _, a, _ in joints], np.int32)
    local = np.array([T if p < 0 else np.linalg.inv(world[p]) @ T for T, p in zip(world, parent)])
    dofs = Dofs.none()
    if channels:
        kinds = [TRANSLATION] * 3 + [ROTATION] * (3 * n)
        d = len(kinds)
        dofs = Dofs(
            names=tuple(f"c{i}" for i in range(d)),
            joint=np.array([0] * 3 + list(np.repeat(np.arange(n), 3)), np.int32),
            kind=np.array(kinds, np.int8),
            axis=np.concatenate([np.eye(3), np.tile(np.eye(3), (n, 1))]),
            lower=np.full(d, -np.inf),
            upper=np.full(d, np.inf),
            mimic_source=np.full(d, -1, np.int32),
            mimic_multiplier=np.ones(d),
            mimic_offset=np.zeros(d),
        )
    return Rig(joint_names=tuple(names), parent=parent, T_parent_joint=local, dofs=dofs)


def body_of(joints, rolls=None):
    """A body whose skin is one point per joint, on the ground below the toes."""
    rig = rig_of(joints, rolls=rolls, channels=False)
    x = rest_transforms(rig)[:, :3, 3].copy()
    x[[name.endswith("Toes") for name in rig.joint_names], 2] = 0.0
    n = len(rig)
    return Body(
        name="target",
        rig=rig,
        skin=Skin(
            vertices=x,
            triangles=np.zeros((0, 3), np.int32),
            bone=np.maximum(rig.parent, 0)[:, None],
            weight=np.ones((n, 1)),
            T_bone_bind=np.tile(np.eye(4), (n, 1, 1)),
        ),
        humanoid=humanoid_map(rig.joint_names, rig.parent),
    )


def acting(rig, seed, amount=0.5):
    """Channel values of a pose, standing near the origin."""
    q = np.random.default_rng(seed).uniform(-amount, amount, len(rig.dofs))
    q[:3] *= 0.2
    return q


def bone(T, rig, a, b):
    v = T[rig.index(b), :3, 3] - T[rig.index(a), :3, 3]
    return v / np.linalg.norm(v)


LIMBS = [
    (side + a, side + b)
    for side, _ in SIDES
    for a, b in (
        *(("UpperArm", "LowerArm"), ("LowerArm", "Hand")),
        *(("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot")),
    )
]


@pytest.mark.parametrize("arms", ARMS)
def test_same_skeleton_same_pose(arms):
    joints = person(arms)
    source, target = rig_of(joints), body_of(joints)
    retargeter = Retargeter(source, target)
    fk = ForwardKinematics(source)
    for seed in range(5):
        q = acting(source, seed)
        np.testing.assert_allclose(retargeter.world_joints(q), fk.from_dofs(q), atol=1e-9)
        np.testing.assert_allclose(retargeter.root_pose, fk.from_dofs(q)[0], atol=1e-9)


@pytest.mark.parametrize("source_arms", ARMS)
@pytest.mark.parametrize("target_arms", ARMS)
def test_rest_poses_and_bone_axes_drop_out(source_arms, target_arms):
    """Whatever the rest poses, limbs point where the source's do, and hinges turn alike."""
    rng = np.random.default_rng(1)
    joints = person(target_arms, size=0.8, leg=0.45)
    source = rig_of(person(source_arms, turn=140.0), rolls=rng.normal(size=(19, 3)))
    target = body_of(joints, rolls=rng.normal(size=(19, 3)))
    retargeter = Retargeter(source, target)
    fk = ForwardKinematics(source)
    for seed in range(4):
        q = acting(source, seed, 0.7)
        T_source = fk.from_dofs(q).copy()
        T = retargeter.world_joints(q)
        for a, b in LIMBS:
            np.testing.assert_allclose(
                bone(T, target.rig, a, b), bone(T_source, source, a, b), atol=1e-7
            )
        np.testing.assert_allclose(np.linalg.norm(T[:, :3, 0], axis=1), 1.0, atol=1e-12)


def test_twist_follows_anatomy_not_axes():
    """A bent elbow of an arm hanging in the source bends the same way in a T-pose target."""
    source, target = rig_of(person("hanging")), body_of(person("tee"))
    q = np.zeros(len(source.dofs))
    # The hanging forearm flexes forward: about -y.
    q[3 + 3 * source.index("leftLowerArm") + 1] = -np.pi / 2
    T = Retargeter(source, target).world_joints(q)
    rest = rest_transforms(target.rig)
    j = target.rig.index("leftLowerArm")
    turn = T[j, :3, :3] @ rest[j, :3, :3].T
    np.testing.assert_allclose(turn @ [0, 1, 0], [1, 0, 0], atol=0.05)  # along x: forward
    np.testing.assert_allclose(turn @ [0, 0, -1], [0, -1, 0], atol=0.05)  # inner side inward


def test_bent_rest_elbow_is_straightened():
    source, target = rig_of(person("tee")), body_of(person("a_pose", elbow=40.0))
    T = Retargeter(source, target).world_joints(np.zeros(len(source.dofs)))
    upper = bone(T, target.rig, "leftUpperArm", "leftLowerArm")
    np.testing.assert_allclose(upper, [0, 1, 0], atol=1e-7)
    np.testing.assert_allclose(bone(T, target.rig, "leftLowerArm", "leftHand"), upper, atol=1e-7)


def test_hinges_that_are_told_win():
    """An upper arm whose elbow axis is turned by 30 degrees turns the target's arm by as much."""
    source, target = rig_of(person("hanging", leg=0.45)), body_of(person("hanging"))
    s, c = np.sin(np.radians(30)), np.cos(np.radians(30))
    told = SourceReference(hinges={"leftUpperArm": np.array([s, -c, 0.0])})
    q = np.zeros(len(source.dofs))
    plain = Retargeter(source, target).world_joints(q).copy()
    turned = Retargeter(source, target, reference=told).world_joints(q)
    j = target.rig.index("leftUpperArm")
    angle = Rotation.from_matrix(turned[j, :3, :3] @ plain[j, :3, :3].T).magnitude()
    assert np.degrees(angle) == pytest.approx(30.0, abs=0.2)
    np.testing.assert_allclose(turned[:, :3, 3], plain[:, :3, 3], atol=1e-2)


def test_captured_reference_pose_takes_its_lean_out():
    """A source whose zero pose is nonsense is compared in the pose that its reference gives."""
    joints = person("hanging")
    upright = rig_of(joints)
    rng = np.random.default_rng(4)
    lean = np.zeros(len(upright.dofs))
    for name in ("hips", "leftUpperLeg", "rightUpperLeg"):
        j = upright.index(name)
        lean[3 + 3 * j + 1] = 0.2 if name == "hips" else -0.2
    # The same person with scrambled zero pose: rest rotations are random, angles undo them.
    scrambled = Rotation.random(len(upright), random_state=5).as_matrix()
    T = upright.T_parent_joint.copy()
    T[:, :3, :3] = T[:, :3, :3] @ scrambled
    source = Rig(
        joint_names=upright.joint_names,
        parent=upright.parent,
        T_parent_joint=T,
        dofs=upright.dofs,
    )

    def angles(q):
        out = q.copy()
        for j in range(len(source)):
            local = Rotation.from_euler("XYZ", q[3 + 3 * j : 6 + 3 * j]).as_matrix()
            wanted = Rotation.from_matrix(scrambled[j].T @ local)
            out[3 + 3 * j : 6 + 3 * j] = wanted.as_euler("XYZ")
        out[:3] = scrambled[0].T @ q[:3]
        return out

    reference = SourceReference(values=dict(zip(source.dofs.names, angles(lean))))
    target = body_of(joints)
    retargeter = Retargeter(source, target, reference=reference)
    for _ in range(3):
        q = rng.uniform(-0.3, 0.3, len(upright.dofs))
        expected = ForwardKinematics(upright).from_dofs(q)
        found = retargeter.world_joints(angles(q))
        for a, b in [*LIMBS, ("spine", "chest"), ("chest", "neck")]:
            np.testing.assert_allclose(
                bone(found, target.rig, a, b), bone(expected, upright, a, b), atol=2e-2
            )


def test_turned_and_moved_source():
    """Turning and moving the source on the ground turns and moves the target, scaled."""
    source, target = rig_of(person("tee")), body_of(person("a_pose", size=0.7))
    G = np.eye(4)
    G[:3, :3] = Rotation.from_euler("z", 1.1).as_matrix()
    G[:2, 3] = (0.4, -2.0)
    plain = Retargeter(source, target)
    moved = Retargeter(source, target, T_world_source=G)
    scaled = G.copy()
    scaled[:3, 3] *= plain.scale
    for seed in range(3):
        q = acting(source, seed)
        np.testing.assert_allclose(
            moved.world_joints(q), scaled @ plain.world_joints(q), atol=1e-9
        )


def test_feet_stay_on_the_ground_at_any_size():
    source = rig_of(person("tee"))
    fk = ForwardKinematics(source)
    for size, leg in ((0.6, 0.42), (1.2, 0.5)):
        target = body_of(person("tee", size=size, leg=leg))
        told = SourceReference(ankle_height=0.07)
        retargeter = Retargeter(source, target, reference=told)
        assert retargeter.scale == pytest.approx(size * leg / 0.42)
        ankle = target.rig.index("leftFoot"), target.rig.index("rightFoot")
        for lift in (0.0, 0.3):
            q = np.zeros(len(source.dofs))
            q[2] = lift
            q[3 + 3 * source.index("leftUpperLeg") + 1] = -0.9  # one leg raised
            low = fk.from_dofs(q)[source.index("rightFoot"), 2, 3]
            T = retargeter.world_joints(q)
            wanted = 0.07 * size + retargeter.scale * (low - 0.07)
            assert min(T[j, 2, 3] for j in ankle) == pytest.approx(wanted, abs=2e-3)


def test_a_handstand_stands_on_its_hands():
    source = rig_of(person("tee"))
    target = body_of(person("tee", leg=0.2))  # long arms for its legs
    q = np.zeros(len(source.dofs))
    q[3] = np.pi  # upside down about x
    for side, sign in SIDES:
        q[3 + 3 * source.index(f"{side}UpperArm")] = sign * np.pi / 2
    low = ForwardKinematics(source).from_dofs(q)[source.index("leftHand"), 2, 3]
    q[2] -= low
    retargeter = Retargeter(source, target)
    T = retargeter.world_joints(q)
    assert T[target.rig.index("leftHand"), 2, 3] == pytest.approx(0.0, abs=1e-3)
    assert T[target.rig.index("leftFoot"), 2, 3] > 0.8


def test_without_hands_a_handstand_stands_on_its_wrists():
    """What the body has beyond them is not in the source; its finger tips would carry it."""
    source = rig_of([j for j in person("tee") if not j[0].endswith("Hand")])
    target = with_fingers(body_of(person("tee")), 0.18)
    joints = {name: x for name, _, x in person("tee")}
    forearm = joints["leftHand"] - joints["leftLowerArm"]
    ends = {f"{side}LowerArm": sign * forearm for side, sign in SIDES}
    q = np.zeros(len(source.dofs))
    q[3] = np.pi  # upside down about x
    for side, sign in SIDES:
        q[3 + 3 * source.index(f"{side}UpperArm")] = sign * np.pi / 2
    elbow = ForwardKinematics(source).from_dofs(q)[source.index("leftLowerArm")]
    q[2] -= (elbow[:3, :3] @ forearm + elbow[:3, 3])[2]
    retargeter = Retargeter(source, target, reference=SourceReference(end_sites=ends))
    T = retargeter.world_joints(q, 0.0)
    assert T[target.rig.index("leftHand"), 2, 3] == pytest.approx(0.0, abs=1e-3)
    T = retargeter.world_joints(q, 0.0, ground_feet=False)
    assert T[target.rig.index("leftHand"), 2, 3] == pytest.approx(0.18, abs=1e-3)


def test_trunk_between_is_shared_and_missing_bones_follow():
    source = _without_spine()
    target = body_of(person("tee"))
    retargeter = Retargeter(source, target)
    q = np.zeros(len(source.dofs))
    q[3 + 3 * source.index("chest") + 2] = 0.8  # the chest turns about the vertical
    T = retargeter.world_joints(q)
    turned = [
        Rotation.from_matrix(T[target.rig.index(name), :3, :3]).as_rotvec()[2]
        for name in ("hips", "spine", "chest", "neck", "head", "leftHand")
    ]
    np.testing.assert_allclose(turned, [0.0, 0.4, 0.8, 0.8, 0.8, 0.8], atol=1e-9)
    assert set(retargeter.unmapped_target) >= {"spine", "neck", "head", "leftHand"}
    assert "chest" not in retargeter.unmapped_target


def _without_spine():
    joints = [
        (n, "hips" if a == "spine" else a, x)
        for n, a, x in person("tee")
        if n not in ("spine", "neck", "head", "leftHand", "rightHand", "leftToes", "rightToes")
    ]
    return rig_of(joints)


def test_half_of_the_hands_twist_is_in_the_forearm():
    joints = person("tee")
    k = next(i for i, j in enumerate(joints) if j[0] == "leftHand")
    elbow = next(x for n, _, x in joints if n == "leftLowerArm")
    joints[k] = ("leftHand", "twist", joints[k][2])
    joints.insert(k, ("twist", "leftLowerArm", 0.5 * (elbow + joints[k][2])))
    source, target = rig_of(person("tee")), body_of(joints)
    q = np.zeros(len(source.dofs))
    q[3 + 3 * source.index("leftHand") + 1] = 1.0  # about the forearm
    T = Retargeter(source, target).world_joints(q)
    twist = [
        Rotation.from_matrix(T[target.rig.index(name), :3, :3]).as_rotvec()
        for name in ("leftLowerArm", "twist", "leftHand")
    ]
    np.testing.assert_allclose(twist, [[0, 0, 0], [0, 0.5, 0], [0, 1.0, 0]], atol=1e-9)


def test_joints_above_the_hips_go_with_them():
    joints = [("armature", None, np.zeros(3)), *person("tee")]
    joints[1] = ("hips", "armature", joints[1][2])
    source, target = rig_of(person("tee")), body_of(joints)
    q = acting(source, 3)
    T = Retargeter(source, target).world_joints(q)
    rest = rest_transforms(target.rig)
    np.testing.assert_allclose(
        T[0] @ np.linalg.inv(rest[0]), T[1] @ np.linalg.inv(rest[1]), atol=1e-9
    )


def test_source_joints_that_drive_nothing_are_listed():
    joints = [*person("tee"), ("tail", "hips", np.array([-0.2, 0, 0.9]))]
    retargeter = Retargeter(rig_of(joints), body_of(person("tee")))
    assert retargeter.unmapped_source == ("tail",)
    assert ("chest", "chest") in retargeter.mapping


def test_overrides_name_source_joints():
    odd = [(n.replace("head", "Kopf"), a, x) for n, a, x in person("tee")]
    source, target = rig_of(odd), body_of(person("tee"))
    assert "Kopf" in Retargeter(source, target).unmapped_source
    assert not Retargeter(source, target, overrides={"head": "Kopf"}).unmapped_source
    with pytest.raises(ParameterError, match="Kopfe"):
        Retargeter(source, target, overrides={"head": "Kopfe"})


def test_what_cannot_be_retargeted_is_said():
    good = person("tee")
    unknown = [(f"b{i}", a and f"b{[n for n, _, _ in good].index(a)}", x)
               for i, (_, a, x) in enumerate(good)]  # fmt: skip
    with pytest.raises(GeometryError, match=r"source.*hips"):
        Retargeter(rig_of(unknown), body_of(good))
    with pytest.raises(GeometryError, match=r"target.*hips"):
        Retargeter(rig_of(good), body_of(unknown))
    trunk = [j for j in good if "left" not in j[0] and "right" not in j[0]]
    with pytest.raises(GeometryError, match="hip joints nor both shoulders"):
        Retargeter(rig_of(trunk), body_of(good))


def test_a_rest_pose_that_lies_is_noted():
    lying = Rotation.from_euler("y", 90, degrees=True).as_matrix()
    joints = [(n, a, lying @ x) for n, a, x in person("tee")]
    retargeter = Retargeter(rig_of(joints), body_of(person("tee")))
    assert any("source" in note for note in retargeter.notes)


def test_zero_length_bones_stay_finite():
    flat = [(n, a, np.array([0.0, 0.09 * np.sign(x[1]), 0.0])) for n, a, x in person("tee")]
    source = rig_of(flat)
    T = Retargeter(source, body_of(person("tee"))).world_joints(acting(source, 0))
    assert np.isfinite(T).all()
