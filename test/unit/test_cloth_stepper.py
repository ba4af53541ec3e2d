"""The cloth's clock, without any node."""

import contextlib

import numpy as np
import pytest

pytest.importorskip("rclpy")
from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.errors import MessageError
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.sim.simulation import Simulation

SECOND = 10**9
STEP = SECOND // 100


def poses(x, count=2):
    found = ColliderPoses.identity(count)
    found.position[:, 0] = x
    return found


class TestClothStepper:
    @pytest.fixture
    def make(self, cloth):
        """A stepper of a cloth pinned to a bone; `stepper.moves` are the poses it went through."""

        def make(**options):
            vertices, triangles = cloth.grid(3, 3)
            garment = cloth.garment(vertices, triangles, pins=(0, 1, 2))
            ball = Collider(
                name="ball",
                kind="sphere",
                bone="bone",
                position=[0.0, 0.0, -5.0],
                geometry={"radius": 0.1},
            )
            simulation = Simulation((garment,), cloth.colliders(ball), solver_step=STEP / SECOND)
            values = {
                **{"step": STEP / SECOND, "delay": 0.0, "catch_up": 0.1},
                **{"time_jump": 1.0, "longest_lag": 0.0},
                **{"teleport_speed": 30.0, "teleport_turn_rate": 105.0, "on_teleport": "reset"},
                **{"on_time_jump": "reset"},
            }
            stepper = ClothStepper(simulation, **{**values, **options})
            stepper.moves = []
            advance, reset = simulation.advance, simulation.reset

            def watched_advance(start, end, dt=None):
                stepper.moves.append((start.position[0, 0], end.position[0, 0]))
                advance(start, end, dt)

            def watched_reset(found):
                stepper.moves.append(("reset", found.position[0, 0]))
                reset(found)

            simulation.advance, simulation.reset = watched_advance, watched_reset
            return stepper

        return make

    @staticmethod
    def feed(stepper, stamp, x, arrival=None):
        stepper.add(stamp, poses(x), stamp if arrival is None else arrival)

    def test_steps_are_whole_and_the_rest_is_carried(self, make):
        stepper = make()
        self.feed(stepper, 0, 0.0)
        assert stepper.advance(0)
        for stamp in (7, 14, 21, 35, 36, 49):
            self.feed(stepper, stamp * SECOND // 1000, stamp / 1000)
            before = stepper.time
            moved = stepper.advance(stamp * SECOND // 1000)
            assert moved == (stepper.time > before)
            assert stepper.time == stamp * SECOND // 1000 // STEP * STEP
        # One unbroken motion, poses interpolated at every step.
        expected = [(k / 100, (k + 1) / 100) for k in range(4)]
        np.testing.assert_allclose(stepper.moves[1:], expected, atol=1e-12)

    def test_target_is_even_and_never_beyond_the_input(self, make):
        """10 Hz input, 100 Hz frames, jittering arrivals."""
        stepper = make(delay=-1.0)
        random = np.random.default_rng(0)
        arrivals = {}
        for i in range(100):
            arrivals[i * SECOND // 10 + int(random.integers(0, SECOND // 100))] = i * SECOND // 10
        pending = sorted(arrivals)
        targets = []
        for frame in range(900):
            now = frame * SECOND // 100
            while pending and pending[0] <= now:
                arrival = pending.pop(0)
                self.feed(stepper, arrivals[arrival], 0.0, arrival)
                newest = arrivals[arrival]
            if not stepper.has_poses:
                continue
            target = stepper.target(now)
            assert target <= newest
            if frame > 100:
                targets.append(target)
                assert newest - target <= 1.2 * SECOND // 10
        steps = np.diff(targets) / SECOND * 100
        assert 0.95 < steps.mean() < 1.05
        assert np.abs(steps - 1.0).max() < 0.5

    def test_delay_keeps_it_behind(self, make):
        stepper = make(delay=0.2)
        for i in range(50):
            self.feed(stepper, i * STEP, 0.0)
            assert stepper.target(i * STEP) == i * STEP - SECOND // 5

    def test_too_much_at_once_is_passed_over(self, make):
        stepper = make(catch_up=0.05)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        stepper.advance(0)
        for i in range(1, 51):
            self.feed(stepper, i * STEP, i / 1000)
        stepper.moves.clear()
        stepper.advance(50 * STEP)
        assert stepper.time == 50 * STEP
        assert stepper.skipped == 45 * STEP
        assert stepper.resets == 0
        # The garments are carried along between the steps, not all the way at once.
        expected = [((k - 1) / 1000, k / 1000) for k in (10, 20, 30, 40, 50)]
        np.testing.assert_allclose(stepper.moves, expected, atol=1e-12)

    def test_a_stall_is_caught_up_in_coarse_steps_before_time_is_passed_over(self, make):
        stepper = make(catch_up=0.05, longest_lag=0.4)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        stepper.advance(0)
        lags = []
        for now in range(1, 45):
            self.feed(stepper, now * STEP, now / 1000)
            if now < 31:
                continue
            stepper.advance(now * STEP)
            assert stepper.time + stepper.lag == now * STEP
            lags.append(stepper.lag // STEP)
        assert lags == [26, 22, 18, 14, 10, 6, 2, *[0] * 7]
        assert stepper.skipped == 0
        # All of the way is simulated, the late part of it coarsely, then as always.
        assert stepper.steps == 44
        assert 26 * STEP < stepper.coarse <= 38 * STEP
        coarse = stepper.coarse
        self.feed(stepper, 45 * STEP, 0.0)
        stepper.advance(45 * STEP)
        assert stepper.coarse == coarse

    def test_a_machine_that_stays_too_slow_does_not_lag_for_ever(self, make):
        stepper = make(catch_up=0.05, longest_lag=0.4)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        stepper.advance(0)
        lags = []
        for now in range(10, 500, 10):
            self.feed(stepper, now * STEP, now / 1000)
            stepper.advance(now * STEP)
            lags.append(stepper.lag)
        assert 0.1 * SECOND < max(lags) <= 0.4 * SECOND
        assert lags[-1] == 0
        assert stepper.skipped + stepper.steps * STEP == stepper.time

    def test_poses_that_jump_again_and_again_are_waited_for(self, make):
        stepper = make()
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        for i in range(1, 31):
            self.feed(stepper, i * STEP, float(i % 2))
            stepper.advance(i * STEP)
        assert stepper.teleports == 30
        assert stepper.resets == 1
        for i in range(31, 45):
            self.feed(stepper, i * STEP, 0.001 * i)
            stepper.advance(i * STEP)
        assert stepper.resets == 2
        assert ("reset", 0.04) in stepper.moves

    def test_without_a_limit_nothing_is_passed_over(self, make):
        stepper = make(catch_up=0.05)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        self.feed(stepper, 50 * STEP, 0.5)
        stepper.advance(50 * STEP, in_time=False)
        assert stepper.skipped == 0
        assert stepper.steps == 50

    def test_what_came_while_garments_were_put_on_is_no_jump(self, make):
        stepper = make(catch_up=0.05)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        self.feed(stepper, 3 * SECOND, 0.1)  # all that the queue kept
        while stepper.is_behind:
            stepper.advance(3 * SECOND)
        assert stepper.resets == 0
        assert stepper.time == 3 * SECOND
        with pytest.raises(MessageError, match="stamp_jump"):
            self.feed(stepper, 6 * SECOND, 0.1)

    def test_garments_catch_up_with_a_body_that_moved_on_before_they_are_shown(self, make):
        """They were put on one pose; no part of the way to where the body is now is left out."""
        stepper = make(catch_up=0.05)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        assert stepper.is_behind
        stepper.moves.clear()
        now = 50
        while stepper.is_behind:
            self.feed(stepper, now * STEP, now / 1000)
            stepper.advance(now * STEP)
            now += 2
        assert stepper.skipped == 0
        assert stepper.time == (now - 2) * STEP
        expected = [(k / 1000, (k + 1) / 1000) for k in range(now - 2)]
        np.testing.assert_allclose(stepper.moves, expected, atol=1e-12)

    def test_a_machine_that_cannot_catch_up_passes_time_over(self, make):
        stepper = make(catch_up=0.05)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        frames = 0
        while stepper.is_behind:
            frames += 1
            self.feed(stepper, frames * 50 * STEP, frames * 0.001)
            stepper.advance(frames * 50 * STEP)
        assert frames == 30
        assert stepper.skipped > 0
        assert stepper.time == frames * 50 * STEP

    def test_a_machine_on_which_they_fall_back_shows_them_all_the_same(self, make):
        """Putting on took a minute, and each frame takes longer than what it simulates."""
        stepper = make(catch_up=0.05)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        frames = 0
        while stepper.is_behind:
            frames += 1
            now = 60_000 + 60 * frames
            self.feed(stepper, now * STEP, frames * 0.001)
            stepper.advance(now * STEP)
        assert frames == 31
        assert stepper.time == now * STEP
        assert stepper.skipped > 0

    def test_a_loop_shorter_than_putting_on_takes_has_garments_taken_along(self, make):
        """The next round begins before they were seen: put on anew they never would be."""
        stepper = make(catch_up=0.05)
        self.feed(stepper, 100 * STEP, 0.1)
        stepper.advance(100 * STEP)
        assert stepper.is_behind
        self.feed(stepper, 180 * STEP, 0.18)
        stamp = 100
        while stepper.newest != stamp * STEP:
            stamp += 1
            with contextlib.suppress(MessageError):
                self.feed(stepper, stamp * STEP, stamp / 1000)
        assert stepper.advance(stamp * STEP)
        assert not stepper.is_behind
        assert stepper.time == stamp * STEP
        assert stepper.resets == 0
        assert stepper.moves == [("reset", 0.1)]

    def test_whoever_asks_for_it_has_them_put_on_though_they_were_not_seen(self, make):
        stepper = make(catch_up=0.05)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        self.feed(stepper, STEP, 0.001)
        stepper.restart()
        stepper.advance(STEP)
        assert stepper.resets == 1

    def test_garments_on_a_body_that_stands_still_are_shown_at_once(self, make):
        stepper = make(delay=0.02)
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        stepper.advance(-2 * STEP)
        assert not stepper.is_behind

    def test_with_every_message_kept_a_jump_is_one_from_the_start(self, make):
        stepper = make()
        self.feed(stepper, 0, 0.0)
        stepper.advance(0, in_time=False)
        with pytest.raises(MessageError, match="stamp_jump"):
            self.feed(stepper, 3 * SECOND, 0.1)

    def test_fast_is_no_jump_but_a_teleport_is(self, make):
        stepper = make()
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        self.feed(stepper, STEP, 0.25)  # 25 m/s
        stepper.advance(STEP)
        assert stepper.resets == 0
        self.feed(stepper, 2 * STEP, 0.75)  # 50 m/s
        stepper.advance(2 * STEP)
        assert stepper.resets == 1
        assert stepper.moves[-1] == ("reset", 0.75)
        assert stepper.time == 2 * STEP

    def test_poses_of_another_sender_are_no_motion(self, make):
        stepper = make()
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        self.feed(stepper, STEP, 0.0)
        stepper.advance(STEP)
        with pytest.raises(MessageError, match="pose_count"):
            stepper.add(2 * STEP, poses(0.2, 3), 2 * STEP, new_sender=True)
        assert not stepper.advance(STEP)
        stepper.add(STEP // 2, poses(0.2), 2 * STEP, new_sender=True)  # an earlier stamp, too
        stepper.advance(STEP)
        assert (stepper.resets, stepper.teleports) == (1, 0)
        assert stepper.moves[-1] == ("reset", 0.2)
        assert stepper.time == STEP // 2

    def test_a_root_that_turns_round_at_once_has_jumped(self, make):
        stepper = make()
        self.feed(stepper, 0, 0.0)
        for step, turn in ((1, 0.9), (2, 2.0)):  # 90 rad/s, 110 rad/s
            found = poses(0.0)
            found.orientation[:, 2:] = np.sin(turn / 2), np.cos(turn / 2)
            stepper.add(step * STEP, found, step * STEP)
            assert stepper.teleports == (step == 2)

    def test_cloth_that_is_kept_jumps_along(self, make):
        stepper = make(on_teleport="keep")
        for i in range(30):
            self.feed(stepper, i * STEP, 0.0)
            stepper.advance(i * STEP)
        x = stepper.simulation.positions("cloth").copy()
        v = stepper.simulation.state("cloth").v.copy()
        stepper.moves.clear()
        self.feed(stepper, 30 * STEP, 0.75)
        stepper.advance(30 * STEP)
        assert (stepper.teleports, stepper.resets, stepper.moves) == (1, 0, [])
        assert stepper.time == 30 * STEP
        x[:, 0] += 0.75
        assert stepper.simulation.positions("cloth") == pytest.approx(x, abs=1e-6)
        assert (stepper.simulation.state("cloth").v == v).all()
        self.feed(stepper, 31 * STEP, 0.76)
        stepper.advance(31 * STEP)
        np.testing.assert_allclose(stepper.moves, [(0.75, 0.76)], atol=1e-12)

    def test_cloth_that_is_kept_goes_along_when_time_begins_again(self, make):
        stepper = make(on_time_jump="keep")
        for i in range(100, 130):
            self.feed(stepper, i * STEP, 0.0)
            stepper.advance(i * STEP)
        x = stepper.simulation.positions("cloth").copy()
        with pytest.raises(MessageError):
            self.feed(stepper, 5 * SECOND, 0.5)
        self.feed(stepper, 5 * SECOND + STEP, 0.75)
        stepper.advance(5 * SECOND + STEP)
        assert (stepper.figures()["time_jumps"], stepper.resets) == (1, 0)
        assert stepper.time == 5 * SECOND + STEP
        x[:, 0] += 0.75
        assert stepper.simulation.positions("cloth") == pytest.approx(x, abs=1e-6)

    def test_jumps_of_the_time_before_do_not_hold_up_the_next(self, make):
        stepper = make()
        for i in range(100):
            self.feed(stepper, 50 * SECOND + i * STEP, float(i // 8))
            stepper.advance(50 * SECOND + i * STEP)
        assert stepper.teleports > 5
        with pytest.raises(MessageError):
            self.feed(stepper, SECOND, 0.0)
        for i in range(1, 4):
            self.feed(stepper, SECOND + i * STEP, 0.0)
            stepper.moves.clear()
            stepper.advance(SECOND + i * STEP)
            assert stepper.moves == [("reset", 0.0) if i == 1 else (0.0, 0.0)]

    def test_a_jump_that_is_ignored_is_simulated(self, make):
        stepper = make(on_teleport="ignore")
        self.feed(stepper, 0, 0.0)
        stepper.advance(0)
        self.feed(stepper, STEP, 0.75)
        stepper.advance(STEP)
        assert (stepper.teleports, stepper.resets) == (1, 0)
        np.testing.assert_allclose(stepper.moves[-1], (0.0, 0.75), atol=1e-12)

    @pytest.mark.parametrize("bad", [poses(0.0, 1), poses(0.0, 3)])
    def test_poses_of_other_colliders_change_nothing(self, make, bad):
        stepper = make()
        self.feed(stepper, 0, 0.0)
        with pytest.raises(MessageError) as error:
            stepper.add(STEP, bad, STEP)
        assert error.value.reason == "pose_count"
        self.feed(stepper, STEP, 0.01)
        stepper.advance(STEP)
        assert stepper.resets == 0

    def test_nothing_happens_without_poses(self, make):
        stepper = make()
        assert not stepper.has_poses
        assert not stepper.advance(SECOND)
        assert stepper.time is None
