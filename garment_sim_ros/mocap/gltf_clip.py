"""Animations in glTF files as clips: .gltf, .glb, .vrm and .vrma.

The rig is as of a BVH file: in the pose that the body rests in all its joints are turned as the
file's axes are. A joint's rotation is what it has turned since; so a body that rests in a T-pose
and nodes that hold some frame of the motion make no difference.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.loaders.gltf_bind import rigid
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.body.loaders.gltf_scene import Scene
from garment_sim_ros.body.loaders.gltf_skeleton import Skeleton, read_skeleton
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.clip_in_metres import check_options, clip_in_metres, skipped_frames
from garment_sim_ros.mocap.gltf_channels import Channel, key_times, read_channels

_STEP = 1.0 / 60.0
_APART = 1e-4
_LONGEST = 24.0 * 3600.0
_MAX_VALUES = 10_000_000
"""Frames times channels of a clip."""
_MAX_COORDINATE = 1e6
_AT_ONCE = 500
"""Frames whose transforms are in memory together."""
_STILL = 1e-6
"""Turns of a joint [rad] that are none."""
_SLIDES = 2e-3
"""From which share of the skeleton's size on a joint moves against the one above it."""
_ORDER = "ZXY"


def load_gltf_clip(
    path: str | Path,
    animation: str | None = None,
    *,
    skip_t_pose: str = "auto",
    humanoid_overrides: Mapping[str, str | None] | None = None,
) -> Clip:
    """An animation of a glTF file.

    Args:
        path: A .gltf, .glb, .vrm or .vrma file; it needs no mesh.
        animation: Its name, or its number from 0; None takes the first that moves the skeleton.
        skip_t_pose: As for `load_bvh`.
        humanoid_overrides: As for `load_bvh`; a VRM or VRMA file brings its own.

    Returns:
        The clip; its notes say which animation it is, and which others there are.

    Raises:
        InputFileError: The file cannot be used, or has no such animation.
        ParameterError: An option is outside its range.
    """
    check_options(skip_t_pose)
    file = GltfFile(path)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # results are checked to be finite
            return _load(file, animation, skip_t_pose, humanoid_overrides)
    except (GeometryError, np.linalg.LinAlgError) as error:
        raise InputFileError(path, str(error)) from error


def _load(
    file: GltfFile,
    asked: str | None,
    skip_t_pose: str,
    overrides: Mapping[str, str | None] | None,
) -> Clip:
    scene = Scene(file)
    name, channels, notes = _chosen(file, asked)
    skeleton = read_skeleton(
        file, scene, list(scene.pieces()), np.eye(4), _limbs(file, scene, channels)
    )
    notes += skeleton.notes
    names = _plain_names(skeleton)
    times = key_times(channels, _STEP, _APART)
    if len(times) * 3 * (len(names) + 1) > _MAX_VALUES:
        raise file.error(
            f"moves {len(names)} joints in {len(times)} frames",
            f"allowed: {_MAX_VALUES} numbers in all",
        )
    parent = np.array(skeleton.parents(scene), np.int32)
    rest = rigid(skeleton.T_world_rest)
    turned, at = _motion(file, scene, skeleton, channels, times, rest)
    rig, values = _rig(file, names, parent, rest[:, :3, 3], turned, at)
    mapping = humanoid_map(rig.joint_names, rig.parent, overrides)
    first = skipped_frames(skip_t_pose, rig, mapping, values)
    return clip_in_metres(
        name or Path(file.path).stem,
        rig,
        times[first:] - times[first],
        values,
        mapping=mapping,
        notes=notes,
        says_metres=True,
    )


def _chosen(file: GltfFile, asked: str | None) -> tuple[str, list[Channel], list[str]]:
    """Name and channels of an animation, and what else there is."""
    animations = file.list_of("animations")
    if not animations:
        raise file.error("has no animation", "allowed: a file with one")
    names = [_text(animation.get("name")) for animation in animations]
    known = ", ".join(f"{i}: {name!r:.60}" for i, name in enumerate(names[:20]))
    if asked is None:
        wanted = range(len(animations))
    elif asked in names:
        wanted = range(names.index(asked), names.index(asked) + 1)
    elif asked.isdecimal() and int(asked) < len(animations):
        wanted = range(int(asked), int(asked) + 1)
    else:
        raise file.error(f"has no animation {asked!r:.60}", f"allowed: {known}")
    for i in wanted:
        channels = read_channels(file, animations[i])
        if any(channel.path == "rotation" for channel in channels):
            first = min(channel.times[0] for channel in channels)
            last = max(channel.times[-1] for channel in channels)
            if last - first > _LONGEST:
                raise file.error(f"is {last - first:g} s long", f"allowed: {_LONGEST:g} s")
            notes = [f"Animation {names[i]!r:.60}."]
            if len(animations) > 1:
                notes = [f"Animation {i}, {names[i]!r:.60}; the file has {known}."]
            return names[i], channels, notes
    raise file.error("has no animation that turns a joint", f"found {known}")


