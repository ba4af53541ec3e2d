"""Arms out of the trunk: what a source's arms do beside its hips, other bodies do inside theirs.

Trunk and thighs are polytopes, the support of their skin in sampled directions; a lower arm is
spheres along its bone, a hand spheres in its plane. Where one of these is nearer to a polytope
than `_GAP`, the whole arm is turned about the shoulder; what is clear stays as it is. A
first pose is cleared by the smallest turn away from the axes of what it is in. From then on
arms are pushed: the turn shrinks, and whatever is in the way moves the arm ahead of it, as a thigh
that is kicked up takes along a hand. So an arm does not pass through what it was beside, nor
twitch where another way out becomes the shorter one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.anatomy import SIDES
from garment_sim_ros.body.arm_pushes import Trunk, find_gaps, push
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.body.skin import Body
from garment_sim_ros.constants import PERSON_HEIGHT

_TRUNK = ("hips", "spine", "chest", "upperChest", "leftUpperLeg", "rightUpperLeg")
_DIRECTIONS = 128
_GAP = 0.04
"""Room for cloth between arm and trunk [m]."""
_NEAR = 0.06
"""Distance from which on a part has a say in the way out [m]."""
_ANGLES = np.radians(np.arange(0.0, 41.0, 2.0))
_MOST = np.radians(60.0)
"""Largest turn of an arm that is pushed [rad]."""
_RATE = 4.0
"""How fast an arm goes back to where the source has it [rad/s]."""
_SLOWEST = 0.2
"""The same while something is in the way."""
_DOUBLES = 1 / 60
"""Time in which it becomes twice as fast after that [s]."""
_PUSH_RATE = 20.0
"""How fast it is pushed [rad/s]; what kicks it moves at up to 10 m/s, half a metre off."""
_LONGEST = 0.25
"""Poses farther apart than this [s] have nothing to do with each other."""
_ALONG_ARM = (0.0, 0.35, 0.7, 1.0)
_ON_HAND = 5
"""Spheres in a hand: one in its middle, the others at what sticks out, as the thumb does."""
LEAST_SKIN = 4
"""Vertices that a part has at least."""


@dataclass(frozen=True)
class Part:
    """A part of the trunk.

    Attributes:
        joint: Its joint.
        axis: Its ends in the joint's frame [m], shape [2, 3].
        support: Of its skin in `_NORMALS` of that frame [m], shape [_DIRECTIONS].
    """

    joint: int
    axis: FloatArray
    support: FloatArray


@dataclass(frozen=True)
class _Arm:
    """An arm.

    Attributes:
        joint: The upper arm's joint, about which it turns.
        opposite: That of the other arm.
        carrier: The joint above, with which the turn moves.
        below: That one and all that hang on it, shape [k].
        mover: Joint that moves each sphere, shape [m].
        centre: Of the spheres in their joints' frames [m], shape [m, 3].
        radius: Their radii [m], shape [m].
    """

    joint: int
    opposite: int
    carrier: int
    below: IntArray
    mover: IntArray
    centre: FloatArray
    radius: FloatArray


def _sphere_of_directions() -> FloatArray:
    """Unit vectors spread evenly, shape [_DIRECTIONS, 3]."""
    i = np.arange(_DIRECTIONS) + 0.5
    z = 1.0 - 2.0 * i / _DIRECTIONS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * i
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


_NORMALS = _sphere_of_directions()
NORMALS_BY_AXIS = np.ascontiguousarray(_NORMALS.T)


class Arms:
    """Keeps the arms of one body out of its trunk.

    Args:
        body: Rig and skin; without a trunk or arms that have skin nothing is done.

    Attributes:
        turn: Rotation vectors by which the left and the right arm were turned last [rad], in the
            frame of the joint above the arm, shape [2, 3].
    """

    def __init__(self, body: Body) -> None:
        T = rest_transforms(body.rig)
        scale = max(float(np.ptp(body.skin.vertices[:, 2])), 1e-6) / PERSON_HEIGHT
        self._gap, self._near = scale * _GAP, scale * _NEAR
        skins = skin_of_bones(body)
        trunk = [bone for bone in _TRUNK if len(skins.get(bone, ())) >= LEAST_SKIN]
        self._parts = tuple(part_of(body, T, bone, skins[bone]) for bone in trunk)
        self._joint_of_part = np.array([part.joint for part in self._parts], np.int32)
        self._support = np.array([part.support for part in self._parts])
        self._arms = tuple(_arm(body, T, side, skins) for side in SIDES)
        self.turn = np.zeros((2, 3))
        self._speed = np.full(2, _SLOWEST)
        self._time: float | None = None
        self._compile(T)

    def _compile(self, T: FloatArray) -> None:
        """Have the kernels at hand, compiled or loaded: not in the midst of a motion."""
        for arm in self._arms:
            if arm is not None and self._parts:
                trunk, shoulder = self._trunk(T), T[arm.joint, :3, 3].copy()
                self._gaps(trunk, arm.centre[None], shoulder, arm.radius)
                still = (self._gap, np.zeros(3), 0.0, 1.0)
                push(trunk, arm.centre, shoulder, arm.radius, *still)

    def forget(self) -> None:
        """Begin anew: what comes next has no past."""
        self._time = None

    def clear(self, T_world_joint: FloatArray, time: float) -> None:
        """Turn arms that are in the trunk out of it.

        Args:
            T_world_joint: Poses of the joints, changed in place, shape [n, 4, 4].
            time: When that is [s].
        """
        since = np.inf if self._time is None else time - self._time
        self._time = time
        for side, arm in enumerate(self._arms):
            if arm is None or not self._parts:
                continue
            T = T_world_joint[arm.mover]
            centre = np.einsum("mij,mj->mi", T[:, :3, :3], arm.centre) + T[:, :3, 3]
            shoulder = T_world_joint[arm.joint, :3, 3].copy()
            centre -= shoulder
            R_carrier = T_world_joint[arm.carrier, :3, :3].copy()
            if 0.0 <= since < _LONGEST:
                was = R_carrier @ self.turn[side]
                turn = self._pushed(side, was, centre, shoulder, T_world_joint, since)
            else:
                own_side = shoulder - T_world_joint[arm.opposite, :3, 3]
                own_side /= max(float(np.linalg.norm(own_side)), 1e-9)
                turn = self._way_out(centre, shoulder, own_side, arm.radius, T_world_joint)
                self._speed[side] = _SLOWEST
            self.turn[side] = turn @ R_carrier
            if turn.any():
                R = Rotation.from_rotvec(turn).as_matrix()
                below = T_world_joint[arm.below]
                below[:, :3, 3] = (below[:, :3, 3] - shoulder) @ R.T + shoulder
                below[:, :3, :3] = R @ below[:, :3, :3]
                T_world_joint[arm.below] = below

    def _pushed(
        self,
        side: int,
        was: FloatArray,
        centre: FloatArray,
        shoulder: FloatArray,
        T: FloatArray,
        dt: float,
    ) -> FloatArray:
        """Rotation vector of an arm on its way home, pushed by what it meets [rad], shape [3].

        Args:
            side: Which arm.
            was: Its turn so far, taken along with the trunk [rad], shape [3].
            centre: Its spheres where the source has them, from the shoulder [m], shape [m, 3].
            shoulder: World position [m], shape [3].
            T: Poses of the joints, shape [n, 4, 4].
            dt: Time since the last pose [s].
        """
        arm = self._arms[side]
        assert arm is not None
        angle = float(np.linalg.norm(was))
        trunk = self._trunk(T)
        is_clear = self._gaps(trunk, centre[None], shoulder, arm.radius).min() >= self._gap
        if angle == 0.0 and is_clear:
            return was
        home, farthest = float(self._speed[side] * dt), _PUSH_RATE * dt
        pushed = np.array(
            push(trunk, centre, shoulder, arm.radius, self._gap, was, home, farthest)
        )
        length = float(np.linalg.norm(pushed))
        # Faster and faster, as long as nothing is in the way.
        came = (angle - length) / max(dt, 1e-9)
        self._speed[side] = min(max(came * 2.0 ** (dt / _DOUBLES), _SLOWEST), _RATE)
        return np.asarray(pushed * min(1.0, _MOST / max(length, 1e-9)))

    def _way_out(
        self,
        centre: FloatArray,
        shoulder: FloatArray,
        own_side: FloatArray,
        radius: FloatArray,
        T: FloatArray,
    ) -> FloatArray:
        """Rotation vector by which an arm with such spheres [m, 3] gets out [rad], shape [3]."""
        trunk = self._trunk(T)
        gaps = self._gaps(trunk, centre[None], shoulder, radius)[:, 0]
        if gaps.min() >= self._gap:
            return np.zeros(3)
        say = np.maximum(self._near - gaps, 0.0)
        out = np.stack([_from_axis(shoulder + centre, part, T) for part in self._parts])
        # Not to the other side, through the trunk or between the legs.
        out -= np.minimum(out @ own_side, 0.0)[..., None] * own_side
        torque = (say[..., None] * np.cross(centre, out)).sum(axis=(0, 1))
        length = float(np.linalg.norm(torque))
        if length < 1e-9:
            return np.zeros(3)
        axis = torque / length
        across = np.cross(axis, centre)
        along = (centre @ axis)[:, None] * axis
        cosine, sine = np.cos(_ANGLES)[:, None, None], np.sin(_ANGLES)[:, None, None]
        turned = along + cosine * (centre - along) + sine * across
        least = self._gaps(trunk, turned, shoulder, radius).min(axis=(0, 2))
        clear = np.flatnonzero(least >= self._gap)
        if not clear.size:
            return np.asarray(_ANGLES[np.argmax(least)] * axis)
        k = int(clear[0])
        low, high = least[k - 1], least[k]
        share = (self._gap - low) / max(float(high - low), 1e-12)
        return np.asarray((_ANGLES[k - 1] + share * (_ANGLES[k] - _ANGLES[k - 1])) * axis)

    def _trunk(self, T: FloatArray) -> Trunk:
        """The parts where they are now."""
        return Trunk(T[self._joint_of_part], NORMALS_BY_AXIS, self._support)

    @staticmethod
    def _gaps(
        trunk: Trunk, centre: FloatArray, shoulder: FloatArray, radius: FloatArray
    ) -> FloatArray:
        """Distances of spheres [a, m] at `shoulder + centre` from the parts [m], [p, a, m]."""
        gaps = np.empty((len(trunk.support), *centre.shape[:2]))
        find_gaps(trunk, np.ascontiguousarray(centre), shoulder, radius, gaps)
        return gaps


def _from_axis(x: FloatArray, part: Part, T: FloatArray) -> FloatArray:
    """Unit vectors from a part's axis to points [m, 3]; zero on it."""
    start, end = part.axis @ T[part.joint, :3, :3].T + T[part.joint, :3, 3]
    along = end - start
    share = np.clip((x - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    away = x - start - share[:, None] * along
    return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)


def skin_of_bones(body: Body) -> dict[str, FloatArray]:
    """Skin that each major bone moves most, with all small ones on it, by humanoid name [m]."""
    bones = major_bones(body)
    skin = body.skin
    main = skin.bone[np.arange(len(skin.vertices)), skin.weight.argmax(axis=1)]
    owner = bones.owner[main]
    return {
        bone: np.asarray(skin.vertices[owner == k], np.float64)
        for k, bone in enumerate(bones.human)
        if bone
    }


def part_of(body: Body, T: FloatArray, bone: str, skin: FloatArray) -> Part:
    """A part of the trunk."""
    joint = body.rig.index(body.humanoid[bone])
    x = (skin - T[joint, :3, 3]) @ T[joint, :3, :3]
    up = 0.5 * np.ptp(skin[:, 2]) * T[joint, 2, :3]
    axis = x.mean(axis=0) + np.stack([-up, up])
    return Part(joint, axis, (x @ _NORMALS.T).max(axis=0))


def _arm(body: Body, T: FloatArray, side: str, skins: dict[str, FloatArray]) -> _Arm | None:
    """An arm; None without joints or skin."""
    bones = [f"{side}{name}" for name in ("UpperArm", "LowerArm", "Hand")]
    other = "rightUpperArm" if side == "left" else "leftUpperArm"
    if not all(bone in body.humanoid for bone in (*bones, other)):
        return None
    upper, lower, hand = (body.rig.index(body.humanoid[bone]) for bone in bones)
    fore, palm = (skins.get(bone, np.zeros((0, 3))) for bone in bones[1:])
    if len(fore) < LEAST_SKIN:
        return None
    elbow, wrist = T[lower, :3, 3], T[hand, :3, 3]
    radius = thickness(fore, elbow, wrist)
    spheres = [(lower, elbow + s * (wrist - elbow), radius) for s in _ALONG_ARM]
    if len(palm) >= LEAST_SKIN:
        tip = palm[np.argmax(np.linalg.norm(palm - wrist, axis=1))]
        # Hands are flat, and lie flat on what they touch.
        radius = thickness(palm, wrist, tip)
        spheres += [(hand, x, radius) for x in _spread(palm, radius)]
    return _Arm(
        joint=upper,
        opposite=body.rig.index(body.humanoid[other]),
        carrier=max(int(body.rig.parent[upper]), 0),
        below=np.flatnonzero(body.rig.below(upper)).astype(np.int32),
        mover=np.array([j for j, _, _ in spheres], np.int32),
        centre=np.array([T[j, :3, :3].T @ (x - T[j, :3, 3]) for j, x, _ in spheres]),
        radius=np.array([r for _, _, r in spheres]),
    )


def _spread(palm: FloatArray, radius: float) -> FloatArray:
    """Middles of spheres in a hand's plane: in its middle and where it sticks out, [m, 3]."""
    middle = palm.mean(axis=0)
    flat = np.linalg.svd(palm - middle, full_matrices=False)[2][:2]
    x = middle + (palm - middle) @ flat.T @ flat
    chosen = middle[None]
    for _ in range(_ON_HAND - 1):
        away = np.linalg.norm(x[:, None] - chosen, axis=2).min(axis=1)
        chosen = np.vstack([chosen, x[np.argmax(away)]])
    out = chosen - middle
    far = np.linalg.norm(out, axis=1, keepdims=True)
    return np.asarray(middle + out * np.maximum(1.0 - radius / np.maximum(far, 1e-9), 0.0))


def thickness(skin: FloatArray, start: FloatArray, end: FloatArray) -> float:
    """Median distance of skin from the line between two points [m]."""
    along = end - start
    along /= max(float(np.linalg.norm(along)), 1e-9)
    x = skin - start
    return float(np.median(np.linalg.norm(x - (x @ along)[:, None] * along, axis=1)))
