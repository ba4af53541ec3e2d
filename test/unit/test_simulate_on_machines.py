"""`simulate --scheduler`: workers of a scheduler, on this machine, one of which is killed."""

import os
import re
import signal
import subprocess
import sys
from contextlib import ExitStack

import pytest

pytest.importorskip("sensor_msgs")
pytest.importorskip("distributed")

from waiting import until

from garment_sim_ros.cli.main import main

OUTFIT = """
version: 1
garments: [{name: skirt, generator: short_skirt, options: {vertices: 300}}]
"""
CLIP = ("--clip", "walk", "--seconds", "8", "--rate", "25")


@pytest.fixture
def started(tmp_path):
    """Starts a part of a cluster: `started(what, *words)` is its process."""
    with ExitStack() as stack:

        def start(what, *words):
            log = stack.enter_context((tmp_path / f"{what}.log").open("ab"))
            command = [sys.executable, "-m", "distributed.cli." + what, *words]
            process = stack.enter_context(
                subprocess.Popen([*command, "--host", "127.0.0.1"], stdout=log, stderr=log)
            )
            stack.callback(process.kill)
            return process

        yield start


@pytest.fixture
def scheduler(started, tmp_path):
    """The address of a scheduler."""
    process = started("dask_scheduler", "--port", "0", "--no-dashboard", "--no-show")
    log = tmp_path / "dask_scheduler.log"
    address = until(lambda: re.search(r"Scheduler at:\s+(tcp://\S+)", log.read_text()), process)
    return address.group(1)


def work(started, scheduler, count):
    """Workers of a scheduler."""
    words = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
    return [started("dask_worker", scheduler, *words) for _ in range(count)]


def workers_at_work(out):
    """By the recordings that they have begun: who writes them."""
    found = {}
    for file in out.glob(".partial-*/simulation/*.mcap"):
        for descriptor in os.scandir("/proc"):
            if descriptor.name.isdigit():
                found |= {
                    int(descriptor.name): file
                    for link in _links(descriptor.name)
                    if link == str(file)
                }
    return found


def _links(process):
    try:
        return [os.readlink(link.path) for link in os.scandir(f"/proc/{process}/fd")]
    except OSError:
        return []


def files(path):
    return {p.name: p.read_bytes() for p in path.iterdir()}


def test_bags_of_a_killed_worker_are_done_again(started, scheduler, tmp_path, capsys):
    """Same bytes as here; none is left half-written."""
    outfit, alone, out = tmp_path / "outfit.yaml", tmp_path / "alone", tmp_path / "out"
    outfit.write_text(OUTFIT)
    assert main(["simulate", *CLIP, "--outfit", str(outfit), "--out", str(alone)]) == 0
    bags = [tmp_path / name for name in "abc"]
    for bag in bags:
        bag.symlink_to(alone)
    workers = work(started, scheduler, 2)
    command = [sys.executable, "-m", "garment_sim_ros.cli.main", "simulate"]
    words = ["--outfit", str(outfit), "--out", str(out), "--scheduler", scheduler]
    process = subprocess.Popen([*command, "--bag", *map(str, bags), *words])
    both = until(lambda: len(found := workers_at_work(out)) == 2 and found, process, *workers)
    killed, unfinished = next(iter(both.items()))
    os.kill(killed, signal.SIGKILL)
    assert process.wait(180) == 0
    assert not unfinished.exists()
    assert sorted(p.name for p in out.iterdir()) == ["a", "b", "c"]
    whole = [files(out / bag.name) for bag in bags]
    assert whole[0] == whole[1] == whole[2]
    assert (
        main(
            [
                "simulate",
                "--bag",
                str(bags[0]),
                "--outfit",
                str(outfit),
                "--out",
                str(tmp_path / "here"),
            ]
        )
        == 0
    )
    assert whole[0] == files(tmp_path / "here")
    assert {p.pid for p in workers if p.poll() is not None} == {killed}


def test_what_is_interrupted_leaves_nothing(started, scheduler, tmp_path):
    work(started, scheduler, 1)
    out = tmp_path / "out"
    command = [sys.executable, "-m", "garment_sim_ros.cli.main", "simulate", "--clip", "walk"]
    process = subprocess.Popen(
        [*command, "--seconds", "3000", "--out", str(out), "--scheduler", scheduler],
        stderr=subprocess.DEVNULL,
    )
    until(lambda: list(tmp_path.glob(".partial-*/simulation/*")), process)
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 130
    until(lambda: not list(tmp_path.glob(".partial-*")))
    assert not out.exists()


def test_workers_and_inputs_that_cannot_be_used(started, scheduler, tmp_path, capsys):
    words = ["simulate", "--clip", "walk", "--out", str(tmp_path / "out")]
    assert main([*words, "--scheduler", scheduler]) == 2
    assert ": has no workers" in capsys.readouterr().err
    work(started, scheduler, 1)
    bad = tmp_path / "bad.bvh"
    bad.write_text("HIERARCHY\n")
    words = ["simulate", "--clip", str(bad), "--out", str(tmp_path / "out")]
    assert main([*words, "--scheduler", scheduler]) == 2
    assert f"error: {bad}: " in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
