"""Retargeting: a source skeleton's motion on another body's rig.

Every bone that both have turns in the world as the source's bone does. What lies between the two
is one constant rotation per bone, found by comparing anatomical frames (`body.anatomy`) of the
source in its reference pose and the target in its rest pose; so A-pose, T-pose and hanging arms,
bone axes and twists of either rig drop out. In symbols, with the source's joint s, the target's
joint t and the frames F:

    R_world_t(now) = R_world_s(now) R_world_s(reference)^-1 F_s F_t^-1 R_world_t(rest)

Lengths stay the target's. The midpoint between the hip joints moves as the source's, scaled by the
ratio of leg lengths, so that a foot on the ground stays on it, but for what the proportions
differ; where the time is given, `body.feet` mends that, `body.lying` what lies and `body.hands`
what is leaned on, `body.knees` calves in thighs, `body.arms` arms in the trunk, and `body.tucks`
thighs in it.

Joints of a rig with one-degree-of-freedom chains (URDF) are turned freely, not within their axes
and limits: the last link of a ball joint gets the whole rotation, links between follow their
parent. That shows what the person did even where the robot model could not do it.
"""

from collections.abc import Mapping

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.anatomy import (
    TRUNK,
    SourceReference,
    leg_length,
    stands,
    unit,
)
from garment_sim_ros.body.arms import Arms
from garment_sim_ros.body.contact_points import contacts_of, forearm_ends
from garment_sim_ros.body.feet import Feet
from garment_sim_ros.body.hands import Hands
from garment_sim_ros.body.humanoid import humanoid_of_rig
from garment_sim_ros.body.kinematics import ForwardKinematics, rest_transforms
from garment_sim_ros.body.lying import Lying
from garment_sim_ros.body.retarget_pass import (
    BLEND,
    DRIVEN,
    FOLLOW,
    TWIST,
    Turns,
    place_joints,
    turn_joints,
)
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Rig
from garment_sim_ros.body.robot_names import last_hinges
from garment_sim_ros.body.skeleton import Skeleton
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.tucks import Tucks
from garment_sim_ros.geometry.transforms import invert_transform, quaternion_from_matrix

_BLENDED = {*TRUNK, "hips", "neck", "head"}
_TWISTED = {"leftHand": "leftLowerArm", "rightHand": "rightLowerArm"}
_FEET = ("leftFoot", "rightFoot")
_COINCIDENT = 1e-9
_REACH = 0.05
"""Height above the lowest foot or hand up to which others share in bearing, in leg lengths."""


