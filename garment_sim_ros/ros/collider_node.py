"""`collider_node`: joint states of a source skeleton to world poses of the avatar's colliders."""

import sys
from collections.abc import Callable
from threading import Thread

from std_msgs.msg import String

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.humanoid import load_humanoid_overrides
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.loaders.urdf_xml import MAX_TEXT
from garment_sim_ros.colliders.description import to_json
from garment_sim_ros.errors import MessageError
from garment_sim_ros.params import ColliderNodeParameters
from garment_sim_ros.ros.background import Background
from garment_sim_ros.ros.conversions import JointStates, text_from
from garment_sim_ros.ros.diagnostics import Condition
from garment_sim_ros.ros.joint_channels import MISSING, UNKNOWN, JointChannels
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.place import ALONE, Place
from garment_sim_ros.ros.posed_avatar import PosedAvatar, Skeleton, read_skeleton, wear
from garment_sim_ros.ros.process import run
from garment_sim_ros.ros.progress import reporting
from garment_sim_ros.ros.rclpy_internals import Taken
from garment_sim_ros.ros.shared import shared
from garment_sim_ros.ros.sources import Source
from garment_sim_ros.ros.stamp_order import StampOrder
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_MARKERS,
    COLLIDER_POSES,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
    ROOT_POSE,
    TF,
)
from garment_sim_ros.stamps import SECOND

_DESCRIPTION = "robot_description"
_SHOWN = 5
_MOST_KEPT = 10_000
"""Joint states kept, with `lossless`, until there is a skeleton and who follows its poses."""
_ROOM = 64
"""Messages that may come while one is used: in a flood the good ones are to be among them."""


def _unposed(q: FloatArray, time: float) -> FloatArray:
    """Before there is a skeleton there is nothing to pose."""
    raise AssertionError


