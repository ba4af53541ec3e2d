"""Where the time of a frame goes: the default outfit on the walking mannequin, phase by phase.

    python bench/phases.py [--seconds 6] [--outfit tshirt_short_skirt] [--paced] [--json]

Processor time of the thread, medians over the frames [ms]. ``--paced`` waits for the next sixtieth
of a second before each frame, as a node does; without it frames follow each other. What a phase
holds that is a line of its own is counted in both.
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
from garment_sim_ros.sim import loop
from garment_sim_ros.sim import simulation as steps
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.holds.pins import Pins
from garment_sim_ros.sim.layers.pair import LayerPair
from garment_sim_ros.sim.solvers.xpbd import step as solver

RATE, SKIPPED = 60.0, 30
KERNELS = {
    "begin": "begin",
    "solve": "sub-steps",
    "meet": "search",
    "guard": "guard",
    "stop": "velocities after it",
}
"""What those of `xpbd` do."""
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
        name = f"kernel: {KERNELS[kernel.py_func.__name__]}"
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


def main() -> None:
    """Walks and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--outfit", default="tshirt_short_skirt")
    parser.add_argument("--paced", action="store_true", help="frames at 60 Hz")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    measure()
    avatar = gs.Avatar.load("mannequin")
    simulation = gs.Simulation(avatar.dress(options.outfit), avatar.colliders)
    poses = iter(avatar.play("walk", rate=RATE, seconds=options.seconds))
    for _ in range(SKIPPED):
        simulation.step(next(poses), dt=1 / RATE)
    spent.clear()
    simulation.step = timed("frame", simulation.step)  # type: ignore[method-assign]
    following = timed("pose", lambda: next(poses, None))
    frames = []
    begin = time.monotonic()
    while (pose := following()) is not None:
        if options.paced:
            time.sleep(max(0.0, begin + len(frames) / RATE - time.monotonic()))
        simulation.step(pose, dt=1 / RATE)
        frames.append(dict(spent))
        spent.clear()
    names = {name for frame in frames for name in frame}
    found = {name: 1e3 * float(np.median([f.get(name, 0.0) for f in frames])) for name in names}
    if options.json:
        print(json.dumps(found))
        return
    for name, ms in sorted(found.items(), key=lambda item: -item[1]):
        print(f"{name:24} {ms:7.3f} ms")


if __name__ == "__main__":
    main()
