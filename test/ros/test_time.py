"""Time that is paused, stepped, slow, fast, or jumps: all nodes follow, and garments stay worn."""

import signal

import numpy as np
import pytest

pytest.importorskip("rclpy")

from ros_input.scene import PERIOD, SECOND, STEP, Scene

from garment_sim_ros.ros.topics import JOINT_STATES
from garment_sim_ros.stamps import nanoseconds

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def scene(start_node, make_probe, until):
    made = Scene("/time_reset", start_node, make_probe, until)
    yield made
    made.end()


@pytest.fixture
def playing(scene):
    """A scene at the usual rate."""
    source = scene.source
    source.rate, source.playing, source.loop, source.period = 1.0, True, None, PERIOD
    source.late, source.swaps = 0, False
    scene.settle()
    yield scene
    source.loop = None


def test_pause_and_step(playing):
    source = playing.source

    def is_there():
        return source.stamp - STEP < playing.last() <= source.stamp

    source.playing = False
    # All that came is simulated, then nothing moves.
    playing.until(lambda: playing.last() > source.stamp - PERIOD - STEP, "the last pose")
    before = playing.fresh()
    assert playing.fresh()["solver_steps"] == before["solver_steps"]
    for _ in range(3):
        source.step()
        playing.until(is_there, "the step's pose")
    source.step(60)
    playing.until(is_there, "the pose after 60 steps")
    source.playing = True
    playing.follow()
    after = playing.fresh()
    for key in ("time_jumps", "teleports", "resets"):
        assert after[key] == before[key]
    playing.assert_worn(before)


@pytest.mark.parametrize("rate", [0.1, 3.0, 10.0])
def test_rates(playing, rate):
    source, before = playing.source, playing.fresh()
    source.rate = rate
    playing.follow()
    stamps = playing.next(30)
    assert (np.diff(stamps) >= 0).all()
    assert stamps[-1] <= source.stamp
    if rate < 1.0:
        # In small steps: a frame is never much farther on than a frame's time.
        assert np.diff(stamps).max() < 2.5 * PERIOD
    source.rate = 1.0
    playing.follow()
    if rate < 10.0:  # a busy machine's stall of 0.1 s is a second of such a source's
        assert playing.fresh()["time_jumps"] == before["time_jumps"]
    # More than the machine can simulate is more than clothes can be kept at.
    playing.assert_worn(before if rate < 1.0 else None)


def jump(scene, by, *, keeps):
    """Set the source's time, and see that the nodes have heard of it, once.

    Returns:
        What the cloth's diagnostics told before.
    """
    colliders, cloth = scene.fresh(scene.colliders), scene.fresh()
    scene.source.jump(round(by * SECOND))
    scene.follow()
    scene.counts("time_jumps", colliders["time_jumps"] + 1, scene.colliders)
    scene.counts("time_jumps", cloth["time_jumps"] + 1)
    assert scene.fresh()["resets"] == cloth["resets"] + (not keeps)
    return cloth


def go_round(scene, length):
    """Some rounds of a loop of so many seconds."""
    source = scene.source
    begin = source.stamp + SECOND
    jumps = scene.fresh()["time_jumps"]
    rounds, source.loop = source.rounds, (begin, begin + round(length * SECOND))
    # On a busy machine garments may be put on for longer than a round takes.
    scene.until(lambda: scene.value("time_jumps") >= jumps + 2, "two new times")
    assert scene.fresh()["time_jumps"] - jumps <= source.rounds - rounds
    stamps = scene.next(30)
    assert begin - PERIOD <= stamps.min()
    assert stamps.max() <= source.loop[1]
    source.loop = None
    scene.follow()


@pytest.mark.parametrize("by", [-20.0, -2.0, -0.5, 30.0])
def test_jumps(playing, by):
    before = jump(playing, by, keeps=False)
    playing.assert_worn(before)


@pytest.mark.parametrize("length", [0.8, pytest.param(1.5, marks=pytest.mark.slow)])
def test_loops_with_a_seam(playing, length):
    before = playing.fresh()
    go_round(playing, length)
    playing.assert_worn(before)


