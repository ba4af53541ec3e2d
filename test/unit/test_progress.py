"""Progress on stderr."""

from garment_sim_ros.cli import progress


def test_a_phase_is_shown_when_it_begins(monkeypatch, capsys):
    """Whatever it takes until it tells more, as where kernels are compiled."""
    monkeypatch.setattr(progress, "_DELAY", -1.0)
    with progress.Phases("shirt", ("cutting", "sewing")) as phases:
        phases.show("cutting", 1.0)
        assert "shirt: sewing" not in capsys.readouterr().err
        phases.show("sewing", 0.0)
        assert "shirt: sewing" in capsys.readouterr().err
