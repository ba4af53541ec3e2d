"""Fig. 8 of Sun et al. 2007: 2,500 particles fall on a model within its simplified hull.

    python bench/falling.py [--frames 240] [--contact union|rays] [--json]

A cloth of 50 x 50 particles, 1 m x 1 m, from 3 cm above the lying model of
`tradeoff/waisted_limb.py` (508 triangles, hull simplified from 224 to at most 116 faces with delta
0.005); `relaxation` with three sweeps, fixed steps of 1/180 s, one thread, processor time; F is
three plain C sweeps over its springs, timed between the frames. The paper: 68 steps per second,
17 % of them for collision, which is here contact and the swept test before it. Penetration is how
deep particles, middles of edges and of triangles are in the model's own hull, without delta and
thickness, at the end of every frame from the first contact on.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.constants import USUAL_STEP
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import Material
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers.relaxation import step as relaxation
from garment_sim_ros.tradeoff.waisted_limb import lying_hulls

sys.path.insert(0, str(Path(__file__).parent))
from drape import Unit
from springs import grid

STEP = USUAL_STEP
FRAME = 3 * STEP


def fall(frames: int, contact: str = "union") -> dict[str, Any]:
    """Let it fall and measure; with the contact "rays" all of it is as printed."""
    printed = contact == "rays"
    inner, hull = lying_hulls(printed=printed)
    vertices, triangles = grid(50)
    top = float(hull.vertices[:, 2].max())
    vertices = vertices - [0.5, 0.5, 0.0] + [0.0, 0.0, top + 0.03]
    cloth = Garment.from_mesh(vertices, triangles, material=Material(friction=0.5), bone="bone")
    geometry = {"vertices": hull.vertices, "faces": hull.faces}
    colliders = ColliderSet(
        colliders=(
            Collider(name="frame_bone", kind="frame", bone="bone"),
            Collider(name="hull", kind="hull", bone="bone", geometry=geometry),
        )
    )
    simulation = Simulation(
        (cloth,),
        colliders,
        solver="relaxation",
        solver_step=STEP,
        contact=contact,
        extras=not printed,
    )
    still = ColliderPoses.identity(2)
    edges = mesh_topology(triangles).edges
    passes = (relaxation.sweep, relaxation.collide, relaxation.meet_rays)
    spent = [0.0]

    def timed(collide: Callable[..., Any]) -> Callable[..., Any]:
        def measured(*given: Any) -> Any:
            begin = time.thread_time()
            result = collide(*given)
            spent[0] += time.thread_time() - begin
            return result

        return measured

    with tempfile.TemporaryDirectory() as folder:
        unit = Unit(simulation, folder)
    steps, shares, sweeps, deepest = [], [], [], {"particles": 0.0, "edges": 0.0, "triangles": 0.0}
    touched, most = False, 0
    simulation.reset(still, settle=not printed)  # without friction it slides off
    simulation.advance(still, still, FRAME)  # compiles
    for measured in range(frames):
        # Timing the inner calls costs time of its own: every other frame goes without.
        timed_or_not = tuple(map(timed, passes)) if measured % 2 else passes
        relaxation.sweep, relaxation.collide, relaxation.meet_rays = timed_or_not
        spent[0] = 0.0
        begin = time.thread_time()
        simulation.advance(still, still, FRAME)
        took = time.thread_time() - begin
        p = simulation.positions("cloth").astype(np.float64)
        near = hull.height(p) < cloth.material.thickness + 1e-3
        touched = bool(near.any()) or (touched and not printed)
        if not touched:
            continue
        most = max(most, int(near.sum()))
        if measured % 2:
            shares.append(spent[0] / took)
        else:
            steps.append(took / 3)
            sweeps.append(unit.measure(3))
        for name, corners in (("particles", p[:, None]), ("edges", p[edges])):
            depth = -1e3 * float(inner.height(corners.mean(axis=1)).min())
            deepest[name] = max(deepest[name], depth)
        depth = -1e3 * float(inner.height(p[triangles].mean(axis=1)).min())
        deepest["triangles"] = max(deepest["triangles"], depth)
    relaxation.sweep, relaxation.collide, relaxation.meet_rays = passes
    return {
        "model_faces": len(inner.faces),
        "hull_faces": len(hull.faces),
        "particles": len(vertices),
        "touching": most if printed else int(near.sum()),
        "steps_per_second": round(1.0 / float(np.median(steps))),
        "step_in_F": round(float(np.median(np.divide(steps, sweeps))), 2),
        "F_us": round(1e6 * float(np.median(sweeps)), 1),
        "collision_share": round(float(np.median(shares)), 4),
        "penetration_mm": {name: round(depth, 3) for name, depth in deepest.items()},
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--frames", type=int, default=240)
    parser.add_argument("--contact", choices=("union", "rays"), default="union")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    figures = fall(options.frames, options.contact)
    if options.json:
        print(json.dumps(figures))
        return
    for name, value in figures.items():
        print(f"{name}: {value}")


if __name__ == "__main__":
    main()
