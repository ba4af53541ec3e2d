"""The nodes as real processes: started, watched and ended."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml

from garment_sim_ros.cli.interrupts import interrupts_held
from garment_sim_ros.errors import GarmentSimError

_LOG_HEAD = re.compile(r"^\[[A-Z]+\] \[[0-9.]+\] \[\S+\]: ")
_FATAL_HEAD = re.compile(r"^\[(ERROR|FATAL)\] \[[0-9.]+\] \[(?P<name>\S+)\]: ")
_AT_WORK = re.compile(r": \d+ s so far$")
# Above 101 the ports of a domain may collide with those that Linux hands out.
_DOMAINS = 101
_FIRST_PORT, _PORTS_OF_A_DOMAIN = 7400, 250  # as the standard of the middleware has them
_claims: list[socket.socket] = []
# Ctrl-C is for this program, which ends its nodes in order. No session of their own where there is
# a choice: between sessions Linux does not regard priorities, see `stepping_back`.
_APART: dict[str, Any] = (
    {"process_group": 0} if sys.version_info >= (3, 11) else {"start_new_session": True}
)
_PATIENCE = 15.0  # for an orderly end, on a busy machine, too [s]


def own_network() -> dict[str, str]:
    """Environment in which nodes of this program meet each other and nobody else.

    A program has its domain to its end: it holds the TCP port that has the number of the
    domain's first UDP port, which the middleware leaves alone.

    Raises:
        GarmentSimError: All domains are taken.
    """
    for number in range(_DOMAINS):
        domain = 1 + (os.getpid() + number) % _DOMAINS
        claim = socket.socket()
        try:
            claim.bind(("127.0.0.1", _FIRST_PORT + _PORTS_OF_A_DOMAIN * domain))
        except OSError:
            claim.close()
            continue
        _claims.append(claim)
        return {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    raise GarmentSimError(f"ROS_DOMAIN_ID: all of 1 to {_DOMAINS} are taken by other programs")


class NodeProcesses:
    """Nodes that live as long as the `with` block.

    Args:
        logs: Folder for one log and one parameter file per node.
    """

    def __init__(self, logs: Path) -> None:
        logs.mkdir(parents=True, exist_ok=True)
        self._logs = logs
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "NodeProcesses":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end()

    def start(self, name: str, parameters: Mapping[str, Any]) -> None:
        """Start ``garment_sim_ros.ros.<name>`` with ROS parameters."""
        file = self._logs / f"{name}.yaml"
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in parameters.items()}
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": plain}}))
        command = [sys.executable, "-m", f"garment_sim_ros.ros.{name}"]
        with (self._logs / f"{name}.log").open("wb") as log, interrupts_held():
            self._processes[name] = subprocess.Popen(
                [*command, "--ros-args", "--params-file", str(file)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                **_APART,
            )

    def check(self) -> None:
        """See that all nodes are running and can go on.

        Raises:
            GarmentSimError: One has ended, with the reason that its log gives, or says that it
                cannot do its part.
        """
        for name, process in self._processes.items():
            code = process.poll()
            if code is not None:
                raise GarmentSimError(
                    f"{name} ended with exit code {code}: {self.last_words(name)}"
                )
            if fatal := self.fatal_words(name):
                raise GarmentSimError(f"{name}: {fatal}")

    def last_words(self, name: str) -> str:
        """The last line of a node's log that says something."""
        lines = [line.strip() for line in self._log(name).splitlines() if line.strip()]
        return _LOG_HEAD.sub("", lines[-1]) if lines else "no output yet"

    def fatal_words(self, name: str) -> str:
        """The first line of a node's log that says that it cannot do its part; else empty."""
        for line in self._log(name).splitlines():
            if (head := _FATAL_HEAD.match(line)) and head["name"].split(".")[-1] == name:
                return line[head.end() :]
        return ""

    def _log(self, name: str) -> str:
        return (self._logs / f"{name}.log").read_text(errors="replace")

    def at_work(self) -> str:
        """What a node says that it is still compiling, loading or fitting; empty if none does."""
        words = (self.last_words(name) for name in self._processes)
        return next((said for said in words if _AT_WORK.search(said)), "")

    def finish(self) -> None:
        """End all nodes as Ctrl-C would, and see that they end well.

        Raises:
            GarmentSimError: One did not end in time, or with an exit code other than 0.
        """
        self.check()
        self._end()
        for name, process in self._processes.items():
            if process.returncode != 0:
                raise GarmentSimError(
                    f"{name}: ended with exit code {process.returncode} after SIGINT; "
                    f"it said: {self.last_words(name)}"
                )

    @interrupts_held()
    def _end(self) -> None:
        for sign in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            running = [p for p in self._processes.values() if p.poll() is None]
            for process in running:
                process.send_signal(sign)
            limit = time.monotonic() + _PATIENCE
            for process in running:
                try:
                    process.wait(max(0.0, limit - time.monotonic()))
                except subprocess.TimeoutExpired:
                    continue
