"""Animations in glTF files as clips: .gltf, .glb, .vrm and .vrma.

The rig is as of a BVH file: in the pose that the body rests in all its joints are turned as the
file's axes are. A joint's rotation is what it has turned since. The rest pose is that of the
skin's bind matrices, so nodes that hold some frame of the motion make no difference; a file
without skin rests as its nodes do.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.humanoid import humanoid_map
from garment_sim_ros.body.loaders.gltf_bind import rigid
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.body.loaders.gltf_scene import Piece, Scene
from garment_sim_ros.body.loaders.gltf_skeleton import Skeleton, read_skeleton
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.clip_in_metres import check_options, clip_in_metres, skipped_frames
from garment_sim_ros.mocap.clip_name import plain_name
from garment_sim_ros.mocap.gltf_channels import Channel, frame_times, read_channels
from garment_sim_ros.mocap.turned_joints import Turned, rig_of

_UP = np.array([0.0, 1.0, 0.0])
_MAX_JOINTS = 1024
_MAX_PLACES = 3_000_000
"""Frames times joints of a clip."""
_MAX_FRAMES_OF_NODES = 20_000_000
_LONGEST = 24.0 * 3600.0
_MAX_COORDINATE = 1e6
_AT_ONCE = 200
"""Frames whose transforms are in memory together."""
_MAX_TRIED = 16
"""Animations of which it is seen whether they move the skeleton."""
_STILL = 1e-6
"""Changes of a quaternion's numbers that are none."""


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
        animation: Its name, or its number from 0; None takes the first that moves the skeleton,
            of a file without skin the first that moves one with hips.
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


class _Motion:
    """The channels of an animation that move a skeleton, and that skeleton.

    Joints are in the order of their depth, those on the way to the hips first: what moves first
    carries the body along.
    """

    def __init__(
        self,
        file: GltfFile,
        scene: Scene,
        pieces: list[Piece],
        channels: list[Channel],
        overrides: Mapping[str, str | None] | None,
    ) -> None:
        self.skeleton = read_skeleton(
            file, scene, pieces, np.eye(4), _limbs(file, scene, channels)
        )
        plain = dict(zip(self.skeleton.names, _plain_names(self.skeleton)))
        parent = self.skeleton.parents(scene)
        asked = {bone: plain.get(joint or "", joint) for bone, joint in (overrides or {}).items()}
        names = [plain[name] for name in self.skeleton.names]
        self.mapping = humanoid_map(names, parent, asked)
        order = _hips_first(parent, names, self.mapping.get("hips"))
        place = {joint: k for k, joint in enumerate(order)}
        self.names = [names[j] for j in order]
        self.parent = np.array([place.get(parent[j], -1) for j in order], np.int32)
        self.joints = order
        self.way: set[int] = set()  # the joints' nodes and all above them
        for node in self.skeleton.nodes:
            while node != -1 and node not in self.way:
                self.way.add(node)
                node = scene.parent[node]
        self.channels = [channel for channel in channels if channel.node in self.way]


def _load(
    file: GltfFile,
    asked: str | None,
    skip_t_pose: str,
    overrides: Mapping[str, str | None] | None,
) -> Clip:
    scene = Scene(file)
    pieces = list(scene.pieces())
    animations = file.list_of("animations")
    if not animations:
        raise file.error("has no animation", "allowed: a file with one")
    names = [name if isinstance(name := a.get("name"), str) else "" for a in animations]
    known = ", ".join(f"{i}: {name!r:.60}" for i, name in enumerate(names[:20]))
    found: tuple[int, _Motion] | None = None
    tried = 0
    for i in _numbers(file, asked, names, known):
        channels = read_channels(file, animations[i])
        if tried == _MAX_TRIED or (asked is None and not _turn(channels)):
            continue
        tried += 1
        motion = _Motion(file, scene, pieces, channels, overrides)
        if not motion.channels or (asked is None and not _turn(motion.channels)):
            continue
        if found is None or "hips" in motion.mapping:
            found = i, motion
        if "hips" in motion.mapping or motion.skeleton.skins:
            break
    if found is None:
        which = f"no joint that moves in animation {asked!r:.60}"
        raise file.error(
            f"has {'no animation in which a joint turns' if asked is None else which}",
            f"found {known}",
        )
    i, motion = found
    others = f"; the file has {known}" if len(animations) > 1 else ""
    first, count, step = frame_times(motion.channels)
    _check_size(file, motion, count, step * count)
    times = step * np.arange(count, dtype=np.float64)
    turned = _turned(file, scene, motion, first + times)
    rig, values = rig_of(motion.names, motion.parent, turned)
    del turned
    skipped = skipped_frames(skip_t_pose, rig, motion.mapping, values)
    return clip_in_metres(
        plain_name(names[i]) or Path(file.path).stem,
        rig,
        times[: count - skipped],
        values,
        mapping=motion.mapping,
        notes=[f"Animation {i}, {names[i]!r:.60}{others}.", *motion.skeleton.notes],
        known_up=_UP,
    )


def _turn(channels: list[Channel]) -> bool:
    """Whether anything turns."""
    return any(
        channel.path == "rotation" and np.ptp(channel.values, axis=0).max() > _STILL
        for channel in channels
    )


def _numbers(file: GltfFile, asked: str | None, names: list[str], known: str) -> Iterator[int]:
    """The animations that may be meant, by number."""
    if asked is None:
        yield from range(len(names))
    elif asked in names:
        yield names.index(asked)
    elif asked.isdecimal() and len(asked) < 6 and int(asked) < len(names):
        yield int(asked)
    else:
        raise file.error(f"has no animation {asked!r:.60}", f"allowed: {known}")