def _text(name: Any) -> str:
    return name if isinstance(name, str) else ""


def _limbs(file: GltfFile, scene: Scene, channels: list[Channel]) -> set[int]:
    """The nodes of a skeleton without skin: all that hang together with one that is turned.

    Meshes and cameras are none, and neither is what holds the skeleton and stands still.
    """
    nodes = file.list_of("nodes")
    turned = {channel.node for channel in channels if channel.path == "rotation"}
    root: dict[int, int] = {}
    for n in scene.order:
        root[n] = root.get(scene.parent[n], n)
    roots = {root[n] for n in turned}
    shown = {n for n in root if {"mesh", "camera"} & nodes[n].keys()}
    limbs = turned | ({n for n in root if root[n] in roots} - shown)
    moved = {channel.node for channel in channels}
    for n in scene.order:
        below = [child for child in file.items(nodes[n], "children", int) if child in limbs]
        if n in limbs and scene.parent[n] not in limbs and n not in moved and len(below) == 1:
            limbs.remove(n)
    return limbs


def _plain_names(skeleton: Skeleton) -> list[str]:
    """Names that topics and URDF take; bones that the file declares are called by their names."""
    declared = {joint: bone for bone, joint in skeleton.bones.items()}
    taken = set(declared.values())
    names: list[str] = []
    for node, name in zip(skeleton.nodes, skeleton.names):
        plain = declared.get(name) or re.sub(r"[^!-~\u00a1-\uffff]", "_", name)[:200]
        if name not in declared:
            if plain in taken:
                plain = f"{plain}_{node}"
            taken.add(plain)
        names.append(plain)
    return names


