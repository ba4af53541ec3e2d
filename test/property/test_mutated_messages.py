"""Damaged messages of every topic: refused or used, soon; good ones are still taken."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("sensor_msgs")

TEST = Path(__file__).resolve().parents[1]
COUNT = 4000
"""Of all topics; `make fuzz-messages` tries a million."""


def test_handlers_of_damaged_messages_refuse_or_use_them():
    """In a process of its own, whose memory is limited and which a hanging handler ends."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "hostile.messages", "--count", str(COUNT)],
        cwd=TEST,
        env={**os.environ, "PYTHONPATH": f"{TEST}{os.pathsep}{TEST.parent}"},
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.stdout, done.stderr[-4000:]
    found = json.loads(done.stdout)
    assert set(found) == {
        *("joint_states", "collider_poses", "robot_description", "collider_description")
    }
    assert {name: result["failures"] for name, result in found.items() if result["failures"]} == {}
    assert done.returncode == 0
    # Damage that breaks everything or nothing would show little.
    for name in ("joint_states", "collider_poses"):
        assert found[name]["taken"] > 0.1 * COUNT * 0.38
        assert len(found[name]["refused"]) >= 5
