"""Built-in garments by name, made for any body."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from numpy.typing import NDArray

from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.disk_cache import array_digest, cached_arrays, code_digest
from garment_sim_ros.garment.dressing import dressed
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.materials import PRESETS
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.garment.skirt import skirt
from garment_sim_ros.params import parameter, validated


@dataclass(frozen=True, kw_only=True)
class ShortSkirtOptions:
    """Options of the short skirt."""

    vertices: int = parameter(1687, "Number of vertices.", minimum=60, maximum=100_000)
    length: float = parameter(
        0.45, "Hem between crotch (0) and knee (1).", minimum=0.0, maximum=1.5
    )
    flare: float = parameter(0.2, "Widening per length below the hips.", minimum=0.0, maximum=1.0)


@dataclass(frozen=True, kw_only=True)
class LongSkirtOptions:
    """Options of the long skirt."""

    vertices: int = parameter(2235, "Number of vertices.", minimum=60, maximum=100_000)
    length: float = parameter(
        0.95, "Hem between knee (0) and the top of the foot (1).", minimum=0.0, maximum=1.0
    )
    flare: float = parameter(0.15, "Widening per length below the hips.", minimum=0.0, maximum=1.0)


@dataclass(frozen=True, kw_only=True)
class TShirtOptions:
    """Options of the T-shirt."""

    # Made by remeshing, 20,000 vertices take some 7 s; skirts are drawn directly.
    vertices: int = parameter(1503, "Number of vertices.", minimum=300, maximum=20_000)
    length: float = parameter(
        0.8, "Hem between waist (0) and widest hips (1).", minimum=0.2, maximum=1.0
    )
    ease: float = parameter(
        0.025,
        "How far its trunk stands off a person of 1.65 m: 0.01 close-fitting, 0.04 loose.",
        unit="m",
        minimum=0.005,
        maximum=0.05,
    )


@dataclass(frozen=True, kw_only=True)
class Generator:
    """A kind of garment that can be made.

    Attributes:
        options: Its parameter group.
        make: Makes the mesh from a body and options; returns also the pose it was made in.
    """

    options: type
    make: Callable[[Measures, Any], tuple[GarmentMesh, Measures]]


def _short_skirt(measures: Measures, o: ShortSkirtOptions) -> tuple[GarmentMesh, Measures]:
    hem = measures.crotch - o.length * (measures.crotch - measures.knee)
    return skirt(measures, vertices=o.vertices, hem=hem, flare=o.flare), measures


def _long_skirt(measures: Measures, o: LongSkirtOptions) -> tuple[GarmentMesh, Measures]:
    hem = measures.knee - o.length * (measures.knee - measures.instep)
    return skirt(measures, vertices=o.vertices, hem=hem, flare=o.flare), measures


def _tshirt(measures: Measures, o: TShirtOptions) -> tuple[GarmentMesh, Measures]:
    measures = measures.with_arms_away()
    body, skin = measures.body, measures.body.skin
    arrays = (measures.vertices, measures.T_world_joint, skin.triangles, skin.bone, skin.weight)
    key = (
        f"tshirt {o} {body.name} {sorted(body.humanoid.items())} {body.rig.joint_names} "
        f"{array_digest(*arrays)} {code_digest('body', 'contact', 'garment', 'geometry')}"
    )

    def make() -> dict[str, NDArray[Any]]:
        # Only where no such shirt was made before: what it takes is slow to import, too.
        from garment_sim_ros.garment.tshirt import tshirt

        mesh = tshirt(measures, vertices=o.vertices, length=o.length, ease=o.ease)
        return {"vertices": mesh.vertices, "triangles": mesh.triangles}

    made = cached_arrays("garments", key, make)
    return GarmentMesh(vertices=made["vertices"], triangles=made["triangles"]), measures


GENERATORS: Mapping[str, Generator] = MappingProxyType(
    {
        "short_skirt": Generator(options=ShortSkirtOptions, make=_short_skirt),
        "long_skirt": Generator(options=LongSkirtOptions, make=_long_skirt),
        "tshirt": Generator(options=TShirtOptions, make=_tshirt),
    }
)
"""Built-in garments by name."""


def short_skirt(body: Body, *, colliders: ColliderSet | None = None, **options: Any) -> Garment:
    """A short skirt of polyester; options as in `ShortSkirtOptions`.

    Raises:
        ParameterError: An unknown option or a value out of range.
        GeometryError: The body lacks bones or skin that a skirt needs.
    """
    return _made("short_skirt", body, colliders, options, "polyester")


def long_skirt(body: Body, *, colliders: ColliderSet | None = None, **options: Any) -> Garment:
    """A long skirt of polyester; options as in `LongSkirtOptions`, errors as `short_skirt`."""
    return _made("long_skirt", body, colliders, options, "polyester")


def tshirt(body: Body, *, colliders: ColliderSet | None = None, **options: Any) -> Garment:
    """A T-shirt of cotton jersey; options as in `TShirtOptions`, errors as `short_skirt`."""
    return _made("tshirt", body, colliders, options, "cotton_jersey")


def _made(
    name: str,
    body: Body,
    colliders: ColliderSet | None,
    options: Mapping[str, Any],
    preset: str,
) -> Garment:
    generator = GENERATORS[name]
    mesh, measures = generator.make(Measures(body), validated(generator.options, options))
    material = PRESETS[preset].material
    return dressed(name, mesh, measures, material, colliders=colliders)[0]
