"""The drawing of packages in docs/architecture.md shows the imports that there are."""

import re
from pathlib import Path

import pytest

grimp = pytest.importorskip("grimp")  # comes with the checks, not with the tests

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "architecture.md"
PACKAGE = "garment_sim_ros"


def layers():
    """Packages and modules from the highest to the lowest, as the import contract has them."""
    rows = re.search(r"^layers = \[\n(.*?)^\]", (ROOT / "pyproject.toml").read_text(), re.M | re.S)
    return [
        [name.strip().removeprefix(f"{PACKAGE}.") for name in row.split("|")]
        for row in re.findall(r'"(.+)"', rows[1])
    ]


def imports():
    """What each package or module of the contract imports, those of all packages left out."""
    graph = grimp.build_graph(PACKAGE, cache_dir=None)
    drawn = [name for row in layers() for name in row]
    common = set(drawn[drawn.index("geometry") :])
    found = {name: set() for name in drawn if name not in common}
    for module in graph.modules:
        _, _, inner = module.partition(".")
        importer = inner.split(".")[0]
        for imported in graph.find_modules_directly_imported_by(module):
            other = imported.partition(".")[2].split(".")[0]
            if importer in found and other in found and other != importer:
                found[importer].add(other)
    return found


def drawing():
    """The imports as a Mermaid flowchart; what follows from other arrows has none of its own."""
    found = imports()

    def reached(name):
        return found[name].union(*(reached(other) for other in found[name]))

    lines = ["```mermaid", "flowchart TD"]
    for name, others in found.items():
        beyond = set().union(*(reached(other) for other in others))
        shown = [other for other in found if other in others - beyond]
        lines.append(f"    {name} --> {' & '.join(shown)}" if shown else f"    {name}")
    return "\n".join([*lines, "```"])


def test_the_drawing_is_true():
    assert drawing() in PAGE.read_text(), f"docs/architecture.md should have:\n{drawing()}"


def test_every_package_is_in_the_contract_and_in_the_table():
    known = {name for row in layers() for name in row}
    there = {
        path.stem if path.suffix == ".py" else path.name
        for path in (ROOT / PACKAGE).iterdir()
        if path.name[0] not in "._" and (path.suffix == ".py" or (path / "__init__.py").exists())
    }
    assert there == known
    page = PAGE.read_text()
    assert not [name for name in known if f"`{name}`" not in page]


def test_types_of_arrays_are_in_one_place():
    alias = re.compile(r"^\w+Array\b.*= NDArray\[", re.MULTILINE)
    folders = (PACKAGE, "test", "bench")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert [path.name for path in files if alias.search(path.read_text())] == ["arrays.py"]


if __name__ == "__main__":
    print(drawing())
