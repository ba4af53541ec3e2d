"""A body with its colliders, moved by a source skeleton: what `collider_node` says of it."""

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Protocol

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.urdf import body_from_urdf, parse_urdf
from garment_sim_ros.body.missing_bones import missing_bones, missing_bones_of
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.description import load_colliders
from garment_sim_ros.colliders.fit_cache import cached_fit
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import MessageError
from garment_sim_ros.garment.outfit_file import read_outfit
from garment_sim_ros.geometry.transforms import quaternion_from_matrix
from garment_sim_ros.mocap.source_urdf import reference_from_urdf
from garment_sim_ros.params import ColliderNodeParameters, ColliderOptions, declarations
from garment_sim_ros.ros.conversions import LARGEST, OUT_OF_RANGE
from garment_sim_ros.ros.markers import ColliderMarkers
from garment_sim_ros.ros.progress import reporting
from garment_sim_ros.ros.serialize import Poses, RootFrame, StampedPose
from garment_sim_ros.stamps import SECOND

WorldJoints = Callable[[FloatArray, float], FloatArray]
"""Channel values [rad or m] and their time [s] to world transforms of the body's joints."""


class Log(Protocol):
    """Takes what is assumed and what is missing."""

    def info(self, message: str) -> object:
        """A line that is good to know."""

    def warning(self, message: str) -> object:
        """A line that says what will not be as wanted."""


class PosedAvatar:
    """A body with its colliders and the messages about them.

    Args:
        body: The body.
        colliders: Its colliders.
        marker_rate: Largest rate of markers [Hz]; 0: none.

    Attributes:
        body: As given.
        colliders: As given.
    """

    def __init__(self, body: Body, colliders: ColliderSet, marker_rate: float) -> None:
        self.body, self.colliders = body, colliders
        self._markers = ColliderMarkers(colliders) if marker_rate else None
        self._period = round(SECOND / marker_rate) if marker_rate else 0
        self._next_markers = 0
        self._poser = ColliderPoser(colliders, body)
        self._poses = ColliderPoses.identity(len(colliders))
        self._message = Poses(len(colliders), colliders.frame_id)
        self._root_message = StampedPose(colliders.frame_id)
        self._frame_message: RootFrame | None = None
        self._hips = body.rig.index(body.humanoid.get("hips", body.rig.joint_names[0]))
        # Compiles what messages will run.
        poses = self._poser.poses(np.tile(np.eye(4), (len(body.rig), 1, 1)))
        if self._markers is not None:
            self._markers.fill(0, poses)
        if "hips" in body.humanoid:
            Retargeter(body.rig, body).world_joints(np.zeros(len(body.rig.dofs)))

    def posed(self, T_world_joint: FloatArray, stamp: int) -> tuple[ColliderPoses, bytes]:
        """Poses of the colliders, which the next call overwrites, and their message.

        Args:
            T_world_joint: World transforms of the body's joints, shape [n, 4, 4].
            stamp: Their time [ns].

        Raises:
            MessageError: Poses that are too far away.
        """
        poses = self._poser.poses(T_world_joint, self._poses)
        if not np.abs(poses.position).max(initial=0.0) <= LARGEST:
            raise MessageError(OUT_OF_RANGE, f"poses of colliders beyond {LARGEST:g} m")
        return poses, self._message.fill(stamp, poses)

    def root(self, T_world_joint: FloatArray, stamp: int) -> bytes:
        """The message of the hips' pose; arguments as for `posed`."""
        T = T_world_joint[self._hips]
        return self._root_message.fill(stamp, T[:3, 3], quaternion_from_matrix(T[:3, :3]))

    def root_frame(self, T_world_joint: FloatArray, stamp: int, name: str) -> bytes:
        """The hips' pose as a frame with a name; else as `root`."""
        if self._frame_message is None:
            self._frame_message = RootFrame(self.colliders.frame_id, name)
        T = T_world_joint[self._hips]
        return self._frame_message.fill(stamp, T[:3, 3], quaternion_from_matrix(T[:3, :3]))

    def due_markers(self, stamp: int, poses: ColliderPoses) -> bytes | None:
        """The markers at a time [ns]; None where there are none, or their rate allows none yet."""
        if self._markers is None:
            return None
        if self._next_markers - 2 * self._period < stamp < self._next_markers:
            return None
        self._next_markers = stamp + self._period
        return self._markers.fill(stamp, poses)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Skeleton:
    """A source skeleton, and how it moves an avatar.

    Attributes:
        rig: The skeleton.
        avatar: What it moves.
        is_new: Whether the avatar was made with it.
        world_joints: How.
    """

    rig: Rig
    avatar: PosedAvatar
    is_new: bool
    world_joints: WorldJoints


