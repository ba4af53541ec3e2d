"""What `make soak` runs is there, and a missed limit ends it with 1."""

import importlib
import sys
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")
from soak import run
from soak.report import FULL, SHORT, Row, at_least, at_most


@pytest.mark.parametrize("fault", run.FAULTS)
def test_each_fault_can_be_run(fault):
    module = importlib.import_module(f"soak.{fault}")
    assert callable(module.run)
    assert module.__doc__


def test_limits():
    assert at_most("a", 1.0, 1.0).holds
    assert not at_most("a", float("nan"), 1.0).holds
    assert not at_least("a", 0.9, 1.0, "Hz").holds
    assert not at_least("a", float("nan"), 1.0).holds


def fault_of(*rows):
    return SimpleNamespace(run=lambda lengths: list(rows))


def test_a_missed_limit_is_marked_and_ends_it_with_1(monkeypatch, capsys):
    told = []
    good = SimpleNamespace(run=lambda lengths: told.append(lengths) or [Row("rate", "60 Hz")])
    monkeypatch.setitem(sys.modules, "soak.killed", good)
    monkeypatch.setitem(sys.modules, "soak.hours", fault_of(at_most("pierced", 2.0, 0.0, "%")))
    monkeypatch.setattr(run, "own_network", dict)
    monkeypatch.setattr(sys, "argv", ["run", "--only", "killed", "--kills", "3"])
    assert run.main() == 0
    assert (told[0].kills, told[0].rounds) == (3, SHORT.rounds)
    monkeypatch.setattr(sys, "argv", ["run", "--full", "--only", "killed", "hours"])
    capsys.readouterr()
    assert run.main() == 1
    assert told[1] == FULL
    lines = capsys.readouterr().out.splitlines()
    assert [line.endswith("FAILED") for line in lines if "pierced" in line] == [True]
    assert lines[-1] == "1 limits missed"
