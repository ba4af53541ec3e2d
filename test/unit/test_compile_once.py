"""Processes that need the same kernel at the same time compile it once."""

import os
import subprocess
import sys

import numba
import pytest

_PROCESS = """
import sys
import numpy as np
from garment_sim_ros.geometry import geodesics
print("ready", flush=True)
sys.stdin.readline()
triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32)
graph = geodesics.mesh_graph(np.eye(4)[:, :3], triangles)
far = graph.distances(0)[0].max()
stats = geodesics._dijkstra.stats
print(sum(stats.cache_misses.values()), sum(stats.cache_hits.values()), round(far, 3))
"""


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_two_processes_compile_a_kernel_once(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", _PROCESS]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    both = [subprocess.Popen(command, env=environment, **pipes) for _ in range(2)]
    for process in both:
        assert process.stdout.readline() == "ready\n"
    for process in both:
        process.stdin.write("go\n")
        process.stdin.flush()
    told = [process.communicate()[0].split() for process in both]
    assert sorted(words[:2] for words in told) == [["0", "1"], ["1", "0"]]
    assert told[0][2] == told[1][2]
    assert not any(process.returncode for process in both)
