"""Progress on stderr."""

import io

from garment_sim_ros.cli import progress


def test_a_phase_is_shown_when_it_begins(monkeypatch, capsys):
    """Whatever it takes until it tells more, as where kernels are compiled."""
    monkeypatch.setattr(progress, "_DELAY", -1.0)
    with progress.Phases("shirt", ("cutting", "sewing")) as phases:
        phases.show("cutting", 1.0)
        assert "shirt: sewing" not in capsys.readouterr().err
        phases.show("sewing", 0.0)
        assert "shirt: sewing" in capsys.readouterr().err


def test_a_bar_that_was_shown_is_wiped_before_the_next_line(monkeypatch):
    """What comes after it, as an error, stands in a line of its own."""
    monkeypatch.setattr(progress, "_DELAY", 1e-6)
    said = io.StringIO()
    monkeypatch.setattr("sys.stderr", said)
    with progress.Phases("shirt", ("cutting", "sewing")) as phases:
        phases.show("sewing", 0.0)
    shown = said.getvalue().split("\r")
    assert "shirt: sewing" in shown[1]
    assert shown[-2:] == [" " * len(shown[1]), ""]
