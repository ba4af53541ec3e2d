"""How parameters are declared and checked: type, default, unit, range and text.

A group of parameters is a frozen dataclass whose fields are made by `parameter`; those of nodes,
solvers and fabrics are in `params`. Nodes, commands, outfit files and documents derive names,
ranges and texts from it (`declarations`), and all values from outside pass through `validated`.
"""

import dataclasses
import math
import sys
from collections.abc import Mapping
from typing import Any, TypeVar

from garment_sim_ros.errors import ParameterError

Group = TypeVar("Group")


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
    """

    name: str
    type: type
    default: Any
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    text: str

    @property
    def allowed(self) -> str:
        """The allowed values as text for error messages."""
        if self.choices:
            return "allowed: " + ", ".join(self.choices)
        kind = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}.get(
            self.type, f"{len(self.default)} numbers" if self.type is tuple else "a value"
        )
        low = "" if self.minimum is None else f" from {self.minimum:g}"
        high = "" if self.maximum is None else f" to {self.maximum:g}"
        return f"allowed: {kind}{low}{high}{' ' + self.unit if self.unit else ''}"


def parameter(
    default: Any,
    text: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
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

    Raises:
        ParameterError: Wrong type, not finite, or out of range.
    """

    def refuse() -> ParameterError:
        return ParameterError(declaration.name, f"found {value!r:.60}", declaration.allowed)

    def number(v: Any) -> float:
        if isinstance(v, bool) or not isinstance(v, int | float) or not abs(v) < math.inf:
            raise refuse()
        if abs(v) > sys.float_info.max:  # a whole number of hundreds of digits
            raise refuse()
        if declaration.minimum is not None and v < declaration.minimum:
            raise refuse()
        if declaration.maximum is not None and v > declaration.maximum:
            raise refuse()
        return float(v)

    if declaration.type is bool or declaration.type is str:
        if not isinstance(value, declaration.type):
            raise refuse()
        if declaration.choices and value not in declaration.choices:
            raise refuse()
        return value
    if declaration.type is int:
        v = number(value)
        if v != int(v):
            raise refuse()
        return int(v)
    if declaration.type is tuple:
        if isinstance(value, str | bytes | Mapping) or not hasattr(value, "__iter__"):
            raise refuse()
        values = tuple(number(v) for v in value)
        if len(values) != len(declaration.default):
            raise refuse()
        return values
    return number(value)


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
            raise ParameterError(str(name), "unknown", "allowed: " + ", ".join(known))
    return group(**{name: checked(known[name], value) for name, value in values.items()})


def markdown_table(group: type) -> str:
    """The declarations of a group as a Markdown table: name, default, what is allowed, text."""
    rows = ["| parameter | default | allowed | |", "|---|---|---|---|"]
    for d in declarations(group).values():
        default = f"{d.default:.6g}" if isinstance(d.default, float) else f"{d.default}"
        allowed = d.allowed.removeprefix("allowed: ")
        rows.append(
            f"| `{d.name}` | {f'`{default}`' if default else '-'} | {allowed} | {d.text} |"
        )
    return "\n".join(rows)
