"""Any clip by name: the built-in walk, a BVH or glTF file, or a recording."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.input_file import exists, is_folder
from garment_sim_ros.mocap.bvh import load_bvh
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.clip_name import GLTF, OF_GLTF, file_and_animation
from garment_sim_ros.mocap.gltf_clip import load_gltf_clip
from garment_sim_ros.mocap.walk import WalkOptions, walk
from garment_sim_ros.params import declarations, validated

_ALLOWED = (
    f"allowed: .bvh, {', '.join(GLTF)} (with {OF_GLTF}NAME after it for one of several), "
    ".mcap, .db3, a rosbag2 folder, or walk[:option=value,...]"
)


def load_clip(
    source: str | Path,
    *,
    skip_t_pose: str = "auto",
    humanoid_overrides: Mapping[str, str | None] | None = None,
) -> Clip:
    """A clip from a file, or the built-in walk.

    Args:
        source: A .bvh, .glb, .gltf, .vrm, .vrma, .mcap or .db3 file, or a rosbag2 folder. One of
            several animations in a glTF file as in ``avatar.glb:animation=Run``, by name or by
            number from 0. Or ``walk``, with options as in ``walk:speed=1.1,path=straight``.
        skip_t_pose: As for `load_bvh`.
        humanoid_overrides: As for `load_bvh`.

    Raises:
        InputFileError: The file cannot be used.
        ParameterError: An option is unknown or out of range.
    """
    name, colon, options = str(source).partition(":")
    if name == "walk" and (colon or not exists(source)):
        return _walk(options)
    file, animation = file_and_animation(source)
    path = Path(file)
    if path.suffix.lower() in GLTF:
        return load_gltf_clip(
            path, animation, skip_t_pose=skip_t_pose, humanoid_overrides=humanoid_overrides
        )
    if path.suffix.lower() == ".bvh":
        return load_bvh(path, skip_t_pose=skip_t_pose, humanoid_overrides=humanoid_overrides)
    if path.suffix.lower() in (".mcap", ".db3") or is_folder(path):
        # Reading bags needs a library that takes longer to import than the rest of this package.
        from garment_sim_ros.mocap.rosbag import load_bag

        return load_bag(path)
    if not exists(path):
        raise InputFileError(source, "does not exist", _ALLOWED)
    raise InputFileError(source, f"has the ending {path.suffix!r}", _ALLOWED)


def _walk(text: str) -> Clip:
    known = declarations(WalkOptions)
    values: dict[str, Any] = {}
    for option in filter(None, text.split(",")):
        key, _, value = option.partition("=")
        if key not in known:
            raise ParameterError(f"walk:{key}", "unknown", "allowed: " + ", ".join(known))
        values[key] = value
        if known[key].type is not str:
            try:
                values[key] = float(value)
            except ValueError:
                raise ParameterError(
                    f"walk:{key}", f"found {value!r}", known[key].allowed
                ) from None
    return walk(**dataclasses.asdict(validated(WalkOptions, values)))
