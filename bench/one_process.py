"""Processor time of avatars: three processes each, and all nodes in one process.

    python bench/one_process.py [--avatars 1 2 4] [--rate 60] [--preset balanced] [--seconds 8]
        [--rounds 3] [--set NODE.PARAM=VALUE ...] [--json]

In turns: the three nodes of `garment-sim demo` as processes, without a recorder, then one process
with each number of avatars. Prints medians and ranges over the rounds, for each avatar. In percent
of one core: all, the solver's part (processor time of its thread while it steps), the rest. In
percent of those that were due: frames that came, of all avatars and of the one with the fewest.
Latency. `c_us` is how fast the machine was, as `bench/springs.py` has it: on a busy machine with
shared cores processor time grows as it does. Frames and latency depend on what else it does.
"""

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import psutil
from springs import machine_us

from garment_sim_ros.cli.avatar_options import node_parameters
from garment_sim_ros.cli.main import parser
from garment_sim_ros.cli.node_processes import NodeProcesses, own_network
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.ros.one_process import OneProcess

_SETTLING = 3.0  # [s]
_in_solver = 0.0


def measure_solver() -> None:
    """Have the processor time of all steppers of this process counted."""
    plain = ClothStepper.advance

    def advance(self: ClothStepper, *given: Any, **named: Any) -> bool:
        global _in_solver
        began = time.thread_time()
        moved = plain(self, *given, **named)
        _in_solver += time.thread_time() - began
        return moved

    ClothStepper.advance = advance  # type: ignore[method-assign]


def three(parameters: dict[str, Any], seconds: float) -> dict[str, float]:
    """One avatar as three processes."""
    with tempfile.TemporaryDirectory() as folder, NodeProcesses(Path(folder)) as nodes:
        for name, given in parameters.items():
            nodes.start(name, given)
        children = psutil.Process().children()
        while "vertices" not in nodes._log("cloth_node"):  # it tells its garments
            nodes.check()
            time.sleep(0.1)
        time.sleep(_SETTLING)
        speed = machine_us()
        before, began = [c.cpu_times() for c in children], time.monotonic()
        time.sleep(seconds)
        used = sum(
            sum(c.cpu_times()[:2]) - sum(b[:2]) for c, b in zip(children, before, strict=True)
        )
        share = 100.0 * used / (time.monotonic() - began)
        return {"all": share, "c_us": 0.5 * (speed + machine_us())}


def one(parameters: dict[str, Any], avatars: int, seconds: float) -> dict[str, float]:
    """So many avatars in this process; per avatar."""
    with OneProcess() as process:
        for i in range(avatars):
            process.add(f"/avatar_{i + 1}", parameters)
        while not process.is_dressed:
            process.check()
            time.sleep(0.1)
        time.sleep(_SETTLING)
        speed = machine_us()
        process.measure()
        in_solver = _in_solver
        time.sleep(seconds)
        process.check()
        figures = process.figures()
        solver = 100.0 * (_in_solver - in_solver) / figures["seconds"]
        speed = 0.5 * (speed + machine_us())
    of_each = list(figures["avatars"].values())
    share = figures["processor_percent"]
    return {
        "all": share / avatars,
        "solver": solver / avatars,
        "rest": (share - solver) / avatars,
        "frames": 100.0 * sum(a["frames"] / a["due_frames"] for a in of_each) / avatars,
        "least": 100.0 * min(a["frames"] / a["due_frames"] for a in of_each),
        "latency_ms": statistics.median(a["latency_ms_median"] for a in of_each),
        "c_us": speed,
    }


def in_words(name: str, runs: list[dict[str, float]]) -> str:
    """One line of figures."""
    parts = []
    for key in runs[0]:
        values = [run[key] for run in runs]
        parts.append(
            f"{key} {statistics.median(values):.1f} ({min(values):.1f} to {max(values):.1f})"
        )
    return f"{name}: {', '.join(parts)}"


def main() -> None:
    """Runs and prints."""
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--avatars", nargs="+", type=int, default=[1, 2, 4])
    options.add_argument("--rate", type=float, default=60.0)
    options.add_argument("--preset", default="balanced")
    options.add_argument("--seconds", type=float, default=8.0)
    options.add_argument("--rounds", type=int, default=3)
    options.add_argument("--set", nargs="*", default=[], metavar="NODE.PARAM=VALUE")
    options.add_argument("--json", action="store_true")
    args = options.parse_args()
    os.environ.update(own_network())
    words = ["demo", "--preset", args.preset, "--set", f"cloth_node.rate={args.rate:g}"]
    words += [word for setting in args.set for word in ("--set", setting)]
    parameters = node_parameters(parser("demo").parse_args(words))
    measure_solver()
    found: dict[str, list[dict[str, float]]] = defaultdict(list)
    for _ in range(args.rounds):
        found["three processes"].append(three(parameters, args.seconds))
        for count in args.avatars:
            name = f"{count} in one process, each"
            found[name].append(one(parameters, count, args.seconds))
            print(in_words(name, found[name][-1:]), file=sys.stderr, flush=True)
    for name, runs in found.items():
        print(in_words(name, runs))
    if args.json:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
