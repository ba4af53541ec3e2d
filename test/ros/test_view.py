"""The live source of the page: topics, hostile messages, nodes that go and come again."""

import dataclasses
import signal
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import Point
from ros_input.cloth import SECOND, Avatar
from shape_msgs.msg import Mesh, MeshTriangle
from std_msgs.msg import String

from garment_sim_ros.errors import ParameterError
from garment_sim_ros.ros.live_source import LiveSource
from garment_sim_ros.ros.serialize import PointCloud
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_POSES,
    GARMENT_POINTS,
    GARMENT_TOPOLOGY,
)

pytestmark = pytest.mark.ros

X = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
TRIANGLES = ((0, 1, 2), (1, 3, 2))
FLAT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 300}}
"""


def topology(x=X, triangles=TRIANGLES):
    return Mesh(
        triangles=[MeshTriangle(vertex_indices=np.array(t, np.uint32)) for t in triangles],
        vertices=[Point(x=float(a), y=float(b), z=float(c)) for a, b, c in x],
    )


class Garment:
    """A garment that a probe publishes."""

    def __init__(self, probe, name):
        self._probe = probe
        self._points = dataclasses.replace(GARMENT_POINTS, name=GARMENT_POINTS.name.format(name))
        self._mesh = dataclasses.replace(GARMENT_TOPOLOGY, name=GARMENT_TOPOLOGY.name.format(name))
        make = probe.node.create_publisher
        self._publishers = [make(t.type, t.name, t.profile()) for t in (self._mesh, self._points)]
        self._message = PointCloud(len(X), "world")

    def describe(self, message=None):
        self._publishers[0].publish(message or topology())

    def send(self, stamp, x=X):
        self._publishers[1].publish(bytes(self._message.fill(stamp, x)))

    def send_raw(self, data):
        self._publishers[1].publish(data)

    @property
    def is_heard(self):
        return all(p.get_subscription_count() for p in self._publishers)


@pytest.fixture
def source(request):
    with LiveSource(f"/view/{request.node.name.partition('[')[0]}", "world") as made:
        yield made


@pytest.fixture
def probe(source, make_probe):
    return make_probe(source._node.get_namespace())


@pytest.fixture
def garment(source, probe, until):
    """A garment that the source knows."""
    made = Garment(probe, "sheet")
    made.describe()
    until(lambda: source.frame() is None and "sheet" in source.cloths, "the sheet is known")
    until(lambda: made.is_heard, "its points are heard")
    return made


def shown(source, until, stamp, resend):
    """The frame of a time."""
    found = []

    def look():
        resend()
        frame = source.frame()
        if frame is not None:
            found.append(frame)
        return found and found[-1].stamp == stamp

    until(look, f"a frame of {stamp}")
    return found[-1]


def test_garments_are_found_and_their_points_shown(source, garment, until):
    assert (source.cloths["sheet"].triangles == TRIANGLES).all()
    frame = shown(source, until, 5, lambda: garment.send(5, X + 1))
    assert (frame.positions["sheet"] == X + 1).all()
    assert "cloth at" in source.words()
    rates, errors = source.graphs()
    assert len(rates) == 2
    assert len(errors) == 3


def test_frames_are_those_that_all_garments_have(source, garment, probe, until):
    other = Garment(probe, "other")
    other.describe()
    until(lambda: source.frame() is None and len(source.cloths) == 2, "both are known")
    until(lambda: other.is_heard, "its points are heard")

    def send():
        garment.send(10)
        garment.send(20)
        other.send(10)

    frame = shown(source, until, 10, send)
    assert set(frame.positions) == {"sheet", "other"}


def test_poses_are_those_of_the_time_of_the_cloth(source, garment, probe, until):
    avatar = Avatar()
    probe.publish(COLLIDER_DESCRIPTION, avatar.description)
    until(lambda: source.frame() is None and source.colliders is not None, "described")
    early, late = avatar.at(0.0), avatar.at(0.5)

    def send():
        probe.publish(COLLIDER_POSES, avatar.message(1 * SECOND, early))
        probe.publish(COLLIDER_POSES, avatar.message(2 * SECOND, late))
        garment.send(1 * SECOND + SECOND // 4)

    def is_between():
        """Both poses came: with one alone the body is in that one."""
        poses = (frame_of(source) or frame).poses
        return poses is not None and np.allclose(poses.position, expected, rtol=0.0, atol=1e-9)

    expected = 0.75 * early.position + 0.25 * late.position
    frame = shown(source, until, 1 * SECOND + SECOND // 4, send)
    until(lambda: send() or is_between(), "the pose of the cloth's time")


def frame_of(source):
    source._given = -1
    return source.frame()


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda g: g.send(6, X * np.float32(np.nan)), "not_finite"),
        (lambda g: g.send(6, X + np.float32(1e9)), "out_of_range"),
        (lambda g: g.send_raw(b"\0\1\0\0" + b"\xff" * 60), "stamp_invalid"),
        (lambda g: g.send_raw(b"\0\1\0\0"), "malformed"),
        (lambda g: g.send_raw(bytes(PointCloud(9, "world").fill(6, np.zeros((9, 3))))),
         "length_mismatch"),
        (lambda g: g.send_raw(bytes(PointCloud(4, "map").fill(6, X))), "frame_id"),
        (lambda g: g.describe(topology(X * np.float32(np.inf))), "not_finite"),
        (lambda g: g.describe(topology(triangles=((0, 1, 4_000_000_000),))), "length_mismatch"),
        (lambda g: g.describe(topology(triangles=())), "length_mismatch"),
    ],
)  # fmt: skip
def test_hostile_messages_are_counted_and_what_was_good_stays(
    source, garment, until, spoil, reason
):
    shown(source, until, 5, lambda: garment.send(5))
    before = source.cloths

    def look():
        spoil(garment)
        assert source.frame() is None
        return source.rejections.counts[reason]

    until(look, f"counted as {reason}")
    assert source.cloths is before
    assert "rejected" in source.words()
    frame = shown(source, until, 7, lambda: garment.send(7, X + 2))
    assert (frame.positions["sheet"] == X + 2).all()


def test_hostile_descriptions_and_poses_are_counted(source, garment, probe, until):
    avatar = Avatar()
    probe.publish(COLLIDER_DESCRIPTION, String(data="{" * 10_000))
    until(lambda: source.frame() is None and source.rejections.counts, "counted")
    assert source.colliders is None
    probe.publish(COLLIDER_DESCRIPTION, avatar.description)
    until(lambda: source.frame() is None and source.colliders is not None, "described")
    few = avatar.at(0.0)
    few.position[3] = np.nan

    def look():
        probe.publish(COLLIDER_POSES, avatar.message(5, few))
        source.frame()
        return source.rejections.counts["not_finite"]

    until(look, "poses that are not finite are counted")


def test_names_that_are_none_and_too_many_garments(source, probe, until, monkeypatch):
    monkeypatch.setattr("garment_sim_ros.ros.live_source.MOST_GARMENTS", 3)
    kept = [Garment(probe, name) for name in ("a", "b", "c", "d", "e", "Not_one", "a" * 80)]
    for garment in kept:
        garment.describe()
    until(lambda: source.frame() is None and len(source.cloths) == 3, "three are known")
    for _ in range(3):
        source._next_look = 0.0
        source.frame()
    assert len(source._garments) == 3
    assert set(source._garments) <= set("abcde")


def test_triangles_are_limited(source, garment, until, monkeypatch):
    monkeypatch.setattr("garment_sim_ros.ros.live_source.MOST_TRIANGLES", 2)
    many = topology(triangles=TRIANGLES * 2)
    until(
        lambda: garment.describe(many) or source.frame() or source.rejections.counts["too_many"],
        "counted",
    )
    assert len(source.cloths["sheet"].triangles) == 2


def test_a_namespace_that_is_none_is_told():
    with pytest.raises(ParameterError, match="--namespace: found 'a b'"):
        LiveSource("a b", "world")


def test_what_is_not_there_is_told(source, until):
    said = []
    source.nodes.reset("cloth_node", said.append)
    source.nodes.set("wind", (1.0, 0.0, 0.0), said.append)
    source.nodes.pause("mocap_player", True, said.append)
    until(lambda: len(said) == 3, "all are answered")
    assert all("is not there" in text for text in said)
    assert source.nodes.values() == {}
    assert source.body() is None


@pytest.mark.slow
def test_a_node_that_is_killed_and_started_again_is_shown_again(
    tmp_path, start_node, make_probe, until
):
    """With the real node: its parameters, services, and its garments after a kill."""
    namespace = "/view/killed"
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(FLAT)
    avatar = Avatar()
    probe = make_probe(namespace)
    stamp = [1000 * SECOND]

    with LiveSource(namespace, "world") as source:
        frames = []

        def moves():
            """Whether the cloth goes on, with poses being sent."""
            stamp[0] += SECOND // 100
            poses = avatar.message(stamp[0], avatar.at(1e-9 * stamp[0]))
            probe.publish(COLLIDER_POSES, poses)
            time.sleep(0.01)
            frame = source.frame()
            if frame is not None and frame.positions:
                frames.append(frame)
            return len(frames) > 20

        node = start_node("cloth_node", namespace, outfit=str(outfit))
        probe.publish(COLLIDER_DESCRIPTION, avatar.description)
        until(moves, "the first node's cloth is shown")
        assert frames[-1].poses is not None
        assert source.body() == ("mannequin", "")
        until(lambda: moves() and source.nodes.values().get("preset") == "balanced", "asked")

        said = []
        source.nodes.set("wind", (3.0, 0.0, 0.0), said.append)
        source.nodes.set("preset", "fast", said.append)
        source.nodes.reset("cloth_node", said.append)
        source.nodes.pause("cloth_node", True, said.append)
        until(lambda: moves() and len(said) == 4, "all are answered")
        assert said.count("") == 3
        assert any("read-only" in text for text in said)
        until(
            lambda: moves() and source.nodes.values()["wind"] == (3.0, 0.0, 0.0), "the wind is set"
        )
        assert source.nodes.values()["preset"] == "balanced"

        node.send(signal.SIGKILL)
        node.wait()
        until(lambda: source.frame() is None and "no garments for" in source.words(), "told")
        assert set(source.cloths) == {"skirt"}
        start_node("cloth_node", namespace, outfit=str(outfit))
        frames.clear()
        until(moves, "the second node's cloth is shown")
        assert "cloth at" in source.words()
