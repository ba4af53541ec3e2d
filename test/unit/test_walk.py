"""The built-in walk: gait as published, feet that stand, loops without a seam."""

import numpy as np
import pytest

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.mocap import gait_curves as gait
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler, closes
from garment_sim_ros.mocap.walk import walk

SIDES = (("left", 0.5), ("right", 0.0))


def _poses(clip):
    fk = ForwardKinematics(clip.rig)
    return np.array([fk.from_dofs(q).copy() for q in clip.values])


def _channel(clip, name):
    return np.degrees(clip.values[:, clip.rig.dofs.names.index(name)])


def _phases(clip, strides=9):
    return np.linspace(0.0, strides, len(clip.times))


def test_speed_and_stride():
    clip = walk(path="straight", speed=1.3)
    assert (clip.values[-1, 0] - clip.values[0, 0]) / clip.duration == pytest.approx(1.3)
    assert clip.duration / 9 == pytest.approx(1.08, abs=0.02)  # 111 steps a minute


def test_angles_follow_the_published_curves():
    clip = walk(path="straight")
    phase = _phases(clip)
    for side, shift in SIDES:
        knee = _channel(clip, f"{side}LowerLeg_Yrotation")
        thigh = -_channel(clip, f"{side}UpperLeg_Yrotation")
        published = np.degrees(gait.knee_flexion(phase + shift))
        assert np.sqrt(np.mean((knee - published) ** 2)) < 8.0
        assert knee.min() > 3.0  # never backward, never locked
        assert 55.0 < knee.max() < 70.0
        assert np.sqrt(np.mean((thigh - np.degrees(gait.thigh_pitch(phase + shift))) ** 2)) < 5.0


def test_curves_have_the_known_extremes():
    phase = np.linspace(0, 1, 200)
    knee, ankle = np.degrees(gait.knee_flexion(phase)), np.degrees(gait.ankle_dorsiflexion(phase))
    assert 60 < knee.max() < 67
    assert 0.70 < phase[knee.argmax()] < 0.76
    assert -21 < ankle.min() < -17
    assert 0.58 < phase[ankle.argmin()] < 0.68


@pytest.mark.parametrize("path", ["straight", "circle"])
@pytest.mark.parametrize("speed", [0.8, 1.3, 1.7])
def test_feet_stand_and_do_not_sink(path, speed):
    clip = walk(path=path, speed=speed)
    T = _poses(clip)
    dt = clip.times[1]
    for side, shift in SIDES:
        phase = np.mod(_phases(clip) + shift, 1.0)
        toes = T[:, clip.rig.index(f"{side}Toes"), :3, 3]
        foot = T[:, clip.rig.index(f"{side}Foot")]
        heel = (foot @ [-0.035 * 1.7, 0.0, -0.039 * 1.7, 1.0])[:, :3]
        assert min(toes[:, 2].min(), heel[:, 2].min()) > -1e-3
        standing = (phase > 0.1) & (phase < 0.28)
        both = standing[1:] & standing[:-1]
        for point in (toes, heel):
            slide = np.linalg.norm(np.diff(point, axis=0), axis=1)[both] / dt
            assert slide.max() < 0.02  # [m/s]
        assert np.abs(toes[standing, 2]).max() < 2e-3
        swinging = (phase > 0.7) & (phase < 0.9)
        assert min(toes[swinging, 2].min(), heel[swinging, 2].min()) > 5e-3


def test_arms_swing_against_the_legs_and_elbows_bend():
    clip = walk(path="straight")
    for side, _ in SIDES:
        arm = -_channel(clip, f"{side}UpperArm_Yrotation")
        leg = -_channel(clip, f"{side}UpperLeg_Yrotation")
        assert np.corrcoef(arm, leg)[0, 1] < -0.7
        assert 25.0 < np.ptp(arm) < 45.0
        elbow = -_channel(clip, f"{side}LowerArm_Yrotation")
        assert elbow.min() > 10.0


def test_pelvis_lists_turns_and_bobs():
    clip = walk(path="straight")
    T = _poses(clip)[:, clip.rig.index("hips")]
    turn = np.degrees(np.arctan2(T[:, 1, 0], T[:, 0, 0]))
    lists = np.degrees(np.arcsin(T[:, 2, 1]))
    assert 6.0 < np.ptp(turn) < 12.0
    assert 5.0 < np.ptp(lists) < 10.0
    assert 0.02 < np.ptp(T[:, 2, 3]) < 0.05
    assert 0.02 < np.ptp(T[:, 1, 3]) < 0.06


@pytest.mark.parametrize("path", ["circle", "in_place"])
def test_it_loops_without_a_seam(path):
    clip = walk(path=path)
    assert clip.loops
    assert closes(clip)
    T = _poses(clip)
    seam = np.abs((T[1] - T[0]) - (T[-1] - T[-2])).max(axis=(1, 2))
    within = np.abs(np.diff(T, 2, axis=0)).max(axis=(0, 2, 3))
    assert (seam <= 1.001 * within + 1e-12).all()  # the velocity goes on as anywhere else
    assert np.abs(T[:, 0, :2, 3]).max() < 2.1


def test_straight_on_it_is_carried_on():
    clip = walk(path="straight", strides=4)
    sampler = ClipSampler(clip, "carry")
    x = [sampler.sample(t)[0] for t in np.linspace(0, 5 * clip.duration, 200)]
    np.testing.assert_allclose(np.diff(x), 1.3 * 5 * clip.duration / 199, rtol=1e-6)


def test_motion_is_smooth():
    clip = walk()
    acceleration = np.diff(clip.values, 2, axis=0) / clip.times[1] ** 2
    assert np.abs(acceleration[:, :3]).max() < 5.0  # [m/s^2]
    assert np.abs(acceleration[:, 3:]).max() < 600.0  # [rad/s^2]


def test_sizes_scale():
    small = walk(height=1.0, speed=1.0, path="straight")
    assert small.ankle_height == pytest.approx(0.039)
    assert 0.45 < small.values[:, 2].mean() < 0.55


@pytest.mark.parametrize(
    "options",
    [
        *({"height": 0.1}, {"speed": 9.0}, {"speed": float("nan")}, {"path": "square"}),
        *({"strides": 2}, {"strides": 5.5}, {"height": 0.5, "speed": 2.0}),
    ],
)
def test_options_are_checked(options):
    with pytest.raises(ParameterError):
        walk(**options)


def test_clips_by_name(tmp_path):
    assert load_clip("walk").loops
    assert not load_clip("walk:path=straight,strides=4,speed=1.1").loops
    for bad in ("walk:path=square", "walk:speed=fast", "walk:color=red"):
        with pytest.raises(ParameterError, match=r"walk|path"):
            load_clip(bad)
    for bad in (tmp_path / "none.bvh", tmp_path / "a.fbx", tmp_path):
        with pytest.raises(InputFileError):
            load_clip(bad)
    (tmp_path / "a.fbx").write_text("x")
    with pytest.raises(InputFileError, match="ending"):
        load_clip(tmp_path / "a.fbx")
