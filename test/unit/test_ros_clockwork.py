"""Stamps, buffered poses and channels, without any node."""

import contextlib
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")

from garment_sim_ros.body.rig import ROTATION, Dofs
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.errors import MessageError
from garment_sim_ros.ros.conversions import StampedJoints
from garment_sim_ros.ros.joint_channels import JointChannels
from garment_sim_ros.ros.pose_buffer import PoseBuffer
from garment_sim_ros.ros.stamp_order import StampOrder
from garment_sim_ros.ros.ticker import Ticker

SECOND = 10**9
STEP = SECOND // 100


def poses(x, count=2):
    found = ColliderPoses.identity(count)
    found.position[:, 0] = x
    return found


class TestStampOrder:
    @staticmethod
    def reasons(stamps, time_jump=1.0):
        order, found = StampOrder(time_jump), []
        for seconds in stamps:
            try:
                found.append("anew" if order.accept(round(seconds * SECOND)) else "next")
            except MessageError as error:
                found.append(error.reason)
        return found

    def test_increasing_stamps_follow(self):
        assert self.reasons([5.0, 5.1, 5.1001, 6.1]) == ["anew", "next", "next", "next"]

    def test_the_same_or_an_older_stamp_is_rejected(self):
        assert self.reasons([5.0, 5.0, 4.5, 5.2]) == [
            *("anew", "stamp_backwards", "stamp_backwards", "next"),
        ]

    @pytest.mark.parametrize("far", [-4.0, 100.0])
    def test_one_stray_stamp_is_rejected(self, far):
        assert self.reasons([5.0, 5.0 + far, 5.1, 5.2]) == ["anew", "stamp_jump", "next", "next"]

    @pytest.mark.parametrize("far", [-4.0, 100.0])
    def test_two_that_agree_begin_a_new_time(self, far):
        stamps = [5.0, 5.0 + far, 5.1 + far, 5.2 + far]
        assert self.reasons(stamps) == ["anew", "stamp_jump", "anew", "next"]

    def test_strays_that_do_not_agree_stay_strays(self):
        stamps = [5.0, 100.0, 50.0, 200.0, 5.1]
        assert self.reasons(stamps) == ["anew", *["stamp_jump"] * 3, "next"]

    def test_a_clip_that_is_shorter_than_a_jump_begins_again(self):
        clip = [5.0 + 0.02 * i for i in range(25)]
        found = self.reasons([*clip, *clip])
        assert found[:25] == ["anew", *["next"] * 24]
        # Old ones until they have followed on each other for 0.1 s.
        assert found[25:31] == [*["stamp_backwards"] * 5, "anew"]
        assert set(found[31:]) == {"next"}

    def test_old_ones_between_newer_ones_are_no_new_time(self):
        late = [value for i in range(60) for value in (5.0 + 0.02 * i, 4.6 + 0.02 * i)]
        found = self.reasons(late)
        assert found[:2] == ["anew", "stamp_backwards"]
        assert set(found[2::2]) == {"next"}
        assert set(found[3::2]) == {"stamp_backwards"}

    def test_few_old_ones_far_apart_are_none_either(self):
        assert self.reasons([5.0, 4.2, 4.7, 5.1]) == ["anew", *["stamp_backwards"] * 2, "next"]

    def test_a_gap_is_excused_once_and_for_as_long_as_its_receiver_was_away(self):
        order = StampOrder(1.0)
        order.accept(SECOND)
        order.excuse_gap(2 * SECOND)
        assert not order.accept(4 * SECOND)
        with pytest.raises(MessageError, match="stamp_jump"):
            order.accept(7 * SECOND)
        order.excuse_gap(SECOND)
        with pytest.raises(MessageError, match="stamp_jump"):
            order.accept(4 * SECOND + 2 * SECOND + 1)
        order.excuse_gap()
        assert not order.accept(1000 * SECOND)
        assert order.jumps == 0

    def test_new_times_are_counted(self):
        order = StampOrder(1.0)
        for seconds in (5.0, 5.1, 50.0, 50.1, 50.2, 49.9, 49.95, 50.0, 3.0, 3.1):
            with contextlib.suppress(MessageError):
                order.accept(round(seconds * SECOND))
        assert order.jumps == 3
        order.begin(0)
        assert order.jumps == 3


class _Clock:
    """A machine's clock that can be set."""

    def __init__(self):
        self.ahead = 0

    def now(self):
        return SimpleNamespace(nanoseconds=time.monotonic_ns() + self.ahead)

    def get_clock(self):
        return self

    def get_parameter(self, name):
        return SimpleNamespace(value=False)


