"""What the documents say of parameters and commands is what is declared."""

import re
from pathlib import Path

import pytest

from garment_sim_ros import params
from garment_sim_ros.cli.main import COMMANDS
from garment_sim_ros.nodes import NODES

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize(
    "group",
    [params.Material, *{s.group: s for card in NODES.values() for s in card.sections}],
)
def test_parameter_tables_are_those_declared(group):
    assert params.markdown_table(group) in (DOCS / "ros_interface.md").read_text()


def test_every_command_is_in_the_readme():
    text = (DOCS.parent / "README.md").read_text()
    for command in COMMANDS:
        assert f"| `{command}" in text


def test_links_between_documents_lead_somewhere():

    for page in [DOCS.parent / "README.md", *DOCS.glob("*.md")]:
        for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
            assert (page.parent / link).exists(), f"{page.name}: {link}"
