"""Presets: parameters of all nodes under one name, as ROS parameter files in ``config/presets``.

A preset takes the place of defaults: what is given beside it wins. Nodes, commands and Python take
the same values from here, so that a name means the same everywhere.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from garment_sim_ros.declaration import (
    Declaration,
    checked,
    declarations,
    nearest,
    shown,
    validated,
)
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.nodes import NODES
from garment_sim_ros.params import ClothNodeParameters, ColliderOptions, LifecycleParameters
from garment_sim_ros.plain_data import read_yaml

_FOLDER = Path("config") / "presets"
_SHARE = Path("share") / "garment_sim_ros"
_LARGEST = 2**16
_USUAL_SOLVER = declarations(ClothNodeParameters)["solver"].default
_OF_A_SOLVER = ("solver", "solver_step", "rate")
"""Belong to the solver, too: what one of them is fast with, another cannot be run with."""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A preset, and what was given beside it.

    Attributes:
        preset: Its name.
        single: By node: single values, which win.
    """

    preset: str = "balanced"
    single: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def solver(self) -> str:
        """Name of the solver."""
        said = {**_read(self.preset)["cloth_node"], **self.single.get("cloth_node", {})}
        return str(said.get("solver", _USUAL_SOLVER))

    def given(self, node: str) -> dict[str, Any]:
        """What a node is to be started with."""
        return {"preset": self.preset, **self.single.get(node, {})}

    def values(self, node: str, group: type) -> dict[str, Any]:
        """What a node's group of parameters gets; those that are not said keep their default."""
        usual = preset_values(self.preset, node, solver=self.solver)
        both = {**usual, **self.single.get(node, {})}
        return {name: both[name] for name in declarations(group) if name in both}


def preset_values(name: str, node: str, *, solver: str = "") -> dict[str, Any]:
    """A node's parameters in a preset, those that it says.

    Args:
        name: The preset.
        node: The node.
        solver: The solver that runs: what the preset says of another is left out. Empty: its own.

    Raises:
        ParameterError: There is no such preset.
        InputFileError: Its file is missing or holds something else.
    """
    values = _read(name)[node]
    if not solver or solver == values.get("solver", _USUAL_SOLVER):
        return values
    known = {k for s in NODES[node].sections if not s.solver for k in declarations(s.group)}
    return {k: v for k, v in values.items() if k in known and k not in _OF_A_SOLVER}


def collider_options(name: str | None) -> dict[str, Any]:
    """How a preset has colliders fitted; nothing where it is None."""
    values = preset_values(name, "collider_node") if name is not None else {}
    return {k: v for k, v in values.items() if k in declarations(ColliderOptions)}


def worn_with(name: str | None) -> tuple[str, str]:
    """What holds garments and how the skin follows its bones, with a preset or with none."""
    values = preset_values(name, "cloth_node") if name is not None else {}
    usual = declarations(ClothNodeParameters)
    attachments, skinning = (
        str(values.get(k, usual[k].default)) for k in ("attachments", "skinning")
    )
    return attachments, skinning


def usual_colliders(name: str | None) -> ColliderOptions:
    """How colliders are fitted with a preset where nothing else is said."""
    return validated(ColliderOptions, collider_options(name))


def chosen(preset: str, words: Iterable[str] = (), *, option: str = "--set") -> Choice:
    """What a command line asks for.

    Args:
        preset: Name of a preset.
        words: ``NODE.PARAM=VALUE`` each; a later one wins.
        option: What messages call these.

    Raises:
        ParameterError: An unknown preset, node or parameter, or a value that is not allowed.
    """
    _read(preset)
    texts: dict[str, dict[str, str]] = {node: {} for node in NODES}
    for word in words:
        place, mark, text = word.partition("=")
        node, dot, name = place.strip().partition(".")
        if not (mark and dot):
            raise ParameterError(option, f"found {shown(word)}", "allowed: NODE.PARAM=VALUE")
        if node not in NODES:
            raise ParameterError(option, f"no node {shown(node)}", f"allowed: {', '.join(NODES)}")
        texts[node][name] = text.strip()
    solver = texts["cloth_node"].get("solver", "") or Choice(preset=preset).solver
    single = {
        node: {name: _value(option, node, name, text, solver) for name, text in of.items()}
        for node, of in texts.items()
    }
    return Choice(preset=preset, single=single)


def preset_file(name: str) -> Path:
    """A preset's file: beside the package in a clone, else where installing puts shared files.

    Raises:
        InputFileError: It is nowhere.
    """
    package = Path(__file__).resolve().parent
    places = [package.parent / _FOLDER, *(p / _SHARE / _FOLDER for p in package.parents)]
    for place in places:
        if (path := place / f"{name}.yaml").is_file():
            return path
    raise InputFileError(
        f"{_FOLDER}/{name}.yaml", "is not installed", "allowed: to install the package anew"
    )


def _read(name: str) -> dict[str, dict[str, Any]]:
    """All values of a preset, by node and name."""
    checked(declarations(LifecycleParameters)["preset"], name)
    path = preset_file(name)
    content = read_yaml(path, limit=_LARGEST)
    keys = {f"/**/{node}": node for node in NODES}
    if not isinstance(content, Mapping) or not set(content) <= set(keys):
        raise InputFileError(path, "is not a preset", f"allowed: {', '.join(keys)}")
    found: dict[str, dict[str, Any]] = {node: {} for node in NODES}
    for key, section in content.items():
        values = section.get("ros__parameters") if isinstance(section, Mapping) else None
        if not isinstance(values, Mapping):
            raise InputFileError(path, f"{key} has no ros__parameters", "allowed: values by name")
        solver = str(values.get("solver", _USUAL_SOLVER))
        try:
            found[keys[key]] = {
                n: checked(_declared("", keys[key], n, solver), v) for n, v in values.items()
            }
        except ParameterError as error:
            raise InputFileError(path, f"{error.name}: {error.problem}", error.allowed) from None
    return found


def _declared(option: str, node: str, name: str, solver: str) -> Declaration:
    """The declaration of a node's parameter under a solver."""
    card = NODES[node]
    acting: Sequence[type] = [s.group for s in card.sections if s.solver in ("", solver)]
    known = {k: d for group in acting for k, d in declarations(group).items()}
    if name in known:
        return known[name]
    where = f"{option} {node}.{name:.60}".strip()
    if name in card.declared():
        raise ParameterError(where, f"does nothing with the solver {solver}", _allowed(known))
    alike = nearest(name, known)
    raise ParameterError(where, f"unknown{f', perhaps {alike}' if alike else ''}", _allowed(known))


def _allowed(names: Iterable[str]) -> str:
    return "allowed: " + ", ".join(names)


def _value(option: str, node: str, name: str, text: str, solver: str) -> Any:
    """A parameter's value from its text."""
    declaration = _declared(option, node, name, solver)
    value: Any = text
    if declaration.type is bool:
        value = {"true": True, "false": False}.get(text.lower(), text)
    try:
        return checked(declaration, value)
    except ParameterError as error:
        raise ParameterError(f"{option} {node}.{name}", error.problem, error.allowed) from None
