"""Nodes end when they are told to, whatever they are doing."""

import signal
import subprocess
import sys

import pytest

pytest.importorskip("rclpy")

pytestmark = pytest.mark.ros

NODE = """
import sys
from garment_sim_ros.params import MocapPlayerParameters
from garment_sim_ros.ros.lifecycle import ManagedNode, run

class Stuck(ManagedNode):
    def __init__(self):
        super().__init__("mocap_player", MocapPlayerParameters)

    def start(self):
        self.tick_at(100.0, self.tick)

    def tick(self, due, ticks):
        print("stuck", flush=True)
        {work}

sys.exit(run("mocap_player", Stuck, []))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("work", ["while True: pass", "import time; time.sleep(1e6)"])
def test_a_callback_that_does_not_end_is_interrupted(number, work):
    process = subprocess.Popen(
        [sys.executable, "-c", NODE.format(work=work)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert process.stdout is not None
        said = []
        while not said or "stuck" not in said[-1]:
            said.append(process.stdout.readline())
            assert said[-1], said
        process.send_signal(number)
        assert process.wait(60.0) == 0
        assert "Traceback" not in process.stdout.read()
    finally:
        process.kill()
        process.wait()
