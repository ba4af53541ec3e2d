"""Poses that clothes are hard to wear in, of `bench/exercises.py`: the default outfit stays on."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.contact.pierced import PiercedMeter
from garment_sim_ros.recording.metrics import GarmentMesh

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))
import exercises

sys.path.pop(0)

QUICK = ("arms_crossed", "squat", "on_one_knee")
LONGEST = 1.0
"""Excess length over rest length of any edge: 0.97 in the squat, in the crease between thigh and
belly."""
STARTS = 7
"""What a crease does to cloth hangs on the last bits of numbers."""


@pytest.fixture(scope="module")
def avatar():
    return gs.Avatar.load("mannequin")


@pytest.fixture
def clip(tmp_path, monkeypatch):
    def make(*names):
        path = tmp_path / "exercises.bvh"
        words = ["exercises.py", str(path), "--only", *names]
        monkeypatch.setattr(sys, "argv", words)
        exercises.main()
        return str(path)

    return make


@pytest.mark.parametrize(
    ("pose", "height"),
    [
        ({}, 0.04 + 0.42 + 0.41 + 0.09),  # straight legs over the ankles
        ({"UpLeg": (-90, 0, 0)}, 0.04 + 0.09),  # legs ahead, on the floor; hips over the ankles
        ({"UpLeg": (0, 0, 90)}, 0.04 + 0.09),
        ({"UpLeg": (-90, 0, 0), "Leg": (90, 0, 0)}, 0.04 + 0.41 + 0.09),
        ({"Leg": (110, 0, 0)}, 0.04 + 0.42 + 0.06),  # on the knees
        ({"UpLeg": (-180, 0, 0)}, 0.12),  # nothing is lower than the hips
    ],
)
def test_the_lowest_joint_stands_on_the_floor(pose, height):
    assert exercises.height(exercises.turns(pose)) == pytest.approx(height, abs=1e-12)


def test_a_clip_begins_and_ends_standing_and_is_in_the_pose_between(clip, avatar):
    path = clip("arms_up")
    poses = [p.copy() for p in avatar.play(path, rate=30.0)]
    hands = [i for i, c in enumerate(avatar.colliders.colliders) if c.bone.endswith("Hand")]
    heights = np.array([p.position[hands, 2].mean() for p in poses])
    stay, go = round(exercises.STAY * 30), round(exercises.GO * 30)
    assert len(poses) in (2 * stay + 2 * go - 1, 2 * stay + 2 * go)
    assert np.ptp(heights[: stay - 1]) < 0.01
    assert abs(heights[-1] - heights[0]) < 0.02
    assert heights[stay + go + 2] > heights[0] + 1.0


def worn(avatar, clip, start=0, outfit="tshirt_short_skirt"):
    """Pierced frames and the excess length of the longest edge.

    Starts differ by micrometres that colliders are off.
    """
    outfit = avatar.dress(outfit)
    simulation = gs.Simulation(outfit, avatar.colliders)
    meshes = {g.name: GarmentMesh.of(g) for g in outfit.garments}
    meter, longest = PiercedMeter(avatar.colliders), 0.0
    off = 1e-6 * np.random.default_rng(start).normal(size=(len(avatar.colliders), 3))
    for pose in avatar.play(clip, rate=60.0):
        pose = dataclasses.replace(pose, position=pose.position + off)
        simulation.step(pose, dt=1 / 60)
        seen = {
            name: (simulation.positions(name), mesh.triangles) for name, mesh in meshes.items()
        }
        meter.add(pose, seen)
        strains = [mesh.strain(seen[name][0]).max() for name, mesh in meshes.items()]
        longest = max(longest, *map(float, strains))
    return meter.result(), longest


@pytest.mark.parametrize(
    "names",
    [
        pytest.param(QUICK, id="some"),
        pytest.param(tuple(exercises.POSES), id="all", marks=pytest.mark.slow),
    ],
)
def test_the_default_outfit_stays_worn(clip, avatar, names):
    path = clip(*names)
    for start in range(STARTS):
        pierced, longest = worn(avatar, path, start)
        assert pierced.share == 0.0, (start, pierced.by_bone)
        assert longest < LONGEST, start


def test_a_soft_body_squats_without_its_shirt_in_its_thighs(clip, data_file):
    """Where thighs are left in the belly, an edge is 14 times too long."""
    avatar = gs.Avatar.load(str(data_file("bodies", "mh_female_young.glb")))
    pierced, longest = worn(avatar, clip("squat"))
    assert pierced.share == 0.0, pierced.by_bone
    assert longest < 1.0


@pytest.mark.parametrize("name", ["mannequin", "mh_female_young.glb", "CesiumMan.glb"])
def test_trousers_stay_on_folded_legs(clip, data_file, name):
    """Where calves are left in the thighs, a shin comes through in up to half of the frames."""
    avatar = gs.Avatar.load(name if name == "mannequin" else str(data_file("bodies", name)))
    trousers = {
        "name": "trousers",
        "mesh": str(data_file("garments", "trousers_female.obj")),
        "material": "polyester",
        "options": {"made_on": str(data_file("bodies", "mh_female_young.glb"))},
    }
    path = clip("crouch", "heel_to_seat")
    for start in range(2):
        pierced, longest = worn(avatar, path, start, {"version": 1, "garments": [trousers]})
        assert pierced.share == 0.0, (start, pierced.by_bone)
        assert longest < LONGEST, start
