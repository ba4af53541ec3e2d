"""Recordings that are gone on with: what is kept, and what is no use."""

import fcntl
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sensor_msgs")

from waiting import until

from garment_sim_ros.cli.main import main
from garment_sim_ros.frozen_state import freeze, thaw
from garment_sim_ros.jit import compiled, kernel
from garment_sim_ros.ros.offline import unfinished
from garment_sim_ros.ros.offline.inputs import from_clip
from garment_sim_ros.ros.offline.setup import Setup
from garment_sim_ros.ros.offline.work import Work
from garment_sim_ros.sim.solvers import SOLVERS

OUTFIT = """
version: 1
garments: [{name: skirt, generator: short_skirt, options: {vertices: 300}}]
"""


@kernel()
def add_one(x):
    """Something to compile."""
    x += 1.0


def test_arrays_that_share_memory_do_so_again():
    x = np.arange(24.0).reshape(4, 6)
    packed = np.zeros(3, dtype=[("a", "f4"), ("b", "i4", 2)])
    thing = {"x": x, "part": x[1:, ::2], "field": packed["b"], "packed": packed, "no": x[2:2]}
    found = thaw(freeze(thing))
    assert all(np.array_equal(thing[k], found[k]) for k in thing)
    found["part"][:] = 7.0
    assert (found["x"][1:, ::2] == 7.0).all()
    found["packed"]["b"][:] = 3
    assert (found["field"] == 3).all()


def test_compiled_code_is_called_again():
    x = np.zeros(3)
    code = compiled(add_one, x)
    again = thaw(freeze([code, add_one]))
    for call in again:
        call(x)
    assert (x == 2.0).all()


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_goes_on_as_it_would(solver, tmp_path):
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(OUTFIT.replace("options", "self_collision: true, options"))
    setup = Setup.of(
        {
            "mocap_player": {"clip": "walk", "rate": 25.0},
            "collider_node": {"body": "mannequin"},
            "cloth_node": {"body": "mannequin", "outfit": str(outfit), "solver": solver},
        }
    )
    messages = list(from_clip(setup.player, 0.8).messages)
    work = Work(setup)
    for message in messages[:12]:
        list(work.take(message))
    later = thaw(freeze(work))
    expected = [sent for message in messages[12:] for sent in work.take(message)]
    assert [sent for message in messages[12:] for sent in later.take(message)] == expected
    assert sum(topic.endswith("points") for topic, _ in expected) == len(messages) - 12


@pytest.fixture
def words(tmp_path, monkeypatch):
    """Of a run that can be interrupted; states are kept in a folder of its own."""
    monkeypatch.setattr(unfinished, "user_cache", lambda folder: tmp_path / "states" / folder)
    (tmp_path / "outfit.yaml").write_text(OUTFIT)
    clip = ["--clip", "walk", "--seconds", "3.5", "--rate", "20", "--resume"]
    out = tmp_path / "out" / "walk"
    return ["simulate", *clip, "--outfit", str(tmp_path / "outfit.yaml"), "--out", str(out)]


@pytest.fixture
def interrupted(words, tmp_path, monkeypatch):
    """A run that was interrupted in its third second; its state."""
    keep, count = unfinished.Unfinished.keep, [0]

    def interrupt(self, making):
        keep(self, making)
        count[0] += 1
        if count[0] == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(unfinished.Unfinished, "keep", interrupt)
        assert main(words) == 130
    (state,) = (tmp_path / "states" / "unfinished").iterdir()
    return state


def gone_on_from(words, capsys):
    assert main(words) == 0
    said = capsys.readouterr().out
    return ", from frame " in said


def test_it_goes_on(words, interrupted, capsys):
    assert gone_on_from(words, capsys)
    assert not interrupted.exists()


@pytest.mark.parametrize("what", ["other input", "damaged", "other version", "no file", "short"])
def test_what_is_no_use_is_left(words, interrupted, tmp_path, capsys, what):
    """Then it begins anew, to the same bytes."""
    (bag,) = tmp_path.glob("out/.unfinished-walk/simulation/*.mcap")
    data = interrupted.read_bytes()
    if what == "other input":
        words = [*words, "--set", "cloth_node.gravity=[0, 0, -5]"]
    elif what == "damaged":
        interrupted.write_bytes(data[: len(data) // 2])
    elif what == "other version":
        interrupted.write_bytes(bytes([data[0] ^ 1]) + data[1:])
    elif what == "no file":
        bag.unlink()
    else:
        bag.write_bytes(bag.read_bytes()[:9])
    assert not gone_on_from(words, capsys)
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["walk"]
    assert main(["simulate", "--verify", str(tmp_path / "out" / "walk")]) == 0


def test_one_at_a_time(words, interrupted, tmp_path, capsys):
    with (tmp_path / "out" / ".unfinished-walk" / "lock").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert main(words) == 2
    assert "walk: is being made by another process" in capsys.readouterr().err
    assert interrupted.exists()
    assert gone_on_from(words, capsys)


def test_an_input_that_leads_to_nothing_leaves_nothing(words, tmp_path, capsys):
    bad = tmp_path / "bad.bvh"
    bad.write_text("HIERARCHY\n")
    assert main([*words[:2], str(bad), *words[3:]]) == 2
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize(
    "sign", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGKILL]
)
def test_a_process_that_was_interrupted_is_gone_on_with(tmp_path, sign):
    """From its last whole second, to the same bytes."""
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(OUTFIT)
    command = [sys.executable, "-m", "garment_sim_ros.cli.main", "simulate", "--resume"]
    clip = ["--clip", "walk", "--seconds", "12", "--rate", "25", "--outfit", str(outfit), "--json"]
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache")}
    kept = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "garment_sim_ros").mkdir()
    for folder in ("kernels", "colliders", "bodies", "garments"):
        if (kept / "garment_sim_ros" / folder).exists():
            (tmp_path / "cache" / "garment_sim_ros" / folder).symlink_to(
                kept / "garment_sim_ros" / folder
            )
    out = tmp_path / "out" / "walk"
    words = [*command, *clip, "--out", str(out)]
    process = subprocess.Popen(words, stderr=subprocess.DEVNULL, env=environment)
    states = tmp_path / "cache" / "garment_sim_ros" / "unfinished"
    first = until(lambda: [p.stat().st_mtime_ns for p in states.glob("?" * 32)], process)
    until(lambda: [p.stat().st_mtime_ns for p in states.glob("?" * 32)] > first, process)
    process.send_signal(sign)
    process.wait(60)
    assert [p.name for p in out.parent.iterdir()] == [".unfinished-walk"]
    told = json.loads(
        subprocess.run(
            words, check=True, stdout=subprocess.PIPE, env=environment
        ).stdout.splitlines()[-1]
    )["recordings"][0]
    assert 25 < told["gone_on_from"] < 300
    assert told["frames"] == 301
    assert [p.name for p in out.parent.iterdir()] == ["walk"]
    assert not list(states.iterdir())
    whole = tmp_path / "whole"
    assert main(["simulate", *clip[:-1], "--out", str(whole)]) == 0
    assert files(out) == files(whole)


def files(path):
    return {p.name: p.read_bytes() for p in path.iterdir()}
