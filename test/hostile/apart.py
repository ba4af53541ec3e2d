"""Runs a module of this folder in a process of its own, whose memory it limits itself."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

_TEST = Path(__file__).resolve().parents[1]


def told_by(module: str, *words: str) -> tuple[dict[str, Any], int]:
    """What a module found, by name, and its exit code."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", module, *words],
        cwd=_TEST,
        env={**os.environ, "PYTHONPATH": f"{_TEST}{os.pathsep}{_TEST.parent}"},
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.stdout, done.stderr[-4000:]
    return json.loads(done.stdout), done.returncode