class ColliderNode(ManagedNode[ColliderNodeParameters]):
    """Fits colliders to a body and poses them as the source skeleton moves."""

    def __init__(self, place: Place = ALONE) -> None:
        super().__init__("collider_node", ColliderNodeParameters, place)
        self.realtime_priority = self.parameters.realtime_priority
        self._still_reading: Thread | None = None
        self._avatar: PosedAvatar | None = None
        self._channels: JointChannels | None = None
        self._world_joints: Callable[[FloatArray, float], FloatArray] = _unposed
        self._sent = 0
        self._kept: list[Taken] = []
        self._keeps = False

    def prepare(self) -> None:
        """Load the body and fit its colliders.

        Raises:
            InputFileError: A file cannot be used.
            GeometryError: The body cannot be fitted.
        """
        p = self.parameters
        self._bone_names = load_humanoid_overrides(p.bone_names) if p.bone_names else None
        names = p.body_bone_names
        self._body_bone_names = load_humanoid_overrides(names) if names else None
        self._stamps = StampOrder(p.time_jump)
        self._reader = JointStates()
        self._description_out = self.advertise(COLLIDER_DESCRIPTION)
        self._poses_out = self.advertise(COLLIDER_POSES, keep_all=p.lossless)
        self._keeps = p.lossless
        self._markers_out = self.advertise(COLLIDER_MARKERS)
        self._root_out = self.advertise(ROOT_POSE)
        self._frame_out = self.advertise(TF) if TF and p.root_frame else None
        self._frame = f"{self.get_namespace()}/{p.root_frame}".lstrip("/")
        if p.body:
            with reporting(self.get_logger().info, f"load {p.body} and fit its colliders"):
                body = shared(load_body, p.body, bone_names=p.body_bone_names)
                self._avatar = wear(body, p, self.get_logger())
        self._skeleton = Background(self._read, _DESCRIPTION, self._still_reading)
        self.take_in(ROBOT_DESCRIPTION, self._take_description, always=True)
        self._source = Source(p.stale_after)
        self._joints = self.take_in(
            JOINT_STATES, self._take, source=self._source, room=_ROOM, keep_all=p.lossless
        )

    def start(self) -> None:
        """Publish the colliders; poses follow as joint states come."""
        if self._avatar is not None:
            self._description_out.publish(String(data=to_json(self._avatar.colliders)))

    def release(self) -> None:
        """Forget body and skeleton."""
        if hasattr(self, "_skeleton"):  # else configuring failed before
            self._still_reading = self._skeleton.retire()
            del self._skeleton
        self._avatar = self._channels = None
        self._kept = []

    @property
    def has_description(self) -> bool:
        """Whether there is a skeleton to follow."""
        return self._channels is not None

    def condition(self) -> Condition:
        """What the node waits for, or that it poses."""
        if self.state != "active":
            return Condition(text=self.state)
        if self._channels is None:
            return Condition(text=f"waits for {ROBOT_DESCRIPTION.name}", well=False)
        if self._kept:
            return Condition(text=f"waits for subscribers of {COLLIDER_POSES.name}", well=False)
        if not self._joints.count:
            return Condition(text=f"waits for {JOINT_STATES.name}", well=False)
        missing = len(self._channels.missing())
        silent = self._joints.silent()
        stale = silent > self.parameters.stale_after
        text = "waits for the first value of some joints" if missing else "poses colliders"
        return Condition(
            text=f"no usable {JOINT_STATES.name} for {silent:.1f} s" if stale else text,
            stale=stale,
            values={
                "poses": self._sent,
                "joints_missing": missing,
                "input_age_s": silent,
                "time_jumps": self._stamps.jumps,
            },
        )

    def attend(self) -> None:
        """Take over a skeleton that has been read."""
        if self.state not in ("inactive", "active"):
            return
        self._take_skeleton()
        if not self._keeps or self._channels is None or self.state != "active":
            return
        wanted = self.parameters.wait_for_subscribers
        if self._poses_out.get_subscription_count() >= wanted:
            self._keeps, kept, self._kept = False, self._kept, []
            for message in kept:
                try:
                    self._take_joints(message)
                except MessageError as error:
                    self.reject(JOINT_STATES.name, error)

    def _take_skeleton(self) -> None:
        try:
            skeleton = self._skeleton.result()
        except MessageError as error:
            self.reject(_DESCRIPTION, error)
            return
        if skeleton is None:
            return
        self._avatar = skeleton.avatar
        self._world_joints = skeleton.world_joints
        self._channels = JointChannels(skeleton.rig.dofs)
        if skeleton.is_new:
            self.start()

    def _take_description(self, message: Taken) -> None:
        self._skeleton.request(text_from(message.data, MAX_TEXT))

    def _read(self, text: str) -> Skeleton:
        """Map a source skeleton to the body; not in the node's thread."""
        return read_skeleton(
            text,
            self._avatar,
            self.parameters,
            self.get_logger(),
            bone_names=self._bone_names,
            body_bone_names=self._body_bone_names,
        )

    def _take(self, message: Taken) -> None:
        if not self._keeps:
            self._take_joints(message)
        elif len(self._kept) < _MOST_KEPT:
            self._kept.append(message)
        else:
            raise MessageError(
                "not_followed",
                f"over {_MOST_KEPT} messages wait for a skeleton and for subscribers of "
                f"{COLLIDER_POSES.name}; allowed: up to {_MOST_KEPT}",
            )

    def _take_joints(self, message: Taken) -> None:
        joints = self._reader.read(message.data)
        channels = self._channels
        if channels is None:
            return  # a skeleton that is not described yet; `condition` says so
        channels.check(joints)
        stamp = joints.stamp or self.get_clock().now().nanoseconds
        if self._source.followed in (None, message.publisher):
            if self._joints.away:
                self._stamps.excuse_gap(self._joints.away)
            self._stamps.accept(stamp)
        else:
            self._stamps.begin(stamp)
        channels.take(joints)
        unknown = channels.unknown()
        if unknown:
            shown = ", ".join(unknown[:_SHOWN])
            self.rejections.add(
                JOINT_STATES.name,
                MessageError(UNKNOWN, f"found {shown}; allowed: joints of robot_description"),
            )
        if channels.is_complete:
            self._publish(stamp)
            return
        missing = channels.missing()
        shown = ", ".join(missing[:_SHOWN])
        self.rejections.add(
            JOINT_STATES.name,
            MessageError(MISSING, f"waits for the first value of {len(missing)} joints: {shown}"),
        )

    def _publish(self, stamp: int) -> None:
        assert self._avatar is not None
        assert self._channels is not None
        avatar = self._avatar
        T_world_joint = self._world_joints(self._channels.values, stamp / SECOND)
        poses, data = avatar.posed(T_world_joint, stamp)
        self._poses_out.publish(data)
        if self._root_out.get_subscription_count():
            self._root_out.publish(avatar.root(T_world_joint, stamp))
        if self._frame_out is not None and self._frame_out.get_subscription_count():
            self._frame_out.publish(avatar.root_frame(T_world_joint, stamp, self._frame))
        self._sent += 1
        if self._markers_out.get_subscription_count():
            markers = avatar.due_markers(stamp, poses)
            if markers is not None:
                self._markers_out.publish(markers)


def main(argv: list[str] | None = None) -> int:
    """Entry point of the executable."""
    # Poses are wanted an input period after they came: cloth, due earlier, goes first.
    return run("collider_node", ColliderNode, argv, steps_back=True)


if __name__ == "__main__":
    sys.exit(main())
