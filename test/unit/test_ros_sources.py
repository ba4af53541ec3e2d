"""Which publisher of a topic is followed, without any node."""

import pytest

pytest.importorskip("rclpy")

from garment_sim_ros.errors import MessageError
from garment_sim_ros.ros.sources import Source

SECOND = 10**9


def used(source, publisher, now):
    """Whether a message that could be used is used."""
    try:
        source.check(publisher, now)
    except MessageError:
        return False
    source.accept(publisher, now)
    return True


def test_the_first_is_followed_and_the_other_ignored():
    source = Source(1.0)
    for i in range(10):
        assert used(source, b"a", i * SECOND // 10)
        assert not used(source, b"b", i * SECOND // 10 + 1)
    assert source.others(SECOND) == [b"b"]


def test_the_other_takes_over_after_a_silence():
    source = Source(1.0)
    assert used(source, b"a", 0)
    assert not used(source, b"b", SECOND)
    assert used(source, b"b", SECOND + 1)
    assert not used(source, b"a", SECOND + 2)
    assert source.others(SECOND + 2) == [b"a"]


def test_the_other_takes_over_at_once_from_one_that_is_gone():
    source = Source(100.0)
    assert used(source, b"a", 0)
    assert not used(source, b"b", 1)
    source.leave()
    assert used(source, b"b", 2)


def test_only_usable_messages_count():
    source = Source(1.0)
    assert used(source, b"a", 0)
    source.check(b"a", SECOND)  # and then found unusable
    source.check(b"hostile", 2 * SECOND)
    assert source.followed == b"a"
    assert used(source, b"b", 2 * SECOND)


def test_those_that_went_away_are_forgotten():
    source = Source(1.0)
    assert used(source, b"a", 0)
    assert not used(source, b"b", 0)
    for i in range(1000):
        assert not used(source, str(i).encode(), SECOND // 2)
    assert len(source.ignored) < 100
    assert used(source, b"a", 3 * SECOND)
    assert source.others(3 * SECOND) == []


def test_without_identities_all_are_one():
    source = Source(1.0)
    assert used(source, b"", 0)
    assert used(source, b"", 1)
    assert source.others(1) == []
