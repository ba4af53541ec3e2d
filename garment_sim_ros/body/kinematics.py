"""Forward kinematics: world transforms of all joints in one compiled pass."""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.rig import ROTATION, Dofs, Rig
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.jit import kernel


class ForwardKinematics:
    """World transforms of a rig's joints; everything is allocated once.

    Args:
        rig: The rig.

    Raises:
        GeometryError: A channel follows itself through other channels.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        dofs = rig.dofs
        self._first = np.searchsorted(dofs.joint, np.arange(len(rig) + 1)).astype(np.int32)
        self._axis = np.ascontiguousarray(dofs.axis, dtype=np.float64)
        self._kind = np.ascontiguousarray(dofs.kind, dtype=np.int8)
        self._source, self._multiplier, self._offset = followed_channels(dofs)
        self._q = np.zeros(len(dofs))
        self._T_root = np.eye(4)
        self._T_local = np.zeros((len(rig), 4, 4))
        self.T_world_joint = np.zeros((len(rig), 4, 4))

    def from_dofs(self, q: FloatArray, T_world_root: FloatArray | None = None) -> FloatArray:
        """World transforms from channel values; values of followers (mimic) are not read.

        Args:
            q: Channel values [rad or m], shape [d].
            T_world_root: World pose of the rig's root frame, rigid; identity where None.

        Returns:
            `T_world_joint`, shape [n, 4, 4], overwritten by the next call.
        """
        self._q[:] = q
        self._set_root(T_world_root)
        _forward_dofs(
            self._rig.parent,
            self._rig.T_parent_joint,
            self._first,
            self._kind,
            self._axis,
            self._source,
            self._multiplier,
            self._offset,
            self._q,
            self._T_root,
            self.T_world_joint,
        )
        return self.T_world_joint

    def from_local(
        self, T_local: FloatArray, T_world_root: FloatArray | None = None
    ) -> FloatArray:
        """World transforms from each joint's transform in its parent.

        Args:
            T_local: Transforms in the place of the rig's `T_parent_joint`, shape [n, 4, 4].
            T_world_root: World pose of the rig's root frame, rigid; identity where None.

        Returns:
            `T_world_joint`, shape [n, 4, 4], overwritten by the next call.
        """
        self._T_local[:] = T_local
        self._set_root(T_world_root)
        _forward_local(self._rig.parent, self._T_local, self._T_root, self.T_world_joint)
        return self.T_world_joint

    def _set_root(self, T_world_root: FloatArray | None) -> None:
        if T_world_root is None:
            self._T_root[:] = 0.0
            np.fill_diagonal(self._T_root, 1.0)
        else:
            self._T_root[:] = T_world_root


def world_from_local(
    rig: Rig, T_local: FloatArray, T_world_root: FloatArray | None = None
) -> FloatArray:
    """A new array of world transforms; see `ForwardKinematics.from_local`."""
    return ForwardKinematics(rig).from_local(T_local, T_world_root)


def rest_transforms(rig: Rig) -> FloatArray:
    """Transforms of all joints in the rig's root frame in rest pose, shape [n, 4, 4]."""
    return world_from_local(rig, rig.T_parent_joint)


def followed_channels(dofs: Dofs) -> tuple[NDArray[np.int32], FloatArray, FloatArray]:
    """For each channel the free one that it follows in the end, with multiplier and offset.

    Returns:
        Source (the channel itself where it is free), multiplier and offset, each of shape [d].

    Raises:
        GeometryError: A channel follows itself, or by a factor that is not finite.
    """
    d = len(dofs)
    source = np.arange(d, dtype=np.int32)
    multiplier, offset = np.ones(d), np.zeros(d)
    settled = dofs.mimic_source < 0
    for i in range(d):
        line = [i]  # of channels, each following the next
        open_ones = {i}
        while not settled[line[-1]]:
            above = int(dofs.mimic_source[line[-1]])
            if above in open_ones:
                raise GeometryError(f"channel {dofs.names[i]!r} mimics itself")
            line.append(above)
            open_ones.add(above)
        for channel, above in zip(line[-2::-1], line[:0:-1]):
            source[channel] = source[above]
            factor = float(dofs.mimic_multiplier[channel])
            multiplier[channel] = factor * float(multiplier[above])
            offset[channel] = factor * float(offset[above]) + float(dofs.mimic_offset[channel])
            settled[channel] = True
    for i in np.flatnonzero(~(np.isfinite(multiplier) & np.isfinite(offset)))[:1]:
        raise GeometryError(f"channel {dofs.names[i]!r} mimics others beyond what is finite")
    return source, multiplier, offset


@kernel(inner=True)
def _compose(a, b, out):
    """Product a b of rigid transforms into out."""
    for i in range(3):
        for k in range(4):
            out[i, k] = a[i, 0] * b[0, k] + a[i, 1] * b[1, k] + a[i, 2] * b[2, k]
        out[i, 3] += a[i, 3]
    out[3, 0] = 0.0
    out[3, 1] = 0.0
    out[3, 2] = 0.0
    out[3, 3] = 1.0


@kernel(inner=True)
def _turn(T, x, y, z, angle):
    """Turn the frame T about its own unit axis (x, y, z), by Rodrigues' formula."""
    c = np.cos(angle)
    s = np.sin(angle)
    u = 1.0 - c
    for i in range(3):
        r0 = T[i, 0]
        r1 = T[i, 1]
        r2 = T[i, 2]
        T[i, 0] = r0 * (c + x * x * u) + r1 * (y * x * u + z * s) + r2 * (z * x * u - y * s)
        T[i, 1] = r0 * (x * y * u - z * s) + r1 * (c + y * y * u) + r2 * (z * y * u + x * s)
        T[i, 2] = r0 * (x * z * u + y * s) + r1 * (y * z * u - x * s) + r2 * (c + z * z * u)


@kernel()
def _forward_dofs(
    parent, T_parent_joint, first, kind, axis, source, multiplier, offset, q, T_world_root, out
):
    for j in range(parent.shape[0]):
        if parent[j] < 0:
            _compose(T_world_root, T_parent_joint[j], out[j])
        else:
            _compose(out[parent[j]], T_parent_joint[j], out[j])
        T = out[j]
        for d in range(first[j], first[j + 1]):
            value = multiplier[d] * q[source[d]] + offset[d]
            x = axis[d, 0]
            y = axis[d, 1]
            z = axis[d, 2]
            if kind[d] == ROTATION:
                _turn(T, x, y, z, value)
            else:
                for i in range(3):
                    T[i, 3] += value * (T[i, 0] * x + T[i, 1] * y + T[i, 2] * z)


@kernel()
def _forward_local(parent, T_local, T_world_root, out):
    for j in range(parent.shape[0]):
        if parent[j] < 0:
            _compose(T_world_root, T_local[j], out[j])
        else:
            _compose(out[parent[j]], T_local[j], out[j])
