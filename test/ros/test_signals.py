"""Nodes end when they are told to, whatever they are doing."""

import contextlib
import signal
import subprocess
import sys

import pytest

pytest.importorskip("rclpy")

pytestmark = pytest.mark.ros

STUCK = """
import sys
from garment_sim_ros.params import MocapPlayerParameters
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.process import run

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

LONG = """
import sys, time

class Long:
    def __init__(self):
        print("stuck", flush=True)
        while time:
            time.sleep(0.1)  # a signal just before it does not cut it short
        self.handle = 1

    def __del__(self):
        print(f"ends without {self.handle}")

"""
A_NODE = """
from garment_sim_ros.ros.process import run

sys.exit(run("mocap_player", Long, []))
"""
SEVERAL_NODES = """
from garment_sim_ros.cli.interrupts import interrupts_kept

try:
    with interrupts_kept():
        Long()
except KeyboardInterrupt:
    sys.exit(130)
"""


DEFECT = """
import sys
from garment_sim_ros.params import MocapPlayerParameters
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.process import run

class Broken(ManagedNode):
    def __init__(self):
        super().__init__("mocap_player", MocapPlayerParameters)

    def {when}(self):
        raise ZeroDivisionError("a defect")

sys.exit(run("mocap_player", Broken, []))
"""

ENDS = """
from pathlib import Path
from garment_sim_ros.ros.{node} import main

main([])
names = {path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")}
print("at work:", sorted(name for name in names if name.startswith("dds.")))
"""


@contextlib.contextmanager
def stuck(code, where="stuck"):
    """A process that has come to where it says that it is stuck."""
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert process.stdout is not None
        said = []
        while not said or where not in said[-1]:
            said.append(process.stdout.readline())
            assert said[-1], said
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "work", ["while True: pass", "import time\n        while True: time.sleep(0.1)"]
)
def test_a_callback_that_does_not_end_is_interrupted(number, work):
    with stuck(STUCK.format(work=work)) as process:
        process.send_signal(number)
        assert process.wait(60.0) == 0
        assert "Traceback" not in process.stdout.read()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("making", "code"), [(A_NODE, 0), (SEVERAL_NODES, 130)], ids=["a node", "several nodes"]
)
def test_what_is_cut_short_in_the_making_says_nothing(making, code, number):
    """The compiler's objects expect to be whole when they end."""
    with stuck(LONG + making) as process:
        process.send_signal(number)
        assert process.wait(60.0) == code
        assert process.stdout.read() == ""


def test_a_context_that_is_gone_within_a_callback_is_an_end():
    """The middleware shuts it down before Python hears of the signal."""
    work = "import rclpy; rclpy.shutdown(); next(self.publishers).get_subscription_count()"
    with stuck(STUCK.format(work=work)) as process:
        assert process.wait(60.0) == 0
        assert process.stdout.read() == ""


@pytest.mark.parametrize(("when", "what"), [("prepare", "configured"), ("start", "activated")])
def test_a_defect_ends_the_node_and_is_told(when, what):
    done = subprocess.run(
        [sys.executable, "-c", DEFECT.replace("{when}", when)],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 2
    assert "ZeroDivisionError: a defect" in done.stderr
    assert done.stderr.splitlines()[-1] == f"error: mocap_player could not be {what}"


@pytest.mark.parametrize("node", ["mocap_player", "collider_node", "cloth_node"])
def test_a_node_that_ended_has_left_the_network(node):
    """Else the middleware works on while the process takes away what it uses."""
    with stuck(ENDS.replace("{node}", node), where="preset") as process:
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0
        # The one that is left looks after shared memory, and is joined when its library goes.
        assert process.stdout.read().splitlines()[-1] == "at work: ['dds.shm.wdog']"
