"""Sampling and retargeting kernels against plain double-precision twins."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retarget_pass import BLEND, DRIVEN, FOLLOW
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.mocap.channels import ball_joints
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.root_motion import RootMotion
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.walk import walk

WALK = walk(strides=4)
SAMPLER = ClipSampler(WALK)


@settings(max_examples=80, derandomize=True, deadline=None)
@given(st.floats(0.0, WALK.duration))
def test_sampled_rotations_are_slerped(t):
    q = SAMPLER.sample(t)
    i = min(int(np.searchsorted(WALK.times, t, side="right")) - 1, len(WALK.times) - 2)
    s = (t - WALK.times[i]) / (WALK.times[i + 1] - WALK.times[i])
    joints = ball_joints(WALK.rig)
    for channels in joints.channels:
        ends = Rotation.from_euler("ZYX", WALK.values[i : i + 2, channels])
        expected = Slerp([0.0, 1.0], ends)(s)
        assert (Rotation.from_euler("ZYX", q[channels]).inv() * expected).magnitude() < 1e-5
    a, b = WALK.values[i, joints.single], WALK.values[i + 1, joints.single]
    np.testing.assert_allclose(q[joints.single], a + s * (b - a), atol=1e-12)


def _twin(retargeter, T_source):
    """`Retargeter.world_joints` joint by joint, with rotation objects."""
    r = retargeter
    n = len(r._parent)
    turned = [Rotation.identity()] * n

    def rest(values, j):
        return Rotation.from_quat(values[j])

    turns = r._turns
    for j in range(n):
        if turns.rule[j] == DRIVEN:
            of_source = Rotation.from_matrix(T_source[turns.source[j], :3, :3])
            turned[j] = of_source * rest(turns.offset, j)
    for j in range(n):
        above, below = turns.above[j], turns.below[j]
        if turns.rule[j] == FOLLOW:
            carrier = r._parent[j] if r._parent[j] >= 0 else r._hips
            turned[j] = turned[carrier] * rest(turns.rest_rotation, j)
        elif turns.rule[j] != DRIVEN:
            a = turned[above] * rest(turns.above_rest, j)
            b = turned[below] * rest(turns.below_rest, j)
            if turns.rule[j] == BLEND:
                turned[j] = Slerp([0, 1], Rotation.concatenate([a, b]))(turns.share[j])
            else:
                axis = turns.bone_axis[j]
                x, y, z, w = (a.inv() * b).as_quat()
                angle = 2.0 * np.arctan2(np.dot([x, y, z], axis), w)
                angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
                turned[j] = a * Rotation.from_rotvec(turns.share[j] * angle * axis)
    T = np.tile(np.eye(4), (n, 1, 1))
    hips = T_source[r._travel_joints, :3, 3].mean(axis=0) * r.scale
    hips = hips - turned[r._hips].apply(r._middle_in_hips)
    for j in range(n):
        p = r._parent[j]
        carrier, origin = (p, T[p, :3, 3]) if p >= 0 else (r._hips, hips)
        T[j, :3, 3] = origin + turned[carrier].apply(r._rest_position[j])
        T[j, :3, :3] = turned[j].as_matrix()

    def height(pose, offset):
        return (pose[:3, :3] @ offset + pose[:3, 3])[2]

    wanted, weight = [], []
    for (s, t), offsets, heights in zip(*r._contacts):
        z = height(T_source[s], offsets[0]) - heights[0]
        weight.append(-z / r._reach)
        wanted.append(r.scale * z + heights[1] - height(T[t], offsets[1]))
    w = np.exp(np.array(weight) - max(weight))
    softness = 0.5 * r._reach * r.scale
    T[:, 2, 3] += softness * np.log((w * np.exp(np.array(wanted) / softness)).sum() / w.sum())
    return T


@pytest.mark.parametrize("body", ["mannequin", "mh_female_young"])
def test_retargeting_pass(body, data_file):
    if body != "mannequin":
        body = data_file("bodies", f"{body}.glb")
    retargeter = Retargeter(WALK.rig, load_body(body), reference=WALK.source_reference)
    kinematics = ForwardKinematics(WALK.rig)
    rng = np.random.default_rng(0)
    for k in range(6):
        q = WALK.values[k * 50] + rng.normal(scale=0.3, size=WALK.values.shape[1])
        T_source = kinematics.from_dofs(q).copy()
        np.testing.assert_allclose(
            retargeter.world_joints(q), _twin(retargeter, T_source), atol=1e-9
        )


@settings(max_examples=25, derandomize=True, deadline=None)
@given(
    heading=st.floats(-7.0, 7.0),
    way=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)),
    frame=st.integers(0, len(WALK.times) - 1),
)
def test_turning_and_moving_the_source_turns_and_moves_the_body(heading, way, frame):
    body = load_body("mannequin:vertices=1000")
    G = np.eye(4)
    G[:3, :3] = Rotation.from_euler("z", heading).as_matrix()
    G[:2, 3] = way
    reference = WALK.source_reference
    plain = Retargeter(WALK.rig, body, reference=reference)
    moved = Retargeter(WALK.rig, body, T_world_source=G, reference=reference)
    expected = plain.world_joints(WALK.values[frame]).copy()
    G[:2, 3] *= plain.scale
    np.testing.assert_allclose(moved.world_joints(WALK.values[frame]), G @ expected, atol=1e-9)


@pytest.mark.parametrize("fade", [0.2, 0.4])
def test_the_end_is_led_to_the_start(fade):
    """The last samples turn by a growing part of what is missing to the first one."""
    rng = np.random.default_rng(3)
    joints = ball_joints(WALK.rig)
    clip = dataclasses.replace(
        WALK,
        times=WALK.times[:90],
        values=WALK.values[:90] + np.cumsum(rng.normal(0.0, 0.01, (90, 1)), axis=0),
        loops=False,
    )
    sampler = ClipSampler(clip, "loop", fade=fade)
    start = clip.duration - fade
    for t in clip.times[1:-1]:
        s = max((t - start) / fade, 0.0)
        share = s * s * (3.0 - 2.0 * s)
        plain, found = clip.values[np.searchsorted(clip.times, t)], sampler.sample(t)
        for channels in joints.channels:
            first, last, own = Rotation.from_euler(
                "ZYX", np.stack([clip.values[0], clip.values[-1], plain])[:, channels]
            )
            expected = Rotation.from_rotvec(share * (first * last.inv()).as_rotvec()) * own
            apart = Rotation.from_euler("ZYX", found[channels]).inv() * expected
            assert apart.magnitude() < 1e-5
        gap = share * (clip.values[0] - clip.values[-1])[joints.single]
        np.testing.assert_allclose(found[joints.single], plain[joints.single] + gap, atol=1e-9)


@settings(max_examples=10, derandomize=True, deadline=None)
@given(st.integers(-3, 3), st.integers(0, len(WALK.times) - 1))
def test_a_walk_is_carried_on_by_whole_cycles(cycles, frame):
    """The root's pose, turned and moved by what lies between the clip's ends on the ground."""
    forward = ForwardKinematics(WALK.rig)

    def root(q):
        return WALK.T_world_file @ forward.from_dofs(q)[WALK.rig.dofs.joint[5]].copy()

    first, last = root(WALK.values[0]), root(WALK.values[-1])
    turn = Rotation.from_matrix(last[:3, :3] @ first[:3, :3].T).as_quat()
    cycle = np.eye(4)
    heading = 2.0 * np.arctan2(turn[2], turn[3])
    cycle[:3, :3] = Rotation.from_euler("z", heading).as_matrix()
    cycle[:2, 3] = (last[:3, 3] - cycle[:3, :3] @ first[:3, 3])[:2]
    q = WALK.values[frame].copy()
    RootMotion(WALK).advance(q, cycles)
    expected = np.linalg.matrix_power(cycle, cycles) @ root(WALK.values[frame])
    np.testing.assert_allclose(root(q), expected, atol=1e-9)
    np.testing.assert_array_equal(q[6:], WALK.values[frame, 6:])


def test_a_clip_is_not_changed_by_sampling():
    values = WALK.values.copy()
    ClipSampler(WALK, "carry", fade=1.0).sample(77.7)
    np.testing.assert_array_equal(values, WALK.values)
    assert isinstance(WALK, Clip)
