"""Outfit files: YAML that names garments, fabrics and attachments.

Untrusted: read with `safe_load`, every key known, every number bounded, no more memory than the
file's own size asks for.
"""

import importlib.resources
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from garment_sim_ros.colliders.ellipsoids.thresholds import tightest
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.garment.generators import GENERATORS
from garment_sim_ros.garment.holds import AUTOMATIC, Attachment, Holds
from garment_sim_ros.garment.holds_file import (
    SHORTEST,
    attachments_of,
    holds_of,
    mapping,
    number,
)
from garment_sim_ros.garment.materials import material_from
from garment_sim_ros.garment.mesh import UNITS, UP_AXES
from garment_sim_ros.garment.sizing import Sizes
from garment_sim_ros.input_file import read_text
from garment_sim_ros.params import ColliderOptions, Material, parameter, validated
from garment_sim_ros.plain_data import PlainDataError, parse_yaml
from garment_sim_ros.sim.holds.skin_limits import SKIN_LIMITS

DEFAULT_OUTFIT = "tshirt_short_skirt"
MAX_FILE_BYTES = 2**20
MAX_GARMENTS = 16

_NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")
_FILE_KEYS = ("version", "garments", "colliders")
GARMENT_KEYS = (
    *("name", "generator", "options", "mesh", "material", "attachments"),
    *("layer", *SKIN_LIMITS, "tethers", "self_collision", "mu"),
    *("attachment_stiffness", "attachment_damping", "elastic"),
)
"""What an outfit file may say of one garment."""

ANEW = ("always", "curved")
"""Values of `remesh` that mesh any file anew."""

_MAX_LAYER = 15
_LARGEST_OWN_DISTANCE = 0.1


