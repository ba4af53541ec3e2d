"""Damaged files of every format: one clear error or a result, soon and in little memory."""

import json
import os
import subprocess
import sys
from pathlib import Path

TEST = Path(__file__).resolve().parents[1]
MUTANTS = 25
"""Of each format; `make fuzz` tries many more."""


def test_readers_of_damaged_files_end_with_one_clear_error():
    """In a process of its own, whose memory is limited and which a hanging reader ends."""
    done = subprocess.run(
        [sys.executable, "-m", "hostile.run", "--mutants", str(MUTANTS), "--seed", "7"],
        cwd=TEST,
        env={**os.environ, "PYTHONPATH": f"{TEST}{os.pathsep}{TEST.parent}"},
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.stdout, done.stderr[-4000:]
    found = json.loads(done.stdout)
    assert len(found) >= 36
    assert {name: result["failures"] for name, result in found.items() if result["failures"]} == {}
    assert done.returncode == 0
    # Damage that breaks everything or nothing would show little.
    assert sum(result["read"] for result in found.values()) > MUTANTS
    assert sum(result["refused"] for result in found.values()) > 10 * MUTANTS
