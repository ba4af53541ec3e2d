"""The example that listens, beside real nodes."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

pytestmark = pytest.mark.ros

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "subscribe.py"
NAMESPACE = "/example_test"
OUTFIT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 500}}
"""


def test_garments_arrive_as_arrays(start_node, tmp_path):
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(OUTFIT)
    for name, parameters in (
        ("mocap_player", {}),
        ("collider_node", {"method": "capsules"}),
        ("cloth_node", {"outfit": str(outfit)}),
    ):
        start_node(name, NAMESPACE, **parameters)
    words = [sys.executable, str(EXAMPLE), "skirt", "5", "--ros-args", "-r"]
    done = subprocess.run(
        [*words, f"__ns:={NAMESPACE}"], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    frames = re.findall(r"(\d+) ns: 500 vertices about \[(.*)\] m", done.stdout)
    assert len(frames) >= 5
    stamps = [int(stamp) for stamp, _ in frames]
    assert stamps == sorted(set(stamps))
    assert all(0.3 < float(place.split()[2]) < 1.5 for _, place in frames)
    assert re.search(r"triangles: \(\d{3}, 3\)", done.stdout)
