"""Damaged messages of every topic: refused or used, soon; good ones are still taken."""

import pytest
from hostile.apart import told_by

pytest.importorskip("sensor_msgs")

COUNT = 4000
"""Of all topics; `make fuzz-messages` tries a million."""


def test_handlers_of_damaged_messages_refuse_or_use_them():
    """In a process of its own, whose memory is limited and which a hanging handler ends."""
    found, code = told_by("hostile.messages", "--count", str(COUNT))
    assert set(found) == {
        *("joint_states", "collider_poses", "robot_description", "collider_description")
    }
    assert {name: result["failures"] for name, result in found.items() if result["failures"]} == {}
    assert code == 0
    # Damage that breaks everything or nothing would show little.
    for name in ("joint_states", "collider_poses"):
        assert found[name]["taken"] > 0.1 * COUNT * 0.38
        assert len(found[name]["refused"]) >= 5