def wear(body: Body, p: ColliderNodeParameters, log: Log) -> PosedAvatar:
    """Fit colliders and prepare what posing them takes.

    Raises:
        InputFileError: A file cannot be used.
        GeometryError: The body cannot be fitted.
    """
    if missing := missing_bones_of(body, "body_bone_names"):
        log.warning(missing)
    colliders = dataclasses.replace(_fit(body, p, log), frame_id=p.frame_id)
    avatar = PosedAvatar(body, colliders, p.marker_rate)
    for note in body.notes:
        log.info(f"{body.name}: {note}")
    shapes = sum(c.is_met for c in colliders.colliders)
    log.info(f"{body.name}: {shapes} colliders on {len(body.rig)} joints")
    return avatar


def _fit(body: Body, p: ColliderNodeParameters, log: Log) -> ColliderSet:
    if p.colliders:
        return load_colliders(p.colliders)
    options = ColliderOptions(**{n: getattr(p, n) for n in declarations(ColliderOptions)})
    if p.outfit:
        options = read_outfit(p.outfit).colliders_on(options)
    if not p.cache:
        return fit_colliders(body, options)
    return cached_fit(body, options, p.body or None, log.info)


def read_skeleton(
    text: str,
    avatar: PosedAvatar | None,
    p: ColliderNodeParameters,
    log: Log,
    *,
    bone_names: Mapping[str, str | None] | None,
    body_bone_names: Mapping[str, str | None] | None,
) -> Skeleton:
    """Map a source skeleton to the body, or take it for the body.

    Args:
        text: The skeleton, URDF.
        avatar: The body; None where the skeleton is the body.
        p: The node's parameters.
        log: Takes what is assumed.
        bone_names: Humanoid bone to joint of the skeleton, where names do not tell.
        body_bone_names: The same of a body.

    Raises:
        GarmentSimError: The skeleton cannot be used.
    """
    rig = parse_urdf(text)
    if p.body:
        assert avatar is not None
        posed = _retargeted(text, rig, avatar.body, p, log, bone_names)
    else:
        body = body_from_urdf(text, humanoid_overrides=body_bone_names)
        with reporting(log.info, "fit colliders to the body"):
            avatar = wear(body, p, log)
        # The body may be turned to stand upright, and have a head that the description has not.
        T_parent_joint = body.rig.T_parent_joint.copy()
        T_parent_joint[0] = rig.T_parent_joint[0]
        own = dataclasses.replace(body.rig, T_parent_joint=T_parent_joint)
        from_dofs = ForwardKinematics(own).from_dofs

        def posed(q: FloatArray, time: float) -> FloatArray:
            return from_dofs(q)

    posed(np.zeros(len(rig.dofs)), 0.0)
    return Skeleton(rig=rig, avatar=avatar, is_new=not p.body, world_joints=posed)


def _retargeted(
    text: str,
    rig: Rig,
    body: Body,
    p: ColliderNodeParameters,
    log: Log,
    bone_names: Mapping[str, str | None] | None,
) -> WorldJoints:
    retargeter = Retargeter(rig, body, reference=reference_from_urdf(text), overrides=bone_names)
    known = retargeter.source_bones
    others = retargeter.unmapped_source
    if missing := missing_bones("the source skeleton", known, others, "bone_names"):
        log.warning(missing)
    for note in retargeter.notes:
        log.info(note)
    for what, bones in (
        ("the source skeleton", retargeter.unmapped_source),
        (body.name, retargeter.unmapped_target),
    ):
        if bones:
            log.info(f"not mapped in {what}: {', '.join(bones)}")
    return partial(
        retargeter.world_joints,
        ground_feet=p.ground_feet,
        clear_arms=p.clear_arms,
        clear_thighs=p.clear_thighs,
    )
