"""Outfit files: YAML that names garments, fabrics and attachments.

Untrusted: read with `safe_load`, every key known, every number bounded, no more memory than the
file's own size asks for.
"""

import importlib.resources
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from garment_sim_ros.body.input_file import read_text
from garment_sim_ros.colliders.thresholds import tightest
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.garment.dressing import AUTOMATIC, NONE, Attachment
from garment_sim_ros.garment.generators import GENERATORS
from garment_sim_ros.garment.materials import material_from
from garment_sim_ros.garment.mesh import UNITS, UP_AXES
from garment_sim_ros.params import ColliderOptions, Material, parameter, validated

DEFAULT_OUTFIT = "tshirt_short_skirt"
MAX_FILE_BYTES = 2**20
MAX_GARMENTS = 16

_NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")
_FILE_KEYS = ("version", "garments", "colliders")
_GARMENT_KEYS = (
    *("name", "generator", "options", "mesh", "material", "attachments"),
    *("layer", "max_distance", "mu"),
)
_MAX_LAYER = 15


@dataclass(frozen=True, kw_only=True)
class MeshOptions:
    """Options of a garment from a mesh file."""

    unit: str = parameter("m", "Length unit of the file.", choices=tuple(UNITS))
    up: str = parameter("y", "Up axis of the file.", choices=UP_AXES)
    edge_length: float = parameter(
        0.022, "Longer edges are halved to about this.", unit="m", minimum=1e-5, maximum=100.0
    )


@dataclass(frozen=True, kw_only=True)
class GarmentEntry:
    """One garment of an outfit file.

    Attributes:
        name: Unique in its outfit, matches ``[a-z][a-z0-9_]*``.
        generator: Name of a built-in garment, or None.
        mesh: Path of a mesh file, or None.
        options: The generator's parameter group, or `MeshOptions`.
        material: Its fabric.
        attachments: "auto", "none", or a list.
        layer: Garments with a higher number are worn over those with a lower one; those with the
            same do not meet.
        max_distance: How far a vertex may be from where it would be as skin [m]; None: what suits
            the garment, see `dressed`.
        mu: Thresholds of the ellipsoids that it lies on, as `EllipsoidSettings.mu`.
    """

    name: str
    generator: str | None
    mesh: Path | None
    options: Any
    material: Material
    attachments: str | tuple[Attachment, ...]
    layer: int = 0
    max_distance: float | None = None
    mu: str = ""


@dataclass(frozen=True, kw_only=True)
class OutfitFile:
    """An outfit before it is made for a body.

    Attributes:
        name: File name without its ending.
        source: Path, or name of the built-in outfit, for messages.
        text: Its YAML text.
        garments: Inner garments before outer ones.
        colliders: What they are to lie on; `mu` with the thresholds of the garments, the smallest
            where several name a region.
    """

    name: str
    source: str
    text: str
    garments: tuple[GarmentEntry, ...]
    colliders: ColliderOptions


def builtin_outfits() -> dict[str, str]:
    """YAML text of the built-in outfits by name."""
    folder = importlib.resources.files("garment_sim_ros.garment").joinpath("outfits")
    return {
        entry.name.removesuffix(".yaml"): entry.read_text(encoding="utf-8")
        for entry in sorted(folder.iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith(".yaml")
    }


def read_outfit(source: str | Path) -> OutfitFile:
    """An outfit file, or a built-in outfit by its name.

    Raises:
        InputFileError: The file is missing, not YAML or not an outfit; the message names the
            garment and key.
    """
    builtin = builtin_outfits()
    path = Path(source)
    if str(source) in builtin:
        name, text, folder = str(source), builtin[str(source)], Path()
    elif path.suffix not in (".yaml", ".yml"):
        raise InputFileError(
            source,
            "is not an outfit",
            "allowed: a .yaml file, or one of " + ", ".join(builtin),
        )
    else:
        name, text, folder = path.stem, read_text(path, limit=MAX_FILE_BYTES), path.parent
    try:
        content = _parsed(text)
        garments = _garments(content, folder)
        asked = _mapping("colliders", content.get("colliders", {}))
        colliders = validated(ColliderOptions, asked)
        return OutfitFile(
            name=name,
            source=str(source),
            text=text,
            garments=garments,
            colliders=replace(
                colliders, mu=tightest([colliders.mu, *(garment.mu for garment in garments)])
            ),
        )
    except ParameterError as error:
        raise InputFileError(source, f"{error.name}: {error.problem}", error.allowed) from error


class _PlainLoader(yaml.SafeLoader):
    """Safe YAML without aliases, which could make a small file a huge one, or repeated keys."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """As the base class does, for anything but an alias."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases are not allowed")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """As the base class does, if no key stands twice."""
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.YAMLError(f"the key {key.value!r} stands twice")
                seen.add(key.value)
        return super().construct_mapping(node, deep)


