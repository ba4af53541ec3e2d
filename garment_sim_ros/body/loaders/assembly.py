"""From what a body file holds to a `Body`: units, facing, welding, weights, humanoid names."""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.sparse as sp

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.loaders.weights import influences, normalised
from garment_sim_ros.body.loaders.welding import weld
from garment_sim_ros.body.rig import Dofs, Rig
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.transforms import invert_transform

_UNITS = (
    ("metre", 1.0, 0.3, 3.5),
    ("decimetre", 0.1, 3.5, 35.0),
    ("centimetre", 0.01, 35.0, 350.0),
)
_FAR = 1e6
_MILLIMETRE = ("millimetre", 0.001, 350.0, 3500.0)


def guessed_unit(height: float) -> tuple[str, float]:
    """Name and size [m] of the unit in which a human would be `height` high.

    Raises:
        GeometryError: In no unit would this be a human's height.
    """
    for name, metres, low, high in (*_UNITS, _MILLIMETRE):
        if low <= height < high:
            return name, metres
    raise GeometryError(
        f"a body {height:.4g} units high has no known unit; allowed: 0.3 to 3.5 m, also in dm, cm"
        " or mm"
    )


TURNED = "turned so that the joints named as human stand upright and face x"
"""What is noted of a body that was."""


def assemble(
    name: str,
    joint_names: Sequence[str],
    parent: IntArray,
    T_world_joint: FloatArray,
    vertices: FloatArray,
    triangles: IntArray,
    W: sp.csr_matrix,
    *,
    notes: Sequence[str] = (),
    humanoid_overrides: Mapping[str, str | None] | None = None,
) -> Body:
    """A body whose rest pose is its bind pose, in metres, z up, facing x.

    Args:
        name: The body's name.
        joint_names: Joint names, length n.
        parent: Parent of each joint, shape [n].
        T_world_joint: Rest frames, rigid, z up, in the file's unit, shape [n, 4, 4].
        vertices: Rest positions, z up, in the file's unit, shape [v, 3].
        triangles: Vertex indices, shape [t, 3].
        W: Raw skin weights, shape [v, n].
        notes: What the loader has assumed so far.
        humanoid_overrides: Joint name of some humanoid bones, going before name tables.

    Raises:
        GeometryError: Not finite, no triangles, or of no human size.
    """
    notes = list(notes)
    if len(triangles) == 0:
        raise GeometryError("the body has no triangles")
    if not (np.abs(vertices).max() < _FAR and np.abs(T_world_joint).max() < _FAR):
        raise GeometryError(f"the body has positions that are not finite or over {_FAR:g} units")
    W, repairs = normalised(W, vertices)
    notes.extend(repairs)
    vertices, triangles, W = weld(vertices, triangles, W)
    if len(triangles) == 0:
        raise GeometryError("all triangles of the body are degenerate")
    T_world_joint = np.array(T_world_joint)

    humanoid = humanoid_map(joint_names, parent.tolist(), humanoid_overrides)
    index = {joint: j for j, joint in enumerate(joint_names)}
    origins = {bone: T_world_joint[index[joint], :3, 3] for bone, joint in humanoid.items()}
    R = upright_rotation(origins)
    if not np.array_equal(R, np.eye(3)):
        notes.append(TURNED)
        vertices = vertices @ R.T
        T_world_joint[:, :3] = R @ T_world_joint[:, :3]
    unit, metres = guessed_unit(float(np.ptp(vertices[:, 2])))
    if metres != 1.0:
        notes.append(f"unit taken as {unit} from its height of {np.ptp(vertices[:, 2]):.4g}")
        vertices = vertices * metres
        T_world_joint[:, :3, 3] *= metres
    if _signed_volume(vertices, triangles) < 0.0:
        notes.append("triangles were wound inwards; turned round")
        triangles = triangles[:, ::-1]

    T_joint_world = invert_transform(T_world_joint)
    T_parent_joint = T_world_joint.copy()
    child = np.flatnonzero(parent >= 0)
    T_parent_joint[child] = T_joint_world[parent[child]] @ T_world_joint[child]
    bone, weight = influences(W)
    return Body(
        name=name,
        rig=Rig(
            joint_names=tuple(joint_names),
            parent=parent,
            T_parent_joint=T_parent_joint,
            dofs=Dofs.none(),
        ),
        skin=Skin(
            vertices=vertices,
            triangles=triangles,
            bone=bone,
            weight=weight,
            T_bone_bind=T_joint_world,
        ),
        humanoid=humanoid,
        notes=tuple(notes),
    )


def upright_rotation(origins: Mapping[str, FloatArray]) -> FloatArray:
    """The rotation by quarter turns after which the body stands along z and faces x.

    Args:
        origins: Positions of humanoid joints by bone name.

    Returns:
        Rotation matrix, shape [3, 3]; identity where the joints needed are not named.
    """
    pairs = [
        (origins[f"left{part}"], origins[f"right{part}"])
        for part in ("UpperLeg", "UpperArm")
        if f"left{part}" in origins and f"right{part}" in origins
    ]
    tops = [origins[b] for b in ("head", "neck", "upperChest", "chest") if b in origins]
    if "leftUpperArm" in origins and "rightUpperArm" in origins:
        tops.append(0.5 * (origins["leftUpperArm"] + origins["rightUpperArm"]))
    if not pairs or not tops or "hips" not in origins:
        return np.eye(3)
    left = pairs[0][0] - pairs[0][1]
    # The farthest: a robot's head may have its joint anywhere.
    up = max((top - origins["hips"] for top in tops), key=lambda v: float(np.abs(v).max()))
    frame = np.zeros((3, 3))
    z = int(np.argmax(np.abs(up)))
    frame[2, z] = np.sign(up[z])
    left[z] = 0.0
    y = int(np.argmax(np.abs(left)))
    if left[y] == 0.0 or up[z] == 0.0:
        return np.eye(3)
    frame[1, y] = np.sign(left[y])
    frame[0] = np.cross(frame[1], frame[2])
    return frame


def _signed_volume(vertices: FloatArray, triangles: IntArray) -> float:
    centred = vertices - vertices.mean(axis=0)
    a, b, c = (centred[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
