"""Numerical parameters of the solvers."""

import dataclasses

from garment_sim_ros.declaration import needs, parameter

SPRINGS, TRIANGLES = MEMBRANES = ("springs", "triangles")
"""What may resist strain in the plane of the cloth."""
_MEMBRANE = (
    "What resists strain in the plane. springs: the mesh's edges; triangles: an orthotropic "
    "membrane, which is as stiff as the fabric on any mesh, and takes longer."
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class RelaxationSettings:
    """Numerical parameters of the `relaxation` solver."""

    sweeps: int = parameter(3, "Sweeps of spring correction per step.", minimum=1, maximum=1000)
    contact: str = parameter(
        "union",
        "Contact method. union: particles are moved out of the union of all shapes; earliest: "
        "each particle stops at its earliest hit (ellipsoids and spheres only), as in Gong et al. "
        "2018; rays: one shape after the other moves each particle inside of it to its surface, "
        "along the ray from its inner origin or centre, and nothing else: no friction, no "
        "thickness, as in Sun et al. 2007 and the simple case of Gong et al. 2018 (hulls, spheres "
        "and ellipsoids only).",
        choices=("union", "earliest", "rays"),
    )
    response: str = parameter(
        "surface",
        "Response to an earliest hit. surface: along the normal, with friction and restitution; "
        "inelastic: along the normal, without either; reflection: along the ray from the centre.",
        choices=("surface", "inelastic", "reflection"),
        needs=(needs("contact", "earliest"),),
    )
    restitution: float = parameter(
        0.0,
        "Coefficient of restitution of an earliest hit.",
        minimum=0.0,
        maximum=1.0,
        needs=(needs("contact", "earliest"), needs("response", "surface")),
    )
    extras: bool = parameter(
        True,
        "Do what the papers (presets sun2007 and gong2018) do not: keep garments that are worn "
        "over each other apart, take garments that a limb is stuck in back to an earlier state, "
        "and show cloth outside of the shapes between its particles, too, with round creases.",
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class XpbdSettings:
    """Numerical parameters of the `xpbd` solver."""

    sub_step: float = parameter(
        1 / 1080,
        "Longest sub-step. Shorter ones give stiffer cloth and take longer.",
        unit="s",
        minimum=1e-5,
        maximum=0.1,
    )
    iterations: int = parameter(
        1, "Passes over the edges in each sub-step.", minimum=1, maximum=1000
    )
    search_every: int = parameter(
        6,
        "Sub-steps between two contact searches and two passes over the hinges; stiff hinges have "
        "passes more often.",
        minimum=1,
        maximum=64,
    )
    strain_limit: float = parameter(
        0.3,
        "Strain that edges do not grow beyond: cloth pulled harder moves instead. 0: no limit.",
        minimum=0.0,
        maximum=1e3,
    )
    coarse: bool = parameter(
        False,
        "Correct the stretch on a coarse level, too: less stretch with few sub-steps.",
        needs=(needs("iterations", 1),),
    )
    membrane: str = parameter(SPRINGS, _MEMBRANE, choices=MEMBRANES)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ImplicitSettings:
    """Numerical parameters of the `implicit` solver."""

    sub_step: float = parameter(
        1 / 60,
        "Longest sub-step. Shorter ones are more accurate and take longer.",
        unit="s",
        minimum=1e-4,
        maximum=0.5,
    )
    iterations: int = parameter(8, "Descent steps in each sub-step.", minimum=1, maximum=200)
    most_iterations: int = parameter(
        8,
        "Most descent steps in a sub-step: there are more than `iterations` where the last one "
        "still gained much. With 16, cloth that moves is less slowed down.",
        minimum=1,
        maximum=600,
    )
    membrane: str = parameter(SPRINGS, _MEMBRANE, choices=MEMBRANES)
