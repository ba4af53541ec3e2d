"""Topics: names, types and what is kept of them, in one table.

Names are relative: one avatar lives in one namespace.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2
from shape_msgs.msg import Mesh
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile


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

    @property
    def kind(self) -> str:
        """Name of the type, as sensor_msgs/msg/JointState."""
        return f"{self.type.__module__.partition('.')[0]}/msg/{self.type.__name__}"

    def profile(self, *, subscribed: bool = False, keep_all: bool = False) -> "QoSProfile":
        """A new profile; overriding changes it in place. To keep all takes reliable delivery."""
        # Here, so that recordings are written where there is no middleware.
        from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

        reliable = self.subscribed_reliably or not subscribed or keep_all
        return QoSProfile(
            history=HistoryPolicy.KEEP_ALL if keep_all else HistoryPolicy.KEEP_LAST,
            depth=self.depth,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=(
                DurabilityPolicy.TRANSIENT_LOCAL if self.latched else DurabilityPolicy.VOLATILE
            ),
        )


# Best effort hears every publisher. "Best available" is settled when a node subscribes, as
# reliable where nobody publishes yet: a driver that comes later would never be heard.
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
TF = None if TFMessage is None else Topic(name="/tf", type=TFMessage, depth=100)
"""Frames for everybody; None where its type is not installed."""
QUALITY = Topic(name="quality", type=DiagnosticArray, depth=2)
DIAGNOSTICS = Topic(name="/diagnostics", type=DiagnosticArray, depth=10)
_ALL = (
    *(JOINT_STATES, ROBOT_DESCRIPTION, CLOCK, COLLIDER_DESCRIPTION, COLLIDER_POSES),
    *(COLLIDER_MARKERS, ROOT_POSE, GARMENT_POINTS, GARMENT_MESH, GARMENT_TOPOLOGY),
    *(QUALITY, DIAGNOSTICS),
)


def topic_of(name: str) -> Topic | None:
    """The topic with a full name, told by its last part; None where it is none of these."""
    last = name.rpartition("/")[2]
    return next((topic for topic in _ALL if topic.name.rpartition("/")[2] == last), None)
