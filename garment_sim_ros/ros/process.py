"""How a node's process begins and ends."""

import faulthandler
import gc
import os
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn

from garment_sim_ros.ending import end_process
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.nodes import NODES, version
from garment_sim_ros.ros.arguments import in_short, plain_numbers
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.memory import keep_in_few_pieces
from garment_sim_ros.ros.rclpy_internals import RCLError
from garment_sim_ros.ros.ticker import spin
from garment_sim_ros.stepping_back import step_back

_SWITCH_INTERVAL = 5e-4
"""Longest wait of a frame for a thread that makes something beside it in Python [s]."""
_GRACE = 2.0
"""Time that a callback has to end once a signal asked for it [s]."""


class _Stopped(BaseException):
    """A signal came while the node was not yet spinning."""


class _StopSignals:
    """SIGINT and SIGTERM end the process in order, from the first line to the last.

    `rclpy` ends spinning on both; before that, work in Python is interrupted, and so is work
    that has not ended some time after.
    """

    def __init__(self) -> None:
        self.asked = False
        self.interrupts = True
        # Before rclpy.init: its own handlers call these afterwards.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._take)
        signal.signal(signal.SIGALRM, self._insist)

    def _take(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        if self.interrupts:
            self.interrupts = False
            # What is cut short in the making may not end well either, and says so at length.
            sys.unraisablehook = lambda _: None
            raise _Stopped
        signal.setitimer(signal.ITIMER_REAL, _GRACE)

    def _insist(self, number: int, frame: FrameType | None) -> None:
        raise _Stopped

    def ended(self) -> None:
        """Interrupt nothing any more."""
        self.interrupts = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, signal.SIG_IGN)


def run(
    name: str,
    make_node: Callable[[], ManagedNode[Any]],
    argv: list[str] | None = None,
    *,
    steps_back: bool = False,
) -> int:
    """Run a node until SIGINT, SIGTERM or the end of its context.

    With `--help` or `--version` it tells about itself instead.

    Args:
        name: The node's name.
        make_node: Makes the node.
        argv: Command line with ROS arguments; that of the process where None.
        steps_back: Whether other processes go first once it spins.

    Returns:
        Exit code: 0, or 2 for a parameter or file that is not allowed, after one line about it.
    """
    code = _run(name, make_node, argv, steps_back)
    return end_process(code) if argv is None else code


def _run(
    name: str, make_node: Callable[[], ManagedNode[Any]], argv: list[str] | None, steps_back: bool
) -> int:
    """As `run`; returns the exit code."""
    words = sys.argv[1:] if argv is None else argv
    if asked := {"-h", "--help", "--version"}.intersection(words):
        print(version() if asked == {"--version"} else NODES[name].help())
        return 0
    signals = _StopSignals()
    faulthandler.enable()  # a fault below Python says where it was
    prepare_process()
    node: ManagedNode[Any] | None = None
    try:
        with plain_numbers(argv) as plain:
            rclpy.init(args=plain)
        node = make_node()
        if node.autostart:
            autostart(node)
        if steps_back:
            step_back()
        # What lives now lives to the end: the collector need not look at it again.
        gc.collect()
        gc.freeze()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        signals.interrupts = False
        if not signals.asked:
            spin(executor, node)
    except (_Stopped, ExternalShutdownException):
        pass
    except GarmentSimError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return 2
    except RCLError as error:
        # The context is gone between two lines of a callback once a signal came, of which
        # Python may hear only after this.
        if not signals.asked and (node is None or rclpy.ok()):
            print(f"error: {in_short(error)}", file=sys.stderr, flush=True)
            return 2
    finally:
        signals.ended()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def prepare_process() -> None:
    """What a process with a time to keep does before anything else of `rclpy`."""
    sys.setswitchinterval(_SWITCH_INTERVAL)
    keep_in_few_pieces()
    # Sending happens in a thread of the middleware's: a slow reader does not delay a frame.
    os.environ.setdefault("RMW_FASTRTPS_PUBLICATION_MODE", "ASYNCHRONOUS")


def autostart(node: ManagedNode[Any]) -> None:
    """Configure and activate a node.

    Raises:
        GarmentSimError: It cannot be.
    """
    if node.trigger_configure() != TransitionCallbackReturn.SUCCESS:
        raise node.failure or GarmentSimError(f"{node.get_name()} could not be configured")
    if node.trigger_activate() != TransitionCallbackReturn.SUCCESS:
        raise GarmentSimError(f"{node.get_name()} could not be activated")
