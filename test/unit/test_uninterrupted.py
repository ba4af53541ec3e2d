"""An interrupt while machine code is loaded is raised, and the code is there."""

import os
import subprocess
import sys

import numba
import pytest
from numba.core.codegen import JitEngine

from garment_sim_ros.uninterrupted import load_uninterrupted

_PROCESS = """
import os, signal, sys
from numba.core import codegen

library = codegen.CPUCodeLibrary
plain, asked = library._object_getbuffer_hook.__func__, []

def interrupted(cls, module):
    if asked == [True]:
        asked.append(os.kill(os.getpid(), getattr(signal, sys.argv[1])))
    return plain(cls, module)

library._object_getbuffer_hook = classmethod(interrupted)
if sys.argv[1] == "SIGTERM":
    signal.signal(signal.SIGTERM, signal.default_int_handler)

import numpy as np
from garment_sim_ros.geometry import geodesics

triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32)

def far():
    return geodesics.mesh_graph(np.eye(4)[:, :3], triangles).distances(0)[0].max()

asked.append(len(sys.argv) > 2)
try:
    far()
    print("went on")
except KeyboardInterrupt:
    print("interrupted")
print(len(asked), sum(geodesics._dijkstra.stats.cache_misses.values()), round(far(), 3))
"""


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_what_interrupts_loading_is_raised_and_the_kernel_can_be_called(tmp_path, name):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}

    def said(*words):
        command = [sys.executable, "-c", _PROCESS, name, *words]
        return subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True
        ).stdout.splitlines()

    assert said() == ["went on", "1 1 1.414"]  # now it is on disk
    assert said("interrupt") == ["interrupted", "2 0 1.414"]


def test_what_cannot_be_made_is_told(monkeypatch):
    def fail(engine):
        raise MemoryError("no room")

    monkeypatch.setattr(JitEngine, "finalize_object", fail)
    load_uninterrupted()
    with pytest.raises(MemoryError, match="no room"):
        JitEngine.finalize_object(None)
