"""Animated glTF: the body with its skin on moving joints, garments as morph targets."""

from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.arrays import AnyArray, FloatArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.garment.colours import Colour
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.geometry.transforms import (
    AXES_FROM_Y_UP,
    invert_transform,
    quaternion_from_matrix,
)
from garment_sim_ros.glb_writer import INDICES, VERTICES, GlbWriter
from garment_sim_ros.recording.export.frames import SKIN_COLOUR, Frames, Progress, Surface
from garment_sim_ros.recording.export.shapes import normals_of, shapes_of

_MOST_FRAMES = 3000
_STILL = 1e-7
"""Joints whose translation changes less than that [m] have none in the animation."""


def write_glb(frames: Frames, path: Path, *, bound: float, progress: Progress) -> dict[str, Any]:
    """Write a .glb file, y up as glTF has it.

    Args:
        frames: What was recorded.
        path: The file.
        bound: How far a garment's vertex may be from where it was recorded [m].
        progress: Passes items on and shows how far it is: a text, and of a total.

    Returns:
        Largest error [mm] and number of morph targets of each garment.

    Raises:
        InputFileError: More frames than morph targets can be found for.
    """
    if len(frames.times) > _MOST_FRAMES:
        raise InputFileError(
            f"--out {path.name}",
            f"{len(frames.times)} frames",
            f"allowed: up to {_MOST_FRAMES} in a GLB; take a lower --rate or write USD",
        )
    film = _Film(frames)
    if frames.body is not None:
        _add_body(film, frames.body, frames.joints)
    told: dict[str, Any] = {"error_mm": 0.0, "targets": {}}
    garments = frames.garments.items()
    for name, surface in progress(garments, "finding shapes", len(garments)):
        error, count = _add_garment(film, name, surface, frames.positions[name], bound)
        told["error_mm"] = max(told["error_mm"], round(1e3 * error, 4))
        told["targets"][name] = count
    film.finish(path)
    return told


