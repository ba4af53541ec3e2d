"""`collider_node`: joint states of a source skeleton to world poses of the avatar's colliders."""

import dataclasses
import sys
from collections.abc import Callable
from functools import partial
from threading import Thread

import numpy as np
from std_msgs.msg import String

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.humanoid import load_humanoid_overrides
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.loaders.urdf import body_from_urdf, parse_urdf
from garment_sim_ros.body.loaders.urdf_xml import MAX_TEXT
from garment_sim_ros.body.missing_bones import missing_bones, missing_bones_of
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.description import load_colliders, to_json
from garment_sim_ros.colliders.fit_cache import cached_fit
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import MessageError
from garment_sim_ros.garment.outfit_file import read_outfit
from garment_sim_ros.geometry.transforms import quaternion_from_matrix
from garment_sim_ros.mocap.source_urdf import reference_from_urdf
from garment_sim_ros.params import ColliderNodeParameters, ColliderOptions, declarations
from garment_sim_ros.ros.background import Background
from garment_sim_ros.ros.conversions import LARGEST, OUT_OF_RANGE, JointStates, text_from
from garment_sim_ros.ros.diagnostics import Condition
from garment_sim_ros.ros.interfaces import (
    COLLIDER_DESCRIPTION,
    COLLIDER_MARKERS,
    COLLIDER_POSES,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
    ROOT_POSE,
)
from garment_sim_ros.ros.joint_channels import MISSING, UNKNOWN, JointChannels
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.markers import ColliderMarkers
from garment_sim_ros.ros.process import run
from garment_sim_ros.ros.progress import reporting
from garment_sim_ros.ros.rclpy_internals import Taken
from garment_sim_ros.ros.serialize import Poses, StampedPose
from garment_sim_ros.ros.sources import Source
from garment_sim_ros.ros.stamp_order import StampOrder
from garment_sim_ros.stamps import SECOND
from garment_sim_ros.stepping_back import step_back

