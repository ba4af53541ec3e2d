"""One rule for late frames, with a clock and a hold-up that the test sets."""

import numpy as np
import pytest
from ros_input.clock import Clock

from garment_sim_ros.lateness import LateFrames, late_of

SECOND = 10**9
RATE = 50.0
PERIOD = round(SECOND / RATE)


def held_up(*holds, before=0):
    """Late frames of a ticker each of whose frames is held up for a time [ns]."""
    ticker_of = pytest.importorskip("garment_sim_ros.ros.ticker").Ticker
    clock, late, told, holds = Clock(10**18 + 12_345), LateFrames(), [], list(holds)

    def frame(due, ticks):
        late.begin(due, PERIOD, ticks - 1)
        clock.time += holds.pop(0)
        late.published(clock.time)
        told.append(late.count)

    ticker = ticker_of(clock, RATE, frame)
    clock.time += before
    while holds:
        clock.time += max(0, ticker.ahead())
        ticker.call_if_due()
    return told


def test_half_a_period_is_allowed_and_a_nanosecond_more_is_late():
    assert held_up(PERIOD // 2, 0, PERIOD // 2 + 1, 0) == [0, 0, 1, 1]


@pytest.mark.parametrize("periods", [1.2, 3.2, 7.2])
def test_held_up_for_a_known_time(periods):
    """The frame itself, those that fell into the hold-up, and none after it."""
    held = int(periods * PERIOD)
    told = held_up(0, held, 0, 0, 0)
    left_out = int(periods) - 1
    assert told == [0, 1, 1 + left_out, 1 + left_out, 1 + left_out]
    # The frame that is made at once after the hold-up is 0.2 periods late: in time.


def test_a_frame_that_begins_late_is_late_by_the_grid_not_by_its_start():
    # 1.7 periods: the frame of the grid is 0.7 late when it begins, takes no time, and is late.
    assert held_up(0, int(1.7 * PERIOD), 0, 0) == [0, 1, 2, 2]


def test_due_times_do_not_move_with_what_is_late():
    """Frames that are all late by 0.6 periods are all late: a rule by arrivals sees none."""
    assert held_up(*[int(0.6 * PERIOD)] * 20)[-1] == 20


def test_what_is_not_due_is_not_late():
    late = LateFrames()
    late.published(10**18)
    assert late.count == 0
    late.begin(0, PERIOD, 0)
    late.published(PERIOD)
    late.published(PERIOD)
    assert late.count == 1, "a frame is judged once"


def test_a_recording_takes_the_nodes_count_after_the_first_second():
    told = np.concatenate([np.full(50, 4.0), np.full(50, 9.0), np.full(50, 11.0)])
    assert late_of(told, 50.0) == 2
    assert late_of(told, 49.0) == 7
    assert late_of(told[:10], 50.0) == 0
