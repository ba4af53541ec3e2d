"""What the levels of `auto` cost on this machine, as `garment-sim tradeoff --calibrate` measured.

It is kept in the user's cache, by processor, versions and code: after a change of any of them
the costs that come with the package hold until it is measured again.
"""

import platform
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.disk_cache import code_digest, keep_arrays, kept_arrays
from garment_sim_ros.sim.auto.levels import LEVELS, Level, with_costs
from garment_sim_ros.version import VERSION

FOLDER = "fronts"
_CHEAPEST, _DEAREST = 1e-3, 1e4
"""What a frame may cost [ms]."""
_LARGEST_RATIO = 50.0
"""A front on which one level costs so many times another one is none."""
SHIPPED = "as measured where this package was made; garment-sim tradeoff --calibrate measures here"


class OwnLevels(NamedTuple):
    """The levels with their costs, and where these are from.

    Attributes:
        levels: From cheap to accurate.
        cost: Of each of `LEVELS` on this machine [ms]; None where it was not measured.
        told: Where the costs are from, in words.
    """

    levels: tuple[Level, ...]
    cost: FloatArray | None
    told: str


def own_levels() -> OwnLevels:
    """The levels with this machine's costs where they were measured, else as shipped."""
    try:
        found = kept_arrays(FOLDER, _key())
        if found is None:
            return OwnLevels(LEVELS, None, SHIPPED)
        cost = _checked(found)
    except Exception as error:  # whatever a damaged file makes its readers raise
        return OwnLevels(LEVELS, None, f"the measured front is not used, {error}; {SHIPPED}")
    return OwnLevels(with_costs(cost.tolist()), cost, "as measured on this machine")


def keep_front(cost: FloatArray) -> bool:
    """Keep the costs of all `LEVELS` on this machine [ms]; whether that was possible."""
    return keep_arrays(FOLDER, _key(), {"cost": cost})


def processor() -> str:
    """Its name as Linux has it, or what Python knows."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _checked(found: dict[str, np.ndarray]) -> FloatArray:
    """The costs in a file.

    Raises:
        ValueError: They cannot be.
    """
    if set(found) != {"cost"}:
        raise ValueError("it holds something else")
    cost = found["cost"]
    if cost.shape != (len(LEVELS),) or cost.dtype != np.float64:
        raise ValueError("it holds something else")
    if not (np.isfinite(cost).all() and cost.min() >= _CHEAPEST and cost.max() <= _DEAREST):
        raise ValueError("its costs cannot be")
    if cost.max() > _LARGEST_RATIO * cost.min():
        raise ValueError("its costs are too far apart")
    return cost


@cache
def _key() -> str:
    """What costs depend on."""
    versions = (VERSION, platform.python_version(), np.__version__, numba.__version__)
    levels = repr([(lv.name, lv.sub_steps, lv.search_every, lv.detail) for lv in LEVELS])
    return " ".join([processor(), *versions, code_digest("sim", "contact"), levels])
