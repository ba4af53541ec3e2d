"""What of a garment is simulated where it is not all of it."""

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.sim.detail.coarser import coarser, fewest
from garment_sim_ros.sim.detail.surface import Surface
from garment_sim_ros.sim.placement import GarmentLike

_ROUNDED = 1.2
"""A garment of several parts has a few more vertices than its share."""


def simulated_share(
    given: GarmentLike, detail: float
) -> tuple[GarmentLike, Surface | None, tuple[str, ...]]:
    """What of a garment is simulated, all its vertices over it, and why it is not as asked."""
    if detail >= 1.0:
        return given, None, ()
    if given.stitches is not None:
        return given, None, ("detail: all vertices are simulated: it is being sewn",)
    try:
        made = coarser(given, detail)
    except GeometryError as error:
        return given, None, (f"detail: all vertices are simulated: {error}",)
    if made is None:
        return given, None, ()
    asked, has = fewest(given, detail), len(made[0].vertices)
    more = f"detail: {has} instead of {asked} vertices are simulated: so few cannot tell its shape"
    return (*made, (more,) if has > _ROUNDED * asked else ())
