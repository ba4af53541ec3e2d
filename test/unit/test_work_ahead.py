"""A frame is simulated before it is due, as soon as its poses are there; the clock is the test's.

Poses come every hundredth of a second, some time after their stamps; frames are due in between.
"""

import pytest

pytest.importorskip("rclpy")
from ros_input.clock import Clock

import garment_sim_ros as gs
from garment_sim_ros.lateness import LateFrames
from garment_sim_ros.ros import rclpy_internals
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.ros.rclpy_internals import Taken
from garment_sim_ros.ros.ticker import Ticker
from garment_sim_ros.sim.simulation import Simulation

SECOND = 10**9
PERIOD = SECOND // 100
UNDERWAY = PERIOD // 10


class Node:
    """What `ClothNode` does in a frame, on that clock; the solver takes as long as one says."""

    def __init__(self, *, ahead=True, phase=0.5, solver=0.0, delay=-1.0, steps=1, every=1.0):
        self.clock, self.solver, self.every = Clock(10**15), round(solver * PERIOD), every
        colliders = gs.ColliderSet.of(gs.sphere(0.1))
        simulation = Simulation(
            gs.Garment.sheet(0.2, 0.2, edge=0.1, at=(0.0, 0.0, 0.12)),
            colliders,
            solver_step=PERIOD / SECOND / steps,
        )
        advance, self.moves = simulation.advance, []

        def watched(start, end, dt=None):
            self.moves.append((start.position[0, 0], end.position[0, 0]))
            self.clock.time += self.solver
            advance(start, end, dt)

        simulation.advance = watched
        self.stepper = ClothStepper(
            simulation,
            **{
                "step": PERIOD / SECOND / steps,
                "delay": delay,
                "catch_up": 0.1,
                "time_jump": 1.0,
                "longest_lag": 0.0,
            },
            **{"teleport_speed": 30.0, "teleport_turn_rate": 105.0},
            **{"on_teleport": "reset", "on_time_jump": "reset"},
        )
        self.begin = self.clock.time
        self.late, self.published, self.asked = LateFrames(), [], []
        origin = self.begin + round(phase * PERIOD)
        work = self.work_ahead if ahead else None
        self.sent = 0
        self.ticker = Ticker(self.clock, SECOND / PERIOD, self.tick, origin, work)

    def take_inputs(self):
        while (stamp := round(self.sent * self.every * PERIOD)) + UNDERWAY <= self.passed():
            poses = self.stepper.simulation.collider_set.poses()
            poses.position[:, 0] = 1e-3 * self.sent
            self.stepper.add(stamp, poses, self.begin + stamp + UNDERWAY)
            self.sent += 1

    def passed(self):
        return self.clock.time - self.begin

    def tick(self, due, ticks):
        self.take_inputs()
        if not self.stepper.has_poses:
            return
        self.late.begin(due, PERIOD, ticks - 1 if self.published else 0)
        self.stepper.advance(self.stepper.target(self.clock.time))
        self.late.published(self.clock.time)
        self.published.append((self.clock.time - due, self.stepper.time))

    def work_ahead(self, due):
        self.asked.append(due - self.clock.time)
        self.take_inputs()
        until = self.stepper.ahead(due)
        if until is not None:
            self.stepper.advance(until)

    def run(self, frames):
        while len(self.published) < frames:
            self.clock.time += max(0, self.ticker.ahead())
            self.ticker.call_if_due()
        return self


def test_a_frame_that_takes_long_is_in_time():
    long = {"solver": 0.7}
    assert Node(ahead=False, **long).run(100).late.count > 90
    node = Node(**long).run(100)
    assert node.late.count == 0
    assert {lateness for lateness, _ in node.published[3:]} == {0}


@pytest.mark.parametrize("phase", [0.0, 0.15, 0.3, 0.5, 0.7, 0.95])
@pytest.mark.parametrize("delay", [-1.0, 0.013, 0.004])
def test_frames_show_what_they_would_without_it(phase, delay):
    """The same times at the same frames, through the same poses, whatever the phase of the two."""
    runs = [Node(ahead=ahead, phase=phase, delay=delay).run(60) for ahead in (False, True)]
    without, ahead = ([time for _, time in run.published] for run in runs)
    assert ahead == without
    assert runs[0].moves == runs[1].moves
    assert [late for late, _ in runs[1].published[3:]] == [0] * 57


def test_it_is_tried_after_each_quarter_of_a_period_and_at_once_where_those_are_past():
    quarters = [3 * PERIOD // 4, PERIOD // 2, PERIOD // 4]
    assert Node().run(20).asked == quarters * (len(Node().run(20).asked) // 3)
    # Half a period is gone when the first one has ended.
    assert set(Node(solver=0.3).run(20).asked[6:]) == {quarters[0], quarters[2]}


def test_part_of_a_frame_is_simulated_ahead_where_poses_for_more_come_later():
    """Three steps a frame, a pose for each; what is missing when it is due is little."""
    some = {"steps": 3, "solver": 0.25, "delay": 0.2 * PERIOD / SECOND, "every": 1 / 3}
    assert Node(ahead=False, **some).run(60).late.count > 50
    node = Node(**some).run(60)
    assert node.late.count == 0
    assert max(lateness for lateness, _ in node.published[3:]) == 2 * node.solver


def test_only_steps_whose_poses_are_there_are_taken_ahead():
    node = Node(phase=0.5).run(10)
    stepper, now = node.stepper, node.clock.time
    known = stepper.ahead(now + PERIOD)
    assert known == stepper.time + PERIOD <= stepper.newest
    assert stepper.ahead(now) is None, "nothing is due yet"
    assert stepper.ahead(now + 3 * PERIOD) == stepper.newest, "poses after it are missing"
    stepper.restart()
    assert stepper.ahead(now + PERIOD) is None, "they are put on anew when the frame is due"


@pytest.mark.parametrize("solver", [1.05, 1.2])
def test_what_takes_longer_than_there_is_time_is_no_later_for_it(solver):
    """More than a machine can: frames are made as late as without it at most, none goes back."""
    without, ahead = (Node(ahead=ahead, solver=solver).run(60) for ahead in (False, True))
    assert 0 < ahead.late.count <= without.late.count
    assert ahead.stepper.skipped <= without.stepper.skipped
    times = [time for _, time in ahead.published]
    assert times == sorted(times)


def test_none_is_worked_ahead_at_where_the_call_before_took_a_period():
    """The call that is due comes first."""
    node = Node(solver=0.1).run(10)
    node.clock.time += 2 * PERIOD
    asked = len(node.asked)
    node.ticker.call_if_due()
    assert len(node.asked) == asked
    assert len(node.published) == 11


def test_steps_of_a_third_of_a_period_leave_nothing_over():
    """Rounded up to nanoseconds three would never fit, and one would always be missing."""
    stepper = Node(steps=1.8).stepper  # a third of a sixtieth of a second
    for frame in range(400):
        stamp = round(frame * SECOND / 60)
        stepper.add(stamp, stepper.simulation.collider_set.poses(), stamp)
        stepper.advance(stamp)
        assert 0 <= stamp - stepper.time < 1000


def test_a_message_is_as_old_as_the_middleware_says_unless_the_clock_was_set(monkeypatch):
    now = 10**18
    monkeypatch.setattr(rclpy_internals.time, "time_ns", lambda: now)
    ages = {0: 0, now - 5_000_000: 5_000_000, now + 1: 0, now - 11 * SECOND: 0}
    assert {received: Taken(b"", b"", received).age() for received in ages} == ages
