"""Numerical parameters of the solvers `xpbd` and `implicit`."""

import dataclasses

from garment_sim_ros.declaration import needs, parameter


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