def _motion(
    file: GltfFile,
    scene: Scene,
    skeleton: Skeleton,
    channels: list[Channel],
    times: FloatArray,
    rest: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """What joints have turned since the rest pose, and where they are.

    Returns:
        Rotations in the file's axes, shape [n, f, 3, 3]; positions, shape [n, f, 3].
    """
    moved: dict[int, dict[str, Channel]] = {}
    for channel in channels:
        moved.setdefault(channel.node, {})[channel.path] = channel
    needed: set[int] = set()
    for node in skeleton.nodes:
        while node != -1 and node not in needed:
            needed.add(node)
            node = scene.parent[node]
    order = [node for node in scene.order if node in needed]
    n = len(skeleton.nodes)
    turned, at = np.empty((n, len(times), 3, 3)), np.empty((n, len(times), 3))
    for start in range(0, len(times), _AT_ONCE):
        now = slice(start, start + _AT_ONCE)
        T: dict[int, FloatArray] = {}
        for node in order:
            T_local = _local(file, scene, node, moved.get(node), times[now])
            above = scene.parent[node]
            T[node] = T_local if above == -1 else T[above] @ T_local
        for j, node in enumerate(skeleton.nodes):
            frames = np.broadcast_to(T[node], (len(times[now]), 4, 4))
            if not (np.abs(frames) < _MAX_COORDINATE).all():
                raise file.error(
                    f"moves joint '{skeleton.names[j]:.60}' out of all bounds",
                    f"allowed: up to {_MAX_COORDINATE:g}",
                )
            turned[j, now] = rigid(frames)[:, :3, :3] @ rest[j, :3, :3].T
            at[j, now] = frames[:, :3, 3]
    return turned, at


def _local(
    file: GltfFile,
    scene: Scene,
    node: int,
    moved: Mapping[str, Channel] | None,
    times: FloatArray,
) -> FloatArray:
    """Affine transforms of a node in its parent's frame at some times, shape [f or 1, 4, 4]."""
    if not moved:
        return scene.local(node)[None]
    if "matrix" in file.list_of("nodes")[node]:
        raise file.error(f"node {node} is animated and has a matrix", "allowed: one of both")
    now = dict(zip(("translation", "rotation", "scale"), scene.parts(node)))
    now |= {path: channel.at(times) for path, channel in moved.items()}
    T = np.zeros((len(times), 4, 4))
    T[:, :3, :3] = matrix_from_quaternion(now["rotation"])
    T[:, :3, :3] *= np.atleast_2d(now["scale"])[:, None, :]
    T[:, :3, 3] = now["translation"]
    T[:, 3, 3] = 1.0
    return T


def _rig(
    file: GltfFile,
    names: list[str],
    parent: IntArray,
    rest: FloatArray,
    turned: FloatArray,
    at: FloatArray,
) -> tuple[Rig, FloatArray]:
    """A rig and its channel values, which put joints where they are.

    Bones are as long as they are in the motion, where they keep their length. Joints that slide
    have three positions, joints that turn three angles after them, others none; the first of
    those that do either has both.

    Args:
        file: The file.
        names: Of the joints.
        parent: Of the joints, -1 for roots.
        rest: Positions of the joints in the rest pose, shape [n, 3].
        turned: Rotations since the rest pose, shape [n, f, 3, 3].
        at: Positions, shape [n, f, 3].
    """
    size = float(np.linalg.norm(np.ptp(rest, axis=0))) or 1.0
    T = np.tile(np.eye(4), (len(names), 1, 1))
    dof_names: list[str] = []
    joint: list[int] = []
    kind: list[int] = []
    axis: list[FloatArray] = []
    columns: list[FloatArray] = []

    def add(j: int, what: int, along: int, values: FloatArray) -> None:
        word = "rotation" if what == ROTATION else "position"
        dof_names.append(f"{names[j]}_{'XYZ'[along]}{word}")
        joint.append(j)
        kind.append(what)
        axis.append(np.eye(3)[along])
        columns.append(values)

    for j, above in enumerate(parent):
        if above < 0:
            offset, own, T[j, :3, 3] = at[j], turned[j], rest[j]
        else:
            back = turned[above].transpose(0, 2, 1)
            offset = np.einsum("fij,fj->fi", back, at[j] - at[above])
            own = back @ turned[j]
            T[j, :3, 3] = np.median(offset, axis=0)
        turns = _angle(own) > _STILL
        slid = offset - T[j, :3, 3]
        slides = np.abs(slid).max() > _SLIDES * size
        if not columns and (turns or slides):
            turns = slides = True  # what carries the body along
        if slides:
            if above >= 0:
                T[j, :3, 3] = rest[j] - rest[above]
            slid = offset - T[j, :3, 3]
            for k in range(3):
                add(j, TRANSLATION, k, slid[:, k])
        if turns:
            angles = np.unwrap(_euler(own), axis=0)
            for k, letter in enumerate(_ORDER):
                add(j, ROTATION, "XYZ".index(letter), angles[:, k])
    if not columns:
        raise file.error("has an animation in which no joint moves")
    d = len(dof_names)
    dofs = Dofs(
        names=tuple(dof_names),
        joint=np.array(joint, np.int32),
        kind=np.array(kind, np.int8),
        axis=np.array(axis),
        lower=np.full(d, -np.inf),
        upper=np.full(d, np.inf),
        mimic_source=np.full(d, -1, np.int32),
        mimic_multiplier=np.ones(d),
        mimic_offset=np.zeros(d),
    )
    rig = Rig(
        joint_names=tuple(names), parent=np.array(parent, np.int32), T_parent_joint=T, dofs=dofs
    )
    return rig, np.stack(columns, axis=1)


def _angle(R: FloatArray) -> float:
    """The largest of some rotations [rad]."""
    sine = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]])
    cosine = np.trace(R, axis1=1, axis2=2) - 1.0
    return float(np.arctan2(np.linalg.norm(sine, axis=0), cosine).max())


def _euler(R: FloatArray) -> FloatArray:
    """Angles [rad] about z, x, y, in this order, each about the axis as it is then, [f, 3]."""
    middle = np.arcsin(np.clip(R[:, 2, 1], -1.0, 1.0))
    locked = np.abs(R[:, 2, 1]) > 1.0 - 1e-12
    first = np.where(
        locked, np.arctan2(R[:, 1, 0], R[:, 0, 0]), np.arctan2(-R[:, 0, 1], R[:, 1, 1])
    )
    last = np.where(locked, 0.0, np.arctan2(-R[:, 2, 0], R[:, 2, 2]))
    return np.stack([first, middle, last], axis=1)
