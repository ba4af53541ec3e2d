"""A node says what it had no time for."""

from garment_sim_ros.ros.overload import LEAST, PERIOD, QUIET, Overload
from garment_sim_ros.stamps import SECOND

TENTH = SECOND // 10


def test_time_that_was_lost_is_told_from_look_to_look():
    overload = Overload([].append)
    assert overload.look(0, 0, 0) == ""
    assert overload.look(2 * TENTH, 0, SECOND) == "too slow: 0.20 s in coarse steps"
    assert overload.look(2 * TENTH, 0, 2 * SECOND) == ""
    both = "too slow: 0.30 s in coarse steps and 0.10 s passed over"
    assert overload.look(5 * TENTH, TENTH, 3 * SECOND) == both
    assert overload.look(5 * TENTH, 3 * TENTH, 4 * SECOND) == "too slow: 0.20 s passed over"


def test_a_hiccup_is_not_told():
    overload = Overload([].append)
    assert overload.look(LEAST // 2, LEAST // 2 - 1, 0) == ""
    assert (
        overload.look(LEAST, LEAST - 1, SECOND)
        == "too slow: 0.05 s in coarse steps and 0.05 s passed over"
    )


def test_new_garments_count_anew():
    overload = Overload([].append)
    assert overload.look(50 * TENTH, 0, 0)
    assert overload.look(0, 0, SECOND) == ""
    assert overload.look(TENTH, 0, 2 * SECOND) == "too slow: 0.10 s in coarse steps"


def test_looks_in_between_say_the_same_and_take_nothing_away():
    overload = Overload([].append)
    assert overload.look(5 * TENTH, 0, SECOND) == "too slow: 0.50 s in coarse steps"
    assert overload.look(9 * TENTH, 0, SECOND + PERIOD // 2) == "too slow: 0.50 s in coarse steps"
    assert overload.look(9 * TENTH, 0, 2 * SECOND) == "too slow: 0.40 s in coarse steps"


def test_time_that_nobody_could_have_used_is_not_told():
    lines = []
    overload = Overload(lines.append)
    assert overload.look(0, 0, 0) == ""
    overload.excuse(SECOND)
    assert overload.look(0, 60 * SECOND, 2 * SECOND) == ""
    assert lines == []
    assert overload.look(0, 60 * SECOND, 3 * SECOND) == ""
    assert overload.look(0, 61 * SECOND, 4 * SECOND) == "too slow: 1.00 s passed over"


def test_it_is_logged_once_in_a_while():
    lines = []
    overload = Overload(lines.append)
    for n in range(4):
        assert overload.look(0, (n + 1) * SECOND, n * QUIET // 2)
    assert len(lines) == 2
    assert lines[0].startswith("too slow: 1.00 s passed over; a cheaper preset")
