"""What single precision changes: the cloth of `drape.py` with all of the state in float64.

    python bench/precision.py [--side 30] [--frames 60] [--json]

Once it falls on the sphere, once it hangs by one side, swings down from level, and comes to rest.

The same kernels, compiled for float64 arrays, run the same steps; constants in them stay float32.
Distances between the two, in micrometres, in the course of the fall and at the end, against the
distance that a start moved by half a unit in the last place of float32 makes: contact and folds
amplify any difference.
"""

import argparse
import itertools
import json
from typing import Any

import drape
import numpy as np
import scaling

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.sim.simulation import Simulation


def doubled(value: Any) -> Any:
    """The same with float64 arrays in the place of float32 ones, named tuples included."""
    if isinstance(value, np.ndarray) and value.dtype == np.float32:
        return value.astype(np.float64)
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*(doubled(part) for part in value))
    return value


def in_double(simulation: Simulation) -> None:
    """Replaces all arrays of the cloth, in place; contacts keep single precision scratch."""
    worn = simulation["cloth"].worn
    for part in (worn.model, worn.model.springs, worn.state, worn.good, worn.workspace):
        for name, value in vars(part).items():
            object.__setattr__(part, name, doubled(value))


def main() -> None:
    """Runs both solvers."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--side", type=int, default=30)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    still = ColliderPoses.identity(2)
    table: dict[str, dict[str, float]] = {}
    for solver, hung in itertools.product(scaling.SETTINGS, (False, True)):
        still.position[1, 2] = 100.0 if hung else 0.0
        given = solver, options.side, options.side if hung else 0
        single, moved, double = (scaling.scene(*given) for _ in range(3))
        in_double(double)
        x = moved.state("cloth").x
        x[:] = np.nextafter(x, np.float32(np.inf))
        figures = {}
        for frame in range(1, options.frames + 1):
            for one in (single, double, moved):
                one.advance(still, still, drape.FRAME)
            if frame in (5, 10, 20, 60, options.frames):
                exact = double.state("cloth").x
                for name, one in (("single", single), ("moved", moved)):
                    reference = exact if name == "single" else single.state("cloth").x
                    off = 1e6 * np.linalg.norm(one.state("cloth").x - reference, axis=1)
                    figures[f"{name}_{frame}_median_um"] = round(float(np.median(off)), 3)
                    figures[f"{name}_{frame}_max_um"] = round(float(off.max()), 2)
        name = f"{solver}, {'hung' if hung else 'on the sphere'}"
        table[name] = figures
        if not options.json:
            print(f"{name}: " + ", ".join(f"{k} {v}" for k, v in figures.items()), flush=True)
    if options.json:
        print(json.dumps(table))


if __name__ == "__main__":
    main()
