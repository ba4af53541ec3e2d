"""How long a motion is unique: cases of known answer."""

import numpy as np
import pytest

from garment_sim_ros.tradeoff.convergence import (
    CHANGE,
    SHAKEN,
    running_mm,
    unique_frames,
    unique_track,
)
from garment_sim_ros.tradeoff.playing import Player, Snapshot
from garment_sim_ros.tradeoff.points import Point
from garment_sim_ros.tradeoff.scenes import staged_scene

VERTICES = 4000


class Told:
    """Vertices whose way from the start grows, and which are off by a known error.

    Args:
        sub_steps: In a frame.
        error: How far off they are after so many frames with so many sub-steps [m].
        growth: What their way from the origin grows by in a frame.
    """

    def __init__(self, sub_steps, error, growth=1.0):
        self.sub_steps, self.error, self.growth = sub_steps, error, growth

    def begin(self, at):
        self.start, self.at = at, at.frame

    def play(self, first, last):
        assert first == self.at
        self.at = last

    def snapshot(self, frame):
        assert frame == self.at
        ran = frame - self.start.frame
        x = self.growth**ran * self.start.x["a"].astype(np.float64)
        x[:, 0] += self.error(ran, self.sub_steps)
        return Snapshot(frame=frame, x={"a": x.astype(np.float32)}, v=self.start.v)


def start(frame=7):
    still = np.zeros((VERTICES, 3), np.float32)
    return Snapshot(frame=frame, x={"a": still}, v={"a": still})


def running(each):
    """RMS over frames of distances that are 0 at the start [mm]."""
    squares = np.cumsum(np.square(each))
    return np.sqrt(squares / np.arange(2, len(squares) + 2))


def test_rms_runs_from_the_start_over_frames_and_vertices():
    here = [start(n) for n in range(4)]
    there = [Snapshot(frame=n, x={"a": s.x["a"].copy()}, v=s.v) for n, s in enumerate(here)]
    for n, state in enumerate(there):
        state.x["a"][: VERTICES // 4, 1] = 1e-3 * n
    assert running_mm(here, there) == pytest.approx(running(0.5 * np.array([1.0, 2.0, 3.0])))


@pytest.mark.parametrize(
    ("off", "frames"),
    [([], 0), ([0.01, 0.02], 2), ([0.01, 0.1, 0.01], 1), ([np.nan], 0), ([0.0, np.inf], 1)],
)
def test_it_is_unique_up_to_the_first_frame_that_is_off(off, frames):
    assert unique_frames(np.array(off)) == frames


def test_chaos_cuts_it_where_what_was_shaken_is_off_by_a_tenth_of_a_millimetre():
    track = unique_track(lambda n: Told(n, lambda ran, n: 0.0, growth=2.0), start(), 30, (60, 960))
    expected = running(1e3 * SHAKEN * np.sqrt(3.0) * 2.0 ** np.arange(1, 31))
    length = int((expected < CHANGE).sum())
    assert 4 < length < 10
    assert [s.frame for s in track.states] == list(range(7, 8 + length))
    assert track.chaos == pytest.approx(expected[length - 1], rel=0.02)
    assert (track.change, track.sub_steps) == (0.0, 120)


def test_sub_steps_are_doubled_until_all_frames_are_unique():
    """Off by e / n in every frame: a doubling to n changes that by e / n."""
    error = 0.03
    track = unique_track(lambda n: Told(n, lambda ran, n: error / n), start(), 30, (60, 960))
    after = {n: running(np.full(30, 1e3 * error / n)) for n in (120, 240, 480)}
    assert after[240].max() > CHANGE > after[480].max()
    assert (track.sub_steps, len(track.states)) == (480, 31)
    assert track.change == pytest.approx(after[480][-1], rel=1e-3)


def test_it_is_cut_where_the_largest_number_of_sub_steps_stops_being_unique():
    """Off by e k / n in frame k."""
    error = 0.02
    track = unique_track(lambda n: Told(n, lambda ran, n: error * ran / n), start(), 30, (60, 960))
    expected = running(1e3 * error * np.arange(1, 31) / 960)
    assert track.sub_steps == 960
    assert len(track.states) - 1 == int((expected < CHANGE).sum()) < 30


def test_where_changes_grow_again_that_with_the_least_one_is_taken():
    def error(ran, n):
        return {60: 3e-3, 120: 1e-3, 240: 8e-4, 480: 2e-3, 960: 5e-3}[n]

    track = unique_track(lambda n: Told(n, error), start(), 30, (60, 960))
    assert track.sub_steps == 240
    # It is told even though one frame, the least that there is, is not unique.
    assert len(track.states) == 2
    assert track.change == pytest.approx(0.2 / np.sqrt(2.0), rel=1e-3)


def test_a_single_number_of_sub_steps_shows_nothing():
    track = unique_track(lambda n: Told(n, lambda ran, n: 0.0), start(), 30, (60, 60))
    assert (len(track.states), track.change) == (2, np.inf)


def test_a_run_that_is_not_finite_is_never_the_better_one():
    def error(ran, n):
        return np.nan if n == 240 else 1e-3 * (n < 100) + 0.2e-3 * (n > 200)

    track = unique_track(lambda n: Told(n, error), start(), 30, (60, 960))
    assert (track.sub_steps, track.change) == (960, 0.0)


def test_a_motion_that_begins_again_is_the_same_bit_for_bit_whatever_was_before():
    """On a body that moves: garments have the speed of the start, not the body's."""
    staged = staged_scene("walk", "hulls", 0.1)
    point = Point(kind="hulls", solver="xpbd", sub_steps=8, passes=1)
    player = Player(staged, point.arguments(1 / 60))
    player.put_on(settle=True)
    at = player.snapshot(0)
    # The mannequin walks at over 1 m/s, and the T-shirt with it.
    assert np.linalg.norm(at.v["tshirt"].mean(axis=0)) > 0.5
    still = Snapshot(frame=2, x=at.x, v={name: np.zeros_like(v) for name, v in at.v.items()})
    paths = []
    for put_on in (True, False, True):
        if put_on:
            player.put_on(settle=False)
        for start in (still, at):
            player.begin(start)
            paths.append(player.play(start.frame, start.frame + 2).paths)
    for first, *others in (paths[0::2], paths[1::2]):
        for other in others:
            for name, x in first.items():
                np.testing.assert_array_equal(other[name], x)
