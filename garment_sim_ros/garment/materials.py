"""Presets of common fabrics, with the source of their numbers.

Measured cloths: Wang, O'Brien & Ramamoorthi 2011, "Data-driven elastic models for cloth:
modeling and measurement", ACM Trans. Graph. 30(4), the published database of ten fabrics. Their
models are piecewise linear in strain and direction; a preset takes one number of each: tensile
stiffness along warp and weft at the strain of 1/6 in that direction, shear stiffness at small
strain, and a quarter of the bending stiffness of small curvature, averaged over the three
directions measured. A quarter, as that number k belongs to hinges (Bridson et al. 2003), which
store k l^2 theta^2 / 8A for an edge of length l, an angle theta and two triangles of area A in
all. On meshes of equilateral triangles, and on a grid along its axes, that is k/8 per area and
squared curvature of a cylinder, where a rigidity B stores B/2 (`test_bending_of_fabrics.py`).
`bench/textile_tests.py` measures how the fabrics hang.

`silk` and `wool` are nominal: mid-range values of the Kawabata evaluation system (KES-F) for thin
silk weaves and for worsted suiting, not one measured cloth. Damping, air drag, friction and
thickness are not in these sources; they are the defaults of `Material`, except that heavy cloths
are thicker.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import Material, declarations, validated

DEFAULT_PRESET = "cotton_jersey"

OF_A_HINGE = 0.25
"""Bending rigidity over the bending stiffness of hinges in the published database."""

_WANG = "Wang et al. 2011, "
_KES = "KES-F mid-range, nominal: "


@dataclass(frozen=True, kw_only=True)
class Preset:
    """A fabric.

    Attributes:
        material: Its parameters.
        source: Where the numbers come from, and what the cloth is.
    """

    material: Material
    source: str


def _rigidity(*measured: float) -> float:
    """Bending rigidity [N m] from bending stiffnesses of the published database [N m]."""
    return OF_A_HINGE * sum(measured) / len(measured)


def _preset(
    source: str,
    density: float,
    stretch: tuple[float, float],
    shear: float,
    bending: float,
    thickness: float = 0.002,
) -> Preset:
    return Preset(
        source=source,
        material=Material(
            areal_density=density,
            stretch_stiffness_warp=stretch[0],
            stretch_stiffness_weft=stretch[1],
            shear_stiffness=shear,
            bending_stiffness=bending,
            thickness=thickness,
        ),
    )


PRESETS: Mapping[str, Preset] = MappingProxyType(
    {
        "cotton_jersey": _preset(
            _WANG + "gray interlock: T-shirt, 60 % cotton 40 % polyester",
            *(0.187, (46.364765, 405.872833), 36.860302),
            _rigidity(23.191698e-6, 24.749964e-6, 14.267624e-6),
        ),
        "rib_knit": _preset(
            _WANG + "ivory rib knit: underwear, 95 % cotton 5 % spandex",
            *(0.276, (52.422512, 254.593491), 83.175644),
            _rigidity(46.237591e-6, 30.015930e-6, 32.243889e-6),
        ),
        "denim": _preset(
            _WANG + "11 oz black denim: jeans, 99 % cotton 1 % spandex",
            *(0.324, (232.027634, 1051.55712), 53.387184),
            _rigidity(64.196457e-6, 73.384567e-6, 96.951576e-6),
            thickness=0.003,
        ),
        "cotton_twill": _preset(
            _WANG + "royal target: trousers, 65 % cotton 35 % polyester",
            *(0.220, (2109.51684, 2152.73852), 104.759674),
            _rigidity(125.409805e-6, 107.997696e-6, 125.409805e-6),
        ),
        "polyester": _preset(
            _WANG + "white dots on black: tablecloth, 100 % polyester",
            *(0.128, (2107.22753, 2150.47680), 19.189022),
            _rigidity(51.713814e-6, 40.659470e-6, 31.282822e-6),
        ),
        "polyester_jacket": _preset(
            _WANG + "tango red jet set: jacket, 100 % polyester",
            *(0.113, (75.151695, 404.867188), 14.314700),
            _rigidity(14.293814e-6, 21.951700e-6, 20.345654e-6),
        ),
        "ponte_roma": _preset(
            _WANG + "camel ponte roma: jacket, 60 % polyester 40 % rayon",
            *(0.284, (78.707756, 191.777588), 31.896357),
            _rigidity(36.348366e-6, 33.013252e-6, 37.157593e-6),
        ),
        "sweatshirt": _preset(
            _WANG + "navy sparkle sweat: sweater, 96 % polyester 4 % spandex",
            *(0.224, (32.172089, 243.264908), 17.616289),
            _rigidity(59.469658e-6, 40.072277e-6, 45.625023e-6),
        ),
        "swimwear": _preset(
            _WANG + "white swim solid: swimsuit, 87 % nylon 13 % spandex",
            *(0.204, (40.369045, 124.468513), 60.773663),
            _rigidity(60.237942e-6, 58.803211e-6, 51.018833e-6),
        ),
        "fleece": _preset(
            _WANG + "pink ribbon brown: blanket, 100 % polyester",
            *(0.228, (164.124344, 359.792633), 30.250183),
            _rigidity(117.070122e-6, 87.509773e-6, 59.774277e-6),
            thickness=0.004,
        ),
        # KES-F units: 1 gf cm^2/cm = 9.8e-5 N m; 1 gf/(cm deg) = 56.2 N/m; tensile stiffness is
        # 490 N/m (500 gf/cm) over the extension EMT at that load.
        "silk": _preset(
            _KES + "thin weave, 60 g/m^2, EMT 6 %, G 0.3 gf/(cm deg), B 0.04 gf cm^2/cm",
            *(0.060, (8200.0, 8200.0), 17.0),
            3.9e-6,
            thickness=0.0015,
        ),
        "wool": _preset(
            _KES + "worsted suiting, 240 g/m^2, EMT 5 %, G 0.6 gf/(cm deg), B 0.1 gf cm^2/cm",
            *(0.240, (9800.0, 9800.0), 34.0),
            9.8e-6,
        ),
    }
)
"""Fabrics by name."""


def material_from(value: object) -> Material:
    """A material from an outfit file.

    Args:
        value: None for the default, a preset's name, or a mapping of `Material` fields with
            an optional `preset` that the other values override.

    Raises:
        ParameterError: An unknown preset or field, or a value out of range.
    """
    overrides: dict[str, object] = {}
    if isinstance(value, Mapping):
        overrides = dict(value)
        value = overrides.pop("preset", None)
    name = DEFAULT_PRESET if value is None else value
    if not isinstance(name, str) or name not in PRESETS:
        raise ParameterError(
            "material",
            f"found {str(name)[:60]!r}",
            "allowed: values by name, or a preset of " + ", ".join(PRESETS),
        )
    base = PRESETS[name].material
    known = {field: getattr(base, field) for field in declarations(Material)}
    return validated(Material, {**known, **overrides})
