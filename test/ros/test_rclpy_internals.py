"""What is used of `rclpy` beside its documented interface: each thing asked once."""

import threading
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

import garment_sim_ros
from garment_sim_ros.ros import rclpy_internals
from garment_sim_ros.ros.interfaces import subscribe
from garment_sim_ros.ros.rclpy_internals import PARTICIPANT, Taker, Waiter
from garment_sim_ros.ros.topics import COLLIDER_DESCRIPTION

SECOND = 10**9


@pytest.fixture(scope="module")
def context():
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    yield context
    rclpy.shutdown(context=context)


@pytest.fixture
def node(context):
    node = LifecycleNode("internals", namespace="/internals", context=context)
    yield node
    node.destroy_node()


def test_this_version_has_been_checked():
    """Where this fails, run the other tests of this file with that version, then add it."""
    try:
        found = version("rclpy")
    except PackageNotFoundError:
        pytest.skip("this rclpy does not tell its version")
    assert ".".join(found.split(".")[:2]) in rclpy_internals.CHECKED_WITH


def test_nothing_else_uses_internals():
    words = ("_implementation", "take_message", "_state_machine", "wait_for_ready", ".handle\n")
    words += ("_parameter_overrides",)
    package = Path(garment_sim_ros.__file__).parent
    for path in package.rglob("*.py"):
        if path.name != "rclpy_internals.py":
            text = path.read_text()
            assert not [word for word in words if word in text], path


def test_messages_come_with_their_publisher(node, until):
    topic = COLLIDER_DESCRIPTION
    subscription = subscribe(node, topic, depth=10, keep_all=True)
    taker, waiter = Taker(subscription), Waiter(node.context, [subscription])
    assert taker.take() is None
    publishers = [node.create_publisher(topic.type, topic.name, topic.profile()) for _ in "ab"]
    until(lambda: all(p.get_subscription_count() for p in publishers), "a reader")
    texts = ["a", "b" * 3_000_000]  # longer than the room that is kept
    for publisher, text in zip(publishers, texts):
        publisher.publish(String(data=text))
    found = {}

    def all_there():
        waiter.wait(SECOND // 10)
        while (taken := taker.take()) is not None:
            found[taken.data[8:9].decode()] = taken
        return len(found) == 2

    until(all_there, "both messages")
    infos = node.get_publishers_info_by_topic(subscription.topic_name)
    identities = {bytes(info.endpoint_gid) for info in infos}
    assert {taken.publisher for taken in found.values()} == identities
    assert len(identities) == 2
    assert len({taken.publisher[:PARTICIPANT] for taken in found.values()}) == 1
    assert all(taken.received > 0 for taken in found.values())
    assert [len(found[text[0]].data) for text in texts] == [4 + 4 + len(t) + 1 for t in texts]


def test_waiting_ends_with_a_message(node, until):
    topic = COLLIDER_DESCRIPTION
    subscription = subscribe(node, topic, depth=10, keep_all=False)
    taker, waiter = Taker(subscription), Waiter(node.context, [subscription])
    publisher = node.create_publisher(topic.type, topic.name, topic.profile())
    until(publisher.get_subscription_count, "a reader")
    ended = threading.Event()

    def wait():
        waiter.wait(1000 * SECOND)
        ended.set()

    threading.Thread(target=wait, daemon=True).start()
    publisher.publish(String(data="now"))
    until(ended.is_set, "the end of waiting")
    assert taker.take() is not None


def test_a_ready_callback_is_run_and_its_error_is_raised(node, until):
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def fail():
        raise ValueError("mine")

    node.create_timer(0.01, fail)
    with pytest.raises(ValueError, match="mine"):
        until(lambda: rclpy_internals.run_ready(executor) and False, "the timer")


def test_states_and_late_publishers(node):
    assert rclpy_internals.lifecycle_state(node) == "unconfigured"
    node.trigger_configure()
    node.trigger_activate()
    assert rclpy_internals.lifecycle_state(node) == "active"
    topic = COLLIDER_DESCRIPTION
    publisher = node.create_lifecycle_publisher(topic.type, topic.name, topic.profile())
    assert not publisher.is_activated
    rclpy_internals.activate(publisher)
    assert publisher.is_activated


def test_parameters_that_are_given_and_not_declared(context):
    given = [Parameter("told", value=1.0)]
    node = LifecycleNode("given", context=context, parameter_overrides=given)
    assert rclpy_internals.given_names(node) == ("told",)
    assert not node.has_parameter("told")
    node.destroy_node()
