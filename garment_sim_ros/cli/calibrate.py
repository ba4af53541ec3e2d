"""`tradeoff --calibrate`: this machine's own front, for the preset `auto` and `info`."""

from typing import Any

from garment_sim_ros.cli.progress import progress
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.sim.auto.levels import LEVELS, with_costs
from garment_sim_ros.sim.auto.own_front import FOLDER, keep_front
from garment_sim_ros.tradeoff.calibration import calibrate
from garment_sim_ros.tradeoff.table import machine


def run_calibration() -> dict[str, Any]:
    """Measure, keep, tell.

    Raises:
        GarmentSimError: It cannot be kept.
    """
    cost, stretch = calibrate(progress=progress)
    taken = {level.name: level.cost for level in with_costs(cost.tolist())}
    if not keep_front(cost):
        raise GarmentSimError(
            f"{FOLDER}: the user's cache folder cannot be written; allowed: another one by "
            "XDG_CACHE_HOME"
        )
    rows = [
        {
            "level": level.name,
            "sub_steps": level.sub_steps,
            "searches": level.sub_steps // level.search_every,
            "detail": level.detail,
            "ms": round(float(ms), 3),
            "of_balanced": round(taken[level.name], 3) if level.name in taken else None,
            "strain_p95": round(float(strain), 4),
        }
        for level, ms, strain in zip(LEVELS, cost, stretch)
    ]
    print("level            vertices  sub-steps     ms  of balanced  stretch p95")
    for level, ms, strain in zip(LEVELS, cost, stretch):
        told = f"{taken[level.name]:.2f}" if level.name in taken else "not on the front"
        percent = f"{100.0 * strain:.1f} %"
        size = f"{level.detail:>8.0%} {level.sub_steps:>10}"
        print(f"{level.name:<16} {size} {ms:>6.2f} {told:>12} {percent:>12}")
    return {"machine": machine(1), "levels": rows}
