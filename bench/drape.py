"""A cloth of 1 m x 1 m falls on a sphere: cost, stretch, rest and penetration.

    python bench/drape.py [--solver xpbd] [--sub-steps 16 32 64] [--search-every 8] [--json]
    python bench/drape.py --solver implicit --sub-steps 1 2 --iterations 8
    python bench/drape.py --pinned 0.0667 --sub-steps 80 160 [--tethers 0]

50 x 50 vertices, 0.2 kg/m^2, friction 0.3, from 0.05 m above a fixed sphere of radius 0.3 m, 180
frames of 1/60 s, one thread. F is the time of three sweeps of plain C over the cloth's 14,406
springs, measured in turns with the frames of each run; both in processor time. Cost is the median
of what each frame takes over F there and then, so that other work on the machine changes it
little. Stretch is the excess length of mesh edges at the end; speed is the highest RMS over the
last 10 frames. With `--pinned` the same cloth hangs by two corners instead, for 60 frames of the
length given.
"""

import argparse
import ctypes
import dataclasses
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import ImplicitSettings, Material, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

sys.path.insert(0, str(Path(__file__).parent))
from springs import compiled, grid

FRAME = 1 / 60
FRAMES = 180
RADIUS = 0.3
MATERIAL = Material(
    areal_density=0.2,
    stretch_stiffness_warp=2000.0,
    stretch_stiffness_weft=2000.0,
    shear_stiffness=500.0,
    bending_stiffness=1e-5,
    damping=4.0,
    friction=0.3,
)
"""A stiff weave. Damping as of air: falling flat it reaches 2.5 m/s (1.8 m/s by drag)."""


def cloth(
    pins: tuple[int, ...] = (),
    tethers: float | None = None,
    damping: float = MATERIAL.damping,
) -> Garment:
    """The cloth, flat, 0.05 m above the sphere."""
    vertices, triangles = grid(50)
    vertices = vertices - 0.5 * np.array([1.0, 1.0, 0.0]) + np.array([0.0, 0.0, RADIUS + 0.05])
    return Garment.from_mesh(
        vertices,
        triangles,
        material=dataclasses.replace(MATERIAL, damping=damping),
        pins=pins,
        bone="bone",
        tethers=tethers,
    )


class Unit:
    """F: three C sweeps over all springs of the cloth."""

    def __init__(self, simulation: Simulation, folder: str, name: str = "cloth") -> None:
        springs = simulation.model(name).springs
        self.x = simulation.state(name).x.copy()
        self.arrays = (self.x, springs.particles, springs.rest_length, springs.share)
        self.count = len(springs)
        self.library = compiled(folder)

    def measure(self, rounds: int = 40) -> float:
        """Median time [s]."""
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in self.arrays]
        times = []
        for _ in range(rounds):
            start = time.thread_time()
            self.library.correct_springs(*pointers, ctypes.c_int64(self.count), ctypes.c_int64(3))
            times.append(time.thread_time() - start)
        return float(np.median(times))


def run(
    solver: str,
    settings: object,
    solver_step: float,
    folder: str,
    frame: float,
    pinned: bool,
    tethers: float | None = None,
    damping: float = MATERIAL.damping,
) -> dict[str, float]:
    """One drape and its figures."""
    ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": RADIUS})
    colliders = ColliderSet(
        colliders=(Collider(name="frame_bone", kind="frame", bone="bone"), ball)
    )
    simulation = Simulation(
        (cloth((0, 49) if pinned else (), tethers, damping),),
        colliders,
        solver=solver,
        settings=settings,  # type: ignore[arg-type]
        solver_step=solver_step,
    )
    still = ColliderPoses.identity(2)
    if pinned:
        still.position[1, 2] = 100.0
    unit = Unit(simulation, folder)
    unit.measure()
    times, units, speeds = [], [], []
    for _ in range(60 if pinned else FRAMES):
        units.append(unit.measure(3))
        start = time.thread_time()
        simulation.advance(still, still, frame)
        times.append(time.thread_time() - start)
        speeds.append(simulation.health("cloth").rms_speed)
    cost = np.array(times) / units
    x = simulation["cloth"].simulated.astype(np.float64)
    rest, triangles = simulation.model("cloth").rest, simulation.model("cloth").triangles
    edges = mesh_topology(triangles).edges
    vertex = simulation.model("cloth").vertex
    flat = np.empty_like(rest)
    flat[vertex] = rest
    stretch = (
        np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)
        / np.linalg.norm(flat[edges[:, 0]] - flat[edges[:, 1]], axis=1)
        - 1.0
    )
    deepest = min(
        float(np.linalg.norm(x, axis=1).min()),
        float(np.linalg.norm(x[triangles].mean(axis=1), axis=1).min()),
    )
    return {
        "F_ms": round(1e3 * float(np.median(units)), 4),
        "cost_F": round(float(np.median(cost)), 2),
        "cost_F_mean": round(float(np.mean(cost[1:])), 2),
        "cost_F_p10": round(float(np.percentile(cost, 10)), 2),
        "cost_F_p90": round(float(np.percentile(cost, 90)), 2),
        "stretch_p95_percent": round(100 * float(np.percentile(stretch, 95)), 3),
        "stretch_max_percent": round(100 * float(stretch.max()), 2),
        "compression_p95_percent": round(-100 * float(np.percentile(stretch, 5)), 2),
        "rest_speed_mm_s": round(1e3 * max(speeds[-10:]), 2),
        "penetration_mm": 0.0 if pinned else round(1e3 * max(0.0, RADIUS - deepest), 3),
        "lowest_m": round(float(x[:, 2].min()), 3),
    }


def main() -> None:
    """Runs the drape with several numbers of sub-steps."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--solver", default="xpbd", choices=("xpbd", "implicit", "relaxation"))
    parser.add_argument("--sub-steps", type=int, nargs="+", default=[12, 16, 32, 64])
    parser.add_argument("--iterations", type=int, default=1, help="passes or sweeps in each")
    parser.add_argument("--search-every", type=int, default=4)
    parser.add_argument("--coarse", action="store_true", help="with the coarse level of `xpbd`")
    parser.add_argument("--pinned", type=float, help="hang it by two corners; frame [s]")
    parser.add_argument("--tethers", type=float, help="with tethers that stretch by this part")
    parser.add_argument("--damping", type=float, default=MATERIAL.damping, help="[1/s]")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    figures = {}
    frame = options.pinned or FRAME
    with tempfile.TemporaryDirectory() as folder:
        for n in options.sub_steps:
            if options.solver == "xpbd":
                settings: object = XpbdSettings(
                    sub_step=frame / n,
                    iterations=options.iterations,
                    search_every=min(options.search_every, n),
                    coarse=options.coarse,
                )
                step = frame
            elif options.solver == "implicit":
                settings = ImplicitSettings(sub_step=frame / n, iterations=options.iterations)
                step = frame
            else:
                settings, step = RelaxationSettings(sweeps=options.iterations), frame / n
            figures[n] = run(
                *(options.solver, settings, step, folder, frame),
                pinned=options.pinned is not None,
                tethers=options.tethers,
                damping=options.damping,
            )
            if not options.json:
                print(f"{n} sub-steps: " + ", ".join(f"{k} {v}" for k, v in figures[n].items()))
    if options.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
