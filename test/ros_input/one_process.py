"""`garment-sim run` as a process, and what an avatar of one process is given."""

import threading

from ros_input.nursery import started

LIMIT = 180.0
"""How long anything may take on a busy machine [s]."""
OUTFIT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 500}}
"""


def wearing(outfit, **cloth):
    """Parameters of an avatar's nodes, by node: an outfit, and others of `cloth_node`."""
    return {
        "mocap_player": {},
        "collider_node": {"outfit": outfit},
        "cloth_node": {"outfit": outfit, **cloth},
    }


class Command:
    """`garment-sim run` as a process, which `begin` starts: a function of module and words."""

    def __init__(self, *words, begin=started):
        self._process = begin("garment_sim_ros.cli.main", ["run", *words], errors=True)
        self._said = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self._process.stderr:
            self._said.append(line)

    @property
    def said(self):
        return "".join(self._said)

    @property
    def pid(self):
        return self._process.pid

    def send(self, number):
        self._process.send_signal(number)

    def wait(self):
        """Exit code and what it printed."""
        printed = self._process.stdout.read()
        code = self._process.wait(LIMIT)
        self._reader.join(LIMIT)
        return code, printed

    def end(self):
        self._process.kill()
        self._process.wait()
