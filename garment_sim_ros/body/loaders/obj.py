"""Bodies from Wavefront OBJ (and PLY) files: static ones, and MakeHuman's base mesh with its rig.

A static body is one rigid piece on the joint ``root``. Nothing in such a file says units, axes or
facing: they are found from the shape and noted. MakeHuman's files (.obj with .mhskel and .mhw) are
y up, face +z, and give each joint as the mean of some vertices of the mesh.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.loaders.assembly import assemble
from garment_sim_ros.body.loaders.obj_file import read_obj
from garment_sim_ros.body.loaders.ply_file import read_ply
from garment_sim_ros.body.loaders.polygons import MAX_MESH_BYTES
from garment_sim_ros.body.loaders.weights import weight_matrix
from garment_sim_ros.body.skin import Body
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.plain_data import number_kinds, read_json

MAX_JOINTS = 4096

_BODY_GROUP = "body"
"""The group of MakeHuman's base mesh that is the body; the others are helpers."""


def load_static(path: str | Path) -> Body:
    """The body in an .obj or .ply file, without a rig.

    Raises:
        InputFileError: The file cannot be read or is no body.
    """
    polygons = read_obj(path) if Path(path).suffix.lower() == ".obj" else read_ply(path)
    vertices, (triangles, _) = polygons.vertices, polygons.fans()
    notes = ["no rig: one rigid piece on the joint 'root'"]
    used = vertices[np.unique(triangles)]
    R, facing = _upright(used)
    notes.append(facing)
    vertices = _on_ground(vertices @ R.T, used @ R.T)
    try:
        return assemble(
            Path(path).stem,
            ["root"],
            np.array([-1], dtype=np.int32),
            np.eye(4)[None],
            vertices,
            triangles.astype(np.int32),
            sp.csr_matrix(np.ones((len(vertices), 1))),
            notes=notes,
        )
    except GeometryError as error:
        raise InputFileError(path, str(error)) from error


def load_makehuman(
    path: str | Path,
    rig_path: str | Path,
    weights_path: str | Path,
    *,
    humanoid_overrides: Mapping[str, str | None] | None = None,
) -> Body:
    """The body made of MakeHuman's base mesh, rig and weights.

    Args:
        path: The .obj file with the helper geometry that the rig's joints refer to.
        rig_path: The .mhskel file.
        weights_path: The .mhw file.
        humanoid_overrides: Joint name of some humanoid bones, or None for "has no such bone".

    Raises:
        InputFileError: A file cannot be read, or they do not fit together.
    """
    obj = read_obj(path)
    names, parent, origins = _skeleton(rig_path, obj.vertices)
    W = _weights(weights_path, names, len(obj.vertices))
    notes = ["y up and facing +z, as MakeHuman writes"]
    triangles, polygon = obj.fans()
    if _BODY_GROUP in obj.groups:
        body = obj.group[polygon] == obj.groups.index(_BODY_GROUP)
        if not body.any():
            raise InputFileError(path, f"has no face in its group {_BODY_GROUP!r}")
        triangles = triangles[body]
        notes.append(f"group {_BODY_GROUP!r} taken; helper geometry left out")
    used = np.unique(triangles)
    compact = np.zeros(len(obj.vertices), dtype=np.int32)
    compact[used] = np.arange(len(used))
    x = obj.vertices[used] @ AXES_FROM_Y_UP.T
    T_world_joint = np.tile(np.eye(4), (len(names), 1, 1))
    T_world_joint[:, :3, :3] = AXES_FROM_Y_UP
    T_world_joint[:, :3, 3] = _on_ground(origins @ AXES_FROM_Y_UP.T, x)
    try:
        return assemble(
            Path(path).stem,
            names,
            parent,
            T_world_joint,
            _on_ground(x, x),
            compact[triangles],
            W[used],
            notes=notes,
            humanoid_overrides=humanoid_overrides,
        )
    except GeometryError as error:
        raise InputFileError(path, str(error)) from error


def _upright(vertices: FloatArray) -> tuple[FloatArray, str]:
    """Rotation to z up, facing x, found from the shape, and a note about it.

    A standing body is least deep from back to front, its up axis is y or z, and its feet reach
    further forwards from the ankle than backwards.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    depth = int(np.argmin(high - low))
    up = 1 if depth == 2 else 2
    size = high[up] - low[up]
    height = vertices[:, up] - low[up]
    sole = vertices[height < 0.03 * size, depth]
    ankle = vertices[np.abs(height - 0.08 * size) < 0.03 * size, depth]
    forwards = -1.0 if depth == 1 else 1.0  # where the feet say nothing: +z, +x, or Blender's -y
    if len(sole) and len(ankle):
        reach = sole.max() + sole.min() - 2.0 * np.median(ankle)
        if abs(reach) > 0.01 * size:
            forwards = float(np.sign(reach))
    R = np.zeros((3, 3))
    R[0, depth] = forwards
    R[2, up] = 1.0
    R[1] = np.cross(R[2], R[0])
    sign = "+" if forwards > 0.0 else "-"
    return R, f"axes taken as {'xyz'[up]} up, facing {sign}{'xyz'[depth]}, from the shape"


def _on_ground(points: FloatArray, body: FloatArray) -> FloatArray:
    """Points moved down or up by as much as puts the body's lowest point on z = 0."""
    return points - (0.0, 0.0, body[:, 2].min())