def _parsed(text: str) -> Mapping[str, Any]:
    try:
        content = yaml.load(text, Loader=_PlainLoader)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        problem = " ".join(str(error).split())[:200]
        raise ParameterError("file", f"is not plain YAML ({problem})") from error
    known = _mapping("file", content, _FILE_KEYS)
    if known.get("version") != 1:
        raise ParameterError("version", f"found {known.get('version')!r}", "allowed: 1")
    return known


def _garments(content: Mapping[str, Any], folder: Path) -> tuple[GarmentEntry, ...]:
    entries = content.get("garments")
    if not isinstance(entries, list) or not 1 <= len(entries) <= MAX_GARMENTS:
        found = f"{len(entries)} entries" if isinstance(entries, list) else repr(entries)[:60]
        raise ParameterError(
            "garments", f"found {found}", f"allowed: a list of 1 to {MAX_GARMENTS} garments"
        )
    garments = tuple(_garment(i, entry, folder) for i, entry in enumerate(entries))
    names = [g.name for g in garments]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError("garments", f"the name {name!r} stands twice", "allowed: once")
    return garments


def _garment(index: int, entry: object, folder: Path) -> GarmentEntry:
    where = f"garments[{index}]"
    values = _mapping(where, entry, _GARMENT_KEYS)
    name = values.get("name")
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ParameterError(
            f"{where}.name", f"found {str(name)[:60]!r}", "allowed: [a-z][a-z0-9_]*"
        )
    where = f"garment {name!r}"
    generator, mesh = values.get("generator"), values.get("mesh")
    if (generator is None) == (mesh is None):
        raise ParameterError(
            where, "has no source, or two", "allowed: one of generator: NAME and mesh: FILE"
        )
    group: type = MeshOptions
    if generator is not None:
        if not isinstance(generator, str) or generator not in GENERATORS:
            raise ParameterError(
                f"{where}.generator",
                f"found {str(generator)[:60]!r}",
                "allowed: " + ", ".join(GENERATORS),
            )
        group = GENERATORS[generator].options
    elif not isinstance(mesh, str) or not mesh:
        raise ParameterError(f"{where}.mesh", f"found {mesh!r}", "allowed: a file's path")
    try:
        return GarmentEntry(
            name=name,
            generator=generator,
            mesh=None if mesh is None else folder / mesh,
            options=validated(group, _mapping("options", values.get("options", {}))),
            material=material_from(values.get("material")),
            attachments=_attachments(values.get("attachments", AUTOMATIC)),
            layer=_layer(values.get("layer", 0)),
            max_distance=_distance(values.get("max_distance")),
            mu=_thresholds(values.get("mu", "")),
        )
    except ParameterError as error:
        raise ParameterError(f"{where}.{error.name}", error.problem, error.allowed) from error


def _layer(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _MAX_LAYER:
        raise ParameterError(
            "layer", f"found {repr(value)[:60]}", f"allowed: a whole number, 0 to {_MAX_LAYER}"
        )
    return value


def _distance(value: object) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0.0:
        raise ParameterError(
            "max_distance", f"found {repr(value)[:60]}", "allowed: a number of metres above 0"
        )
    return float(value)


def _thresholds(value: object) -> str:
    if not isinstance(value, str):
        raise ParameterError(
            "mu", f"found {repr(value)[:60]}", "allowed: text, as left_thigh=0.03"
        )
    return tightest([value])


def _attachments(value: object) -> str | tuple[Attachment, ...]:
    allowed = f"allowed: {AUTOMATIC}, {NONE}, or a list of {{bone: NAME, vertices: [...]}}"
    if isinstance(value, str) and value in (AUTOMATIC, NONE):
        return value
    if not isinstance(value, list) or len(value) > 1000:
        raise ParameterError("attachments", f"found {repr(value)[:60]}", allowed)
    attachments = []
    for entry in value:
        known = _mapping("attachments", entry, ("bone", "vertices"))
        bone, vertices = known.get("bone"), known.get("vertices")
        if not isinstance(bone, str) or not isinstance(vertices, list):
            raise ParameterError("attachments", f"found {repr(entry)[:60]}", allowed)
        if not all(isinstance(v, int) and not isinstance(v, bool) for v in vertices):
            raise ParameterError("attachments", "a vertex is not a whole number", allowed)
        attachments.append(Attachment(bone=bone, vertices=tuple(vertices)))
    return tuple(attachments)


def _mapping(where: str, value: object, keys: Sequence[str] = ()) -> Mapping[str, Any]:
    """A mapping with text keys, only known ones where `keys` are given."""
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise ParameterError(where, f"found {repr(value)[:60]}", "allowed: a mapping of names")
    unknown = sorted(set(value) - set(keys)) if keys else []
    if unknown:
        raise ParameterError(
            where, f"unknown key {unknown[0][:60]!r}", "allowed: " + ", ".join(keys)
        )
    return value
