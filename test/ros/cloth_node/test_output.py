"""The cloth node as a process, fed by hand."""

import os
import re
import signal
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from ros_input.cloth import GARMENTS, NAMESPACE, RATE, SECOND, points_of, resets, stamp_of
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import Marker

from garment_sim_ros.ros.topics import GARMENT_TOPOLOGY

pytestmark = pytest.mark.ros


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="only Linux has priorities of threads")
def test_the_thread_that_ticks_goes_first_where_the_system_grants_it(node, running, probe, until):
    def is_told():
        goes = {v.key: v.value for v in probe.diagnostics(node).values}["scheduling"]
        policy = os.sched_getscheduler(node.pid) & ~os.SCHED_RESET_ON_FORK
        return goes if (goes == "real time") == (policy == os.SCHED_RR) else ""

    goes = until(is_told, "how the node goes, on /diagnostics")
    assert goes == "real time" or goes.startswith("as others:")


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="only Linux has priorities of threads")
def test_threads_of_the_middleware_step_back_for_the_one_that_ticks(node, running):
    threads = [int(folder.name) for folder in Path(f"/proc/{node.pid}/task").iterdir()]
    policy = {t: os.sched_getscheduler(t) & ~os.SCHED_RESET_ON_FORK for t in threads}
    assert policy.pop(node.pid) in (os.SCHED_OTHER, os.SCHED_RR)
    assert os.SCHED_BATCH in policy.values()
    names = {t: Path(f"/proc/{node.pid}/task/{t}/comm").read_text() for t in policy}
    middleware = [t for t, name in names.items() if name.startswith("dds.")]
    assert middleware
    assert all(policy[t] == os.SCHED_BATCH for t in middleware)


def test_what_was_done_to_keep_garments_worn_is_counted_by_the_names_in_the_documents(
    node, running, probe, until
):
    page = (Path(__file__).parents[3] / "docs" / "worn.md").read_text()
    told = page[page.index("All is counted on `/diagnostics`") :].partition("\n\n")[0]
    names = set(re.findall(r"`([a-z_]+)`", told))
    assert len(names) > 12
    until(lambda: probe.value(node, "solver_steps") > 0, "steps on /diagnostics")
    values = {v.key: float(v.value) for v in probe.diagnostics(node).values if v.key in names}
    assert set(values) == names
    assert all(np.isfinite(value) and value >= 0.0 for value in values.values())


def test_topology_reaches_late_joiners_and_fits_the_points(running, probe, make_probe, until):
    late = make_probe(NAMESPACE)
    for name in GARMENTS:
        topology = late.listen(GARMENT_TOPOLOGY, name)
        until(lambda t=topology: late.received(t), f"topology of the {name}")
        mesh = late.received(topology)[-1]
        triangles = np.array([t.vertex_indices for t in mesh.triangles])
        data = probe.next(f"garments/{name}/points")[0]
        cloud = deserialize_message(data, PointCloud2)
        assert len(mesh.vertices) == cloud.width
        assert triangles.max() == cloud.width - 1
        assert (cloud.header.frame_id, cloud.height, cloud.point_step) == ("world", 1, 12)
        assert [f.name for f in cloud.fields] == ["x", "y", "z"]
        drawn = probe.received(f"garments/{name}/mesh")
        same = until(
            lambda d=data, ms=drawn: [m for m in ms if stamp_of(m) == stamp_of(d)],
            "the marker of that frame",
        )
        marker = deserialize_message(same[0], Marker)
        corners = np.array([[p.x, p.y, p.z] for p in marker.points])
        assert (corners == points_of(data)[triangles.ravel()]).all()
        assert (marker.ns, marker.type, marker.action) == (name, marker.TRIANGLE_LIST, marker.ADD)
        assert marker.header.frame_id == "world"


def test_quality_of_service(running, probe):
    topics = {
        "garments/skirt/points": DurabilityPolicy.VOLATILE,
        "garments/skirt/mesh": DurabilityPolicy.VOLATILE,
        "garments/skirt/topology": DurabilityPolicy.TRANSIENT_LOCAL,
        "quality": DurabilityPolicy.VOLATILE,
    }
    for name, durability in topics.items():
        (info,) = probe.publishers_of(name)
        assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        assert info.qos_profile.durability == durability


def test_stamps_are_whole_steps_and_never_beyond_the_input(running, probe):
    step = SECOND // 180  # rounded down, see ClothStepper
    stamps = [stamp_of(m) for m in probe.next("garments/shirt/points", 60)]
    assert max(stamps) <= running.stamp
    steps = np.diff(stamps)
    assert (steps >= 0).all()
    assert (steps % step == 0).all()
    assert stamps[-1] > stamps[0]


def test_quality_has_one_status_per_garment_and_frame(running, probe):
    message = probe.next("quality")[0]
    assert [s.name for s in message.status] == list(GARMENTS)
    for status in message.status:
        values = {v.key: float(v.value) for v in status.values}
        assert values.keys() >= {"step_ms", "strain_p95", "strain_max", "contacts", "resets"}
        assert all(np.isfinite(v) for v in values.values())
        assert values["step_ms"] >= 0.0
        assert values["strain_max"] >= values["strain_p95"] - 1e-3
        for measure in ("pierced", "inside", "inside_p99", "inside_median"):
            assert 0.0 <= values[measure] <= 1.0
    stamps = {stamp_of(m) for m in probe.received("garments/skirt/points")}
    assert message.header.stamp.sec * SECOND + message.header.stamp.nanosec in stamps


def test_frames_of_a_time_in_which_the_node_stands_still_are_late(running, node, probe, until):
    """Stopped from outside for a known time: all frames due in it are late, no others."""

    def late():
        values = {v.key: v.value for v in probe.next("quality")[0].status[0].values}
        return int(values["late_frames"])

    def is_stopped():
        return Path(f"/proc/{node.pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"

    began = time.monotonic()
    before = late()
    node.send(signal.SIGSTOP)
    until(is_stopped, "the node stands still")
    stopped = time.monotonic()
    until(lambda: time.monotonic() > stopped + 0.5, "half a second is over")
    held = time.monotonic() - stopped
    node.send(signal.SIGCONT)
    probe.next("quality")  # it may have been under way
    after = late()
    assert after - before >= int(held * RATE - 0.5)
    assert after - before <= (time.monotonic() - began) * RATE + 2.0
    until(lambda: probe.value(node, "late_frames") >= after, "diagnostics tell the same count")


def test_reset(running, probe, reach):
    before = resets(probe)
    assert probe.call(Trigger, "cloth_node/reset", Trigger.Request()).success
    reach()
    assert resets(probe) == before + 1


def test_pause(running, probe, reach):
    assert probe.call(SetBool, "cloth_node/pause", SetBool.Request(data=True)).success
    held = probe.next("garments/skirt/points", 10)[1:]
    assert all(m == held[0] for m in held)
    assert probe.call(SetBool, "cloth_node/pause", SetBool.Request(data=False)).success
    reach()


def test_clean_end(running, node):
    node.send(signal.SIGTERM)
    assert node.wait() == 0
    assert "Traceback" not in node.output