def _json_object(path: str | Path, *keys: str) -> list[dict[str, Any]]:
    """The objects under some keys of a JSON file."""
    content = read_json(path, limit=MAX_MESH_BYTES)
    found = []
    for key in keys:
        value = content.get(key) if isinstance(content, dict) else None
        if not isinstance(value, dict):
            raise InputFileError(path, f"has no {key!r}", "allowed: a MakeHuman file")
        found.append(value)
    return found


def _skeleton(
    path: str | Path, vertices: FloatArray
) -> tuple[list[str], NDArray[np.int32], FloatArray]:
    """Joint names, parents and positions in the mesh's frame, depth first."""
    bones, joints = _json_object(path, "bones", "joints")
    if not 0 < len(bones) <= MAX_JOINTS:
        raise InputFileError(path, f"has {len(bones)} bones", f"allowed: 1 to {MAX_JOINTS}")
    parents: dict[str, str | None] = {}
    start: dict[str, FloatArray] = {}
    children: dict[str | None, list[str]] = {}
    place: dict[str, FloatArray] = {}
    for name, bone in bones.items():
        above = bone.get("parent") if isinstance(bone, dict) else ""
        if above is not None and (not isinstance(above, str) or above not in bones):
            raise InputFileError(
                path, f"bone {name!r} has the parent {above!r:.60}", "allowed: a bone's name"
            )
        parents[name] = above
        children.setdefault(above, []).append(name)
        head = bone.get("head")
        head = head if isinstance(head, str) else ""
        if head not in place:  # many bones may start at one joint
            marker = joints.get(head)
            if (
                not isinstance(marker, list)
                or not marker
                or not all(type(v) is int and 0 <= v < len(vertices) for v in marker)
            ):
                raise InputFileError(
                    path,
                    f"bone {name!r} starts at {marker!r:.60}",
                    f"allowed: a joint made of vertices 0 to {len(vertices) - 1} of the mesh",
                )
            place[head] = vertices[marker].mean(axis=0)
        start[name] = place[head]
    order: list[str] = []
    stack = children.get(None, [])[::-1]
    while stack:
        order.append(stack.pop())
        stack.extend(reversed(children.get(order[-1], [])))
    if len(order) != len(bones):
        reached = set(order)
        cyclic = next(name for name in bones if name not in reached)
        raise InputFileError(path, f"bone {cyclic!r} is its own ancestor", "allowed: a tree")
    index: dict[str | None, int] = {name: j for j, name in enumerate(order)}
    parent = np.array([index.get(parents[name], -1) for name in order], dtype=np.int32)
    return order, parent, np.array([start[name] for name in order])


def _weights(path: str | Path, names: list[str], vertex_count: int) -> sp.csr_matrix:
    """Raw weights of all vertices of the mesh over the joints."""
    (weights,) = _json_object(path, "weights")
    index = {name: j for j, name in enumerate(names)}
    vertex, joint, weight = [], [], []
    for name, pairs in weights.items():
        if name not in index:
            raise InputFileError(path, f"weights the bone {name!r}", "allowed: bones of the rig")
        try:
            if pairs != [] and not number_kinds(pairs):
                raise ValueError
            table = np.array(pairs, dtype=np.float64).reshape(-1, 2)
        except (ValueError, OverflowError):
            raise InputFileError(
                path, f"bone {name!r} has malformed weights", "allowed: [[vertex, weight], ...]"
            ) from None
        number = table[:, 0]
        if not ((number >= 0) & (number < vertex_count) & (number == np.floor(number))).all():
            raise InputFileError(
                path, f"bone {name!r} weights a vertex that is not there", f"{vertex_count} in all"
            )
        vertex.append(number.astype(np.int64))
        joint.append(np.full(len(table), index[name]))
        weight.append(table[:, 1])
    if not vertex:
        raise InputFileError(path, "holds no weights")
    shape = (vertex_count, len(names))
    try:
        return weight_matrix(
            np.concatenate(vertex), np.concatenate(joint), np.concatenate(weight), shape
        )
    except GeometryError as error:
        raise InputFileError(path, str(error)) from error
