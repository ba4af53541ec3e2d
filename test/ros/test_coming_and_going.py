"""Avatars of one process: none starves, and none leaves anything behind."""

import ctypes
import gc
import time

import psutil
import pytest

pytest.importorskip("rclpy")

from rclpy.node import Node
from ros_input.one_process import LIMIT, wearing

from garment_sim_ros.ros.cloth_node import ClothNode
from garment_sim_ros.ros.collider_node import ColliderNode
from garment_sim_ros.ros.mocap_player import MocapPlayer
from garment_sim_ros.ros.one_process import OneProcess, in_step
from garment_sim_ros.ros.place import Place

pytestmark = pytest.mark.ros


def wait_for(process, condition):
    limit = time.monotonic() + LIMIT
    while not condition():
        process.check()
        assert time.monotonic() < limit
        time.sleep(0.01)


def test_no_avatar_starves_where_there_is_too_much_to_do(outfit):
    """One thread for more than it can do: all have frames, and as many."""
    given = wearing(outfit, rate=240.0, preset="accurate")
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
            return min(frames) > 200 or max(frames) > 600

        wait_for(process, enough)
    assert min(frames) > 0.6 * max(frames), found
    assert all(a["late_frames"] > 0 for a in found.values()), "there was time enough for all"


class Allocated(ctypes.Structure):
    """`struct mallinfo2` of the C library."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    )


def in_use():
    """What all of the process holds of the memory that it asked for [bytes]."""
    gc.collect()
    tell = getattr(ctypes.CDLL(None), "mallinfo2", None)
    if tell is None:
        pytest.skip("this C library does not tell")
    tell.restype = Allocated
    told = tell()
    return told.uordblks + told.hblkhd


def resident():
    """Memory of this process alone, once what is free has been given back [bytes]."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    told = psutil.Process().memory_info()
    return told.rss - told.shared


def test_a_node_leaves_next_to_nothing():
    """The middleware keeps something of every node that there was, if another one stays."""
    with OneProcess() as process:

        def node(namespace):
            place = Place(context=process.context, namespace=namespace)
            return Node("of_an_avatar", **place.options())

        def rounds(count):
            for i in range(count):
                node(f"/guest_{i}").destroy_node()

        stays = node("/host")
        rounds(10)
        before = in_use()
        rounds(40)
        assert in_use() - before < 40 * 20 * 2**10  # 4 KiB are left; 105 of one service
        stays.destroy_node()


def rounds_of(process, given, count):
    for i in range(count):
        process.add(f"/guest_{i}", given)
        wait_for(process, lambda: process.is_dressed)
        process.remove(f"/guest_{i}")


def here(kind):
    return sum(isinstance(thing, kind) for thing in gc.get_objects())


@pytest.mark.parametrize("count", [5, pytest.param(50, marks=pytest.mark.slow)])
def test_avatars_that_come_and_go_leave_nothing(outfit, make_probe, until, count):
    given = wearing(outfit)
    probe = make_probe("/host")
    with OneProcess() as process:
        process.add("/host", given)
        wait_for(process, lambda: process.is_dressed)
        rounds_of(process, given, 3)
        before, before_resident = in_use(), resident()
        threads = psutil.Process().num_threads()
        rounds_of(process, given, count)
        assert psutil.Process().num_threads() <= threads + 3  # those that come and go
        assert [here(k) for k in (MocapPlayer, ColliderNode, ClothNode)] == [1, 1, 1]
        # 25 KiB are left of each. What is held for a moment differs by 2 MiB, and what
        # the C library keeps for threads by 20.
        assert in_use() - before < 5 * 2**20
        assert resident() - before_resident < 48 * 2**20
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
