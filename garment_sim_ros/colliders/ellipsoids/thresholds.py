"""The regions of a human surface by name, and how closely ellipsoids are to fit each."""

from garment_sim_ros.collider_params import EllipsoidSettings
from garment_sim_ros.errors import ParameterError

SIDES = ("left", "right")
REGIONS: tuple[str, ...] = (
    "head",
    *(f"{side}_{part}" for part in ("upper_arm", "forearm", "thigh", "calf") for side in SIDES),
    *(f"{side}_{part}" for part in ("chest", "waist", "hip") for side in SIDES),
)
"""The 15 regions; hands belong to forearms, feet to calves, the neck to the head."""
TORSO: tuple[int, ...] = tuple(range(9, 15))
"""Indices of the torso's six regions."""
_LEAST, _MOST = 1e-6, 1.0


def parse_thresholds(text: str) -> dict[str, float]:
    """Fit errors [m] by region, from ``REGION=M`` separated by spaces.

    Raises:
        ParameterError: An unknown region, or no length.
    """
    result = {}
    for word in text.split():
        region, _, value = word.partition("=")
        if region not in REGIONS:
            raise ParameterError(
                "mu", f"found the region {region[:60]!r}", f"allowed: {', '.join(REGIONS)}"
            )
        try:
            mu = float(value)
        except ValueError:
            mu = -1.0
        if not _LEAST <= mu <= _MOST:
            raise ParameterError(
                "mu", f"found {word[:60]!r}", f"allowed: REGION=M, from {_LEAST:g} to {_MOST:g} m"
            )
        result[region] = mu
    return result


def region_thresholds(settings: EllipsoidSettings) -> dict[str, float]:
    """Fit error above which an ellipsoid is split [m], of every region.

    Raises:
        ParameterError: `mu` names an unknown region, or no length.
    """
    s = settings
    result = {name: s.mu_torso if i in TORSO else s.mu_limb for i, name in enumerate(REGIONS)}
    return result | parse_thresholds(s.mu)


def tightest(texts: list[str]) -> str:
    """Several `mu` as one: the smallest that any of them gives for a region.

    Raises:
        ParameterError: As `parse_thresholds`.
    """
    result: dict[str, float] = {}
    for text in texts:
        for region, mu in parse_thresholds(text).items():
            result[region] = min(mu, result.get(region, mu))
    return " ".join(f"{region}={mu:g}" for region, mu in result.items())