class Retargeter:
    """Poses a body as a source skeleton moves; allocates once.

    Args:
        source_rig: Source skeleton with channels.
        target: The body to pose.
        T_world_source: Pose of the source rig's root frame, z up; identity where the rig itself
            turns its file's axes (the URDF of `mocap.source_urdf`).
        reference: Reference pose and end sites of the source; None for its zero pose.
        overrides: Humanoid bone to joint name of the source, winning over the name tables.

    Attributes:
        mapping: Pairs of source and target joint that are driven, by name.
        source_bones: Humanoid bones that the source is known to have.
        unmapped_source: Source joints that drive nothing.
        unmapped_target: Target joints that no source joint drives: they follow their parents or
            blend between their neighbours.
        scale: Target leg length over source leg length.
        feet: What grounds the feet.
        lying: What puts the body on the ground where it lies, sits or kneels.
        hands: What keeps forearms and hands out of the ground.
        arms: What keeps arms out of the trunk.
        tucks: What keeps thighs out of it.
        notes: What was assumed, one sentence each.

    Raises:
        GeometryError: One of the two has no known hips, or no pair of hips or shoulders.
        ParameterError: An override names an unknown bone or joint.
    """

    def __init__(
        self,
        source_rig: Rig,
        target: Body,
        *,
        T_world_source: FloatArray | None = None,
        reference: SourceReference | None = None,
        overrides: Mapping[str, str | None] | None = None,
    ) -> None:
        rig = target.rig
        reference = reference or SourceReference()
        self._T_world_source = np.eye(4) if T_world_source is None else np.array(T_world_source)
        self._kinematics = ForwardKinematics(source_rig)
        q = np.array([reference.values.get(name, 0.0) for name in source_rig.dofs.names])
        source = Skeleton.compare(
            "source skeleton",
            source_rig,
            humanoid_of_rig(source_rig, overrides),
            self._kinematics.from_dofs(q, self._T_world_source).copy(),
            reference,
        )
        ends = SourceReference(end_sites=forearm_ends(target))
        rest = Skeleton.compare(target.name, rig, target.humanoid, rest_transforms(rig), ends)
        n = len(rig)
        self._hips = rest.bones["hips"]
        self._parent = rig.parent
        T_local = rig.T_parent_joint.copy()
        roots = rig.parent < 0  # these move with the hips
        T_local[roots] = invert_transform(rest.T_world_joint[self._hips]) @ T_local[roots]
        self._rest_position = np.ascontiguousarray(T_local[:, :3, 3])
        self._turns = Turns(
            parent=rig.parent,
            rule=np.full(n, FOLLOW, np.int8),
            source=np.zeros(n, np.int32),
            offset=np.zeros((n, 4)),
            above=np.zeros(n, np.int32),
            below=np.zeros(n, np.int32),
            above_rest=np.zeros((n, 4)),
            below_rest=np.zeros((n, 4)),
            share=np.zeros(n),
            bone_axis=np.zeros((n, 3)),
            rest_rotation=quaternion_from_matrix(T_local[:, :3, :3]),
        )
        self._rotation = np.zeros((n, 4))
        self._T_world_joint = np.tile(np.eye(4), (n, 1, 1))

        pairs = _pair_bones(source.bones, rest.bones)
        self._drive(pairs, source, rest)
        self._share_between(pairs, rest)
        ankle_height = self._measure_travel(source, rest, target, reference)
        self.feet = Feet(
            source,
            rest,
            target,
            scale=self.scale,
            ankle_height=ankle_height,
            end_sites=reference.end_sites,
        )
        self.lying = Lying(source, rest, target, self.scale)
        self.hands = Hands(source, rest, target, self.scale)
        self.arms = Arms(target)
        self.tucks = Tucks(target)
        driven = {rest.bones[t] for _, t in pairs}
        driving = {source.bones[s] for s, _ in pairs}
        names = source_rig.joint_names
        self.mapping = tuple(
            (names[source.bones[s]], rig.joint_names[rest.bones[t]]) for s, t in pairs
        )
        self.source_bones = tuple(source.bones)
        self.unmapped_source = tuple(names[j] for j in _ball_ends(source_rig) if j not in driving)
        self.unmapped_target = tuple(
            name for j, name in enumerate(rig.joint_names) if j not in driven
        )
        self.notes = tuple(
            f"{name} does not stand upright in the compared pose; bones may come out turned."
            for name, skeleton in (("The source skeleton", source), (target.name, rest))
            if skeleton.at_rest and not stands(skeleton.marks)
        )

    def world_joints(
        self,
        q: FloatArray,
        time: float | None = None,
        *,
        ground_feet: bool = True,
        clear_arms: bool = True,
        clear_thighs: bool = True,
    ) -> FloatArray:
        """Poses of the target's joints for channel values of the source.

        Args:
            q: Source channel values [rad or m], shape [d].
            time: When that is [s], for what depends on the calls before; None leaves all joints
                where the angles put them.
            ground_feet: Whether what is on the ground in the source is put there: feet, what
                lies, and hands, see `body.feet`, `body.lying` and `body.hands`.
            clear_arms: Whether arms that are in the trunk are turned out of it, see `body.arms`.
            clear_thighs: Whether knees are opened where calves are in thighs, and the trunk is
                bent back off thighs in it, see `body.knees` and `body.tucks`.

        Returns:
            `T_world_joint`, shape [n, 4, 4], overwritten by the next call.
        """
        T_source = self._kinematics.from_dofs(q, self._T_world_source)
        leans = time is not None and ground_feet
        turn_joints(T_source, self._turns, self._hips, self._rotation)
        place_joints(
            T_source, self._travel_joints, self.scale, self._middle_in_hips, self._parent,
            self._hips, self._rest_position, self._rotation,
            self._wrists if leans else self._contacts, self._reach, self._T_world_joint,
        )  # fmt: skip
        if time is not None and ground_feet:
            self.feet.ground(T_source, self._T_world_joint, time)
            self.lying.look(T_source, self._T_world_joint)
        if time is not None and clear_thighs:
            self.feet.open_knees(self._T_world_joint)
            self.tucks.clear(self._T_world_joint, self.lying.lies if ground_feet else 0.0)
        if time is not None and ground_feet:
            self.lying.rest(T_source, self._T_world_joint, self.feet)
            if clear_thighs and self.lying.shift < 0.0:
                self.feet.open_knees(self._T_world_joint)
        if time is not None and clear_arms:
            self.arms.clear(self._T_world_joint, time)
        if time is not None and ground_feet:
            self.hands.lift(T_source, self._T_world_joint)
        return self._T_world_joint

    def forget(self) -> None:
        """Begin anew: what comes next has no past."""
        self.feet.forget()
        self.arms.forget()

    @property
    def root_pose(self) -> FloatArray:
        """World pose of the target's hips after the last call of `world_joints`, [4, 4]."""
        return self._T_world_joint[self._hips].copy()

    def _drive(self, pairs: list[tuple[str, str]], source: Skeleton, rest: Skeleton) -> None:
        """Constant rotations from source to target joints."""
        last = last_hinges(source.rig)
        same = source.is_posed_as(rest)
        for source_bone, target_bone in pairs:
            s, t = source.bones[source_bone], rest.bones[target_bone]
            s = last.get(s, s)  # of a robot: where its bone is, not all of its turns are made
            if same:  # the body's own motion, which needs no anatomy
                F_s = F_t = rest.frames["hips"]
            elif source_bone in source.frames and target_bone in rest.frames:
                F_s, F_t = source.frames[source_bone], rest.frames[target_bone]
            else:  # a bone whose direction one of the two does not show
                F_s, F_t = source.frames["hips"], rest.frames["hips"]
            offset = source.rotation(s).T @ F_s @ F_t.T @ rest.rotation(t)
            self._turns.rule[t] = DRIVEN
            self._turns.source[t] = s
            self._turns.offset[t] = quaternion_from_matrix(offset)

    def _share_between(self, pairs: list[tuple[str, str]], rest: Skeleton) -> None:
        """Rules of target joints between two driven ones: spine, neck and forearm share."""
        bone_of = {rest.bones[target_bone]: target_bone for _, target_bone in pairs}
        for b, bone in bone_of.items():
            between: list[int] = []
            a = int(self._parent[b])
            while a >= 0 and a not in bone_of:
                between.insert(0, a)
                a = int(self._parent[a])
            if a < 0:
                continue
            if bone in _BLENDED and bone_of[a] in _BLENDED:
                rule = BLEND
            elif _TWISTED.get(bone) == bone_of[a]:
                rule = TWIST
            else:
                continue
            for i, j in enumerate(between):
                R = rest.rotation(j)
                self._turns.rule[j] = rule
                self._turns.above[j], self._turns.below[j] = a, b
                self._turns.above_rest[j] = quaternion_from_matrix(rest.rotation(a).T @ R)
                self._turns.below_rest[j] = quaternion_from_matrix(rest.rotation(b).T @ R)
                self._turns.share[j] = (i + 1) / (len(between) + 1)
                along = unit(rest.T_world_joint[b, :3, 3] - rest.T_world_joint[j, :3, 3])
                self._turns.bone_axis[j] = 0.0 if along is None else R.T @ along

    def _measure_travel(
        self, source: Skeleton, rest: Skeleton, target: Body, reference: SourceReference
    ) -> float:
        """How the point between the hip joints moves: scale and heights above the ground.

        Returns:
            World height of the source's ankle in a foot that stands [m].
        """
        legs = ("leftUpperLeg", "rightUpperLeg")
        if not all(leg in source.bones and leg in rest.bones for leg in legs):
            legs = ("hips", "hips")
        self._travel_joints = np.array([source.bones[leg] for leg in legs], np.int32)
        middle = np.mean([rest.marks.joint[leg] for leg in legs], axis=0)
        self._middle_in_hips = rest.rotation(self._hips).T @ (middle - rest.marks.joint["hips"])
        source_leg, target_leg = leg_length(source.marks), leg_length(rest.marks)
        self.scale = target_leg / source_leg if source_leg and target_leg else 1.0
        self._reach = _REACH * (source_leg or 1.0)
        ankles = [rest.marks.joint[foot] for foot in _FEET if foot in rest.marks.joint]
        height = 0.0
        if ankles and len(target.skin.vertices):
            height = float(np.mean(ankles, axis=0)[2] - target.skin.vertices[:, 2].min())
        source_height = reference.ankle_height
        if source_height is None:
            source_height = height / self.scale
            standing = [source.marks.joint[foot][2] for foot in _FEET if foot in source.bones]
            if standing and not (source.rig.dofs.kind == TRANSLATION).any():
                # A skeleton that stays where its root is says nothing about the ground but this.
                source_height = float(min(standing))
        points = source, rest, target, reference.end_sites, (source_height, height)
        self._contacts, self._wrists = contacts_of(*points), contacts_of(*points, wrists=True)
        return source_height


