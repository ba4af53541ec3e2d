"""How parameters are declared and checked: type, default, unit, range and text.

A group of parameters is a frozen dataclass whose fields are made by `parameter`; those of nodes,
solvers and fabrics are in `params`. Nodes, commands, outfit files and documents derive names,
ranges and texts from it (`declarations`), and all values from outside pass through `validated`.
"""

import dataclasses
import difflib
import math
import re
from collections.abc import Iterable, Mapping
from itertools import islice
from numbers import Real
from types import MappingProxyType
from typing import Any, TypeVar

from garment_sim_ros.errors import ParameterError

Group = TypeVar("Group")

_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?")
_LONGEST_NUMBER = 64
_LONGEST_SHOWN = 80
_LONGEST_NAME = 60
_NO_ALIASES: Mapping[str, str] = MappingProxyType({})
_NO_VALUES: Mapping[str, Any] = MappingProxyType({})


@dataclasses.dataclass(frozen=True)
class Needs:
    """What another parameter has to be, so that a parameter does something.

    Attributes:
        names: Other parameters; one of them is enough.
        values: Values of it with which the parameter acts; empty: any but 0, false and none.
        words: The same for people.
    """

    names: tuple[str, ...]
    values: tuple[Any, ...]
    words: str

    def met(self, group: Any) -> bool:
        """Whether the values of a group are such; other parameters that it lacks are no matter."""
        found = [getattr(group, name) for name in self.names if hasattr(group, name)]
        return not found or any(v in self.values if self.values else v for v in found)


def needs(name: str, *values: Any) -> Needs:
    """That another parameter has one of some values."""
    return Needs((name,), values, f"{name} {' or '.join(in_yaml(v) for v in values)}")


def needs_any(*names: str) -> Needs:
    """That one of other parameters is above 0."""
    return Needs(names, (), f"{' or '.join(names)} above 0")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Declaration:
    """What is declared about one parameter.

    Attributes:
        name: Field name, also the ROS parameter and the YAML key.
        type: `bool`, `int`, `float`, `str` or `tuple` (of floats, fixed length).
        default: Default value.
        unit: SI unit as text, empty where there is none.
        minimum: Smallest value allowed, None for no limit.
        maximum: Largest value allowed, None for no limit.
        choices: Allowed values of a string, empty for any.
        text: One sentence for people.
        needs: What other parameters have to be, all of it, so that this one does something.
        aliases: Other spellings of choices, which become them.
    """

    name: str
    type: type
    default: Any
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    text: str
    needs: tuple[Needs, ...] = ()
    aliases: Mapping[str, str] = dataclasses.field(default_factory=dict)

    @property
    def described(self) -> str:
        """The text, and what the parameter acts with."""
        return f"{self.text} Acts with {self.acts_with}." if self.needs else self.text

    @property
    def acts_with(self) -> str:
        """What makes it act, in words."""
        return ", and ".join(needs.words for needs in self.needs)

    @property
    def allowed(self) -> str:
        """The allowed values as text for error messages."""
        if self.choices:
            return "allowed: " + ", ".join(self.choices)
        kind = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}.get(
            self.type, f"{len(self.default)} numbers" if self.type is tuple else "a value"
        )
        low = "" if self.minimum is None else f" from {_shortly(self.minimum)}"
        high = "" if self.maximum is None else f" to {_shortly(self.maximum)}"
        return f"allowed: {kind}{low}{high}{' ' + self.unit if self.unit else ''}"


def parameter(
    default: Any,
    text: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    needs: tuple[Needs, ...] = (),
    aliases: Mapping[str, str] = _NO_ALIASES,
) -> Any:
    """A dataclass field with its declaration; see `Declaration` for the arguments."""
    return dataclasses.field(
        default=default,
        metadata={
            "declaration": {
                "type": type(default),
                "unit": unit,
                "minimum": minimum,
                "maximum": maximum,
                "choices": choices,
                "text": text,
                "needs": needs,
                "aliases": aliases,
            }
        },
    )


def declarations(group: type) -> dict[str, Declaration]:
    """The declarations of a parameter group, in field order."""
    return {
        f.name: Declaration(name=f.name, default=f.default, **f.metadata["declaration"])
        for f in dataclasses.fields(group)
        if "declaration" in f.metadata
    }


