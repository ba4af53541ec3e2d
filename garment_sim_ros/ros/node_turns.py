"""Nodes that take turns with others in one process, where each would spin in one of its own."""

import time
from collections.abc import Sequence
from typing import Any

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from garment_sim_ros.going_first import go_first
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.rclpy_internals import Ready, run_ready
from garment_sim_ros.stamps import SECOND

_LOOK_PERIOD = SECOND // 10
"""How often services, parameters and timers are looked at [ns];"""
_SIMULATED_LOOK_PERIOD = SECOND // 500
"""in simulated time, whose clock and ticks are among them."""
_LONGEST_LOOK = SECOND // 200
"""Then it goes on at the next look, however much there is to do [ns]."""
_INPUT_PERIOD = SECOND // 200
"""How often messages are asked for where nothing ticks [ns]."""


class NodeTurns:
    """Nodes that do together what is due, one after the other: see `turns.Due`.

    Args:
        context: Their context.
        nodes: The nodes; what one hands over the next takes in the same turn.
    """

    def __init__(self, context: Context, nodes: Sequence[ManagedNode[Any]]) -> None:
        self._nodes = nodes
        self._executor = SingleThreadedExecutor(context=context)
        for node in nodes:
            self._executor.add_node(node)
        self._ready = Ready(context, nodes)
        self._looked = 0

    def destroy(self) -> None:
        """End the nodes; nothing of them is left."""
        self._executor.shutdown()
        for node in self._nodes:
            node.destroy_node()

    def ahead(self) -> int:
        """Time until something is due [ns]."""
        tickers = [node.ticker for node in self._nodes if node.ticker is not None]
        times = [ticker.ahead() for ticker in tickers if not ticker.is_simulated]
        if not tickers:
            times.append(_INPUT_PERIOD)
        return min(self._look_ahead(), *times)

    def turn(self) -> None:
        """Take what has come, tick what is due, look now and then."""
        go_first(max(node.realtime_priority for node in self._nodes))
        for node in self._nodes:
            node.attend()
            if node.ticker is None:
                node.take_inputs()
            else:
                node.ticker.call_if_due()
        if self._look_ahead() <= 0:
            self._look()

    def _look_ahead(self) -> int:
        """Time until the next look [ns]."""
        is_simulated = any(n.ticker is not None and n.ticker.is_simulated for n in self._nodes)
        period = _SIMULATED_LOOK_PERIOD if is_simulated else _LOOK_PERIOD
        return self._looked + period - time.monotonic_ns()

    def _look(self) -> None:
        """Run callbacks, for a short time at most."""
        self._looked = now = time.monotonic_ns()
        if self._ready():
            while run_ready(self._executor) and time.monotonic_ns() - now < _LONGEST_LOOK:
                pass
