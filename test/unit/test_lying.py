"""Bodies that lie, sit, kneel or lean on their hands do so on the ground."""

import sys
from pathlib import Path

import numpy as np
import pytest

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))
import exercises

sys.path.pop(0)

LYING = ("on_back", "face_down", "on_side", "shoulder_stand")
LOW = (*LYING, "sit_on_floor", "cross_legged", "kneel", "on_one_knee", "all_fours", "press_up")
HELD = 1.75
"""A pose of `exercises` is held from 1.5 to 2 s [s]."""
IN_GROUND, OVER_GROUND = 0.03, 0.015
"""How far the lowest skin may be in the ground and over it [m]: skin at joints is not rigid."""


@pytest.fixture(scope="module", params=["mannequin", "mh_female_young.glb", "CesiumMan.glb"])
def body(request, data_file):
    name = request.param
    return load_body(name if name == "mannequin" else data_file("bodies", name))


@pytest.fixture
def clip(tmp_path, monkeypatch):
    def make(name):
        path = tmp_path / f"{name}.bvh"
        monkeypatch.setattr(sys, "argv", ["exercises.py", str(path), "--only", name])
        exercises.main()
        return load_clip(str(path))

    return make


def retargeter_of(clip, body, below=0.0):
    T = clip.T_world_file.copy()
    T[2, 3] -= below
    return Retargeter(clip.rig, body, T_world_source=T, reference=clip.source_reference)


def poses(retargeter, clip, end=None, **options):
    """Poses at 60 Hz from the start on, shape [t, n, 4, 4]."""
    sampler = ClipSampler(clip)
    times = np.arange(clip.times[0], clip.times[-1] if end is None else end, 1 / 60)
    return np.array(
        [retargeter.world_joints(sampler.sample(float(t)), float(t), **options) for t in times]
    )


def lowest(body, T):
    return Skinner(body.skin).vertices(T)[:, 2].min()


@pytest.mark.parametrize("name", LOW)
def test_the_lowest_skin_is_on_the_ground(body, clip, name):
    clip = clip(name)
    T = poses(retargeter_of(clip, body), clip, HELD)[-1]
    assert -IN_GROUND < lowest(body, T) < OVER_GROUND
    R = T[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.eye(3) + 0 * R, atol=1e-9)


def test_it_would_be_in_the_ground_or_over_it(body, clip):
    """Centimetres each, where feet and the ends of arms alone carry the body."""
    off = []
    for name in LYING:
        c = clip(name)
        T = poses(retargeter_of(c, body), c, HELD, ground_feet=False)[-1]
        off.append(abs(lowest(body, T)))
    assert max(off) > 0.05


@pytest.mark.parametrize("name", ["on_side", "sit_on_floor", "kneel", "all_fours"])
def test_it_comes_and_goes_smoothly(body, clip, name):
    """Hips go at most 4 cm more or less in 1/60 s than the source's, to scale."""
    clip = clip(name)
    r, fk = retargeter_of(clip, body), ForwardKinematics(clip.rig)
    sampler = ClipSampler(clip)
    gap = []
    for t in np.arange(clip.times[0], clip.times[-1], 1 / 60):
        q = sampler.sample(float(t))
        T = r.world_joints(q, float(t))
        own = fk.from_dofs(q, clip.T_world_file)[r._travel_joints, 2, 3].mean()
        gap.append(T[r.feet.legs.joints[:, 0], 2, 3].mean() - r.scale * own)
    assert np.abs(np.diff(gap)).max() < 0.04


@pytest.mark.parametrize("name", ["squat", "crouch", "lunge", "bend_over", "sit"])
def test_who_stands_does_not_lie(body, clip, name):
    """Nor who sits on what is not there; a deep crouch comes near it."""
    clip = clip(name)
    retargeter = retargeter_of(clip, body)
    poses(retargeter, clip, HELD)
    assert abs(retargeter.lying.shift) < 0.01


def test_walking_is_left_as_it_is(body):
    clip = load_clip("walk")
    retargeter = retargeter_of(clip, body)
    got = poses(retargeter, clip)
    retargeter = retargeter_of(clip, body)
    retargeter.lying.rest = retargeter.hands.lift = lambda *_: None
    np.testing.assert_array_equal(got, poses(retargeter, clip))


def test_no_ground_is_looked_for_far_under_it(body, clip):
    """A source that lies 0.6 m under 0 lies on something else."""
    clip = clip("face_down")
    got = poses(retargeter_of(clip, body, below=0.6), clip, HELD)
    retargeter = retargeter_of(clip, body, below=0.6)
    retargeter.lying.rest = retargeter.hands.lift = lambda *_: None
    np.testing.assert_array_equal(got, poses(retargeter, clip, HELD))


@pytest.mark.parametrize(("name", "bone"), [("kneel", "LowerLeg"), ("on_back", "hips")])
def test_what_lies_in_the_source_lies(body, clip, name, bone):
    """Not the toes alone: kneeling bodies stood on those, with the knees in the air."""
    clip = clip(name)
    T = poses(retargeter_of(clip, body), clip, HELD)[-1]
    main = body.skin.bone[np.arange(len(body.skin.bone)), body.skin.weight.argmax(axis=1)]
    below = {b: body.rig.below(body.rig.index(j))[main] for b, j in body.humanoid.items()}
    if bone == "hips":
        moved = ~(below["leftUpperLeg"] | below["rightUpperLeg"])
    else:
        moved = sum(below[side + bone] & ~below[f"{side}Foot"] for side in ("left", "right")) > 0
    x = Skinner(body.skin).vertices(T)
    assert x[moved, 2].min() < 0.06


def test_soles_on_the_floor_stay_there_while_the_back_lies(body, clip, monkeypatch):
    hook = {"Hips": (-90, 0, 0), "UpLeg": (-50, 0, 0), "Leg": (105, 0, 0), "Foot": (35, 0, 0)}
    monkeypatch.setitem(exercises.POSES, "hook", hook)
    clip = clip("hook")
    retargeter = retargeter_of(clip, body)
    T = poses(retargeter, clip, HELD)[-1]
    assert retargeter.lying.lies > 0.5
    legs, soles = retargeter.feet.legs, retargeter.feet.soles
    at = T[soles.joint]
    heights = (at[:, 2, :3] * soles.offset).sum(axis=1) + at[:, 2, 3]
    stands = retargeter.feet.stands[:, 0]
    assert stands.min() > 0.5
    for i in range(len(legs.joints)):
        assert heights[soles.start[i] : soles.start[i + 1]].min() < 0.02


def test_knees_that_kneel_are_not_folded_again(body, clip):
    clip = clip("kneel")
    retargeter = retargeter_of(clip, body)
    T = poses(retargeter, clip, HELD)[-1]
    hip, knee, ankle = np.swapaxes(T[retargeter.feet.legs.joints][:, :, :3, 3], 0, 1)
    thigh, shank = knee - hip, ankle - knee
    cosine = (thigh * shank).sum(axis=1)
    cosine /= np.linalg.norm(thigh, axis=1) * np.linalg.norm(shank, axis=1)
    assert np.degrees(np.arccos(cosine)).max() < 141.0
