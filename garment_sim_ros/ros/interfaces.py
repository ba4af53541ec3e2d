"""Topics: names, types and quality of service, in one table.

Names are relative: one avatar lives in one namespace. Profiles can be overridden by the ROS
parameters ``qos_overrides.<topic>.<publisher or subscription>.<policy>``.
"""

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseStamped
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2
from shape_msgs.msg import Mesh
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from garment_sim_ros.ros.rclpy_internals import Unattended


@dataclass(frozen=True, kw_only=True)
class Topic:
    """One topic.

    Attributes:
        name: Relative name; those of garments have a place for the garment's name.
        type: Message type.
        depth: Messages kept.
        latched: Transient local: late joiners get the last message.
        subscribed_reliably: Whether our own subscribers ask for reliable delivery.
    """

    name: str
    type: type
    depth: int
    latched: bool = False
    subscribed_reliably: bool = True

    def profile(self, *, subscribed: bool = False, keep_all: bool = False) -> QoSProfile:
        """A new profile; overriding changes it in place."""
        reliable = self.subscribed_reliably or not subscribed
        return QoSProfile(
            history=HistoryPolicy.KEEP_ALL if keep_all else HistoryPolicy.KEEP_LAST,
            depth=self.depth,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=(
                DurabilityPolicy.TRANSIENT_LOCAL if self.latched else DurabilityPolicy.VOLATILE
            ),
        )


JOINT_STATES = Topic(name="joint_states", type=JointState, depth=10, subscribed_reliably=False)
ROBOT_DESCRIPTION = Topic(name="robot_description", type=String, depth=1, latched=True)
CLOCK = Topic(name="/clock", type=Clock, depth=10)
COLLIDER_DESCRIPTION = Topic(name="collider_description", type=String, depth=1, latched=True)
COLLIDER_POSES = Topic(name="collider_poses", type=PoseArray, depth=10)
COLLIDER_MARKERS = Topic(name="collider_markers", type=MarkerArray, depth=2)
ROOT_POSE = Topic(name="root_pose", type=PoseStamped, depth=10)
GARMENT_POINTS = Topic(name="garments/{}/points", type=PointCloud2, depth=2)
GARMENT_MESH = Topic(name="garments/{}/mesh", type=Marker, depth=2)
GARMENT_TOPOLOGY = Topic(name="garments/{}/topology", type=Mesh, depth=1, latched=True)
QUALITY = Topic(name="quality", type=DiagnosticArray, depth=2)
DIAGNOSTICS = Topic(name="/diagnostics", type=DiagnosticArray, depth=10)

_OVERRIDABLE = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
)


def advertise(node: LifecycleNode, topic: Topic, garment: str = "") -> LifecyclePublisher:
    """A publisher of a topic that is silent while its node is not active.

    Args:
        node: The node.
        topic: From the table above.
        garment: Whose, for the topics of garments.
    """
    publisher: LifecyclePublisher = node.create_lifecycle_publisher(
        topic.type,
        topic.name.format(garment),
        topic.profile(),
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


def subscribe(node: LifecycleNode, topic: Topic, *, depth: int, keep_all: bool) -> Subscription:
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
