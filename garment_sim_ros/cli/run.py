"""`run`: avatars whose nodes share one process."""

import argparse
import json
import math
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from garment_sim_ros.cli.avatar_options import add_avatar_options, check_files, node_parameters
from garment_sim_ros.cli.interrupts import interrupts_held, interrupts_kept
from garment_sim_ros.errors import GarmentSimError, ParameterError

if TYPE_CHECKING:
    from garment_sim_ros.ros.one_process import OneProcess

EXAMPLE = "garment-sim run --avatars 4 --preset fast --seconds 20"

_MOST = 100
_LOOK = 0.05  # [s]
_START_LIMIT = 180.0  # for the first cloth of all avatars, where the time is limited [s]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add_avatar_options(parser)
    add("--avatars", metavar="N", type=int, default=1, help="how many (default: 1)")
    add(
        "--namespace",
        metavar="NS",
        default="",
        help="of the avatar; several are NS/avatar_1, NS/avatar_2, ... (default: none)",
    )
    add(
        "--humans",
        action="store_true",
        help="dress bodies that come and go as /humans/bodies/<id>/joint_states, without a clip",
    )
    add("--seconds", metavar="S", type=float, help="end after so long; default: at Ctrl-C")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the avatars, then print how they ran."""
    if not 1 <= args.avatars <= _MOST:
        raise ParameterError("--avatars", f"found {args.avatars}", f"allowed: 1 to {_MOST}")
    if args.humans and (args.avatars != 1 or args.namespace):
        raise ParameterError(
            "--humans",
            "found with --avatars or --namespace",
            "allowed: without them, as each body has its own namespace",
        )
    if args.seconds is not None and not 0.0 < args.seconds <= 1e9:
        raise ParameterError("--seconds", f"found {args.seconds:g}", "allowed: above 0, to 1e9")
    check_files(args)
    nodes = node_parameters(args)
    if args.humans or not args.clip:
        del nodes["mocap_player"]
    try:
        with interrupts_held():  # an import that is cut short looks like one that fails
            from garment_sim_ros.ros.bodies import Bodies
            from garment_sim_ros.ros.one_process import OneProcess
    except ImportError as error:
        raise GarmentSimError(
            f"rclpy: {error}; source ROS 2 or pip install 'garment_sim_ros[ros]'"
        ) from None
    with interrupts_kept() as check, OneProcess() as process:
        if args.humans:
            with Bodies(process, nodes, _MOST, _warn) as bodies:
                return _watch(args, process, check, bodies.look)
        for namespace in _namespaces(args.namespace, args.avatars):
            process.add(namespace, nodes)
        return _watch(args, process, check, lambda: None)


def _warn(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _namespaces(base: str, count: int) -> list[str]:
    """One for each avatar."""
    base = base.strip("/")
    if count == 1:
        return [f"/{base}" if base else ""]
    return [f"/{base}/avatar_{i + 1}" if base else f"/avatar_{i + 1}" for i in range(count)]


def _watch(
    args: argparse.Namespace,
    process: "OneProcess",
    check: Callable[[], None],
    look: Callable[[], None],
) -> dict[str, Any]:
    """Until the time is up, or Ctrl-C; prints how they ran.

    Time counts from when all are dressed, where a clip is played.
    """
    is_dressed = False
    began, plays = time.monotonic(), bool(args.clip) and not args.humans
    seconds = math.inf if args.seconds is None else args.seconds
    try:
        while True:
            time.sleep(_LOOK)
            check()
            process.check()
            look()
            passed = time.monotonic() - began
            if not is_dressed and process.is_dressed:
                process.measure()
                is_dressed, began = True, time.monotonic()
            elif passed >= seconds and (is_dressed or not plays):
                break
            elif passed >= max(seconds, _START_LIMIT) and not is_dressed:
                raise GarmentSimError(f"no cloth after {passed:.0f} s; the nodes have said why")
    except KeyboardInterrupt:
        figures = process.figures()
        print(json.dumps(figures) if args.json else _table(figures), flush=True)
        raise
    figures = process.figures()
    if not args.json:
        print(_table(figures))
    return figures


def _table(figures: dict[str, Any]) -> str:
    """What people read."""
    lines = [
        f"{name}: {a['rate_hz']:.2f} Hz, {a['late_frames']} of {a['due_frames']} frames late, "
        f"latency {a['latency_ms_median']:.1f} ms (p95 {a['latency_ms_p95']:.1f} ms)"
        for name, a in figures["avatars"].items()
    ]
    share = figures["processor_percent"]
    return "\n".join([*lines, f"{share:.0f} % of a core in {figures['seconds']:.0f} s"])
