"""Where the time of a frame goes: the default outfit on the walking mannequin, phase by phase.

    python bench/phases.py [--seconds 6] [--outfit tshirt_short_skirt] [--paced] [--json]
        [--membrane springs triangles] [--preset fast]

Processor time of the thread, medians over the frames [ms]. ``--paced`` waits for the next sixtieth
of a second before each frame, as a node does; without it frames follow each other. What a phase
holds that is a line of its own is counted in both. With several membranes they take turns, frame
by frame.
"""

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

import garment_sim_ros as gs
from garment_sim_ros.params import PRESETS
from garment_sim_ros.sim import loop
from garment_sim_ros.sim import simulation as steps
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.holds.pins import Pins
from garment_sim_ros.sim.layers.pair import LayerPair
from garment_sim_ros.sim.solvers.xpbd import step as solver
from garment_sim_ros.solver_params import MEMBRANES

RATE, SKIPPED = 60.0, 30
KERNELS = {
    "begin": "begin",
    "solve": "sub-steps",
    "meet": "search",
    "guard": "guard",
    "shorten_longest": "longest edges",
    "stop": "velocities after it",
}
"""What those of `xpbd` do; one that is not listed has its own name."""
spent: Counter[str] = Counter()


def timed(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function; its time is added to `spent`."""

    @wraps(function, assigned=())
    def measured(*given: Any, **named: Any) -> Any:
        began = time.thread_time()
        try:
            return function(*given, **named)
        finally:
            spent[name] += time.thread_time() - began

    return measured


def measure() -> None:
    """Have the phases of all simulations timed that begin from now on."""
    compiled = solver.compiled

    def compiled_and_timed(kernel: Any, *given: Any) -> Callable[..., Any]:
        name = kernel.py_func.__name__
        name = f"kernel: {KERNELS.get(name, name)}"
        return timed(name, compiled(kernel, *given))

    solver.compiled = compiled_and_timed
    for owner, function, name in (
        (steps, "take_step", "all sub-steps"),
        (loop, "_hold", "limits"),
        (LayerPair, "look", "layers: triangles"),
        (LayerPair, "find_close", "layers: what is close"),
        (LayerPair, "separate", "layers: parting"),
        (LayerPair, "untangle", "layers: untangling"),
        (Pins, "follow", "pins"),
        (ColliderState, "move", "colliders"),
    ):
        setattr(owner, function, timed(name, getattr(owner, function)))


def medians(frames: list[Counter[str]]) -> dict[str, float]:
    """Of each phase over frames [ms]."""
    names = {name for frame in frames for name in frame}
    return {n: 1e3 * float(np.median([f.get(n, 0.0) for f in frames])) for n in names}


def main() -> None:
    """Walks and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--outfit", default="tshirt_short_skirt")
    parser.add_argument("--membrane", nargs="+", default=MEMBRANES[:1], choices=MEMBRANES)
    parser.add_argument("--preset", default="balanced", choices=PRESETS)
    parser.add_argument("--paced", action="store_true", help="frames at 60 Hz")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    measure()
    avatar = gs.Avatar.load("mannequin", preset=options.preset)
    outfit = avatar.dress(options.outfit)
    simulations = {
        m: gs.Simulation(outfit, avatar.colliders, preset=options.preset, membrane=m)
        for m in options.membrane
    }
    poses = iter(avatar.play("walk", rate=RATE, seconds=options.seconds))
    for _ in range(SKIPPED):
        pose = next(poses)
        for simulation in simulations.values():
            simulation.step(pose, dt=1 / RATE)
    following = timed("pose", lambda: next(poses, None))
    frames: dict[str, list[Counter[str]]] = {m: [] for m in simulations}
    begin = time.monotonic()
    while True:
        spent.clear()
        pose = following()
        if pose is None:
            break
        posing = spent.copy()
        for membrane, simulation in simulations.items():
            if options.paced:
                count = sum(map(len, frames.values()))
                time.sleep(max(0.0, begin + count / RATE - time.monotonic()))
            spent.clear()
            timed("frame", simulation.step)(pose, dt=1 / RATE)
            frames[membrane].append(posing + spent)
    found = {m: medians(of) for m, of in frames.items()}
    if options.json:
        print(json.dumps(found if len(found) > 1 else found[options.membrane[0]]))
        return
    for name in sorted(found[options.membrane[0]], key=lambda n: -found[options.membrane[0]][n]):
        print(f"{name:24}" + "".join(f" {of.get(name, 0.0):7.3f} ms" for of in found.values()))


if __name__ == "__main__":
    main()
