"""What threads gain where they share the sweeps over a large garment.

    python bench/threads.py [--sides 71 100 150 300] [--threads 2] [--rounds 15] [--first] [--json]

The cloth of `scaling.py`, wall time, one thread and several in turns: three sweeps over all
springs (`relaxation`), a pass over the edges and one over the hinges (`xpbd`), and whole frames of
both solvers. Figures are medians of ratios of neighbouring runs; `cpu` is processor time with
threads over without. `ceiling` is what the cores can give at best: sweeps done by as many
processes at once, over those done by one. Threads that wait for others that have no core lose more
than they gain: `--first` lets the timed runs go before everything else on the machine.
"""

import argparse
import dataclasses
import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from drape import FRAME
from scaling import SETTINGS, scene

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.geometry import locality
from garment_sim_ros.jit import use_threads
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.solvers import in_parts
from garment_sim_ros.sim.solvers.relaxation.springs import correct_springs
from garment_sim_ros.sim.solvers.xpbd.edges import solve_edges
from garment_sim_ros.sim.solvers.xpbd.hinges import bend
from garment_sim_ros.sim.solvers.xpbd.step import XpbdWorkspace

FALL = 20
Pair = tuple[Callable[[], object], Callable[[], object]]


@contextmanager
def ahead(first: bool) -> Iterator[None]:
    """Runs all threads of this process before all others, if `first`; only root may."""
    usual = (os.SCHED_OTHER, os.sched_param(0))
    for policy, rank in ((os.SCHED_FIFO, os.sched_param(1)), usual):
        if first:
            for thread in os.listdir("/proc/self/task"):
                os.sched_setscheduler(int(thread), policy, rank)
        if policy != os.SCHED_OTHER:
            yield


def passes(model: ClothModel) -> dict[str, Pair]:
    """Sweeps on one thread and on several."""
    x = model.rest.astype(np.float32)
    flat, v, springs = x.reshape(-1), np.zeros_like(x), model.springs
    workspace = XpbdWorkspace.room_for(model, 0)
    workspace.prepare(model, FRAME / 10, 0.0, 10)
    ready, parts = workspace.prepared, workspace.parts
    of_springs = (flat, springs.particles, springs.rest_length, springs.share)
    of_edges = (flat, ready.edge_particles, ready.edges)
    of_hinges = (x, v, ready.hinge_particles, ready.hinges, np.float32(FRAME))
    return {
        "springs": (
            lambda: correct_springs(*of_springs, 3),
            lambda: in_parts.correct_springs_in_parts(*of_springs, springs.part_start, 3),
        ),
        "edges": (
            lambda: solve_edges(*of_edges),
            lambda: in_parts.solve_edges_in_parts(*of_edges, parts.edges),
        ),
        "hinges": (
            lambda: bend(*of_hinges),
            lambda: in_parts.bend_in_parts(*of_hinges, parts.hinges),
        ),
    }


def frames(solver: str, side: int, threads: int) -> Pair:
    """Frames on one thread and on several, of a cloth that lies on the sphere."""
    still = ColliderPoses.identity(2)
    both = [scene(solver, side) for _ in range(2)]
    settings = dataclasses.replace(SETTINGS[solver][0], threads=threads)
    both[1].parameters = dataclasses.replace(both[1].parameters, settings=settings)
    for one in both:
        for _ in range(FALL):
            one.advance(still, still, FRAME)
    alone, shared = (one.state("cloth").x for one in both)
    assert np.array_equal(alone, shared), "threads change the result"
    return tuple(lambda one=one: one.advance(still, still, FRAME) for one in both)  # type: ignore


def compared(pair: Pair, rounds: int, first: bool) -> dict[str, float]:
    """Wall time of both in turns; then processor time of each.

    That of the caller alone where it works alone: others still spin for a while when they idle.
    """
    wall, cpu = np.zeros((rounds, 2)), np.zeros(2)
    for run in pair:
        run()
    with ahead(first):
        for row in wall:
            for k, run in enumerate(pair):
                begin = time.perf_counter()
                run()
                row[k] = time.perf_counter() - begin
        for k, clock in enumerate((time.thread_time, time.process_time)):
            begin = clock()
            for _ in range(rounds):
                pair[k]()
            cpu[k] = clock() - begin
    return {
        "ms": round(1e3 * float(np.median(wall[:, 0])), 3),
        "gain": round(float(np.median(wall[:, 0] / wall[:, 1])), 2),
        "cpu": round(float(cpu[1] / cpu[0]), 2),
    }


def ceiling(model: ClothModel, processes: int, rounds: int, first: bool) -> float:
    """Median of sweeps done by several processes at once over those done by one."""
    run, _ = passes(model)["springs"]
    run()

    def done(count: int) -> int:
        """Sweeps that so many processes do in 0.1 s each."""
        ends = []
        for core in range(count):
            receive, send = os.pipe()
            if not os.fork():
                os.sched_setaffinity(0, {sorted(os.sched_getaffinity(0))[core]})
                sweeps, begin = 0, time.perf_counter()
                while time.perf_counter() - begin < 0.1:
                    run()
                    sweeps += 1
                os.write(send, str(sweeps).encode())
                os._exit(0)
            os.close(send)
            ends.append(receive)
        total = 0
        for end in ends:
            total += int(os.read(end, 20))
            os.close(end)
            os.wait()
        return total

    with ahead(first):
        return round(float(np.median([done(processes) / done(1) for _ in range(rounds)])), 2)


def main() -> None:
    """Measures all sizes."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sides", type=int, nargs="+", default=[71, 100, 150, 300])
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--first", action="store_true", help="before all other processes (root)")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    locality.SPLIT_FROM = min(options.sides) ** 2
    models = {side: scene("relaxation", side).model("cloth") for side in options.sides}
    # Before any thread is started: processes that have some do not fork well.
    table: dict[str, dict[str, object]] = {
        str(side**2): {"ceiling": ceiling(model, options.threads, options.rounds, options.first)}
        for side, model in models.items()
    }
    use_threads(options.threads)
    for side, model in models.items():
        pairs = passes(model)
        for solver in SETTINGS:
            pairs[f"{solver} frame"] = frames(solver, side, options.threads)
        for name, pair in pairs.items():
            rounds = options.rounds * (1 if "frame" in name else 4)
            table[str(side**2)][name] = compared(pair, rounds, options.first)
        if not options.json:
            print(side**2, table[str(side**2)], flush=True)
    if options.json:
        print(json.dumps(table))


if __name__ == "__main__":
    main()