def checked(declaration: Declaration, value: Any) -> Any:
    """`value` converted to the declared type and checked against the declared range.

    Numbers may be whole ones or text, as some readers of YAML have `1e-5`; several may be text as
    a whole, as `ros2 param set` has `[0, 0, -9.81]`.

    Raises:
        ParameterError: Wrong type, not finite, or out of range.
    """

    def refuse() -> ParameterError:
        return ParameterError(declaration.name, f"found {shown(value)}", declaration.allowed)

    def number(v: Any) -> float:
        v = number_in(v)
        if v is None or not math.isfinite(v):
            raise refuse()
        if declaration.minimum is not None and v < declaration.minimum:
            raise refuse()
        if declaration.maximum is not None and v > declaration.maximum:
            raise refuse()
        return v

    if declaration.type is bool or declaration.type is str:
        if not isinstance(value, declaration.type):
            raise refuse()
        if isinstance(value, str):
            value = declaration.aliases.get(value, value)
        if declaration.choices and value not in declaration.choices:
            raise refuse()
        return value
    if declaration.type is int:
        v = number(value)
        if v != int(v):
            raise refuse()
        return int(v)
    if declaration.type is tuple:
        several = _several(value, len(declaration.default))
        if several is None:
            raise refuse()
        return tuple(number(v) for v in several)
    return number(value)


def number_in(value: Any) -> float | None:
    """A number, or the one that a text spells; None where it is neither."""
    if isinstance(value, str) and len(value) <= _LONGEST_NUMBER:
        text = value.strip()
        return float(text) if _NUMBER.fullmatch(text) else None
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        return float(value)
    except OverflowError:  # whole numbers have no largest one
        return math.inf


def _several(value: Any, count: int) -> list[Any] | None:
    """So many entries, or those that a text lists; None where it is neither."""
    if isinstance(value, str) and len(value) <= count * (_LONGEST_NUMBER + 2):
        text = value.strip()
        if text.startswith("[") and text.endswith("]"):
            text = text[1:-1]
        value = text.split(",")
    if isinstance(value, str | bytes | Mapping) or not hasattr(value, "__len__"):
        return None
    return list(value) if len(value) == count else None


def shown(value: Any) -> str:
    """A value for a message: short, in one line, lists of all kinds alike."""
    if not isinstance(value, str | bytes | Mapping) and hasattr(value, "__len__"):
        entries = [shown(v) for v in islice(value, _LONGEST_SHOWN // 2)]
        text = f"[{', '.join(entries)}{']' if len(value) == len(entries) else ''}"
    elif isinstance(value, int) and abs(value) >= 10**_LONGEST_SHOWN:
        return "a whole number of too many digits"
    else:
        text = repr(value[: _LONGEST_SHOWN + 1] if isinstance(value, str | bytes) else value)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name that is spelt most like `name`; empty where none is alike."""
    alike = difflib.get_close_matches(name[:_LONGEST_NAME].lower(), list(known), 1, 0.6)
    return alike[0] if alike else ""


def idle(group: Any, usual: Mapping[str, Any] = _NO_VALUES) -> list[str]:
    """What was set in a group and does nothing, a sentence each, with what would make it act.

    Args:
        group: An instance of a parameter group.
        usual: What stands in place of defaults, by name.
    """
    return [
        f"{d.name}: found {shown(getattr(group, d.name))}, which does nothing; "
        f"it acts with {d.acts_with}"
        for d in declarations(type(group)).values()
        if getattr(group, d.name) not in (d.default, usual.get(d.name, d.default))
        and not all(n.met(group) for n in d.needs)
    ]


def validated(group: type[Group], values: Mapping[str, Any]) -> Group:
    """An instance of `group` from untrusted values.

    Args:
        group: A parameter group.
        values: Values by name; absent ones keep their default.

    Raises:
        ParameterError: An unknown name or a value that is not allowed.
    """
    known = declarations(group)
    for name in values:
        if name not in known:
            alike = nearest(str(name), known)
            raise ParameterError(
                str(name)[:_LONGEST_NAME],
                f"unknown{f', perhaps {alike}' if alike else ''}",
                "allowed: " + ", ".join(known),
            )
    return group(**{name: checked(known[name], value) for name, value in values.items()})


def markdown_table(group: type) -> str:
    """The declarations of a group as a Markdown table: name, default, what is allowed, text."""
    rows = ["| parameter | default | allowed | |", "|---|---|---|---|"]
    for d in declarations(group).values():
        default = f"`{in_yaml(d.default)}`" if d.default != "" else "-"
        allowed = d.allowed.removeprefix("allowed: ")
        rows.append(f"| `{d.name}` | {default} | {allowed} | {d.described} |")
    return "\n".join(rows)


def in_yaml(value: Any) -> str:
    """A value as people write it in YAML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(in_yaml(v) for v in value)}]"
    if isinstance(value, float):
        text = _shortly(value)
        return text if "." in text or "e" in text else f"{text}.0"
    return value if isinstance(value, str) and value else str(value) or '""'


def _shortly(value: float) -> str:
    """A number with as many digits as it needs, at most six if it is not a whole one."""
    if isinstance(value, int) or (value == int(value) and abs(value) < 1e6):
        return str(int(value))
    return re.sub(r"e\+?(-?)0*(\d)", r"e\1\2", f"{value:.6g}")
