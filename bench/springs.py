"""Spring correction in numba against the same loop in plain C, in one run.

    python bench/springs.py [--side 50] [--sweeps 3] [--rounds 300] [--json]

The two are timed in turns on the same springs in the same order, from the same positions. Prints
the median of each and the median, 10th and 90th percentile of the ratio of neighbouring runs; then
what a sub-step of `xpbd` takes (of 20 in a step: one pass over the edges, bending every 10,
no colliders) over one sweep of the same cloth. It moves, so that edges are solved as in motion.
"""

import argparse
import ctypes
import json
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.params import Environment, Material, XpbdSettings
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.loop import take_step
from garment_sim_ros.sim.model import ClothModel, Parameters, build_model
from garment_sim_ros.sim.piece import Piece
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.sim.solvers.relaxation.springs import correct_springs
from garment_sim_ros.sim.solvers.xpbd.workspace import XpbdWorkspace
from garment_sim_ros.sim.state import State

COMPILER = ("gcc", "-O3", "-march=x86-64-v3", "-ffast-math", "-shared", "-fPIC")
SOURCE = Path(__file__).with_suffix(".c")


def grid(side: int) -> tuple[np.ndarray, np.ndarray]:
    """A flat cloth of 1 m x 1 m, its quads split one way: vertices and triangles."""
    u = np.linspace(0.0, 1.0, side)
    vertices = np.stack([*np.meshgrid(u, u, indexing="ij"), np.zeros((side, side))], axis=-1)
    index = np.arange(side * side).reshape(side, side)
    a, b, c, d = (
        q.ravel() for q in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    )
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return vertices.reshape(-1, 3), triangles.astype(np.int32)


def compiled(folder: str) -> ctypes.CDLL:
    """The C loop as a shared library in `folder`."""
    library = Path(folder) / "springs.so"
    subprocess.run([*COMPILER, str(SOURCE), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def machine_us(rounds: int = 60) -> float:
    """Processor time of three sweeps of the C loop over the fixed cloth now, median [us].

    How fast the machine is at this moment: figures of processor time are given beside it.
    """
    vertices, triangles = grid(50)
    model = build_model("grid", vertices, triangles, Material())
    springs = model.springs
    x = np.ascontiguousarray(vertices[model.vertex], dtype=np.float32).reshape(-1)
    arrays = (x, springs.particles, springs.rest_length, springs.share)
    times = []
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(folder)
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in arrays]
        for _ in range(rounds):
            start = time.thread_time()
            library.correct_springs(*pointers, ctypes.c_int64(len(springs)), ctypes.c_int64(3))
            times.append(time.thread_time() - start)
    return 1e6 * float(np.median(times))


def sub_step_per_sweep(model: ClothModel, rounds: int, sub_steps: int = 20) -> float:
    """Median time of an `xpbd` sub-step over that of a sweep, timed in turns."""
    state = State.at(model, model.rest[np.argsort(model.vertex)], np.zeros(3))
    workspace = XpbdWorkspace.room_for(model, 0)
    cloth = Piece(model=model, state=state, workspace=workspace)
    colliders = ColliderState.of(ColliderSet(colliders=()))
    settings = XpbdSettings(sub_step=1 / 60 / sub_steps, search_every=10)
    params = Parameters(environment=Environment(), settings=settings)
    springs = model.springs
    arrays = (springs.particles, springs.rest_length, springs.share, springs.colour_start)
    x, wide = state.x.copy().reshape(-1), np.zeros(4 * len(model), np.float32)
    ratio = np.zeros(rounds)
    for n in range(-3, rounds):
        t0 = time.perf_counter()
        take_step(SOLVERS["xpbd"], [cloth], [], colliders, params, 1 / 60)
        t1 = time.perf_counter()
        correct_springs(x, wide, *arrays, sub_steps)
        if n >= 0:
            ratio[n] = (t1 - t0) / (time.perf_counter() - t1)
    return float(np.median(ratio))


def main() -> None:
    """Times both and prints the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--side", type=int, default=50, help="vertices along a side")
    parser.add_argument("--sweeps", type=int, default=3)
    parser.add_argument("--rounds", type=int, default=300)
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()

    vertices, triangles = grid(options.side)
    model = build_model("grid", vertices, triangles, Material())
    springs = model.springs
    shaken = vertices + np.random.default_rng(1).normal(0.0, 0.1 / options.side, vertices.shape)
    start = np.ascontiguousarray(shaken[model.vertex], dtype=np.float32).reshape(-1)
    x, x_c = start.copy(), start.copy()
    arrays = (springs.particles, springs.rest_length, springs.share)
    own = (np.zeros(4 * len(model), np.float32), *arrays, springs.colour_start)

    with tempfile.TemporaryDirectory() as folder:
        library = compiled(folder)
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (x_c, *arrays)]
        counts = [ctypes.c_int64(len(springs)), ctypes.c_int64(options.sweeps)]
        correct_springs(x, *own, options.sweeps)
        library.correct_springs(*pointers, *counts)
        difference = float(np.abs(x - x_c).max())
        times = np.zeros((options.rounds, 2))
        for row in times:
            np.copyto(x, start)
            t0 = time.perf_counter()
            correct_springs(x, *own, options.sweeps)
            t1 = time.perf_counter()
            np.copyto(x_c, start)
            t2 = time.perf_counter()
            library.correct_springs(*pointers, *counts)
            row[:] = t1 - t0, time.perf_counter() - t2

    ratio = times[:, 0] / times[:, 1]
    figures = {
        "edges": len(springs) - springs.bending,
        "bending_springs": springs.bending,
        "colours": len(springs.colour_start) - 1,
        "sweeps": options.sweeps,
        "numba_us": round(float(np.median(times[:, 0])) * 1e6, 1),
        "c_us": round(float(np.median(times[:, 1])) * 1e6, 1),
        "ratio": round(float(np.median(ratio)), 3),
        "ratio_p10": round(float(np.percentile(ratio, 10)), 3),
        "ratio_p90": round(float(np.percentile(ratio, 90)), 3),
        "largest_difference_m": difference,
        "sub_step_per_sweep": round(sub_step_per_sweep(model, options.rounds // 10), 2),
    }
    print(
        json.dumps(figures) if options.json else "\n".join(f"{k}: {v}" for k, v in figures.items())
    )


if __name__ == "__main__":
    main()
