"""What `collider_node` and `cloth_node` do with a message, one after the other in one thread."""

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from std_msgs.msg import String

from garment_sim_ros.body.humanoid import load_humanoid_overrides
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.loaders.urdf_xml import MAX_TEXT as MAX_URDF
from garment_sim_ros.colliders.description import MAX_TEXT, from_json, to_json
from garment_sim_ros.errors import GarmentSimError, MessageError
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT
from garment_sim_ros.recording.worn_watch import WornWatch
from garment_sim_ros.ros.cdr import encode
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.ros.conversions import JointStates, poses_from, text_from
from garment_sim_ros.ros.diagnostics_bytes import diagnostics
from garment_sim_ros.ros.dresser import dress
from garment_sim_ros.ros.garment_messages import garment_marker, topology
from garment_sim_ros.ros.garment_quality import GarmentQuality, quality
from garment_sim_ros.ros.joint_channels import MISSING, JointChannels
from garment_sim_ros.ros.offline.inputs import Message
from garment_sim_ros.ros.offline.setup import Setup
from garment_sim_ros.ros.posed_avatar import Log, PosedAvatar, Skeleton, read_skeleton, wear
from garment_sim_ros.ros.serialize import PointCloud, TriangleMarker
from garment_sim_ros.ros.stamp_order import StampOrder
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_MARKERS,
    COLLIDER_POSES,
    GARMENT_MESH,
    GARMENT_POINTS,
    GARMENT_TOPOLOGY,
    JOINT_STATES,
    QUALITY,
    ROBOT_DESCRIPTION,
    ROOT_POSE,
)
from garment_sim_ros.stamps import SECOND

Out = tuple[str, bytes]
"""Relative name and bytes of a message that is sent."""
_MEASURED = SECOND
"""Time between two measurements of how much of a garment is in the skin [ns]."""
_LOG = logging.getLogger(__name__)


class Colliders:
    """The work of `collider_node`.

    Args:
        setup: Its parameters.
        log: Takes what is assumed.

    Raises:
        GarmentSimError: A file or parameter cannot be used.
    """

    def __init__(self, setup: Setup, log: Log) -> None:
        p = self._p = setup.collider
        self._log, self._with_markers = log, setup.markers and p.marker_rate > 0.0
        self._names = load_humanoid_overrides(p.bone_names) if p.bone_names else None
        names = p.body_bone_names
        self._body_names = load_humanoid_overrides(names) if names else None
        self._avatar: PosedAvatar | None = None
        if p.body:
            self._avatar = wear(load_body(p.body, bone_names=p.body_bone_names), p, log)
        self._skeleton: Skeleton | None = None
        self._reader, self._stamps = JointStates(), StampOrder(p.time_jump)

    def describe(self, data: bytes) -> Iterator[Out]:
        """Take a `robot_description`.

        Raises:
            MessageError: It cannot be used; the one before is kept.
        """
        is_first = self._skeleton is None
        try:
            skeleton = read_skeleton(
                text_from(data, MAX_URDF),
                self._avatar,
                self._p,
                self._log,
                bone_names=self._names,
                body_bone_names=self._body_names,
            )
        except MessageError:
            raise
        except GarmentSimError as error:
            raise MessageError(ROBOT_DESCRIPTION.name, str(error)) from error
        self._skeleton, self._avatar = skeleton, skeleton.avatar
        self._channels = JointChannels(skeleton.rig.dofs)
        if skeleton.is_new or is_first:
            text = to_json(skeleton.avatar.colliders)
            yield COLLIDER_DESCRIPTION.name, encode(String(data=text))

    def pose(self, message: Message) -> Iterator[Out]:
        """Take `joint_states`.

        Raises:
            MessageError: They cannot be used.
        """
        if self._skeleton is None:
            raise MessageError(ROBOT_DESCRIPTION.name, "none that can be used before")
        joints = self._reader.read(message.data)
        self._channels.check(joints)
        stamp = joints.stamp or message.time
        self._stamps.accept(stamp)
        self._channels.take(joints)
        if not self._channels.is_complete:
            raise MessageError(MISSING, "waits for the first value of some joints")
        T_world_joint = self._skeleton.world_joints(self._channels.values, stamp / SECOND)
        avatar = self._skeleton.avatar
        poses, data = avatar.posed(T_world_joint, stamp)
        yield COLLIDER_POSES.name, data
        yield ROOT_POSE.name, avatar.root(T_world_joint, stamp)
        if self._with_markers:
            markers = avatar.due_markers(stamp, poses)
            if markers is not None:
                yield COLLIDER_MARKERS.name, markers


