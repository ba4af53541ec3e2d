"""A process that has imported what nodes import, and becomes one in a copy of it when asked.

Importing is most of what it takes to start a node. The nodes are processes of their own, run
their `main` with a command line, and end as the interpreter does. They share what a process draws
when it begins, such as the seed of hashes: two whose bytes are compared begin apart.
"""

import contextlib
import importlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator

_MODULES = [
    f"garment_sim_ros.{name}"
    for name in (
        *("ros.cloth_node", "ros.collider_node", "ros.mocap_player"),
        *("ros.one_process", "cli.main", "cli.run"),
    )
]
_VARIES = "PYTEST_CURRENT_TEST"


def _environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != _VARIES}


class Child:
    """A process from the nursery; what tests need of `subprocess.Popen`."""

    def __init__(self, pid: int, output: int, errors: int | None, ended: int) -> None:
        self.pid = pid
        self.stdout = os.fdopen(output)
        self.stderr = None if errors is None else os.fdopen(errors)
        self._ended = ended
        self._code: int | None = None

    def poll(self) -> int | None:
        """Its exit code once it has ended, as `subprocess` gives it."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        if self._code is None:
            end = select.poll()
            end.register(self._ended, select.POLLIN)
            if not end.poll(None if timeout is None else 1e3 * timeout):
                raise subprocess.TimeoutExpired("a node", timeout or 0.0)
            self._code = int(os.read(self._ended, 16) or -signal.SIGKILL)
            os.close(self._ended)
        return self._code

    def send_signal(self, number: signal.Signals) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class Nursery:
    """Starts the process with the first child; it ends when this one does."""

    def __init__(self) -> None:
        self._environment: dict[str, str] = {}
        self._process: subprocess.Popen[bytes] | None = None
        self._line, self._far = socket.socketpair()

    def start(
        self, module: str, words: list[str], *, errors: bool = False
    ) -> "Child | subprocess.Popen[str]":
        """A process that runs the `main` of a module; what it prints comes by its `stdout`.

        Where the environment is another by now, it is a process that imports all by itself.

        Args:
            module: The module's name.
            words: Its command line.
            errors: Whether what it prints as errors comes by `stderr` instead.
        """
        if self._process is None:
            self._environment = _environment()
            self._process = subprocess.Popen(
                [sys.executable, __file__], stdin=self._far, stdout=subprocess.DEVNULL
            )
            self._far.close()
        if _environment() != self._environment:
            return started(module, words, errors=errors)
        pipes = [os.pipe() for _ in range(2 + errors)]
        asked = json.dumps([module, words, os.getcwd()]).encode() + b"\n"
        given = [write for _, write in pipes]
        socket.send_fds(self._line, [asked], given)
        for descriptor in given:
            os.close(descriptor)
        (ended, output), said = (read for read, _ in pipes[:2]), pipes[2:]
        pid = int(self._line.recv(16))
        return Child(pid, output, said[0][0] if errors else None, ended)

    def end(self) -> None:
        self._line.close()
        if self._process is not None:
            self._process.wait()


def started(module: str, words: list[str], *, errors: bool = False) -> subprocess.Popen[str]:
    """The same as a process that imports all by itself."""
    return subprocess.Popen(
        [sys.executable, "-m", module, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE if errors else subprocess.STDOUT,
        text=True,
    )


def _requests(line: socket.socket) -> Iterator[tuple[bytes, list[int]]]:
    """What is asked for; meanwhile, exit codes of children go to those who asked for them."""
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    children: dict[int, int] = {}
    while True:
        ready = select.select([line, woken], [], [])[0]
        if woken in ready:
            os.read(woken, 4096)
        for pid in list(children):
            if os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
                code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                with contextlib.suppress(BrokenPipeError):
                    os.write(children[pid], str(code).encode())
                os.close(children.pop(pid))
        if line not in ready:
            continue
        asked, given, *_ = socket.recv_fds(line, 1 << 16, 3)
        if not asked:
            return
        while not asked.endswith(b"\n"):
            asked += line.recv(1 << 16)
        if pid := os.fork():
            children[pid], *printed = given
            for descriptor in printed:
                os.close(descriptor)
            line.send(str(pid).encode())
            continue
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        threading.main_thread()._set_native_id()  # some Pythons keep the parent's
        for descriptor in (woken, wake, given[0], *children.values()):
            os.close(descriptor)
        yield asked, given[1:]


def main() -> int:
    """Entry point: of the nursery, and of each of its children."""
    for module in _MODULES:
        importlib.import_module(module)
    with socket.socket(fileno=os.dup(0)) as line:
        request = next(_requests(line), None)
    if request is None:
        return 0
    asked, printed = request
    module, words, folder = json.loads(asked)
    nothing = os.open(os.devnull, os.O_RDONLY)
    for here, there in ((nothing, 0), (printed[0], 1), (printed[-1], 2)):
        os.dup2(here, there)
    for descriptor in (nothing, *printed):
        os.close(descriptor)
    os.chdir(folder)
    sys.argv = [importlib.import_module(module).__file__ or module, *words]
    code: int = importlib.import_module(module).main()
    return code


if __name__ == "__main__":
    sys.exit(main())
