"""The command line: exit codes, one-line errors, JSON last, nothing half-written."""

import json
import re
import subprocess
import sys
import types

import pytest

from garment_sim_ros import __version__
from garment_sim_ros.cli import main as cli
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.errors import InputFileError


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_every_command_has_help_with_an_example(command, capsys):
    assert cli.main([command, "--help"]) == 0
    text = capsys.readouterr().out
    assert f"example: garment-sim {command}" in text
    assert "--json" in text


def test_help_lists_the_commands():
    words = [sys.executable, "-m", "garment_sim_ros.cli.main", "--help"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert all(command in done.stdout for command in cli.COMMANDS)


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["fly"],
        ["fit"],
        ["fit", "mannequin", "--out", "x.json", "--method", "clay"],
        ["fit", "missing.glb", "--out", "x.json"],
        ["fit", "missing.xyz", "--out", "x.json"],
        ["demo", "--seconds", "0"],
        ["demo", "--seconds", "nan"],
        ["demo", "--seconds", "many"],
        ["demo", "--clip", "missing.bvh"],
        ["demo", "--body", "missing.glb"],
        ["demo", "--outfit", "missing.yaml"],
    ],
)
def test_unusable_input_gives_one_line_and_exit_code_2(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(words) == 2
    text = capsys.readouterr().err
    assert text.startswith("error: ")
    assert text.count("\n") == 1
    assert "; " in text
    assert not list(tmp_path.iterdir())


def fake_command(monkeypatch, action):
    module = types.SimpleNamespace(
        EXAMPLE="garment-sim fake", add_arguments=lambda parser: None, run=action
    )
    monkeypatch.setitem(sys.modules, "garment_sim_ros.cli.fake", module)
    monkeypatch.setitem(cli.COMMANDS, "fake", "pretends")


def test_json_is_the_last_line(monkeypatch, capsys):
    def action(args):
        print("for people")
        return {"answer": 42, "name": "x"}

    fake_command(monkeypatch, action)
    assert cli.main(["fake", "--json"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert json.loads(lines[-1]) == {"answer": 42, "name": "x"}
    assert cli.main(["--json", "fake"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1]) == {"answer": 42, "name": "x"}
    assert cli.main(["fake"]) == 0
    assert capsys.readouterr().out == "for people\n"


def test_version(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"garment-sim {__version__}\n"


def test_interrupt_gives_130(monkeypatch):
    def action(args):
        raise KeyboardInterrupt

    fake_command(monkeypatch, action)
    assert cli.main(["fake"]) == 130


def test_error_over_several_lines_is_printed_on_one(monkeypatch, capsys):
    def action(args):
        raise InputFileError("f.yaml", "bad\n  thing", "allowed: good")

    fake_command(monkeypatch, action)
    assert cli.main(["fake"]) == 2
    assert capsys.readouterr().err == "error: f.yaml: bad\\n thing; allowed: good\n"


def test_output_appears_whole(tmp_path):
    out = tmp_path / "a" / "b"
    with staged(out) as stage:
        (stage / "bag").mkdir()
        (stage / "bag" / "x").write_text("1")
        (stage / "f.json").write_text("2")
        assert [p.name for p in out.iterdir()] == [stage.name]
    assert sorted(p.name for p in out.iterdir()) == ["bag", "f.json"]
    with staged(out) as stage:
        (stage / "bag").mkdir()
        (stage / "bag" / "y").write_text("3")
    assert [p.name for p in (out / "bag").iterdir()] == ["y"]
    assert (out / "f.json").read_text() == "2"


def fail_halfway(folder, name, error):
    with staged(folder) as stage:
        (stage / name).write_text("new")
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt, InputFileError("a", "b")])
def test_output_of_a_failure_disappears(tmp_path, error):
    with pytest.raises((KeyboardInterrupt, InputFileError)):
        fail_halfway(tmp_path / "a" / "b", "half", error)
    assert not list(tmp_path.iterdir())


def test_failure_leaves_what_was_there(tmp_path):
    (tmp_path / "f.json").write_text("old")
    with pytest.raises(KeyboardInterrupt):
        fail_halfway(tmp_path, "f.json", KeyboardInterrupt)
    assert [p.name for p in tmp_path.iterdir()] == ["f.json"]
    assert (tmp_path / "f.json").read_text() == "old"


def test_output_folder_that_is_a_file_is_a_clear_error(tmp_path):
    (tmp_path / "f").write_text("")
    with pytest.raises(InputFileError, match="--out"), staged(tmp_path / "f"):
        pass


@pytest.mark.parametrize(
    ("garment", "words"),
    [
        ("mesh: gone.glb", "gone.glb.*does not exist"),
        (
            "generator: short_skirt, attachments: [{bone: hips, loop: 7}]",
            "attachment 'loop 7 on hips': there is no open edge 7",
        ),
    ],
)
def test_demo_does_not_wait_for_an_outfit_that_cannot_be_worn(tmp_path, capsys, garment, words):
    outfit = tmp_path / "mine.yaml"
    outfit.write_text(f"version: 1\ngarments: [{{name: s, {garment}}}]\n")
    asked = ["demo", "--outfit", str(outfit), "--out", str(tmp_path / "out")]
    assert cli.main([*asked, "--set", "collider_node.method=capsules"]) == 2
    (said,) = capsys.readouterr().err.strip().splitlines()
    assert said.startswith("error: ")
    assert re.search(words, said)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.yaml"]
