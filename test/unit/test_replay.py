"""What is worked out from a recording agrees with what was recorded."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.contact.plain_shapes import capsule
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.mocap.walk import walk
from garment_sim_ros.recording.bags import Recording
from garment_sim_ros.recording.previews import film_indices
from garment_sim_ros.recording.replay import Replay
from garment_sim_ros.recording.summary import figures, summarize
from garment_sim_ros.recording.tracks import ColliderTrack, GarmentTrack

FRAMES = 150
PERIOD = 16_666_667


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin:vertices=1200")


@pytest.fixture(scope="module")
def recording():
    clip = walk()
    stamps = 10**18 + np.arange(FRAMES) * PERIOD
    times = np.arange(FRAMES) * 1e-9 * PERIOD
    values = np.stack([np.interp(times, clip.times, v) for v in clip.values.T], axis=1)
    return Recording(
        robot_description=urdf_from_clip(clip),
        joint_names=clip.rig.dofs.names,
        joint_stamp=stamps,
        joint_values=values,
        stamp=np.zeros(0, np.int64),
        garments={},
        quality={
            "belt": {
                "step_ms": np.linspace(1.0, 3.0, FRAMES),
                "resets": np.ones(FRAMES),
                # 7 late frames in the first second, 3 afterwards.
                "late_frames": np.where(np.arange(FRAMES) < 100, 7.0, 10.0),
            }
        },
    )


def with_belt(recording, body):
    """The recording with a garment that is a part of the skin, moved out a little."""
    replay = Replay(recording, body)
    triangles = body.skin.triangles[:200]
    used = np.unique(triangles)
    triangles = np.searchsorted(used, triangles).astype(np.int32)
    skins = [replay.figure(int(stamp), ()).skin for stamp in recording.joint_stamp]
    positions = np.array([skin[used] for skin in skins], np.float32)
    track = GarmentTrack(
        vertices=body.skin.vertices[used],
        triangles=triangles,
        arrival=recording.joint_stamp + 1000,
        finite=True,
        positions=positions[::5],
    )
    return dataclasses.replace(
        recording, stamp=recording.joint_stamp[::5], garments={"belt": track}
    )


def test_order_of_the_joints_does_not_matter(recording, body):
    turned = dataclasses.replace(
        recording,
        joint_names=recording.joint_names[::-1],
        joint_values=recording.joint_values[:, ::-1],
    )
    stamp = int(recording.joint_stamp[40])
    first, second = (Replay(r, body).figure(stamp, ()) for r in (recording, turned))
    assert first.skin == pytest.approx(second.skin, abs=1e-12)


def test_body_stands_walks_and_faces_where_it_goes(recording, body):
    replay = Replay(recording, body)
    shown = [replay.figure(int(stamp), ()) for stamp in recording.joint_stamp[::10]]
    height = np.ptp(body.skin.vertices[:, 2])
    for figure in shown:
        assert np.ptp(figure.skin[:, 2]) == pytest.approx(height, rel=0.1)
        assert figure.skin[:, 2].min() == pytest.approx(0.0, abs=0.05)
    way = shown[3].root - shown[0].root
    assert np.linalg.norm(way) > 0.3
    assert np.arctan2(way[1], way[0]) == pytest.approx(shown[0].heading, abs=0.5)


def test_time_between_messages_is_between_their_poses(recording, body):
    replay = Replay(recording, body)
    stamps = recording.joint_stamp
    before, after = (replay.figure(int(stamps[k]), ()).skin for k in (30, 31))
    middle = replay.figure(int(stamps[30]) + PERIOD // 2, ()).skin
    assert middle == pytest.approx(0.5 * (before + after), abs=2e-3)
    assert replay.figure(int(stamps[0]) - 10**9, ()).skin == pytest.approx(
        replay.figure(int(stamps[0]), ()).skin
    )


def test_summary_of_a_garment_that_is_the_skin(recording, body):
    worn = with_belt(recording, body)
    shown = figures(worn, body)
    assert len(shown) == FRAMES // 5
    track = worn.garments["belt"]
    belt = Garment.from_mesh(track.vertices, track.triangles, name="belt", pins=range(3))
    summary = summarize(worn, body, [belt], shown, frame_rate=60.0)
    assert summary["frames"] == FRAMES
    assert summary["rate_hz"] == pytest.approx(60.0, abs=0.01)
    assert summary["late_frames"] == 3, "as the node counted, after the first second"
    assert summary["step_ms_median"] == pytest.approx(2.0, abs=0.02)
    assert summary["penetration_mm_max"] < 0.1
    assert summary["gap_mm_median"] == pytest.approx(0.0, abs=0.01)
    assert summary["resets"] == 1
    assert summary["finite"] is True
    assert summary["pierced"] is None, "no colliders were recorded"
    share = summary["garments"]["belt"]["pinned_share"]
    assert share == pytest.approx(3 / len(belt.vertices), abs=1e-5)


def test_the_summary_knows_that_a_garment_is_cut_smaller_than_it_is_put_on(recording, body):
    """Its outfit tells; the recording has the vertices that it was put on with."""
    worn = with_belt(recording, body)
    track = worn.garments["belt"]
    loose = Garment.from_mesh(track.vertices, track.triangles, name="belt", pins=range(3))
    tight = dataclasses.replace(loose, rest=track.vertices / 1.1)
    other = dataclasses.replace(tight, name="scarf")
    # Put on over other colliders than it was recorded with.
    wide = 1.01 * track.vertices
    elsewhere = [dataclasses.replace(g, vertices=wide) for g in (loose, tight)]
    shown = figures(worn, body)
    found = [
        summarize(worn, body, [g], shown, frame_rate=60.0)["strain_p95"]
        for g in (loose, tight, other, *elsewhere)
    ]
    assert 1.0 + found[1] == pytest.approx(1.1 * (1.0 + found[0]), abs=2e-4)
    assert found[2:] == [found[0], found[0], found[1]]


def test_film_ends_where_it_began(recording, body):
    replay = Replay(recording, body)
    stamps = recording.joint_stamp[::4]
    shown = [replay.figure(int(stamp), ()) for stamp in stamps]
    times = 1e-9 * stamps
    film = film_indices(shown, times - times[0], rate=15.0, shortest=0.7, longest=2.0)
    assert film[0] == 0
    assert (np.diff(film) == 1).all()
    # A stride of the built-in walk takes about 1.1 s.
    assert 0.7 <= len(film) / 15.0 <= 1.5


def test_summary_counts_the_frames_in_which_a_limb_is_through(recording, body):
    # A rod through a triangle in the second half of the time; before that far above it.
    worn = with_belt(recording, body)
    track = worn.garments["belt"]
    rod = capsule([-1.0, 0, 0], [1.0, 0, 0], 0.01, name="rod", bone="hips")
    stamps = worn.stamp
    middle = track.positions[:, track.triangles[0]].mean(axis=1)
    middle[stamps < stamps[len(stamps) // 2], 2] += 50.0
    lying = np.tile(rod.orientation, (len(stamps), 1, 1))
    colliders = ColliderTrack(
        colliders=ColliderSet(colliders=(rod,)),
        stamp=stamps,
        position=(middle + rod.position)[:, None].astype(float),
        orientation=lying,
    )
    worn = dataclasses.replace(worn, colliders=colliders)
    belt = Garment.from_mesh(track.vertices, track.triangles, name="belt")
    summary = summarize(worn, body, [belt], figures(worn, body), frame_rate=60.0)
    half = len(stamps) - len(stamps) // 2
    assert summary["pierced"] == pytest.approx(half / len(stamps), abs=1e-4)
    assert summary["pierced_frames"] == {"belt": {"hips": half}}
    # Half-way between two messages it is half-way between two poses; outside of all nowhere.
    poses = colliders.at(int(stamps[0] + stamps[1]) // 2)
    expected = 0.5 * (colliders.position[0] + colliders.position[1])
    assert poses.position == pytest.approx(expected, abs=1e-9)
    assert colliders.at(int(stamps[0]) - 1) is None
