"""The controller of `auto`: any series of frames, and series of known answer."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_sim_ros.sim.auto.controller import PATIENCE, Controller
from garment_sim_ros.sim.auto.levels import LEVELS, START, with_costs

COSTS = tuple(level.cost for level in LEVELS)
TOP = len(COSTS) - 1
AT_FIRST = [level.name for level in LEVELS].index(START)
RATE, BUDGET = 60.0, 6.0

times = st.floats(0.0, 100.0)
frames = st.lists(st.tuples(times, times, st.booleans()), max_size=600)
# What a frame costs at the unit of costs [ms], for so many frames each.
stretches = st.lists(st.tuples(st.floats(0.1, 30.0), st.integers(1, 400)), max_size=12)


def controller(costs=COSTS, start=AT_FIRST):
    return Controller(costs, BUDGET, RATE, start)


def changes_in(series, made=None):
    """Frame number and change of each change."""
    made = made or controller()
    return [
        (n, change)
        for n, (work, waited, behind) in enumerate(series)
        if (change := made.frame(work, waited, behind=behind))
    ]


def check_hysteresis(changes):
    """Climbs are by one, and at least the least patience after whatever change."""
    before = -RATE
    for n, change in changes:
        assert 0 <= change.after <= TOP
        assert change.cause
        if change.after > change.before:
            assert change.after == change.before + 1
            assert n - before >= PATIENCE[0] * RATE - 1
        before = n


@given(frames)
@settings(max_examples=300, deadline=None)
def test_whatever_comes_it_stays_in_bounds_and_climbs_no_faster_than_its_patience(series):
    made = controller()
    check_hysteresis(changes_in(series, made))
    assert 0 <= made.level <= TOP
    assert all(PATIENCE[0] <= p <= PATIENCE[1] for p in made.patience)


@given(stretches)
@settings(max_examples=200, deadline=None)
def test_as_work_changes_it_ends_where_it_fits_or_at_the_floor(parts):
    """Work that is in proportion to the level's cost, as it is told."""
    made, changes, n = controller(), [], 0
    for unit, count in [*parts, (8.0, 600)]:
        for _ in range(count):
            change = made.frame(unit * COSTS[made.level])
            changes += [(n, change)] if change else []
            n += 1
    check_hysteresis(changes)
    assert 8.0 * COSTS[made.level] <= BUDGET or made.level == 0


@given(frames)
@settings(max_examples=100, deadline=None)
def test_in_calm_it_reaches_the_top(series):
    made = controller()
    changes_in(series, made)
    for _ in range(round(RATE * (len(COSTS) * PATIENCE[1] + 60.0))):
        made.frame(0.1)
        if made.level == TOP:
            return
    raise AssertionError(made.level)


@given(frames)
@settings(max_examples=100, deadline=None)
def test_the_same_frames_give_the_same_levels(series):
    assert changes_in(series) == changes_in(series)


def test_two_frames_over_the_budget_are_one_too_many():
    assert not changes_in(
        [(5.0, 0.0, False)] * 30 + [(7.0, 0.0, False)] + [(5.0, 0.0, False)] * 30
    )
    changes = changes_in([(5.0, 0.0, False)] * 30 + [(7.0, 0.0, False)] * 2)
    fits = max(n for n in range(AT_FIRST) if 7.0 * COSTS[n] / COSTS[AT_FIRST] <= BUDGET)
    assert [(n, c.before, c.after) for n, c in changes] == [(31, AT_FIRST, fits)]
    assert changes[0][1].cause == "frames take 7 ms of 6 ms"


def test_it_falls_as_far_as_it_takes_at_once():
    made = controller(start=TOP)
    changes_in([(1.0, 0.0, False)] * 3 + [(10.0, 0.0, False)] * 2, made)
    fits = [n for n in range(TOP) if 10.0 * COSTS[n] / COSTS[TOP] <= BUDGET]
    assert made.level == max(fits)
    deep = controller(start=TOP)
    changes_in([(1.0, 0.0, False)] * 3 + [(40.0, 0.0, False)], deep)
    assert deep.level == 0


def test_waiting_counts_but_is_not_expected_to_grow():
    made = controller()
    changes_in([(2.0, 5.0, False)] * 4, made)
    assert made.level < AT_FIRST
    patient = controller(start=0)
    # 2 ms of work become 3.3 with the margin: with 2 ms of waiting it fits, with 3 not.
    assert changes_in([(2.0, 3.0, False)] * 600, patient) == []
    assert len(changes_in([(2.0, 2.0, False)] * 100, patient)) == 1


def test_a_cloth_that_is_behind_goes_to_the_floor_in_that_frame():
    made = controller(start=TOP)
    change = made.frame(1.0, behind=True)
    assert (change.before, change.after, change.cause) == (TOP, 0, "the cloth is behind")
    assert made.frame(1.0, behind=True) is None


def test_where_there_is_a_shelter_it_goes_there_first():
    """Once is a hiccup, which is not worth the folds."""
    made = Controller(COSTS, BUDGET, RATE, TOP, shelter=2)
    assert [made.frame(1.0, behind=True) for _ in range(3)] == [
        (TOP, 2, "the cloth is behind"),
        (2, 0, "the cloth is behind"),
        None,
    ]


def test_a_level_that_costs_more_than_told_is_tried_less_and_less():
    """Where the lowest takes 2 ms and the next one 20 ms, no cost told it."""
    made, changes = controller(), []
    for n in range(round(120 * RATE)):
        change = made.frame(2.0 if made.level == 0 else 20.0)
        changes += [(n, change)] if change else []
    climbs = [n for n, c in changes if c.after > c.before]
    gaps = [b - a for a, b in pairwise(climbs)]
    assert gaps == sorted(gaps)
    assert gaps[-1] > 20 * RATE
    assert len(climbs) <= 8


def test_a_lonely_spike_does_not_keep_it_down():
    """One frame in ten seconds that is interrupted."""
    series = [(1.0 if n % 600 else 9.0, 0.0, False) for n in range(1, 3600)]
    made = controller(start=0)
    assert all(c.after > c.before for _, c in changes_in(series, made))
    assert made.level == TOP


def test_levels_that_a_better_one_costs_as_little_as_are_left_out():
    assert [level.name for level in with_costs(COSTS)] == [level.name for level in LEVELS]
    costs = [2.0, 3.0, 3.2, 2.9, 3.5, 5.0, 4.9, 6.0, 7.0]
    kept = with_costs(costs)
    assert [level.name for level in kept] == [
        "fast",  # the floor stays
        "18",
        "18, 2 searches",
        START,
        "27",
        "36, 3 searches",
        "accurate",
    ]
    assert kept[3].cost == pytest.approx(1.0)
    assert with_costs([4.0, *costs[1:]])[0].name == LEVELS[0].name


def test_levels_are_told_from_cheap_to_accurate():
    assert list(COSTS) == sorted(COSTS)
    assert COSTS[AT_FIRST] == 1.0
    counts = [(level.sub_steps, level.sub_steps / level.search_every) for level in LEVELS]
    assert [n for n, _ in counts] == sorted(n for n, _ in counts)
