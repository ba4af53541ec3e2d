"""Any declared parameter as an axis of the grid, and colliders by a text that says all of them."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from garment_sim_ros.collider_params import METHODS
from garment_sim_ros.declaration import (
    Declaration,
    checked,
    declarations,
    in_yaml,
    shown,
    validated,
)
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import PRESETS, ClothNodeParameters, ColliderOptions
from garment_sim_ros.sim.solvers import SOLVERS

_SOLVER, _COLLIDERS = "cloth_node", "collider_node"
_OWN = ("method", "sub_step", "iterations", "sweeps", "membrane")
"""Axes with an option of their own."""
_DETAIL = declarations(ClothNodeParameters)["detail"]
"""Belongs to no solver."""
Options = tuple[tuple[str, Any], ...]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Axis:
    """One parameter and its values.

    Attributes:
        node: `cloth_node`, of which the solver's parameters and `detail` can be axes, or
            `collider_node`.
        name: The parameter.
        texts: Its values as they were given.
    """

    node: str
    name: str
    texts: tuple[str, ...]


def axis(word: str, *, option: str = "--vary") -> Axis:
    """An axis from `NODE.PARAM=VALUE,VALUE`.

    Raises:
        ParameterError: No such parameter, or a value that it cannot have.
    """
    place, mark, text = word.partition("=")
    node, dot, name = place.strip().partition(".")
    texts = tuple(part.strip() for part in text.split(","))
    if not (mark and dot) or any(" " in part or not part for part in texts):
        form = "NODE.PARAM=VALUE,VALUE without spaces"
        raise ParameterError(option, f"found {shown(word)}", f"allowed: {form}")
    known = [d for d in _known(node) if d.name == name]
    if not known:
        names = sorted({f"{n}.{d.name}" for n in (_SOLVER, _COLLIDERS) for d in _known(n)})
        raise ParameterError(option, f"found {shown(place)}", f"allowed: {', '.join(names)}")
    for part in texts:
        try:
            _value(known[0], part)
        except ParameterError as error:
            raise ParameterError(f"{option} {place}", error.problem, error.allowed) from None
    return Axis(node=node, name=name, texts=texts)


def solver_options(axes: Sequence[Axis], solver: str) -> list[Options]:
    """Settings of a solver along axes, each once: what is its default or does nothing is left out.

    Args:
        axes: Those of parameters that the solver lacks are passed over.
        solver: Name of the solver.
    """
    own = [a for a in axes if a.node == _SOLVER]
    texts = [text for a in own if a.name == _DETAIL.name for text in a.texts]
    shares = dict.fromkeys(_value(_DETAIL, text) for text in texts or [str(_DETAIL.default)])
    return [
        (*options, *([(_DETAIL.name, share)] if share != _DETAIL.default else []))
        for options in _products(own, SOLVERS[solver].settings, {})
        for share in shares
    ]


def collider_kinds(axes: Sequence[Axis], methods: Sequence[str]) -> list[str]:
    """Colliders along axes, each once, as `collider_arguments` takes them."""
    own = [a for a in axes if a.node == _COLLIDERS]
    return [
        " ".join((method, *words(options)))
        for method in methods
        for options in _products(own, ColliderOptions, {"method": method})
    ]


def words(options: Options) -> list[str]:
    """`PARAM=VALUE` of each."""
    return [f"{name}={in_yaml(value)}" for name, value in options]


def collider_arguments(kind: str) -> dict[str, Any]:
    """Arguments of `Avatar.load` from `METHOD PARAM=VALUE ...`, or the name of a preset.

    Raises:
        ParameterError: No such method, preset or parameter, or a value that it cannot have.
    """
    first, *rest = kind.split()
    if first in PRESETS and not rest:
        return {"preset": first}
    if first not in METHODS:
        raise ParameterError(
            "colliders", f"found {shown(first)}", f"allowed: {', '.join(METHODS)}"
        )
    known, values = declarations(ColliderOptions), {"method": first}
    for word in rest:
        name, _, text = word.partition("=")
        values[name] = _value(known[name], text) if name in known else text
    return dataclasses.asdict(validated(ColliderOptions, values))


def _known(node: str) -> list[Declaration]:
    groups: dict[str, list[type]] = {
        _SOLVER: [solver.settings for solver in SOLVERS.values()],
        _COLLIDERS: [ColliderOptions],
    }
    every = [d for group in groups.get(node, []) for d in declarations(group).values()]
    shared = [_DETAIL] if node == _SOLVER else []
    return shared + [d for d in every if d.name not in _OWN]


def _products(axes: Sequence[Axis], group: type, fixed: Mapping[str, Any]) -> list[Options]:
    known = declarations(group)
    of = [a for a in axes if a.name in known]
    found: dict[Options, None] = {}
    for texts in itertools.product(*(a.texts for a in of)):
        values = {a.name: _value(known[a.name], text) for a, text in zip(of, texts)}
        found[acting(validated(group, {**fixed, **values}), values)] = None
    return list(found)


def acting(group: Any, names: Mapping[str, Any]) -> Options:
    """Of some values of a group those that are no default and do something."""
    return tuple(
        (d.name, getattr(group, d.name))
        for d in declarations(type(group)).values()
        if d.name in names
        and getattr(group, d.name) != d.default
        and all(n.met(group) for n in d.needs)
    )


def _value(declaration: Declaration, text: str) -> Any:
    value: Any = text
    if declaration.type is bool:
        value = {"true": True, "false": False}.get(text.lower(), text)
    return checked(declaration, value)