class TestTicker:
    @pytest.mark.parametrize("by", [-5.0, -1e6, 1e6])
    def test_a_clock_that_is_set_does_not_hold_it_up(self, by):
        clock, calls = _Clock(), []
        ticker = Ticker(clock, 100.0, lambda due, ticks: calls.append((due, ticks)))
        clock.ahead = round(by * SECOND)
        began = time.monotonic_ns()
        for _ in range(5):
            ticker.wait(SECOND)
        assert len(calls) == 5
        for due, _ in calls:
            assert abs(due - clock.ahead - began) < SECOND
        assert all(ticks == 1 for _, ticks in calls[:1])


class TestPoseBuffer:
    def test_interpolates_between_and_stands_still_outside(self):
        buffer, out = PoseBuffer(), ColliderPoses.identity(2)
        for i in range(4):
            buffer.add(i * 100, poses(float(i * i)))
        for stamp, x in ((-50, 0.0), (0, 0.0), (50, 0.5), (150, 2.5), (200, 4.0), (999, 9.0)):
            buffer.at(stamp, out)
            assert out.position[0, 0] == pytest.approx(x)

    def test_forgets_what_no_later_time_needs(self):
        buffer, out = PoseBuffer(), ColliderPoses.identity(2)
        for i in range(10):
            buffer.add(i * 100, poses(float(i)))
        buffer.forget_before(450)
        assert len(buffer) == 6
        buffer.at(450, out)
        assert out.position[0, 0] == pytest.approx(4.5)


class TestJointChannels:
    @staticmethod
    def channels(mimic=(-1, -1, 0)):
        count = len(mimic)
        return JointChannels(
            Dofs(
                names=tuple("abcdef"[:count]),
                joint=np.arange(count, dtype=np.int32),
                kind=np.full(count, ROTATION, np.int8),
                axis=np.tile([1.0, 0.0, 0.0], (count, 1)),
                lower=np.full(count, -np.inf),
                upper=np.full(count, np.inf),
                mimic_source=np.array(mimic, dtype=np.int32),
                mimic_multiplier=np.ones(count),
                mimic_offset=np.zeros(count),
            )
        )

    @staticmethod
    def message(**values):
        return StampedJoints(stamp=1, names=tuple(values), values=np.array([*values.values()]))

    def take(self, channels, **values):
        message = self.message(**values)
        channels.check(message)
        channels.take(message)

    def test_order_and_parts(self):
        channels = self.channels()
        self.take(channels, b=2.0)
        assert not channels.is_complete
        assert channels.missing() == ["a"]  # c follows another
        self.take(channels, b=3.0, a=1.0)
        assert channels.is_complete
        assert channels.values.tolist() == [1.0, 3.0, 0.0]

    def test_unknown_names(self):
        channels = self.channels()
        self.take(channels, a=1.0, tail=5.0)
        assert channels.unknown() == ["tail"]
        with pytest.raises(MessageError) as error:
            channels.check(self.message(tail=5.0))
        assert error.value.reason == "name_unknown"

    def test_a_name_twice(self):
        message = StampedJoints(stamp=1, names=("a", "a"), values=np.zeros(2))
        with pytest.raises(MessageError) as error:
            self.channels().check(message)
        assert error.value.reason == "name_duplicated"

    def test_a_name_twice_among_many_is_found_in_one_pass(self):
        compared = 0

        class Name(str):
            __hash__ = str.__hash__

            def __eq__(self, other):
                nonlocal compared
                compared += 1
                return str.__eq__(self, other)

        count = 3000
        names = (*(Name(f"joint_{i}") for i in range(count - 1)), Name(f"joint_{count - 2}"))
        message = StampedJoints(stamp=1, names=names, values=np.zeros(count))
        with pytest.raises(MessageError, match="'joint_2998' is there twice"):
            self.channels().check(message)
        assert compared < 10 * count

    def test_a_rejected_message_changes_nothing(self):
        channels = self.channels()
        self.take(channels, a=1.0, b=2.0)
        for names in (("a", "a"), ("tail",)):
            message = StampedJoints(stamp=1, names=names, values=np.full(len(names), 9.0))
            with pytest.raises(MessageError):
                channels.check(message)
        self.take(channels, a=3.0, b=4.0)
        assert channels.values.tolist() == [3.0, 4.0, 0.0]