_DESCRIPTION = "robot_description"
_SHOWN = 5
_ROOM = 64
"""Messages that may come while one is used: in a flood the good ones are to be among them."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Avatar:
    """A body with its colliders and all that is sent about them."""

    body: Body
    colliders: ColliderSet
    poser: ColliderPoser
    poses: ColliderPoses
    message: Poses
    markers: ColliderMarkers | None
    hips: int


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Skeleton:
    """A source skeleton, and how it moves an avatar."""

    rig: Rig
    avatar: _Avatar
    is_new: bool  # the avatar
    world_joints: Callable[[FloatArray, float], FloatArray]


def _unposed(q: FloatArray, time: float) -> FloatArray:
    """Before there is a skeleton there is nothing to pose."""
    raise AssertionError


class ColliderNode(ManagedNode[ColliderNodeParameters]):
    """Fits colliders to a body and poses them as the source skeleton moves."""

    def __init__(self) -> None:
        super().__init__("collider_node", ColliderNodeParameters)
        self._still_reading: Thread | None = None
        self._avatar: _Avatar | None = None
        self._channels: JointChannels | None = None
        self._world_joints: Callable[[FloatArray, float], FloatArray] = _unposed
        self._sent = 0

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
        self._root_message = StampedPose(p.frame_id)
        self._next_markers = 0
        self._description_out = self.advertise(COLLIDER_DESCRIPTION)
        self._poses_out = self.advertise(COLLIDER_POSES)
        self._markers_out = self.advertise(COLLIDER_MARKERS)
        self._root_out = self.advertise(ROOT_POSE)
        if p.body:
            with reporting(self.get_logger().info, f"load {p.body} and fit its colliders"):
                self._avatar = self._wear(load_body(p.body, bone_names=p.body_bone_names))
        self._skeleton = Background(self._read, _DESCRIPTION, self._still_reading)
        self.take_in(ROBOT_DESCRIPTION, self._take_description, always=True)
        self._source = Source(p.stale_after)
        self._joints = self.take_in(
            JOINT_STATES, self._take_joints, source=self._source, room=_ROOM
        )

    def start(self) -> None:
        """Publish the colliders; poses follow as joint states come."""
        # Poses are wanted an input period after they came: cloth, due earlier, goes first.
        step_back()
        if self._avatar is not None:
            self._description_out.publish(String(data=to_json(self._avatar.colliders)))

    def release(self) -> None:
        """Forget body and skeleton."""
        if hasattr(self, "_skeleton"):  # else configuring failed before
            self._still_reading = self._skeleton.retire()
            del self._skeleton
        self._avatar = self._channels = None

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
        if not self._joints.count:
            return Condition(text=f"waits for {JOINT_STATES.name}", well=False)
        missing = len(self._channels.missing())
        silent = self._joints.silent()
        stale = silent > self.parameters.stale_after
        text = "waits for the first value of some joints" if missing else "poses colliders"
        return Condition(
            text=f"no usable {JOINT_STATES.name} for {silent:.1f} s" if stale else text,
            stale=stale,
            values={"poses": self._sent, "joints_missing": missing, "input_age_s": silent},
        )

    def _wear(self, body: Body) -> _Avatar:
        """Fit colliders and prepare what posing them takes."""
        if missing := missing_bones_of(body, "body_bone_names"):
            self.get_logger().warning(missing)
        colliders = dataclasses.replace(self._fit(body), frame_id=self.parameters.frame_id)
        hips = body.humanoid.get("hips", body.rig.joint_names[0])
        avatar = _Avatar(
            body=body,
            colliders=colliders,
            poser=ColliderPoser(colliders, body),
            poses=ColliderPoses.identity(len(colliders)),
            message=Poses(len(colliders), colliders.frame_id),
            markers=ColliderMarkers(colliders) if self.parameters.marker_rate else None,
            hips=body.rig.index(hips),
        )
        for note in body.notes:
            self.get_logger().info(f"{body.name}: {note}")
        shapes = sum(not c.is_frame for c in colliders.colliders)
        self.get_logger().info(f"{body.name}: {shapes} colliders on {len(body.rig)} joints")
        # Compiles what the callbacks will run.
        poses = avatar.poser.poses(np.tile(np.eye(4), (len(body.rig), 1, 1)))
        if avatar.markers is not None:
            avatar.markers.fill(0, poses)
        if "hips" in body.humanoid:
            Retargeter(body.rig, body).world_joints(np.zeros(len(body.rig.dofs)))
        return avatar

    def _fit(self, body: Body) -> ColliderSet:
        p = self.parameters
        if p.colliders:
            return load_colliders(p.colliders)
        options = ColliderOptions(**{n: getattr(p, n) for n in declarations(ColliderOptions)})
        if p.outfit:
            options = read_outfit(p.outfit).colliders_on(options)
        if not p.cache:
            return fit_colliders(body, options)
        return cached_fit(body, options, p.body or None, self.get_logger().info)

    def attend(self) -> None:
        """Take over a skeleton that has been read."""
        if self.state not in ("inactive", "active"):
            return
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

    def _read(self, text: str) -> _Skeleton:
        """Map a source skeleton to the body, or take it for the body; not in the node's thread."""
        rig = parse_urdf(text)
        if self.parameters.body:
            avatar = self._avatar
            assert avatar is not None
            retargeter = Retargeter(
                rig,
                avatar.body,
                reference=reference_from_urdf(text),
                overrides=self._bone_names,
            )
            known = retargeter.source_bones
            others = retargeter.unmapped_source
            if missing := missing_bones("the source skeleton", known, others, "bone_names"):
                self.get_logger().warning(missing)
            for note in retargeter.notes:
                self.get_logger().info(note)
            for what, bones in (
                ("the source skeleton", retargeter.unmapped_source),
                (avatar.body.name, retargeter.unmapped_target),
            ):
                if bones:
                    self.get_logger().info(f"not mapped in {what}: {', '.join(bones)}")
            posed: Callable[[FloatArray, float], FloatArray] = partial(
                retargeter.world_joints,
                ground_feet=self.parameters.ground_feet,
                clear_arms=self.parameters.clear_arms,
            )
        else:
            with reporting(self.get_logger().info, "fit colliders to the body"):
                avatar = self._wear(body_from_urdf(text, humanoid_overrides=self._body_bone_names))
            from_dofs = ForwardKinematics(rig).from_dofs

            def alone(q: FloatArray, time: float) -> FloatArray:
                return from_dofs(q)

            posed = alone
        posed(np.zeros(len(rig.dofs)), 0.0)
        return _Skeleton(
            rig=rig,
            avatar=avatar,
            is_new=not self.parameters.body,
            world_joints=posed,
        )

    def _take_joints(self, message: Taken) -> None:
        joints = self._reader.read(message.data)
        channels = self._channels
        if channels is None:
            return  # a skeleton that is not described yet; `condition` says so
        channels.check(joints)
        stamp = joints.stamp or self.get_clock().now().nanoseconds
        if self._source.followed in (None, message.publisher):
            self._stamps.accept(stamp)
        else:
            self._stamps.begin(stamp)
        channels.take(joints)
        unknown = channels.unknown()
        if unknown:
            shown = ", ".join(unknown[:_SHOWN])
            self.rejections.add(
                JOINT_STATES.name,
                MessageError(UNKNOWN, f"{shown}; allowed: those of robot_description"),
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
        poses = avatar.poser.poses(T_world_joint, avatar.poses)
        if not np.abs(poses.position).max(initial=0.0) <= LARGEST:
            raise MessageError(OUT_OF_RANGE, f"poses of colliders beyond {LARGEST:g} m")
        self._poses_out.publish(avatar.message.fill(stamp, poses))
        T_root = T_world_joint[avatar.hips]
        self._root_out.publish(
            self._root_message.fill(stamp, T_root[:3, 3], quaternion_from_matrix(T_root[:3, :3]))
        )
        self._sent += 1
        if avatar.markers is not None and self._markers_out.get_subscription_count():
            period = round(SECOND / self.parameters.marker_rate)
            if not self._next_markers - 2 * period < stamp < self._next_markers:
                data = avatar.markers.fill(stamp, poses)
                if data is not None:
                    self._markers_out.publish(data)
                self._next_markers = stamp + period


def main(argv: list[str] | None = None) -> int:
    """Entry point of the executable."""
    return run("collider_node", ColliderNode, argv)


if __name__ == "__main__":
    sys.exit(main())
