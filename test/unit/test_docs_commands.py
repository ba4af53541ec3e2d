"""Commands of the documents: each is understood; those of replay and export run as they stand."""

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest

from garment_sim_ros.cli import main as cli

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
MAKE = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))


def commands(page):
    """Words of each line of a page's shell blocks."""
    blocks = re.findall(r"```bash\n(.*?)```", page.read_text(), re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


OWN = [
    pytest.param(words[1:], id=f"{page.stem}: {' '.join(words[1:])}")
    for page in PAGES
    for words in commands(page)
    if Path(words[0]).name == "garment-sim"
]


@pytest.mark.parametrize("words", OWN)
def test_commands_are_understood(words):
    args = cli.parser(words[0]).parse_args(words)
    assert args.command == words[0]


def test_no_page_is_missed():
    pages = {"README", "replay", "export", "view", "many_avatars", "patterns", "your_avatar"}
    assert pages | {"colliders"} <= {case.id.partition(":")[0] for case in OWN}


def test_targets_and_scripts_that_are_called_are_there():
    called = [words for page in PAGES for words in commands(page)]
    for words in called:
        if words[0] == "make":
            assert words[1] in MAKE, words
        if Path(words[0]).name == "python" and not words[1].startswith("-"):
            assert (ROOT / words[1]).exists(), words
    assert ["make", "demo"] in called


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the pages' commands run one after the other, as their reader would have them."""
    return tmp_path_factory.mktemp("reader")


@pytest.mark.slow
def test_commands_of_replay_run(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    for words in commands(ROOT / "docs" / "replay.md"):
        assert cli.main(words[1:]) == 0, words
        assert capsys.readouterr().err.count("error") == 0, words
    assert sorted(p.name for p in folder.iterdir()) == ["again", "both", "gust", "long", "walk"]
    assert sorted(p.name for p in (folder / "both").iterdir()) == ["again", "walk"]


@pytest.mark.slow
def test_commands_of_export_run(folder, monkeypatch):
    monkeypatch.chdir(folder)
    bag = folder / "out" / "demo" / "bag"
    bag.parent.mkdir(parents=True)
    words = ["simulate", "--clip", "walk", "--seconds", "1", "--rate", "30", "--out", str(bag)]
    assert cli.main(words) == 0
    for words in commands(ROOT / "docs" / "export.md"):
        if "walk.usdc" in words and not find_spec("pxr"):
            continue
        assert cli.main(words[1:]) == 0, words
        assert (folder / words[words.index("--out") + 1]).exists()