def test_cloth_that_is_kept_goes_along_with_every_jump(start_node, make_probe, until):
    scene = Scene("/time_keep", start_node, make_probe, until, on_time_jump="keep")
    for by in (-20.0, 30.0):
        jump(scene, by, keeps=True)
    go_round(scene, 0.8)
    # A limb may come through while the body jumps; none stays there.
    scene.assert_worn()
    assert scene.fresh()["resets"] == 0.0
    scene.end()


def test_a_short_gap_is_no_jump(playing):
    before = playing.fresh()
    playing.source.jump(SECOND // 2)
    playing.follow()
    assert playing.fresh()["time_jumps"] == before["time_jumps"]
    playing.assert_worn(before)


@pytest.mark.parametrize("late", [0.3, -0.3])
def test_late_and_early_messages(playing, late):
    before = playing.fresh()
    source = playing.source
    source.late = round(late * SECOND)
    now = source.stamp + max(0, -source.late)
    playing.until(lambda: now < playing.last(), "the cloth follows")
    stamps = playing.next(30)
    assert stamps[-1] <= source.stamp - source.late
    assert playing.fresh()["time_jumps"] == before["time_jumps"]
    playing.assert_worn(before)


def test_messages_out_of_order(playing):
    before, rejected = playing.fresh(), "rejected.stamp_backwards"
    old = playing.fresh(playing.colliders).get(rejected, 0.0)
    playing.source.swaps = True
    playing.until(
        lambda: playing.probe.value(playing.colliders, rejected) > old + 60, "old ones are counted"
    )
    playing.follow()
    after = playing.fresh()
    for key in ("time_jumps", "resets", "teleports"):
        assert after[key] == before[key]
    playing.assert_worn(before)


@pytest.mark.parametrize("rate", [10, 1000])
def test_slow_and_fast_input(playing, rate):
    source, before = playing.source, playing.fresh()
    source.period = SECOND // rate
    playing.until(
        lambda: abs(playing.value("input_period_ms") * rate - 1000.0) < 1.0, "the period"
    )
    playing.follow()

    def moves():
        stamps = playing.next(40)
        assert stamps[-1] <= source.stamp
        return len(set(stamps.tolist())) > 20

    # With most frames, not with every message; again where a busy machine stood still.
    playing.until(moves, "cloth that moves with most frames")
    playing.assert_worn(before)


def test_a_source_that_dies_and_another_that_comes(playing, make_probe):
    source, first = playing.source, playing.probe
    for sender in (make_probe("/time_reset"), first):
        source.sends = False
        playing.until(
            lambda: playing.probe.diagnostics(playing.cloth).message.startswith("no usable"),
            "the silence on diagnostics",
        )
        source.probe, source.sends = sender, True
        playing.follow()
    playing.assert_worn()


def test_the_player_follows_a_clock(playing, start_node, make_probe):
    """Its stamps are those of the clock, wherever that jumps; it stands still with it."""
    source = playing.source
    node = start_node("mocap_player", "/time_player", use_sim_time=True, rate=100.0)
    probe = make_probe("/time_player")
    joints = probe.listen(JOINT_STATES)

    def stamp():
        found = probe.received(joints)
        return nanoseconds(found[-1].header.stamp) if found else -1

    def follows():
        playing.until(lambda: abs(source.stamp - stamp()) < SECOND // 10, "the clock's time")

    for by in (0.0, -3.0, 5.0, -100.0):
        source.jump(round(by * SECOND))
        follows()
    source.playing = False
    follows()

    playing.until(
        lambda: probe.silent_while(joints, playing.fresh),
        "what is on its way has come, and no more",
    )
    count = len(probe.received(joints))
    source.step()
    playing.until(lambda: len(probe.received(joints)) > count, "the step")
    source.playing, source.rate = True, 10.0
    follows()
    node.send(signal.SIGTERM)
    assert node.wait() == 0