@dataclass(frozen=True, kw_only=True)
class MeshOptions:
    """Options of a garment from a mesh file."""

    unit: str = parameter("m", "Length unit of the file.", choices=tuple(UNITS))
    up: str = parameter("y", "Up axis of the file.", choices=UP_AXES)
    edge_length: float = parameter(
        0.022, "Longer edges are halved to about this.", unit="m", minimum=1e-5, maximum=100.0
    )
    remesh: str = parameter(
        "auto",
        "Even triangles in place of the file's. auto: where an edge is shorter than a quarter of "
        "the median, unless the outfit names vertices by number. curved: always, with shorter "
        "edges where the surface or a line bends. Open edges and seams of its texture stay.",
        choices=("auto", "never", *ANEW),
    )
    shortest_edge: float = parameter(
        0.008,
        "With remesh: curved, edges may be this short where the surface bends.",
        unit="m",
        minimum=1e-4,
        maximum=100.0,
    )
    deviation: float = parameter(
        0.0005,
        "With remesh: curved, how far triangles may be from the surface as it was, where "
        "shortest_edge lets them.",
        unit="m",
        minimum=1e-6,
        maximum=0.1,
    )
    rest: str = parameter(
        "relaxed",
        "Where its edges have their rest lengths. relaxed: as it is put on, moved out of the body "
        "and carried over to it: nothing is strained then. given: as in the file.",
        choices=("relaxed", "given"),
    )
    made_on: str = parameter(
        "",
        "Body that the mesh was made for: a file, from the outfit's folder, or mannequin. It is "
        "carried over to the wearer, bone by bone. Empty: it is made for the wearer.",
    )

    def sizes(self) -> Sizes:
        """Lengths of edges when it is meshed anew.

        Raises:
            ParameterError: The shortest are to be longer than the others.
        """
        if self.remesh != "curved":
            return Sizes.even(self.edge_length)
        return Sizes(
            longest=self.edge_length, shortest=self.shortest_edge, deviation=self.deviation
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
        attachments: "auto", "arms", "none", or a list.
        layer: Garments with a higher number are worn over those with a lower one; those with the
            same do not meet. None: as they lie on the body at rest, where no garment of the file
            has one; else 0.
        holds: What holds it beside its pins.
        self_collision: Whether it is kept from passing through itself, or the distance that its
            parts keep from each other [m].
        mu: Thresholds of the ellipsoids that it lies on, as `EllipsoidSettings.mu`.
    """

    name: str
    generator: str | None
    mesh: Path | None
    options: Any
    material: Material
    attachments: str | tuple[Attachment, ...]
    layer: int | None = None
    holds: Holds = field(default_factory=Holds)
    self_collision: bool | float = False
    mu: str = ""


@dataclass(frozen=True, kw_only=True)
class OutfitFile:
    """An outfit before it is made for a body.

    Attributes:
        name: File name without its ending.
        source: Path, or name of the built-in outfit, for messages.
        text: Its YAML text.
        garments: In the order of the file.
        colliders: What they are to lie on; `mu` with the thresholds of the garments, the smallest
            where several name a region.
        said: Names of what the file itself says of colliders.
    """

    name: str
    source: str
    text: str
    garments: tuple[GarmentEntry, ...]
    colliders: ColliderOptions
    said: tuple[str, ...] = ()

    def colliders_on(self, usual: ColliderOptions) -> ColliderOptions:
        """What they are to lie on, with other options where the file says nothing."""
        said = {name: getattr(self.colliders, name) for name in self.said}
        said.setdefault("mu", tightest([usual.mu, self.colliders.mu]))
        return replace(usual, **said)


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
        return outfit_from(_parsed(text), name=name, source=str(source), text=text, folder=folder)
    except ParameterError as error:
        raise InputFileError(source, f"{error.name}: {error.problem}", error.allowed) from error


def outfit_from(
    content: Mapping[str, Any],
    *,
    name: str = "outfit",
    source: str = "outfit",
    text: str = "",
    folder: Path = Path(),
) -> OutfitFile:
    """An outfit from what its file says.

    Args:
        content: The file's keys and values.
        name: Its name.
        source: What messages call it.
        text: The file's text.
        folder: Paths of meshes are relative to it.

    Raises:
        ParameterError: A key or value that is not allowed; the message names the garment.
    """
    known = mapping("file", content, _FILE_KEYS)
    if known.get("version") != 1:
        raise ParameterError("version", f"found {known.get('version')!r:.60}", "allowed: 1")
    garments = _garments(known, folder)
    asked = mapping("colliders", known.get("colliders", {}))
    colliders = validated(ColliderOptions, asked)
    mu = tightest([colliders.mu, *(garment.mu for garment in garments)])
    return OutfitFile(
        name=name,
        source=source,
        text=text,
        garments=garments,
        colliders=replace(colliders, mu=mu),
        said=tuple(asked),
    )


def _parsed(text: str) -> Mapping[str, Any]:
    try:
        content = parse_yaml(text)
    except PlainDataError as error:
        raise ParameterError("file", f"is not plain YAML ({error})") from None
    return mapping("file", content)


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
    values = mapping(where, entry, GARMENT_KEYS)
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
        raise ParameterError(f"{where}.mesh", f"found {mesh!r:.60}", "allowed: a file's path")
    try:
        options: Any = validated(group, mapping("options", values.get("options", {})))
        if isinstance(options, MeshOptions):
            options.sizes()
        return GarmentEntry(
            name=name,
            generator=generator,
            mesh=None if mesh is None else folder / mesh,
            options=options,
            material=material_from(values.get("material")),
            attachments=attachments_of(values.get("attachments", AUTOMATIC)),
            layer=_layer(values.get("layer")),
            holds=holds_of(values),
            self_collision=_own_distance(values.get("self_collision", False)),
            mu=_thresholds(values.get("mu", "")),
        )
    except ParameterError as error:
        raise ParameterError(f"{where}.{error.name}", error.problem, error.allowed) from error


def _layer(value: object) -> int | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _MAX_LAYER:
        raise ParameterError(
            "layer", f"found {repr(value)[:60]}", f"allowed: a whole number, 0 to {_MAX_LAYER}"
        )
    return value


def _own_distance(value: object) -> bool | float:
    if isinstance(value, bool):
        return value
    allowed = f"true, false, or a distance of {SHORTEST:g} to {_LARGEST_OWN_DISTANCE:g} m"
    return number("self_collision", value, allowed, SHORTEST, _LARGEST_OWN_DISTANCE)


def _thresholds(value: object) -> str:
    if not isinstance(value, str):
        raise ParameterError(
            "mu", f"found {repr(value)[:60]}", "allowed: text, as left_thigh=0.03"
        )
    return tightest([value])
