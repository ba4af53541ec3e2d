"""Collider shapes: what the fitting side makes and the simulation side collides with.

A `Collider` is one shape in its own frame, carried by one bone. A `ColliderSet` is what one body
wears; its order is the order of poses in `collider_poses`. The simulation knows neither bodies
nor fitting: it sees a set and, every step, one world pose for each of its colliders.
"""

import hashlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.kinds import KINDS
from garment_sim_ros.contact.kinds.frame import FRAME
from garment_sim_ros.contact.kinds.kind import Kind, Shape
from garment_sim_ros.errors import GeometryError, MessageError
from garment_sim_ros.geometry.transforms import quaternion_from_matrix, transform_from

WORLD = "world"
"""The bone that carries what no body carries; it stands still unless `ColliderSet.poses` is told
otherwise."""


@dataclass(frozen=True, kw_only=True)
class Collider:
    """One collider.

    Attributes:
        name: Unique within its set.
        kind: Name of one of `contact.kinds.KINDS`.
        bone: The rig joint that carries it.
        position: Origin of the collider's own frame in the bone's frame [m], shape [3].
        orientation: Unit quaternion (x, y, z, w) of that frame in the bone's frame, shape [4].
        geometry: Shape in its own frame [m], keys as its kind has them; inflation included.
    """

    name: str
    kind: str
    bone: str
    position: FloatArray = field(default_factory=lambda: np.zeros(3))
    orientation: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    geometry: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise GeometryError(
                f"collider {self.name!r}: kind {self.kind!r}; allowed: {', '.join(KINDS)}"
            )
        for key in KINDS[self.kind].keys:
            if key not in self.geometry:
                raise GeometryError(f"collider {self.name!r}: {self.kind} needs {key!r}")
        for label, value, size in (
            ("position", self.position, 3),
            ("orientation", self.orientation, 4),
        ):
            array = np.array(value, dtype=np.float64)
            if array.shape != (size,) or not np.isfinite(array).all():
                raise GeometryError(
                    f"collider {self.name!r}: {label} must be {size} finite numbers"
                )
            array.setflags(write=False)
            object.__setattr__(self, label, array)

    @property
    def record(self) -> Kind:
        """What there is to know about its kind."""
        return KINDS[self.kind]

    @property
    def shape(self) -> Shape | None:
        """What its kind says about its rigid shape; None where it has none."""
        return self.record.shape

    @property
    def is_met(self) -> bool:
        """Whether cloth meets it."""
        return self.record.is_met

    @property
    def is_frame(self) -> bool:
        """Whether it is a place that others move with, and nothing else."""
        return self.record.is_frame


def frame_of(bone: str) -> Collider:
    """The frame of a bone, ``frame_<bone>``: what attachments and skins move with."""
    return Collider(name=f"frame_{bone}", kind=FRAME.name, bone=bone)