class _Film:
    """A document with one scene and one animation, all of whose channels share their times."""

    def __init__(self, frames: Frames) -> None:
        self.glb = GlbWriter()
        self.nodes: list[int] = []
        self._times = self.glb.accessor(frames.times.astype(np.float32), bounds=True)
        self._samplers: list[dict[str, Any]] = []
        self._channels: list[dict[str, Any]] = []

    def animate(self, node: int, path: str, values: AnyArray) -> None:
        """One row, or as many numbers as there are weights, at each time."""
        output = self.glb.accessor(values.astype(np.float32))
        self._samplers.append({"input": self._times, "output": output, "interpolation": "LINEAR"})
        target = {"node": node, "path": path}
        self._channels.append({"sampler": len(self._samplers) - 1, "target": target})

    def material(self, name: str, colour: Colour) -> int:
        """Shaded on both sides."""
        c = np.array(colour)
        linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        surface = {
            "baseColorFactor": [*linear.tolist(), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.8,
        }
        return self.glb.add(
            "materials", {"name": name, "doubleSided": True, "pbrMetallicRoughness": surface}
        )

    def finish(self, path: Path) -> None:
        """Write the file."""
        glb = self.glb
        if self._channels:
            glb.add(
                "animations",
                {"name": "recorded", "samplers": self._samplers, "channels": self._channels},
            )
        glb.json["scene"] = glb.add("scenes", {"nodes": self.nodes})
        glb.write(path)


def _y_up(rotation: FloatArray) -> FloatArray:
    """Rotations between frames that are z up as those between frames that are y up."""
    return AXES_FROM_Y_UP.T @ rotation @ AXES_FROM_Y_UP


def _quaternions(rotation: FloatArray) -> FloatArray:
    """Of y-up rotations over time, each on the side of the one before, shape [m, 4]."""
    q = quaternion_from_matrix(_y_up(rotation))
    flips = np.cumprod(np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    return q


def _add_garment(
    film: _Film, name: str, surface: Surface, positions: Any, bound: float
) -> tuple[float, int]:
    """The largest error [m] and the number of targets."""
    glb = film.glb
    shapes = shapes_of(positions, bound)
    normal, turned = normals_of(positions, surface.triangles, shapes)
    count = len(shapes.targets)
    # Without a buffer view all are zero: one for all targets that turn no normals.
    still: int | None = None
    if count > len(turned):
        entry = {"componentType": 5126, "count": len(normal), "type": "VEC3"}
        still = glb.add("accessors", entry)
    targets = []
    for k, target in enumerate(shapes.targets):
        moved = glb.accessor(target @ AXES_FROM_Y_UP.astype("f4"), target=VERTICES, bounds=True)
        normals = still
        if k < len(turned):
            normals = glb.accessor(turned[k] @ AXES_FROM_Y_UP.astype("f4"), target=VERTICES)
        targets.append({"POSITION": moved, "NORMAL": normals})
    primitive = _primitive(film, name, surface, shapes.base, normal)
    mesh: dict[str, Any] = {"name": name, "primitives": [primitive]}
    if targets:
        primitive["targets"] = targets
        mesh["weights"] = shapes.weights[0].tolist()
        mesh["extras"] = {"targetNames": [f"shape_{k}" for k in range(count)]}
    q, centre = _quaternions(shapes.rotation), shapes.centre @ AXES_FROM_Y_UP
    node = {"name": name, "mesh": glb.add("meshes", mesh)}
    node |= {"rotation": q[0].tolist(), "translation": centre[0].tolist()}
    number = glb.add("nodes", node)
    film.nodes.append(number)
    film.animate(number, "rotation", q)
    film.animate(number, "translation", centre)
    if targets:
        film.animate(number, "weights", shapes.weights.reshape(-1))
    return shapes.error, count


def _primitive(
    film: _Film, name: str, surface: Surface, x: AnyArray, normal: AnyArray
) -> dict[str, Any]:
    glb = film.glb
    turn = AXES_FROM_Y_UP.astype("f4")
    attributes = {
        "POSITION": glb.accessor(x.astype("f4") @ turn, target=VERTICES, bounds=True),
        "NORMAL": glb.accessor(normal.astype("f4") @ turn, target=VERTICES),
    }
    return {
        "attributes": attributes,
        "indices": glb.accessor(surface.triangles.reshape(-1).astype("u4"), target=INDICES),
        "material": film.material(name, surface.colour),
    }


def _add_body(film: _Film, body: Body, joints: FloatArray) -> None:
    """The skin, its skeleton in rest pose, and the joints' motion."""
    glb, rig, skin = film.glb, body.rig, body.skin
    first = len(glb.json.get("nodes", ()))
    for j, name in enumerate(rig.joint_names):
        T = rig.T_parent_joint[j]
        node: dict[str, Any] = {
            "name": name,
            "rotation": quaternion_from_matrix(_y_up(T[:3, :3])).tolist(),
            "translation": (T[:3, 3] @ AXES_FROM_Y_UP).tolist(),
        }
        if children := [first + int(c) for c in np.flatnonzero(rig.parent == j)]:
            node["children"] = children
        glb.add("nodes", node)
    roots = [first + int(j) for j in np.flatnonzero(rig.parent < 0)]
    armature = glb.add("nodes", {"name": "skeleton", "children": roots})
    bind = np.array(skin.T_bone_bind)
    bind[:, :3, :3] = _y_up(bind[:, :3, :3])
    bind[:, :3, 3] = bind[:, :3, 3] @ AXES_FROM_Y_UP
    matrices = np.ascontiguousarray(np.swapaxes(bind, 1, 2)).astype("f4").reshape(-1, 16)
    entry = {
        "joints": list(range(first, first + len(rig))),
        "inverseBindMatrices": glb.accessor(matrices),
        "skeleton": armature,
    }
    normal = np.zeros_like(skin.vertices)
    vertex_normals(skin.vertices, skin.triangles, normal)
    surface = Surface(name="body", triangles=skin.triangles, colour=SKIN_COLOUR, at=joints.take)
    primitive = _primitive(film, "body", surface, skin.vertices, normal)
    _add_weights(glb, primitive["attributes"], body)
    mesh = glb.add("meshes", {"name": "body", "primitives": [primitive]})
    node = {"name": "body", "mesh": mesh, "skin": glb.add("skins", entry)}
    film.nodes += [armature, glb.add("nodes", node)]
    for j, parent in enumerate(rig.parent):
        local = joints[:, j]
        if parent >= 0:
            local = invert_transform(joints[:, parent]) @ local
        film.animate(first + j, "rotation", _quaternions(local[:, :3, :3]))
        if np.abs(local[:, :3, 3] - rig.T_parent_joint[j, :3, 3]).max() > _STILL:
            film.animate(first + j, "translation", local[:, :3, 3] @ AXES_FROM_Y_UP)


def _add_weights(glb: GlbWriter, attributes: dict[str, int], body: Body) -> None:
    """All influences, the largest first, four in a set."""
    skin = body.skin
    order = np.argsort(-skin.weight, axis=1, kind="stable")
    weight = np.take_along_axis(skin.weight, order, axis=1)
    bone = np.where(weight > 0.0, np.take_along_axis(skin.bone, order, axis=1), 0)
    used = max(int((weight > 0.0).any(axis=0).sum()), 1)
    sets = -(-used // 4)
    pad = ((0, 0), (0, max(0, 4 * sets - weight.shape[1])))
    weight, bone = np.pad(weight, pad), np.pad(bone, pad)
    for k in range(sets):
        own = slice(4 * k, 4 * k + 4)
        attributes[f"JOINTS_{k}"] = glb.accessor(bone[:, own].astype("u2"), target=VERTICES)
        attributes[f"WEIGHTS_{k}"] = glb.accessor(weight[:, own].astype("f4"), target=VERTICES)