def _check_size(file: GltfFile, motion: _Motion, count: int, length: float) -> None:
    """See that a motion is of a size that can be worked out.

    Raises:
        InputFileError: It is not.
    """
    joints, nodes = len(motion.names), len(motion.way)
    if joints > _MAX_JOINTS:
        raise file.error(f"has {joints} joints", f"allowed: {_MAX_JOINTS} in a clip")
    if length > _LONGEST:
        raise file.error(f"has an animation that is {length:g} s long", f"allowed: {_LONGEST:g} s")
    if count * joints > _MAX_PLACES or count * nodes > _MAX_FRAMES_OF_NODES:
        raise file.error(
            f"moves {joints} joints of {nodes} nodes in {count} frames",
            f"allowed: {_MAX_PLACES} joints in all frames, {_MAX_FRAMES_OF_NODES} nodes",
        )


def _limbs(file: GltfFile, scene: Scene, channels: list[Channel]) -> set[int]:
    """The nodes of a skeleton without skin: all that hang together with one that is turned.

    Meshes, cameras and lights are none, and neither is what holds the skeleton and stands still.
    """
    nodes = file.list_of("nodes")
    shown = {n for n, node in enumerate(nodes) if _is_shown(node)}
    turned = {channel.node for channel in channels if channel.path == "rotation"} - shown
    root: dict[int, int] = {}
    for n in scene.order:
        root[n] = root.get(scene.parent[n], n)
    roots = {root[n] for n in turned}
    limbs = {n for n in root if root[n] in roots} - shown
    moved = {channel.node for channel in channels}
    for n in scene.order:
        below = [child for child in file.items(nodes[n], "children", int) if child in limbs]
        if n in limbs and scene.parent[n] not in limbs and n not in moved and len(below) == 1:
            limbs.remove(n)
    return limbs


def _is_shown(node: dict[str, Any]) -> bool:
    """Whether a node is something to see or to see by, and no bone."""
    extensions = node.get("extensions")
    return bool({"mesh", "camera"} & node.keys()) or (
        isinstance(extensions, dict) and "KHR_lights_punctual" in extensions
    )


def _plain_names(skeleton: Skeleton) -> list[str]:
    """Names that topics and URDF take; bones that the file declares are called by their names."""
    declared = {joint: bone for bone, joint in skeleton.bones.items()}
    taken = set(declared.values())
    names: list[str] = []
    for name in skeleton.names:
        plain = declared.get(name)
        if plain is None:
            plain = wanted = plain_name(name)
            count = 1
            while plain in taken:
                count += 1
                plain = f"{wanted}_{count}"
            taken.add(plain)
        names.append(plain)
    return names


def _hips_first(parent: list[int], names: list[str], hips: str | None) -> list[int]:
    """Joints in the order of their depth, at each fork the way to the hips first."""
    way: set[int] = set()
    joint = names.index(hips) if hips in names else -1
    while joint >= 0:
        way.add(joint)
        joint = parent[joint]
    below: dict[int, list[int]] = {}
    for j, above in enumerate(parent):
        below.setdefault(above, []).append(j)
    order: list[int] = []
    stack = [-1]
    while stack:
        joint = stack.pop()
        if joint >= 0:
            order.append(joint)
        siblings = below.get(joint, [])
        stack += [j for j in reversed(siblings) if j not in way]
        stack += [j for j in siblings if j in way]
    return order


def _turned(file: GltfFile, scene: Scene, motion: _Motion, times: FloatArray) -> Turned:
    """What joints have turned since the rest pose, and where they are, in the file's axes."""
    moved: dict[int, dict[str, Channel]] = {}
    for channel in motion.channels:
        moved.setdefault(channel.node, {})[channel.path] = channel
    nodes = [motion.skeleton.nodes[j] for j in motion.joints]
    order = [node for node in scene.order if node in motion.way]
    still = {node: scene.local(node)[None] for node in order if node not in moved}
    T_rest = motion.skeleton.T_world_rest[motion.joints]
    rest = _rotations(T_rest)
    n, f = len(nodes), len(times)
    rotation, position = np.empty((n, f, 3, 3)), np.empty((n, f, 3))
    for start in range(0, f, _AT_ONCE):
        now = slice(start, min(start + _AT_ONCE, f))
        T: dict[int, FloatArray] = {}
        for node in order:
            T_local = still.get(node)
            if T_local is None:
                T_local = _local(file, scene, node, moved[node], times[now])
            above = scene.parent[node]
            T[node] = T_local if above == -1 else T[above] @ T_local
        for j, node in enumerate(nodes):
            if not (np.abs(T[node]) < _MAX_COORDINATE).all():
                raise file.error(
                    f"moves joint '{motion.names[j]:.60}' out of all bounds",
                    f"allowed: up to {_MAX_COORDINATE:g}",
                )
            rotation[j, now] = _rotations(T[node]) @ rest[j].T
            position[j, now] = T[node][:, :3, 3]
    return Turned(rest=T_rest[:, :3, 3], rotation=rotation, position=position)


def _rotations(T: FloatArray) -> FloatArray:
    """The rotations in affine transforms, shape [f, 3, 3].

    Of what is mirrored, that of its opposite: the mirror itself drops out between two of them.
    """
    mirrored = np.linalg.det(T[:, :3, :3]) < 0.0
    return rigid(np.where(mirrored[:, None, None], -T, T))[:, :3, :3]


def _local(
    file: GltfFile,
    scene: Scene,
    node: int,
    moved: Mapping[str, Channel],
    times: FloatArray,
) -> FloatArray:
    """Affine transforms of a node in its parent's frame at some times, shape [f, 4, 4]."""
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
