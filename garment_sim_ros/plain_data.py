"""Plain values from JSON and YAML that nobody has checked, in time and memory like their text.

Plain are objects with text keys, lists, text, numbers, booleans and null. Refused is what a reader
downstream could trip over or what makes a short text large: numbers that are not finite, whole
numbers of more than 64 bits, lone surrogates, keys that stand twice, YAML's aliases and tags.
"""

import itertools
import json
import re
from pathlib import Path
from typing import Any

import yaml

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.input_file import MAX_FILE_BYTES, read_text

MAX_VALUES = 8_000_000
"""Most values in one JSON text; each takes some 50 bytes of memory."""
MAX_YAML_VALUES = 200_000
MAX_YAML_DEPTH = 64

_LONGEST_INTEGER = 20
_LONG = 2**20
"""A call for each number takes long, but without any no other thread runs until all are read; from
so many characters on, that would be felt."""
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
_HUGE = re.compile(r"[eE]\+?\d{3}")
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast where it is there


class PlainDataError(ValueError):
    """A text that is not plain JSON or YAML; the message is one line."""


def parse_json(text: str) -> Any:
    """The value of a JSON text.

    Raises:
        PlainDataError: Not JSON, or not plain.
    """
    if sum(text.count(mark) for mark in "[{,") > MAX_VALUES:
        raise PlainDataError(f"over {MAX_VALUES} values")
    try:
        content = json.loads(
            text,
            object_pairs_hook=_unique_keys,
            parse_constant=_refused,
            parse_float=_finite if len(text) > _LONG or _HUGE.search(text) else None,
            parse_int=_integer,
        )
        if _SURROGATE.search(text):
            json.dumps(content, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        raise PlainDataError("a text holds half of a surrogate pair") from None
    except RecursionError:
        raise PlainDataError("nested too deep") from None
    except ValueError as error:
        raise PlainDataError(_cut(error)) from None
    return content


def read_json(path: str | Path, *, limit: int = MAX_FILE_BYTES) -> Any:
    """The value in a JSON file.

    Raises:
        InputFileError: As `read_text`, or the text is not plain JSON.
    """
    try:
        return parse_json(read_text(path, limit=limit))
    except PlainDataError as error:
        raise InputFileError(path, f"is not plain JSON ({error})") from None


def parse_yaml(text: str) -> Any:
    """The value of a YAML text.

    Raises:
        PlainDataError: Not YAML, or not plain.
    """
    try:
        _check_events(text)
        return yaml.load(text, Loader=_PlainLoader)
    except PlainDataError:
        raise
    except (yaml.YAMLError, RecursionError, ValueError, TypeError) as error:
        raise PlainDataError(_cut(error)) from None


def read_yaml(path: str | Path, *, limit: int) -> Any:
    """The value in a YAML file.

    Raises:
        InputFileError: As `read_text`, or the text is not plain YAML.
    """
    try:
        return parse_yaml(read_text(path, limit=limit))
    except PlainDataError as error:
        raise InputFileError(path, f"is not plain YAML ({error})") from None


def number_kinds(value: Any, *, most_dimensions: int = 3) -> set[type]:
    """The types of all numbers in nested lists; empty if anything else is in them.

    Asked before an array is made: among numbers, one text of 100 kB would give each of them as
    much room.

    Args:
        value: A number, a list of numbers, a list of such lists, ...
        most_dimensions: Deepest nesting.
    """
    level = [value]
    for _ in range(most_dimensions + 1):
        kinds = set(map(type, level))
        if kinds != {list}:
            return kinds if kinds <= {int, float} else set()
        level = list(itertools.chain.from_iterable(level))
    return set()


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        raise ValueError("an object has the same key twice")
    return result


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is not a number")


def _finite(text: str) -> float:
    number = float(text)
    if number - number != 0.0:
        raise ValueError(f"{text[:20]} is not finite")
    return number


def _integer(text: str) -> int:
    if len(text) > _LONGEST_INTEGER:
        raise ValueError(f"a whole number has {len(text)} digits")
    return int(text)


def _check_events(text: str) -> None:
    """Refuse aliases, tags and depth before anything is built."""
    depth = 0
    for count, event in enumerate(yaml.parse(text, Loader=_LOADER)):
        if count > MAX_YAML_VALUES:
            raise PlainDataError(f"over {MAX_YAML_VALUES} values")
        if isinstance(event, yaml.AliasEvent):
            raise PlainDataError("aliases are not allowed")
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > MAX_YAML_DEPTH:
                raise PlainDataError(f"nested over {MAX_YAML_DEPTH} deep")
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if getattr(event, "tag", None) is not None:
            raise PlainDataError("tags are not allowed")


class _PlainLoader(_LOADER):
    """Safe YAML without repeated keys and without numbers that no reader takes."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """As the base class does, if no key stands twice."""
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise ValueError(f"the key {key.value[:60]!r} stands twice")
                seen.add(key.value)
        return super().construct_mapping(node, deep)

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        """As the base class does, up to 64 bits."""
        if len(node.value) > 4 * _LONGEST_INTEGER:
            raise ValueError(f"a whole number has {len(node.value)} digits")
        number = super().construct_yaml_int(node)
        if not -(2**63) <= number < 2**63:
            raise ValueError(f"the whole number {number} has over 64 bits")
        return number


_PlainLoader.add_implicit_resolver(
    # YAML 1.2 has these among its numbers, the 1.1 of the base class does not: 1e-5, 2E3.
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)


_PlainLoader.add_constructor("tag:yaml.org,2002:int", _PlainLoader.construct_yaml_int)


def _cut(error: Exception) -> str:
    return " ".join(str(error).split())[:200]
