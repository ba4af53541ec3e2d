"""Sampling: exact at the samples, the short way between them, loops without a jump."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.sampling import ClipSampler, closes, sample

Z_UP = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def _rig(channels, *, limited=()):
    """A chain of joints; `channels` has one string per joint, as "xyzZXY"."""
    names, joint, kind, axis = [], [], [], []
    for j, letters in enumerate(channels):
        for letter in letters:
            names.append(f"j{j}_{letter}")
            joint.append(j)
            kind.append(ROTATION if letter.isupper() else TRANSLATION)
            axis.append(np.eye(3)["xyz".index(letter.lower())])
    d = len(names)
    lower = np.array([-1.0 if name in limited else -np.inf for name in names])
    T = np.tile(np.eye(4), (len(channels), 1, 1))
    T[1:, 2, 3] = 0.3
    return Rig(
        joint_names=tuple(f"j{j}" for j in range(len(channels))),
        parent=np.arange(-1, len(channels) - 1, dtype=np.int32),
        T_parent_joint=T,
        dofs=Dofs(
            names=tuple(names),
            joint=np.array(joint, np.int32),
            kind=np.array(kind, np.int8),
            axis=np.array(axis).reshape(-1, 3),
            lower=lower,
            upper=-lower,
            mimic_source=np.full(d, -1, np.int32),
            mimic_multiplier=np.ones(d),
            mimic_offset=np.zeros(d),
        ),
    )


def _clip(rig, values, *, dt=0.1, T=None, loops=False):
    values = np.asarray(values, dtype=np.float64)
    return Clip(
        name="clip",
        rig=rig,
        times=dt * np.arange(len(values)),
        values=values,
        T_world_file=np.eye(4) if T is None else T,
        loops=loops,
    )


def _degrees(*rows):
    return np.radians(np.array(rows, dtype=np.float64))


def _turn(order, q):
    return Rotation.from_euler(order, q)


def test_samples_come_back_unchanged():
    values = np.random.default_rng(0).uniform(-9.0, 9.0, (20, 9))  # many turns, both branches
    clip = _clip(_rig(["xyzZXY", "YXZ"]), values)
    sampler = ClipSampler(clip)
    for t, expected in zip(clip.times, values):
        np.testing.assert_array_equal(sampler.sample(t), expected)


def test_time_outside_is_the_nearest_sample():
    values = np.random.default_rng(1).normal(size=(4, 3))
    clip = _clip(_rig(["ZXY"]), values)
    np.testing.assert_array_equal(sample(clip, -5.0), values[0])
    np.testing.assert_array_equal(sample(clip, 99.0), values[-1])


def test_one_sample_is_a_still():
    clip = _clip(_rig(["ZXY"]), [[0.1, 0.2, 0.3]])
    for repeat in ("once", "loop", "carry"):
        np.testing.assert_array_equal(sample(clip, 3.0, repeat), [0.1, 0.2, 0.3])


def test_across_half_a_turn_the_short_way():
    clip = _clip(_rig(["ZXY"]), _degrees((178, 0, 0), (-178, 0, 0)))
    middle = sample(clip, 0.05)
    assert abs(np.degrees(middle[0])) == pytest.approx(180.0)


def test_change_of_euler_branch_does_not_turn_the_joint():
    """(170, 100, 170) and (-10, 80, -10) are 0 degrees apart: nothing may move in between."""
    clip = _clip(_rig(["ZXY"]), _degrees((170, 100, 170), (-10, 80, -10)))
    start = _turn("ZXY", clip.values[0])
    for s in np.linspace(0.0, 1.0, 21):
        assert (start.inv() * _turn("ZXY", sample(clip, 0.1 * s))).magnitude() < 1e-7


def test_turns_at_constant_rate_about_one_axis():
    a, b = Rotation.from_euler("ZXY", (0.3, -0.8, 2.0)), Rotation.from_rotvec([0.4, -0.9, 0.7])
    clip = _clip(_rig(["ZXY"]), [a.as_euler("ZXY"), (a * b).as_euler("ZXY")])
    for s in (0.1, 0.35, 0.5, 0.9):
        wanted = a * Rotation.from_rotvec(s * b.as_rotvec())
        assert (wanted.inv() * _turn("ZXY", sample(clip, 0.1 * s))).magnitude() < 1e-9


def test_angles_do_not_jump_between_samples_of_a_smooth_motion():
    t = np.linspace(0.0, 6.0, 61)
    values = np.stack([2.0 * np.sin(t), 1.2 * np.sin(1.7 * t), 3.0 * np.cos(t)], axis=1)
    sampler = ClipSampler(_clip(_rig(["ZXY"]), values))
    fine = np.array([sampler.sample(x) for x in np.linspace(0.0, 6.0, 3001)])
    assert np.abs(np.diff(fine, axis=0)).max() < 0.02


def test_gimbal_lock_stays_finite_and_right():
    clip = _clip(_rig(["ZXY"]), _degrees((20, 90, 30), (50, 90, 10)))
    for s in np.linspace(0, 1, 11):
        q = sample(clip, 0.1 * s)
        assert np.isfinite(q).all()
        angle = (_turn("ZXY", clip.values[0]).inv() * _turn("ZXY", q)).magnitude()
        assert np.degrees(angle) == pytest.approx(10.0 * s, abs=1e-5)


def test_single_channels_wrap_only_without_limits():
    rig = _rig(["Y", "Y"], limited=("j1_Y",))
    clip = _clip(rig, [[3.0, 0.9], [-3.0, -0.9]])
    free, limited = sample(clip, 0.05)
    assert abs(free) == pytest.approx(np.pi)
    assert limited == pytest.approx(0.0)


def test_chain_of_urdf_joints_is_a_ball_joint():
    """Three joints at one place, as in the URDF of a BVH, turn together."""
    chain = _rig(["Z", "X", "Y"])
    T = np.tile(np.eye(4), (3, 1, 1))
    rig = Rig(
        joint_names=chain.joint_names, parent=chain.parent, T_parent_joint=T, dofs=chain.dofs
    )
    clip = _clip(rig, _degrees((170, 100, 170), (-10, 80, -10)))
    start = _turn("ZXY", clip.values[0])
    assert (start.inv() * _turn("ZXY", sample(clip, 0.05))).magnitude() < 1e-7
    apart = _clip(chain, clip.values)  # joints at different places do not
    assert (start.inv() * _turn("ZXY", sample(apart, 0.05))).magnitude() > 0.1


def test_options_are_checked():
    clip = _clip(_rig(["ZXY"]), np.zeros((2, 3)))
    with pytest.raises(ParameterError, match="repeat"):
        ClipSampler(clip, "twice")
    with pytest.raises(ParameterError, match="fade"):
        ClipSampler(clip, "loop", fade=-1.0)


def _walk_like():
    """A root that goes 1 m and turns 30 degrees per cycle, and a joint that does not close."""
    s = np.linspace(0.0, 1.0, 31)
    rows = np.zeros((31, 9))
    rows[:, 0] = 0.3 + np.sin(s)
    rows[:, 1] = 0.9 + 0.05 * np.sin(2 * np.pi * s)
    rows[:, 2] = -2.0 + s
    rows[:, 3] = 0.1 * np.sin(2 * np.pi * s)
    rows[:, 5] = 0.4 + np.radians(30.0) * s
    rows[:, 6] = 0.5 * s
    return _clip(_rig(["xyzZXY", "YXZ"]), rows, T=Z_UP, dt=1 / 30)


def _largest_step(clip, sampler, start, end, count):
    fk = ForwardKinematics(clip.rig)
    poses = np.array(
        [fk.from_dofs(sampler.sample(t), clip.T_world_file).copy()
         for t in np.linspace(start, end, count)]
    )  # fmt: skip
    return np.abs(np.diff(poses, axis=0)).max(), poses


@pytest.mark.parametrize("repeat", ["loop", "carry"])
def test_the_seam_does_not_jump(repeat):
    clip = _walk_like()
    sampler = ClipSampler(clip, repeat)
    step, _ = _largest_step(clip, sampler, 0.0, 5.0, 20_001)
    assert step < 2e-3  # 0.25 ms at under 8 m/s, also where it is led back


def test_loop_begins_again_at_the_first_sample():
    clip = _walk_like()
    sampler = ClipSampler(clip, "loop")
    np.testing.assert_allclose(sampler.sample(clip.duration), clip.values[0], atol=1e-12)
    np.testing.assert_allclose(sampler.sample(2.3), sampler.sample(2.3 - clip.duration))


def test_carry_goes_on_by_the_same_way_each_cycle():
    clip = _walk_like()
    sampler = ClipSampler(clip, "carry")
    fk = ForwardKinematics(clip.rig)

    def root(t):
        return fk.from_dofs(sampler.sample(t), clip.T_world_file)[0].copy()

    cycle = root(1.25) @ np.linalg.inv(root(0.25))
    np.testing.assert_allclose(cycle[2], [0, 0, 1, 0], atol=1e-9)  # on the ground
    assert np.degrees(np.arctan2(cycle[1, 0], cycle[0, 0])) == pytest.approx(30.0)
    np.testing.assert_allclose(root(4.25), np.linalg.matrix_power(cycle, 4) @ root(0.25))


def test_carry_without_a_free_root_is_a_loop():
    clip = _clip(_rig(["ZXY"]), np.random.default_rng(2).normal(size=(5, 3)))
    a, b = ClipSampler(clip, "carry"), ClipSampler(clip, "loop")
    for t in np.linspace(0, 2, 17):
        np.testing.assert_array_equal(a.sample(t), b.sample(t))


def test_a_clip_that_loops_by_itself_is_not_touched():
    s = np.linspace(0.0, 2 * np.pi, 41)
    values = np.stack([np.sin(s), 0.3 * np.cos(s), s], axis=1)  # one full turn
    clip = _clip(_rig(["ZXY"]), values, loops=True)
    assert closes(clip)
    np.testing.assert_array_equal(ClipSampler(clip, "loop").sample(clip.times[37]), values[37])


def test_closes_sees_place_and_pose():
    values = np.zeros((5, 6))
    values[2:4] = 0.3
    rig = _rig(["xyzZXY"])
    assert closes(_clip(rig, values))
    for channel in (1, 4):
        moved = values.copy()
        moved[-1, channel] = 0.01
        assert not closes(_clip(rig, moved))
