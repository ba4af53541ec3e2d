"""Avatars of one process: none starves, and none leaves anything behind."""

import gc
import time

import psutil
import pytest

pytest.importorskip("rclpy")

from garment_sim_ros.ros.cloth_node import ClothNode
from garment_sim_ros.ros.collider_node import ColliderNode
from garment_sim_ros.ros.mocap_player import MocapPlayer
from garment_sim_ros.ros.one_process import OneProcess, in_step

pytestmark = pytest.mark.ros

LIMIT = 180.0
OUTFIT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 500}}
"""


@pytest.fixture(scope="module")
def outfit(tmp_path_factory):
    path = tmp_path_factory.mktemp("outfit") / "outfit.yaml"
    path.write_text(OUTFIT)
    return str(path)


def wait_for(process, condition):
    limit = time.monotonic() + LIMIT
    while not condition():
        process.check()
        assert time.monotonic() < limit
        time.sleep(0.01)


def test_no_avatar_starves_where_there_is_too_much_to_do(outfit):
    """One thread for more than it can do: all have frames, and as many."""
    given = {
        "mocap_player": {},
        "collider_node": {"outfit": outfit},
        "cloth_node": {"outfit": outfit, "rate": 240.0, "preset": "accurate"},
    }
    with OneProcess(threads=1) as process:
        for i in range(4):
            process.add(f"/crowd_{i}", given)
        wait_for(process, lambda: process.is_dressed)
        process.measure()
        found = process.figures()["avatars"]
        frames = []

        def enough():
            nonlocal found, frames
            found = process.figures()["avatars"]
            frames = [a["frames"] for a in found.values()]
            return min(frames) > 30 or max(frames) > 300

        wait_for(process, enough)
    assert min(frames) > 0.6 * max(frames), found
    assert all(a["late_frames"] > 0 for a in found.values()), "there was time enough for all"


def rounds_of(process, given, count):
    for i in range(count):
        process.add(f"/guest_{i}", given)
        wait_for(process, lambda: process.is_dressed)
        process.remove(f"/guest_{i}")


def here(kind):
    return sum(isinstance(thing, kind) for thing in gc.get_objects())


@pytest.mark.parametrize("count", [5, pytest.param(50, marks=pytest.mark.slow)])
def test_avatars_that_come_and_go_leave_nothing(outfit, make_probe, until, count):
    given = {
        "mocap_player": {},
        "collider_node": {"outfit": outfit},
        "cloth_node": {"outfit": outfit},
    }
    probe = make_probe("/host")
    with OneProcess() as process:
        process.add("/host", given)
        wait_for(process, lambda: process.is_dressed)
        rounds_of(process, given, 3)
        memory, threads = psutil.Process().memory_info().rss, psutil.Process().num_threads()
        rounds_of(process, given, count)
        grown = psutil.Process().memory_info().rss - memory
        assert psutil.Process().num_threads() <= threads + 3  # those that come and go
        assert [here(k) for k in (MocapPlayer, ColliderNode, ClothNode)] == [1, 1, 1]
        # One that stays takes some MiB. In the first rounds the process was seen to grow by 31 to
        # 45 MiB; why is not known.
        assert grown < (24 if count >= 50 else 64) * 2**20
        until(
            lambda: not [n for n in probe.node.get_node_names_and_namespaces() if "guest" in n[1]],
            "all guests to have gone",
        )
        process.measure()
        wait_for(process, lambda: process.figures()["avatars"]["/host"]["frames"] > 5)


def test_poses_come_in_step_with_frames():
    _, nodes = in_step({"mocap_player": {}, "collider_node": {}, "cloth_node": {"rate": 25.0}})
    assert nodes["mocap_player"]["rate"] == 50.0  # the clip has 100, more than is worth it
    assert nodes["cloth_node"]["delay"] == 0.0
    given = {"mocap_player": {"rate": 7.0}, "collider_node": {}, "cloth_node": {"delay": 0.1}}
    _, nodes = in_step(given)
    assert nodes["mocap_player"]["rate"] == 7.0
    assert nodes["cloth_node"]["delay"] == 0.1
    _, nodes = in_step({"collider_node": {}, "cloth_node": {}})
    assert nodes["cloth_node"] == {}
