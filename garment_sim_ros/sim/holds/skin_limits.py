"""Limits that a garment may ask for by name, in the order in which they act.

A new one is a `SkinLimit` in a file beside this one, and a line here: outfit files, garments, the
account of a simulation and the warm-up take it from this table.
"""

from collections.abc import Mapping
from types import MappingProxyType

from garment_sim_ros.sim.holds.backstop import Backstop
from garment_sim_ros.sim.holds.constraint import SkinLimit
from garment_sim_ros.sim.holds.distance_limit import DistanceLimit

SKIN_LIMITS: Mapping[str, type[SkinLimit]] = MappingProxyType(
    {"max_distance": DistanceLimit, "backstop": Backstop}
)
