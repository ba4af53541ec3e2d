"""What tethers do for a long skirt on a walking body, at few sweeps.

    python bench/tethers.py [--seconds 3] [--colliders capsules] [--json]

Each setting with and without, in turns; processor time per frame, its median. Stretch over all
edges, and of the length from the waist to the hem: straight distance over the way on the cloth at
rest; penetration into the walking skin, all taken 10 times a second after the first
second; speed after 2 s of standing still.
"""

import argparse
import dataclasses
import itertools
import json
import time
from typing import Any

import numpy as np
from tradeoff import EVERY, FRAME, Walk

from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.params import ColliderOptions, RelaxationSettings, XpbdSettings
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh
from garment_sim_ros.sim.holds.attaching import nearest_pins
from garment_sim_ros.sim.simulation import Simulation

STRETCH = 0.02
SETTINGS: dict[str, tuple[str, Any]] = {
    **{f"relaxation, {n} sweeps": ("relaxation", RelaxationSettings(sweeps=n)) for n in (1, 2, 3)},
    **{
        f"xpbd, {n} sub-steps": ("xpbd", XpbdSettings(sub_step=FRAME / n, search_every=2))
        for n in (6, 12)
    },
}


def run(walk: Walk, colliders: Any, garment: Any, solver: str, settings: Any) -> dict[str, float]:
    """Walks with and without tethers."""
    path = walk.poses(colliders)
    pair = []
    for tether in (None, STRETCH):
        worn = dataclasses.replace(garment, tethers=tether)
        simulation = Simulation(
            (worn,), colliders, solver=solver, settings=settings, solver_step=FRAME / 3
        )
        simulation.reset(path[0])
        mesh = {garment.name: GarmentMesh.of(garment)}
        meter = ClothMeter(walk.body.skin.vertices, walk.body.skin.triangles, mesh)
        pair.append((simulation, meter, [], [], []))
    model = simulation.model(garment.name)
    pin, length = nearest_pins(model)
    hem = np.flatnonzero(length[:, 0] > 0.95 * length[:, 0].max())
    for frame, (start, end) in enumerate(itertools.pairwise(path), start=1):
        for simulation, meter, times, hung, held in pair:
            begin = time.thread_time()
            simulation.advance(start, end, FRAME)
            times.append(time.thread_time() - begin)
            if frame in walk.skins:
                x = simulation.state(garment.name).x
                hung.append(np.linalg.norm(x[hem] - x[pin[hem, 0]], axis=1) / length[hem, 0])
                held.append(simulation.health(garment.name).held)
                points = {garment.name: simulation.positions(garment.name).astype(float)}
                meter.add(walk.skins[frame], points)
    result = {}
    for name, (simulation, meter, times, hung, held) in zip(("without", "with"), pair):
        for _ in range(120):
            simulation.advance(path[-1], path[-1], FRAME)
        figures = meter.result()
        result |= {
            f"{name}_ms": round(1e3 * float(np.median(times)), 3),
            f"{name}_stretch_p95_percent": round(100 * figures["strain_p95"], 2),
            f"{name}_hem_percent": round(100 * (float(np.mean(hung)) - 1.0), 2),
            f"{name}_hem_max_percent": round(100 * (float(np.max(hung)) - 1.0), 2),
            f"{name}_penetration_mm_p99": figures["penetration_mm_p99"],
            f"{name}_rest_mm_s": round(1e3 * simulation.health(garment.name).rms_speed, 1),
            f"{name}_held": round(float(np.mean(held))),
        }
    ratio = np.median(np.array(pair[1][2]) / np.array(pair[0][2]))
    return result | {"cost_percent": round(100 * (float(ratio) - 1.0), 1)}


def main() -> None:
    """Runs every setting."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--colliders", default="capsules")
    parser.add_argument("--only", default="", help="settings whose name holds this text")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    walk = Walk("mannequin", "walk", options.seconds)
    assert EVERY
    colliders = fit_colliders(walk.body, ColliderOptions(method=options.colliders))
    outfit = load_outfit("tshirt_long_skirt", walk.body, colliders=colliders)
    garment = next(g for g in outfit.garments if "skirt" in g.name)
    table = {}
    for name, (solver, settings) in SETTINGS.items():
        if options.only in name:
            table[name] = figures = run(walk, colliders, garment, solver, settings)
            if not options.json:
                print(f"{name}: " + ", ".join(f"{k} {v}" for k, v in figures.items()), flush=True)
    if options.json:
        print(json.dumps(table))


if __name__ == "__main__":
    main()
