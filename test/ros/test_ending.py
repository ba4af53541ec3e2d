"""A process ends with its exit code, whatever its threads are in."""

import subprocess
import sys

import pytest

_BEGINS = """
import sys, threading
import rclpy
from rclpy.executors import SingleThreadedExecutor
from garment_sim_ros.ending import end_process

def spin():
    while True:
        executor.spin_once(timeout_sec=0.001)
        spins.set()

rclpy.init()
executor, spins = SingleThreadedExecutor(), threading.Event()
executor.add_node(rclpy.create_node("{name}"))
threading.Thread(target=spin, daemon=True).start()
print("spins" if spins.wait(30.0) else "does not spin")
"""


@pytest.mark.parametrize("code", [0, 130])
def test_a_thread_in_the_middleware_does_not_abort_the_process(code):
    words = _BEGINS.format(name=f"ending_{code}") + f"sys.exit(end_process({code}))"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (code, "spins\n", "")


def test_without_threads_a_process_ends_as_any_other():
    words = "import atexit, sys; from garment_sim_ros.ending import end_process\n"
    words += "atexit.register(print, 'last'); sys.exit(end_process(3))"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (3, "last\n")