class Cloth:
    """The work of `cloth_node` with `step_on` poses.

    Args:
        setup: Its parameters.

    Attributes:
        stepper: The garments; None before the first description.
        frames: Frames sent.
        garments: Vertices by garment.

    Raises:
        GarmentSimError: A file or parameter cannot be used.
    """

    def __init__(self, setup: Setup) -> None:
        p = self._p = setup.cloth
        self._forces, self._with_markers = setup.forces, setup.markers
        body = load_body(p.body, bone_names=p.body_bone_names)
        self._body = replace(body, skinning=p.skinning)
        self.stepper: ClothStepper | None = None
        self._revision = ""
        self.frames = 0
        self.garments: dict[str, int] = {}
        self._points: dict[str, PointCloud] = {}
        self._qualities: list[GarmentQuality] = []
        self._measured = 0
        self._meshes: dict[str, TriangleMarker] = {}

    def describe(self, data: bytes) -> Iterator[Out]:
        """Take a `collider_description`: make the garments for it.

        Raises:
            MessageError: It cannot be used; the one before is kept.
        """
        p = self._p
        colliders = from_json(text_from(data, MAX_TEXT))
        if colliders.revision == self._revision:
            return
        if colliders.frame_id != p.frame_id:
            raise MessageError(
                "frame_id", f"found {colliders.frame_id!r}; allowed: {p.frame_id!r}"
            )
        try:
            outfit, simulation = dress(
                p.outfit or DEFAULT_OUTFIT,
                self._body,
                colliders,
                attachments=p.attachments,
                solver=p.solver,
                solver_step=p.solver_step,
                detail=p.detail,
                parameters=self._forces,
            )
        except GarmentSimError as error:
            raise MessageError(COLLIDER_DESCRIPTION.name, str(error)) from error
        self._revision = colliders.revision
        self.stepper = ClothStepper.with_parameters(simulation, p)
        self._watch = WornWatch(colliders, self._body, outfit.garments)
        self._qualities = [
            GarmentQuality(name, simulation, self._watch) for name in simulation.names
        ]
        for number, garment in enumerate(outfit.garments):
            count = self.garments[garment.name] = len(garment.vertices)
            self._points[garment.name] = PointCloud(count, p.frame_id, normals=p.normals)
            if self._with_markers:
                self._meshes[garment.name] = garment_marker(garment, number, p.frame_id)
            yield GARMENT_TOPOLOGY.name.format(garment.name), encode(topology(garment))

    def step(self, data: bytes) -> Iterator[Out]:
        """Take `collider_poses`: advance by whole steps up to them.

        Raises:
            MessageError: They cannot be used.
        """
        message = poses_from(data)
        if message.frame_id != self._p.frame_id:
            raise MessageError(
                "frame_id", f"found {message.frame_id!r}; allowed: {self._p.frame_id!r}"
            )
        stepper = self.stepper
        if stepper is None:
            raise MessageError(COLLIDER_DESCRIPTION.name, "none that can be used before")
        stepper.add(message.stamp, message.poses, message.stamp)
        if not stepper.advance(message.stamp, in_time=False) or stepper.time is None:
            return
        self.frames += 1
        simulation = stepper.simulation
        shown = {}
        for name in simulation.names:
            x = shown[name] = simulation.positions(name)
            normal = simulation.normals(name) if self._p.normals else None
            yield (
                GARMENT_POINTS.name.format(name),
                self._points[name].fill(stepper.time, x, normal),
            )
            if self._with_markers:
                yield GARMENT_MESH.name.format(name), self._meshes[name].fill(stepper.time, x)
        is_due = abs(stepper.time - self._measured) >= _MEASURED
        self._measured = stepper.time if is_due else self._measured
        self._watch.look(stepper.poses, shown, measure=is_due)
        # Without what a machine's clock says.
        of_all = [q.status({}, resets=stepper.resets) for q in self._qualities]
        yield QUALITY.name, diagnostics(quality(of_all, stepper.time))

    def state(self) -> Iterator[bytes]:
        """All that the motion goes on from, garment by garment."""
        if self.stepper is None:
            return
        simulation = self.stepper.simulation
        for name in simulation.names:
            state = simulation.state(name)
            for array in (state.x, state.v, simulation.positions(name)):
                yield np.ascontiguousarray(array).tobytes()


class Work:
    """Both, one behind the other.

    Args:
        setup: What to work with.
        log: Takes what is assumed.

    Attributes:
        cloth: The cloth's side.
        rejected: Messages that could not be used, by reason.
        first_rejection: Why the first of them could not.

    Raises:
        GarmentSimError: A file or parameter cannot be used.
    """

    def __init__(self, setup: Setup, log: Log = _LOG) -> None:
        self._colliders = Colliders(setup, log) if setup.begins_with == JOINT_STATES.name else None
        self.cloth = Cloth(setup)
        self.rejected: Counter[str] = Counter()
        self.first_rejection = ""

    def take(self, message: Message) -> Iterator[Out]:
        """What is sent after a message, that message first."""
        yield message.topic.name, message.data
        if message.topic in (COLLIDER_DESCRIPTION, COLLIDER_POSES):
            yield from self._wear(message.topic.name, message.data)
            return
        assert self._colliders is not None
        colliders = self._colliders
        if message.topic is ROBOT_DESCRIPTION:
            sent = self._kept(ROBOT_DESCRIPTION.name, lambda: colliders.describe(message.data))
        else:
            sent = self._kept(JOINT_STATES.name, lambda: colliders.pose(message))
        for topic, data in sent:
            yield topic, data
            yield from self._wear(topic, data)

    def _wear(self, topic: str, data: bytes) -> Iterator[Out]:
        if topic == COLLIDER_DESCRIPTION.name:
            yield from self._kept(topic, lambda: self.cloth.describe(data))
        elif topic == COLLIDER_POSES.name:
            yield from self._kept(topic, lambda: self.cloth.step(data))

    def _kept(self, topic: str, made: Callable[[], Iterator[Out]]) -> Iterator[Out]:
        """What is made; what cannot be used is counted and the last good state kept."""
        try:
            yield from made()
        except MessageError as error:
            self.rejected[error.reason] += 1
            self.first_rejection = self.first_rejection or f"{topic}: {error}"
