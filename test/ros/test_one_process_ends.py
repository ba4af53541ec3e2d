"""One process of many nodes ends whole, at any time, and leaves nothing behind."""

import fcntl
import os
import signal
from pathlib import Path

import psutil
import pytest

pytest.importorskip("rclpy")

pytestmark = pytest.mark.ros


def mapped(pid):
    """Files that a process has mapped."""
    return Path(f"/proc/{pid}/maps").read_text()


def segments(pid):
    """The middleware's shared memory that a process has mapped."""
    words = mapped(pid).split()
    return {w for w in words if w.startswith("/dev/shm/fastrtps_") and "port" not in w}


def lives(process):
    """Whether a process is there and has not ended."""
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def is_left(file):
    """Whether shared memory is there whose owner, who holds a lock beside it, is not."""
    if not os.path.exists(file):
        return False
    try:
        with open(f"{file}_el") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except FileNotFoundError:
        return os.path.exists(file)
    return True


@pytest.mark.parametrize(
    ("when", "number"),
    [
        *(("importing", number) for number in (signal.SIGINT, signal.SIGTERM)),
        *(("making nodes", number) for number in (signal.SIGINT, signal.SIGTERM)),
        ("dressed", signal.SIGINT),
        pytest.param("dressed", signal.SIGTERM, marks=pytest.mark.slow),
    ],
)
def test_an_end_leaves_nothing(command, make_probe, until, outfit, when, number):
    namespace = f"/ends_{when.replace(' ', '_')}_{number.name.lower()}"
    probe = make_probe(namespace)
    ours = segments(os.getpid())
    words = ("--outfit", outfit, "--namespace", namespace, "--avatars", "2")
    process = command(*words, apart=True)
    if when == "importing":
        until(lambda: "librcl.so" in mapped(process.pid), "the middleware")
    elif when == "making nodes":
        until(lambda: "preset" in process.said, "a node")
    elif when == "dressed":
        points = f"{namespace}/avatar_2/garments/skirt/points"
        until(lambda: probe.node.count_publishers(points), "cloth")
    shared = segments(process.pid) - ours
    children = psutil.Process(process.pid).children(recursive=True)
    process.send(number)
    code, _ = process.wait()
    assert code == 130, process.said
    assert "Traceback" not in process.said
    assert "error" not in process.said.lower()
    assert not [file for file in shared if is_left(file)]
    # Those that compile end by themselves, with the process that started them.
    until(lambda: not [child for child in children if lives(child)], "its processes to end")
    until(
        lambda: not [n for n in probe.node.get_node_names_and_namespaces() if "avatar_" in n[1]],
        "nobody to be there any more",
    )
