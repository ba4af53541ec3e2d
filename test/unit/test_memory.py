"""A node's memory comes back once it is free, in a process of its own."""

import subprocess
import sys

import pytest

_PROGRAM = """
import ctypes, io, threading, xml.etree.ElementTree
import numpy as np, psutil
from garment_sim_ros.ros.process import prepare_process
{prepare}

def resident():
    return psutil.Process().memory_info().rss / 2**20

# Freed, a block of 16 MiB raises what the library takes for large.
np.ones(2**21)
start = resident()
large, small = [], []
for _ in range(100):
    large.append(np.ones(2**17))
    small.append(bytes(20000))
held = resident() - start
large.clear()
kept = resident() - start

all_at_once = threading.Barrier(12)
def use():
    all_at_once.wait(timeout=60.0)
    blocks = [bytes(5000) for _ in range(1000)]
    all_at_once.wait(timeout=60.0)
    del blocks
threads = [threading.Thread(target=use) for _ in range(12)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc = ctypes.CDLL(None)
libc.fopen.restype = ctypes.c_void_p
file = libc.fopen({path!r}.encode(), b"w")
libc.malloc_info(0, ctypes.c_void_p(file))
libc.fclose(ctypes.c_void_p(file))
heaps = len(xml.etree.ElementTree.parse({path!r}).findall("heap"))
print(held, kept, heaps)
"""


def _found(tmp_path, prepare):
    program = _PROGRAM.format(prepare=prepare, path=str(tmp_path / "heaps.xml"))
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120.0
    )
    assert done.returncode == 0, done.stderr
    return map(float, done.stdout.split())


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="of the GNU C library")
def test_what_is_large_leaves_no_pieces_and_threads_share_heaps(tmp_path):
    held, kept, heaps = _found(tmp_path, "prepare_process()")
    assert held > 95.0
    assert kept < 6.0
    assert heaps <= 3  # one may be there before
