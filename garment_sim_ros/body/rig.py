"""The skeleton: joints, parents, rest transforms and one-degree-of-freedom channels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError

ROTATION = 0
TRANSLATION = 1


@dataclass(frozen=True, kw_only=True)
class Dofs:
    """The one-degree-of-freedom channels of a rig; names are those of `JointState`.

    A joint's local motion is the product of its channels in array order, applied after its rest
    transform: ``T_parent_joint = T_rest @ M(dof 0) @ M(dof 1) ...``.

    Attributes:
        names: Channel names, unique, length d.
        joint: The joint that each channel moves, shape [d], non-decreasing.
        kind: `ROTATION` [rad] or `TRANSLATION` [m], shape [d].
        axis: Unit axis in the joint's frame, shape [d, 3].
        lower: Lower limit, -inf where there is none, shape [d].
        upper: Upper limit, +inf where there is none, shape [d].
        mimic_source: Index of the channel that this one follows, -1 if it is free, shape [d].
        mimic_multiplier: Follower value = multiplier * source + offset, shape [d].
        mimic_offset: See `mimic_multiplier`, shape [d].
    """

    names: tuple[str, ...]
    joint: IntArray
    kind: NDArray[np.int8]
    axis: FloatArray
    lower: FloatArray
    upper: FloatArray
    mimic_source: IntArray
    mimic_multiplier: FloatArray
    mimic_offset: FloatArray

    @classmethod
    def none(cls) -> "Dofs":
        """No channels: the rig is posed by joint rotations only."""
        empty = np.zeros(0)
        return cls(
            names=(),
            joint=np.zeros(0, np.int32),
            kind=np.zeros(0, np.int8),
            axis=np.zeros((0, 3)),
            lower=empty,
            upper=empty,
            mimic_source=np.zeros(0, np.int32),
            mimic_multiplier=empty,
            mimic_offset=empty,
        )

    @classmethod
    def free(
        cls, names: Sequence[str], joint: Sequence[int], kind: Sequence[int], axis: ArrayLike
    ) -> "Dofs":
        """Channels without limits that follow no others; arguments as the attributes."""
        d = len(names)
        return cls(
            names=tuple(names),
            joint=np.array(joint, np.int32),
            kind=np.array(kind, np.int8),
            axis=np.array(axis),
            lower=np.full(d, -np.inf),
            upper=np.full(d, np.inf),
            mimic_source=np.full(d, -1, np.int32),
            mimic_multiplier=np.ones(d),
            mimic_offset=np.zeros(d),
        )

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, kw_only=True)
class Rig:
    """A tree of joints in rest pose, z up, x forward, metres.

    Attributes:
        joint_names: Unique names, length n.
        parent: Parent of each joint, -1 for roots, shape [n]; parents precede their children.
        T_parent_joint: Rest transform of each joint in its parent (in the rig's root frame for
            roots), rigid, shape [n, 4, 4].
        dofs: One-degree-of-freedom channels; empty for rigs posed by rotations only (glTF).
    """

    joint_names: tuple[str, ...]
    parent: IntArray
    T_parent_joint: FloatArray
    dofs: Dofs

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        if n == 0:
            raise GeometryError("a rig needs at least one joint")
        if len(set(self.joint_names)) != n:
            raise GeometryError("joint names must be unique")
        parent = np.ascontiguousarray(self.parent, dtype=np.int32)
        T = np.ascontiguousarray(self.T_parent_joint, dtype=np.float64)
        if parent.shape != (n,) or T.shape != (n, 4, 4):
            raise GeometryError(f"parent and T_parent_joint must have {n} entries")
        if not np.isfinite(T).all():
            raise GeometryError("rest transforms must be finite")
        if (parent >= np.arange(n)).any() or (parent < -1).any():
            raise GeometryError("parents must precede their children, -1 for roots")
        for array in (parent, T):
            array.setflags(write=False)
        object.__setattr__(self, "parent", parent)
        object.__setattr__(self, "T_parent_joint", T)

    def __len__(self) -> int:
        return len(self.joint_names)

    def below(self, *joints: int) -> NDArray[np.bool_]:
        """Whether each joint is one of these or hangs on one of them, shape [n]."""
        below = np.zeros(len(self), dtype=bool)
        below[list(joints)] = True
        for j, parent in enumerate(self.parent):
            below[j] |= parent >= 0 and below[parent]
        return below

    def index(self, name: str) -> int:
        """Index of the joint called `name`.

        Raises:
            GeometryError: There is none.
        """
        try:
            return self.joint_names.index(name)
        except ValueError:
            raise GeometryError(
                f"no joint {name!r}; the rig has {', '.join(self.joint_names)}"
            ) from None
