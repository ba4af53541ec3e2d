"""What the documents say of parameters, commands, files and words is what there is."""

import re
from pathlib import Path

import pytest

from garment_sim_ros import params
from garment_sim_ros.cli.main import COMMANDS
from garment_sim_ros.nodes import NODES

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PACKAGE = ROOT / "garment_sim_ros"
PAGES = [*ROOT.glob("*.md"), *sorted(DOCS.rglob("*.md"))]


@pytest.mark.parametrize(
    "group",
    [params.Material, *{s.group: s for card in NODES.values() for s in card.sections}],
)
def test_parameter_tables_are_those_declared(group):
    assert params.markdown_table(group) in (DOCS / "ros_interface.md").read_text()


def test_every_command_is_in_the_readme():
    text = (ROOT / "README.md").read_text()
    for command in COMMANDS:
        assert f"| `{command}" in text


def anchors(page):
    """What the headings of a page are called in links to them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_between_documents_lead_somewhere(page):
    for file, anchor in re.findall(r"\]\(([^)#:]*)#?([^):]*)\)", page.read_text()):
        target = page.parent / file if file else page
        assert target.exists(), f"{page.name}: {file}"
        assert not anchor or anchor in anchors(target), f"{page.name}: {file}#{anchor}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_documents_name_are_there(page):
    text = page.read_text()
    for script in re.findall(r"(?<![\w/])((?:bench|examples)/\w+\.(?:py|c))", text):
        assert (ROOT / script).exists(), f"{page.name}: {script}"
    for test in re.findall(r"`(?:test/\w+/)?(test_\w+\.py)`", text):
        assert list((ROOT / "test").rglob(test)), f"{page.name}: {test}"
    packages = "|".join(p.name for p in PACKAGE.iterdir() if (p / "__init__.py").exists())
    for file in re.findall(rf"`((?:{packages})/[\w/]+(?:\.py|/))`", text):
        assert (PACKAGE / file).exists(), f"{page.name}: {file}"


def test_every_measurement_is_in_the_index_and_has_command_and_commit():
    folder = DOCS / "measurements"
    index = (folder / "README.md").read_text()
    for page in folder.glob("*.md"):
        if page.name != "README.md":
            text = page.read_text()
            assert f"({page.name})" in index
            assert re.search(r"^    (\S*python |.*garment-sim )|`garment-sim ", text, re.MULTILINE)
            assert re.search(r"[Rr]ecorded at `[0-9a-f]{7}`", text), page.name


def retired():
    """The words that the glossary's last column names."""
    rows = re.findall(r"^\|(.*)\|$", (DOCS / "glossary.md").read_text(), re.MULTILINE)
    words = [row.split("|")[-1].strip() for row in rows[2:]]
    return [word for word in words if word]


def test_retired_words_are_gone():
    assert {"leash", "inner radius"} <= set(retired())
    words = "|".join(word.replace(" ", "[ _]") for word in retired())
    used = re.compile(rf"(?<![a-z])({words})(?![a-z])", re.IGNORECASE)
    files = [p for p in PACKAGE.rglob("*") if p.suffix in {".py", ".yaml", ".rviz"}]
    files += [page for page in PAGES if page.name not in {"glossary.md", "CHANGELOG.md"}]
    found = [(f.name, match[0]) for f in files for match in used.finditer(f.read_text())]
    assert not found
    assert not [f.name for f in files if used.search(f.stem)]