@dataclass(frozen=True, kw_only=True)
class ColliderSet:
    """All colliders of one body, in a fixed order.

    Attributes:
        colliders: The colliders; names are unique.
        thickness: Distance that cloth keeps from the surfaces [m].
        frame_id: Frame in which poses of this set are given.
    """

    colliders: tuple[Collider, ...]
    thickness: float = 0.0
    frame_id: str = "world"

    def __post_init__(self) -> None:
        count = Counter(c.name for c in self.colliders)
        duplicates = sorted(name for name in count if count[name] > 1)
        if duplicates:
            raise GeometryError(f"collider names must be unique; found twice: {duplicates}")

    def __len__(self) -> int:
        return len(self.colliders)

    @classmethod
    def of(cls, *shapes: Collider, thickness: float = 0.0) -> "ColliderSet":
        """A set of plain shapes, see `plain_shapes`, for scenes without a body.

        Shapes that have the same name get a number behind it. Frames of `WORLD`, on which plain
        garments follow, and of the shapes' bones come first.

        Args:
            shapes: The shapes.
            thickness: Distance that cloth keeps from the surfaces [m], beside its own.

        Raises:
            GeometryError: Two shapes that cannot be told apart.
        """
        named: dict[str, Collider] = {}
        for shape in shapes:
            name, number = shape.name, 1
            while name in named:
                number += 1
                name = f"{shape.name}_{number}"
            named[name] = replace(shape, name=name)
        has_frame = {c.bone for c in shapes if c.is_frame}
        bones = dict.fromkeys((WORLD, *(c.bone for c in shapes)))
        frames = (frame_of(bone) for bone in bones if bone not in has_frame)
        return cls(colliders=(*frames, *named.values()), thickness=thickness)

    def poses(self, T_world_bone: Mapping[str, FloatArray] | None = None) -> "ColliderPoses":
        """World poses of the colliders for poses of their bones.

        Args:
            T_world_bone: World transforms of bones, shape [4, 4], or their positions [m], shape
                [3]; those that are not named are at the world's origin.

        Raises:
            MessageError: A bone that the set does not have, or a transform of another shape.
        """
        bones = {c.bone for c in self.colliders}
        T_bone = dict.fromkeys(bones, np.eye(4))
        for bone, given in (T_world_bone or {}).items():
            if bone not in bones:
                raise MessageError(
                    "unknown_bone", f"found {bone!r}; allowed: {', '.join(sorted(bones))}"
                )
            T = np.asarray(given, dtype=np.float64)
            if T.shape not in ((3,), (4, 4)):
                raise MessageError(
                    "pose_shape", f"found shape {T.shape} for {bone!r}; allowed: (3,) or (4, 4)"
                )
            T_bone[bone] = T if T.ndim == 2 else transform_from(T, np.array([0.0, 0.0, 0.0, 1.0]))
        poses = ColliderPoses.identity(len(self.colliders))
        for i, c in enumerate(self.colliders):
            T = T_bone[c.bone] @ transform_from(c.position, c.orientation)
            poses.position[i] = T[:3, 3]
            poses.orientation[i] = quaternion_from_matrix(T[:3, :3])
        return poses

    @cached_property
    def root(self) -> int:
        """The collider that moves as the body as a whole does: the first frame, else the first.

        Sets that are fitted to a body begin their frames with that of its hips.
        """
        return next((i for i, c in enumerate(self.colliders) if c.is_frame), 0)

    @cached_property
    def has_skin(self) -> bool:
        """Whether its shape is the skin itself, see `contact.mesh`."""
        return any(c.record.is_skin for c in self.colliders)

    @cached_property
    def has_bare_skin(self) -> bool:
        """Whether skin leaves its shapes that cloth is shown over, see `sim.over_skin`."""
        return any(c.record.is_bare for c in self.colliders)

    @property
    def revision(self) -> str:
        """SHA-256 of everything that collision depends on, as hexadecimal text."""
        digest = hashlib.sha256(f"{self.frame_id}|{self.thickness!r}".encode())
        for c in self.colliders:
            digest.update(f"|{c.name}|{c.kind}|{c.bone}|".encode())
            digest.update(c.position.tobytes() + c.orientation.tobytes())
            for key in sorted(c.geometry):
                array = np.asarray(c.geometry[key], dtype=np.float64)
                digest.update(f"{key}{array.shape}".encode() + array.tobytes())
        return digest.hexdigest()


@dataclass(kw_only=True)
class ColliderPoses:
    """World poses of a set's colliders at one instant.

    Attributes:
        position: Origins in the world frame [m], shape [n, 3], float64.
        orientation: Unit quaternions (x, y, z, w) in the world frame, shape [n, 4], float64.
    """

    position: FloatArray
    orientation: FloatArray

    @classmethod
    def identity(cls, count: int) -> "ColliderPoses":
        """Poses of `count` colliders at the world's origin."""
        orientation = np.zeros((count, 4))
        orientation[:, 3] = 1.0
        return cls(position=np.zeros((count, 3)), orientation=orientation)

    def assign(self, other: "ColliderPoses") -> None:
        """Takes over other poses of as many colliders, without allocating."""
        np.copyto(self.position, other.position)
        np.copyto(self.orientation, other.orientation)

    def equals(self, other: "ColliderPoses") -> bool:
        """Whether these are other poses, number for number."""
        return bool(
            (self.position == other.position).all()
            and (self.orientation == other.orientation).all()
        )

    def copy(self) -> "ColliderPoses":
        """An independent copy."""
        return ColliderPoses(position=self.position.copy(), orientation=self.orientation.copy())
