"""Command lines of nodes: numbers that the parser of `rcl` refuses, made such as it takes.

Its YAML has no lists of whole numbers and others together, as ``[0, 0, -9.81]``.
"""

import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import yaml

from garment_sim_ros.declaration import number_in

_LARGEST_FILE = 2**20
_PLACE = re.compile(r", at \S+:\d+")


@contextmanager
def plain_numbers(words: Sequence[str] | None) -> Iterator[list[str]]:
    """The words of a command line with lists of numbers all of one type.

    Parameter files that have others are replaced by temporary ones, for as long as the block runs.

    Args:
        words: With the program's name first; None for those of the process.
    """
    given = list(sys.argv if words is None else words)
    with tempfile.TemporaryDirectory(prefix="garment-sim-") as folder:
        for i, word in enumerate(given[:-1]):
            if word in ("-p", "--param"):
                name, mark, value = given[i + 1].partition(":=")
                given[i + 1] = f"{name}{mark}{_evened(value) or value}"
            elif word == "--params-file":
                text = _evened(_read(given[i + 1]))
                if text is not None:
                    path = Path(folder) / f"{i}.yaml"
                    path.write_text(text, encoding="utf-8")
                    given[i + 1] = str(path)
        yield given


def in_short(error: Exception) -> str:
    """What `rcl` says of arguments, in one line and without places in its sources."""
    return " ".join(_PLACE.sub("", str(error)).split())


def _read(name: str) -> str:
    """A file's text; empty where `rcl` is to say what is wrong with it."""
    path = Path(name)
    try:
        if path.is_file() and path.stat().st_size <= _LARGEST_FILE:
            return path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        pass
    return ""


def _evened(text: str) -> str | None:
    """YAML with lists of numbers all of one type; None where they are."""
    try:
        node = yaml.compose(text, yaml.SafeLoader)
        lists = _lists(node)
        if not lists:
            return None
        for scalars in lists:
            for scalar in scalars:
                number = number_in(scalar.value)
                assert number is not None
                value = repr(number)
                scalar.value = value if "." in value else value.replace("e", ".0e")
                scalar.tag = "tag:yaml.org,2002:float"
                scalar.style = None
        return str(yaml.serialize(node, Dumper=yaml.SafeDumper, width=10**6)).strip()
    except (yaml.YAMLError, RecursionError, ValueError, AttributeError):
        return None


def _lists(root: yaml.Node | None) -> list[list[yaml.ScalarNode]]:
    """Lists of plain numbers of which some are whole and some are not."""
    found, left, seen = [], [root], set()
    while left:
        node = left.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, yaml.MappingNode):
            left += [value for _, value in node.value]
        elif isinstance(node, yaml.SequenceNode):
            left += node.value
            scalars = [n for n in node.value if isinstance(n, yaml.ScalarNode) and n.style is None]
            if len(scalars) == len(node.value) and all(
                number_in(n.value) is not None for n in scalars
            ):
                whole = [n.tag.endswith(":int") for n in scalars]
                if any(whole) and not all(whole):
                    found.append(scalars)
    return found