def _pair_bones(source: Mapping[str, int], target: Mapping[str, int]) -> list[tuple[str, str]]:
    """Source and target bones that turn alike.

    The highest bone of the trunk carries neck and arms whatever it is called, so the highest ones
    are a pair; likewise the head, or the neck where there is no head.
    """
    central = {*TRUNK, "neck", "head"}
    pairs = [(bone, bone) for bone in source if bone in target and bone not in central]
    trunks = [[bone for bone in TRUNK if bone in bones] for bones in (source, target)]
    if all(trunks):
        pairs.append((trunks[0][-1], trunks[1][-1]))
        pairs += [(bone, bone) for bone in trunks[0][:-1] if bone in trunks[1][:-1]]
    heads = [[bone for bone in ("neck", "head") if bone in bones] for bones in (source, target)]
    if heads[0] and heads[1]:
        pairs += [(bone, bone) for bone in heads[0] if bone in heads[1]]
        if not set(heads[0]) & set(heads[1]):
            pairs.append((heads[0][0], heads[1][0]))
        elif heads[1] == ["neck"] and "head" in heads[0]:
            pairs[-1] = ("head", "neck")
    return pairs


def _ball_ends(rig: Rig) -> list[int]:
    """Joints that turn, without those that only lead to another one at the same place."""
    ends = []
    turning = set(rig.dofs.joint[rig.dofs.kind == ROTATION].tolist())
    for j in sorted(turning):
        children = np.flatnonzero(rig.parent == j)
        if (
            len(children) == 1
            and int(children[0]) in turning
            and np.abs(rig.T_parent_joint[children[0], :3, 3]).max() < _COINCIDENT
        ):
            continue
        ends.append(j)
    return ends
