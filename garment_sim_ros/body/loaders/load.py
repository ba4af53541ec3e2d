"""Any body by name: the built-in mannequin or a file, and which loader reads it."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from garment_sim_ros.body.humanoid import load_humanoid_overrides, overridden
from garment_sim_ros.body.skin import Body
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.input_file import exists
from garment_sim_ros.params import declarations, validated

_ALLOWED = "allowed: .glb, .gltf, .vrm, .urdf, .xml, .obj, .ply, or mannequin[:option=value,...]"


def load_body(
    source: str | Path,
    *,
    humanoid_overrides: Mapping[str, str | None] | None = None,
    bone_names: str | Path = "",
) -> Body:
    """A body from a file, or the built-in one.

    Args:
        source: A .glb, .gltf, .vrm, .urdf, .xml, .obj or .ply file; an .obj with MakeHuman's
            .mhskel and .mhw files beside it gets their rig. Or ``mannequin``, with options as in
            ``mannequin:height=1.8,sex=1``.
        humanoid_overrides: Humanoid bone to joint name, or to None for "has no such bone".
        bone_names: File of such names, see `load_humanoid_overrides`; those given win over it.

    Raises:
        InputFileError: A file cannot be used.
        ParameterError: An option of the mannequin is unknown or out of range, or a bone or joint
            that is named does not exist.
    """
    if bone_names:
        humanoid_overrides = {**load_humanoid_overrides(bone_names), **(humanoid_overrides or {})}
    # Each imports what only it needs: a body is ready the sooner, and so is the first cloth.
    name, colon, options = str(source).partition(":")
    if name == "mannequin" and (colon or not exists(source)):
        return _renamed(_mannequin(options), humanoid_overrides)
    suffix = Path(source).suffix.lower()
    if suffix in (".glb", ".gltf", ".vrm"):
        from garment_sim_ros.body.loaders.gltf import load_gltf

        return load_gltf(source, humanoid_overrides=humanoid_overrides)
    if suffix in (".urdf", ".xml"):
        from garment_sim_ros.body.loaders.urdf import load_urdf

        return load_urdf(source, humanoid_overrides=humanoid_overrides)
    if suffix == ".obj":
        rig = _only_sibling(source, ".mhskel")
        weights = _only_sibling(source, ".mhw")
        if rig is not None and weights is not None:
            from garment_sim_ros.body.loaders.obj import load_makehuman

            return load_makehuman(source, rig, weights, humanoid_overrides=humanoid_overrides)
    if suffix in (".obj", ".ply"):
        from garment_sim_ros.body.loaders.obj import load_static

        return _renamed(load_static(source), humanoid_overrides)
    if not exists(source):
        raise InputFileError(source, "does not exist", _ALLOWED)
    raise InputFileError(source, f"has the ending {suffix!r}", _ALLOWED)


def _renamed(body: Body, overrides: Mapping[str, str | None] | None) -> Body:
    """A body whose bones are known, but for those that are given."""
    if not overrides:
        return body
    return dataclasses.replace(
        body, humanoid=overridden(body.humanoid, body.rig.joint_names, overrides)
    )


def _mannequin(text: str) -> Body:
    from garment_sim_ros.body.mannequin.mannequin import MannequinOptions, mannequin

    values: dict[str, float] = {}
    known = declarations(MannequinOptions)
    for option in filter(None, text.split(",")):
        key, _, value = option.partition("=")
        if key not in known:
            raise ParameterError(f"mannequin:{key}", "unknown", "allowed: " + ", ".join(known))
        try:
            number = float(value)
        except ValueError:
            raise ParameterError(
                f"mannequin:{key}", f"found {value!r}", known[key].allowed
            ) from None
        values[key] = number
    options = validated(MannequinOptions, values)
    return mannequin(**dataclasses.asdict(options))


def _only_sibling(source: str | Path, suffix: str) -> Path | None:
    """The one file with this ending in the same folder, None if there are none or several."""
    try:
        found = sorted(Path(source).parent.glob(f"*{suffix}"))
    except (OSError, ValueError):  # no folder, or no path
        return None
    return found[0] if len(found) == 1 else None
