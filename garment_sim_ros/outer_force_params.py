"""Parameters of what acts on cloth from outside: gravity, wind, the motion of the root."""

import dataclasses

from garment_sim_ros.constants import FALL
from garment_sim_ros.declaration import needs_any, parameter

_AIR = needs_any("wind_drag", "wind_lift")
_GUSTS = (needs_any("gust"), _AIR)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Environment:
    """Outer forces on all garments."""

    gravity: tuple[float, ...] = parameter(
        FALL, "Gravity in the world frame.", unit="m/s^2", minimum=-1e4, maximum=1e4
    )
    wind: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        "Wind velocity in the world frame.",
        unit="m/s",
        minimum=-200.0,
        maximum=200.0,
    )
    wind_drag: float = parameter(
        0.0,
        "Drag coefficient of a triangle across the wind; cloth has about 1.2. 0: none.",
        minimum=0.0,
        maximum=10.0,
    )
    wind_lift: float = parameter(
        0.0,
        "Lift coefficient of a triangle; cloth has about 0.4. 0: none.",
        minimum=0.0,
        maximum=10.0,
    )
    gust: float = parameter(
        0.0,
        "Root mean square speed of the noise that is added to the wind.",
        unit="m/s",
        minimum=0.0,
        maximum=200.0,
        needs=(_AIR,),
    )
    gust_shortest: float = parameter(
        0.3, "Shortest wavelength of the noise.", unit="m", minimum=0.01, maximum=1e3, needs=_GUSTS
    )
    gust_longest: float = parameter(
        3.0, "Longest wavelength of the noise.", unit="m", minimum=0.01, maximum=1e3, needs=_GUSTS
    )
    gust_change: float = parameter(
        0.5,
        "Rate at which the noise changes with time, apart from its drift with the wind.",
        unit="1/s",
        minimum=0.0,
        maximum=100.0,
        needs=_GUSTS,
    )
    gust_waves: int = parameter(
        24, "Number of plane waves in the noise.", minimum=1, maximum=512, needs=_GUSTS
    )
    gust_divergence_free: bool = parameter(
        True, "Make the noise divergence-free, so that no air appears or vanishes.", needs=_GUSTS
    )
    gust_seed: int = parameter(
        1,
        "Seed of the noise; equal seeds give equal noise.",
        minimum=0,
        maximum=2**31 - 1,
        needs=_GUSTS,
    )
    root_linear_inertia: float = parameter(
        1.0,
        "Fraction of the root's translation that the cloth feels. 1: simulation in the world; "
        "0: simulation relative to the body, as in Sun et al. 2007.",
        minimum=0.0,
        maximum=1.0,
    )
    root_angular_inertia: float = parameter(
        1.0,
        "Fraction of the root's rotation that the cloth feels; see root_linear_inertia.",
        minimum=0.0,
        maximum=1.0,
    )

    @property
    def blows(self) -> bool:
        """Whether air acts on cloth that is at rest."""
        acts = self.wind_drag > 0.0 or self.wind_lift > 0.0
        return acts and (self.gust > 0.0 or any(self.wind))
