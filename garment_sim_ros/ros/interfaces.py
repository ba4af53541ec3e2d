"""Publishers and subscriptions of the topics in `topics`, with their quality of service.

Profiles can be overridden by the ROS parameters
``qos_overrides.<topic>.<publisher or subscription>.<policy>``.
"""

from rclpy.lifecycle import LifecycleNode, LifecyclePublisher
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSPolicyKind
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from garment_sim_ros.ros.rclpy_internals import Unattended
from garment_sim_ros.ros.topics import Topic

_OVERRIDABLE = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
)


def advertise(
    node: LifecycleNode, topic: Topic, garment: str = "", *, keep_all: bool = False
) -> LifecyclePublisher:
    """A publisher of a topic that is silent while its node is not active.

    Args:
        node: The node.
        topic: From `topics`.
        garment: Whose, for the topics of garments.
        keep_all: Whether none may be lost, however fast they are sent.
    """
    publisher: LifecyclePublisher = node.create_lifecycle_publisher(
        topic.type,
        topic.name.format(garment),
        topic.profile(keep_all=keep_all),
        qos_overriding_options=QoSOverridingOptions(_OVERRIDABLE),
    )
    return publisher


def advertise_always(node: LifecycleNode, topic: Topic, garment: str = "") -> Publisher:
    """A publisher of a topic that does not depend on its node's state."""
    return node.create_publisher(
        topic.type,
        topic.name.format(garment),
        topic.profile(),
        qos_overriding_options=QoSOverridingOptions(_OVERRIDABLE),
    )


def subscribe(node: Node, topic: Topic, *, depth: int, keep_all: bool) -> Subscription:
    """A subscription whose serialized messages are asked for; see `inputs`.

    Bytes rather than messages: a damaged one must not end the node, as it does where `rclpy`
    deserializes it, and large arrays need not become Python objects.
    """
    profile = topic.profile(subscribed=True, keep_all=keep_all)
    profile.depth = max(profile.depth, depth)
    return node.create_subscription(
        topic.type,
        topic.name,
        lambda data: None,  # never called
        profile,
        callback_group=Unattended(),
        qos_overriding_options=QoSOverridingOptions(_OVERRIDABLE),
        raw=True,
    )
