"""Skinning: the surface of a posed body.

Three ways to blend the bones' motions at a vertex:

- ``linear``: the matrices are averaged; simple, but a bent or twisted joint loses volume.
- ``dual_quaternion``: rigid motions are blended as dual quaternions (Kavan, Collins, Zara,
  O'Sullivan 2007, "Skinning with Dual Quaternions", eq. 2 and algorithm 1); no collapse, a
  slight bulge.
- ``bone_blend``: the rotation is interpolated while the joint between the bones stays where it is
  (Kavan, Zara 2003, "Real Time Skin Deformation with Bones Blending"). Between two bones,
  ``x = Q (x_bind - c_bind) + c`` with Q the interpolated rotation, c the joint. A vertex on more
  bones is turned at every joint that separates them, from the lowest to the highest, each time by
  the share of its weight below that joint; the paper has two bones only. Rotations are
  interpolated by normalised linear quaternion blending, within 1 degree of slerp up to a bend of
  90 degrees.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.geometry.transforms import invert_transform, rotate, unit_quaternion
from garment_sim_ros.jit import kernel

METHODS: tuple[str, ...] = ("linear", "dual_quaternion", "bone_blend")


class Skinner:
    """Poses one skin; everything is allocated once.

    Args:
        skin: The skin.
        method: One of `METHODS`.
        parent: Parent of each joint, shape [n]; `bone_blend` needs it, the others do not.

    Raises:
        ParameterError: An unknown method, or `bone_blend` without `parent`.
    """

    def __init__(self, skin: Skin, method: str = "linear", parent: IntArray | None = None) -> None:
        if method not in METHODS:
            raise ParameterError("method", f"found {method!r}", "allowed: " + ", ".join(METHODS))
        self._skin = skin
        self._method = method
        if method == "bone_blend":
            if parent is None:
                raise ParameterError("parent", "missing", "bone_blend needs the joints' parents")
            self._shares = joint_shares(skin, parent)
        self._motion = np.zeros((len(skin.T_bone_bind), 3, 4))
        self._quaternion = np.zeros((len(skin.T_bone_bind), 8))
        self._bend = np.zeros((len(skin.T_bone_bind), 7))
        self.x_world = np.zeros_like(skin.vertices)
        self._normal = np.zeros_like(skin.vertices)

    @classmethod
    def of(cls, body: Body) -> "Skinner":
        """Of a body, in the way that it says."""
        return cls(body.skin, body.skinning, body.rig.parent)

    def vertices(self, T_world_bone: FloatArray) -> FloatArray:
        """Positions of all skin vertices.

        Args:
            T_world_bone: World transforms of the rig's joints, rigid, shape [n, 4, 4].

        Returns:
            `x_world` [m], shape [v, 3], overwritten by the next call.
        """
        skin = self._skin
        T_world_bone = np.asarray(T_world_bone, dtype=np.float64)
        _motions(T_world_bone, skin.T_bone_bind, self._motion, self._quaternion)
        bound = (skin.vertices, skin.bone, skin.weight)
        if self._method == "linear":
            _linear(*bound, self._motion, self.x_world)
        elif self._method == "dual_quaternion":
            _dual_quaternion(*bound, self._quaternion, self.x_world)
        else:
            shares = self._shares
            _bends(shares.above, shares.origin, self._motion, self._bend)
            _bone_blend(
                skin.vertices,
                shares.first,
                shares.joint,
                shares.share,
                shares.carrier,
                shares.origin,
                self._motion,
                self._bend,
                self.x_world,
            )
        return self.x_world

    def normals(self) -> FloatArray:
        """Unit vertex normals of the last posed surface, shape [v, 3], overwritten as above."""
        vertex_normals(self.x_world, self._skin.triangles, self._normal)
        return self._normal


def skin_vertices(
    skin: Skin,
    T_world_bone: FloatArray,
    method: str = "linear",
    out: FloatArray | None = None,
    *,
    parent: IntArray | None = None,
) -> FloatArray:
    """Positions of all skin vertices in one pose; a `Skinner` is for many.

    Args:
        skin: The skin.
        T_world_bone: World transforms of the rig's joints, rigid, shape [n, 4, 4].
        method: One of `METHODS`.
        out: Filled and returned where given, shape [v, 3].
        parent: Parent of each joint, shape [n]; `bone_blend` needs it.

    Returns:
        Positions [m], shape [v, 3].

    Raises:
        ParameterError: An unknown method, or `bone_blend` without `parent`.
    """
    x_world = Skinner(skin, method, parent).vertices(T_world_bone)
    if out is None:
        return x_world
    out[:] = x_world
    return out


@dataclass(frozen=True)
class JointShares:
    """At which joints each vertex bends in `bone_blend`, and how much; flat, vertex by vertex.

    Attributes:
        first: Start of each vertex's entries, shape [v + 1].
        joint: Joint of each entry; within a vertex children come before parents, shape [e].
        share: Share of the joint's rotation that the vertex makes, between 0 and 1, shape [e].
        carrier: The lowest joint that has all of the vertex's weight at or below it, shape [v].
        above: Joint relative to which each joint moves, -1 for the first, shape [n].
        origin: Joint origins in bind pose [m], shape [n, 3].
    """

    first: IntArray
    joint: IntArray
    share: FloatArray
    carrier: IntArray
    above: IntArray
    origin: FloatArray


def joint_shares(skin: Skin, parent: IntArray) -> JointShares:
    """What `bone_blend` needs to know of a skin.

    Args:
        skin: The skin.
        parent: Parent of each joint, shape [n].
    """
    v, k = skin.bone.shape
    n = len(parent)
    # Further roots move relative to the first one, so that a common motion of all stays exact.
    above = np.where(parent < 0, 0, parent).astype(np.int32)
    above[0] = -1
    ancestry = sp.lil_matrix((n, n))
    for joint in range(n):
        if above[joint] >= 0:
            ancestry[joint] = ancestry[above[joint]]
        ancestry[joint, joint] = 1.0
    rows = np.repeat(np.arange(v), k)
    W = sp.csr_matrix((skin.weight.ravel(), (rows, skin.bone.ravel())), shape=(v, n))
    below = sp.csr_matrix(W @ ancestry.tocsr())
    below.eliminate_zeros()
    row = np.repeat(np.arange(v), np.diff(below.indptr))
    whole = below.data > 1.0 - 1e-6
    carrier = np.zeros(v, dtype=np.int32)
    np.maximum.at(carrier, row[whole], below.indices[whole])
    bending = ~whole & (below.data > 1e-6)
    order = np.lexsort((-below.indices[bending], row[bending]))
    return JointShares(
        first=np.searchsorted(row[bending], np.arange(v + 1)).astype(np.int32),
        joint=below.indices[bending][order].astype(np.int32),
        share=below.data[bending][order],
        carrier=carrier,
        above=above,
        origin=np.ascontiguousarray(invert_transform(skin.T_bone_bind)[:, :3, 3]),
    )


@kernel()
def _motions(T_world_bone, T_bone_bind, motion, quaternion):
    """Motion of each bone from bind pose to world, as matrix and as dual quaternion."""
    for j in range(T_world_bone.shape[0]):
        a = T_world_bone[j]
        b = T_bone_bind[j]
        m = motion[j]
        for i in range(3):
            for k in range(4):
                m[i, k] = a[i, 0] * b[0, k] + a[i, 1] * b[1, k] + a[i, 2] * b[2, k]
            m[i, 3] += a[i, 3]
        x, y, z, w = unit_quaternion(m)
        tx = m[0, 3]
        ty = m[1, 3]
        tz = m[2, 3]
        q = quaternion[j]
        q[0] = x
        q[1] = y
        q[2] = z
        q[3] = w
        # Dual part: half the product of the translation and the rotation.
        q[4] = 0.5 * (tx * w + ty * z - tz * y)
        q[5] = 0.5 * (-tx * z + ty * w + tz * x)
        q[6] = 0.5 * (tx * y - ty * x + tz * w)
        q[7] = -0.5 * (tx * x + ty * y + tz * z)


@kernel()
def _linear(x_bind, bone, weight, motion, x_world):
    for v in range(x_bind.shape[0]):
        x = x_bind[v, 0]
        y = x_bind[v, 1]
        z = x_bind[v, 2]
        px = 0.0
        py = 0.0
        pz = 0.0
        for k in range(bone.shape[1]):
            w = weight[v, k]
            if w == 0.0:
                continue
            m = motion[bone[v, k]]
            px += w * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3])
            py += w * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3])
            pz += w * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3])
        x_world[v, 0] = px
        x_world[v, 1] = py
        x_world[v, 2] = pz


@kernel(inner=True)
def _signed(weight, a, b):
    """The weight with the sign that puts quaternion b on the same half-sphere as a."""
    dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    return -weight if dot < 0.0 else weight


@kernel()
def _dual_quaternion(x_bind, bone, weight, quaternion, x_world):
    for v in range(x_bind.shape[0]):
        pivot = quaternion[bone[v, 0]]
        rx = ry = rz = rw = 0.0
        dx = dy = dz = dw = 0.0
        for k in range(bone.shape[1]):
            if weight[v, k] == 0.0:
                continue
            q = quaternion[bone[v, k]]
            w = _signed(weight[v, k], pivot, q)
            rx += w * q[0]
            ry += w * q[1]
            rz += w * q[2]
            rw += w * q[3]
            dx += w * q[4]
            dy += w * q[5]
            dz += w * q[6]
            dw += w * q[7]
        s = 1.0 / np.sqrt(rx * rx + ry * ry + rz * rz + rw * rw)
        rx *= s
        ry *= s
        rz *= s
        rw *= s
        dx *= s
        dy *= s
        dz *= s
        dw *= s
        px, py, pz = rotate(rx, ry, rz, rw, x_bind[v, 0], x_bind[v, 1], x_bind[v, 2])
        x_world[v, 0] = px + 2.0 * (rw * dx - dw * rx + ry * dz - rz * dy)
        x_world[v, 1] = py + 2.0 * (rw * dy - dw * ry + rz * dx - rx * dz)
        x_world[v, 2] = pz + 2.0 * (rw * dz - dw * rz + rx * dy - ry * dx)


@kernel()
def _bends(above, origin, motion, bend):
    """Motion of each joint relative to the one above, in bind space.

    It turns about the joint's origin by the quaternion bend[:4], w >= 0, and shifts by bend[4:7].
    """
    relative = np.empty((3, 4))
    for j in range(above.shape[0]):
        if above[j] < 0:
            continue
        a = motion[above[j]]
        b = motion[j]
        for i in range(3):
            for k in range(4):
                relative[i, k] = a[0, i] * b[0, k] + a[1, i] * b[1, k] + a[2, i] * b[2, k]
            relative[i, 3] -= a[0, i] * a[0, 3] + a[1, i] * a[1, 3] + a[2, i] * a[2, 3]
        bend[j, 0], bend[j, 1], bend[j, 2], bend[j, 3] = unit_quaternion(relative)
        for i in range(3):
            bend[j, 4 + i] = relative[i, 3] - origin[j, i]
            for k in range(3):
                bend[j, 4 + i] += relative[i, k] * origin[j, k]


@kernel()
def _bone_blend(x_bind, first, joint, share, carrier, origin, motion, bend, x_world):
    for v in range(x_bind.shape[0]):
        x = x_bind[v, 0]
        y = x_bind[v, 1]
        z = x_bind[v, 2]
        for e in range(first[v], first[v + 1]):
            s = share[e]
            o = origin[joint[e]]
            b = bend[joint[e]]
            qw = 1.0 - s + s * b[3]
            norm = np.sqrt(s * s * (b[0] * b[0] + b[1] * b[1] + b[2] * b[2]) + qw * qw)
            scale = s / norm
            x, y, z = rotate(
                scale * b[0],
                scale * b[1],
                scale * b[2],
                qw / norm,
                x - o[0],
                y - o[1],
                z - o[2],
            )
            x += o[0] + s * b[4]
            y += o[1] + s * b[5]
            z += o[2] + s * b[6]
        m = motion[carrier[v]]
        for i in range(3):
            x_world[v, i] = m[i, 0] * x + m[i, 1] * y + m[i, 2] * z + m[i, 3]
