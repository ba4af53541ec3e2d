"""ROS parameters out of the parameter groups of `garment_sim_ros.params`.

Ranges and texts of the declarations become descriptors, so that tools show them. A value from
outside passes through `params.checked`, at the start and whenever it is set.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from garment_sim_ros.declaration import Declaration, nearest
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import checked, declarations

Group = TypeVar("Group")

_NO_LIMIT = 1e300


class NodeParameters(Generic[Group]):
    """One group of parameters on one node.

    Args:
        node: The node.
        group: The parameter group.
        usual: Values by name that stand in place of defaults, those of a preset.
        dynamic: Names that may be set while the node runs; the others are read-only.
        check: Called with the values that some are to be set to; may raise `ParameterError`.
        on_change: Called with the new values after some of them were set.

    Attributes:
        values: The values now, an instance of the group.
        usual: As given.

    Raises:
        ParameterError: A value given at the start is not allowed.
    """

    def __init__(
        self,
        node: Node,
        group: type[Group],
        *,
        usual: Mapping[str, Any] | None = None,
        dynamic: Collection[str] = (),
        check: Callable[[Group], None] | None = None,
        on_change: Callable[[Group], None] | None = None,
    ) -> None:
        self._declarations = declarations(group)
        self.usual = {k: v for k, v in (usual or {}).items() if k in self._declarations}
        self._check_together = check
        self._on_change = on_change
        self.values: Group = group(
            **{
                name: self._declare(node, declaration, read_only=name not in dynamic)
                for name, declaration in self._declarations.items()
            }
        )
        self._live = frozenset(dynamic)
        node.add_post_set_parameters_callback(self._take)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the group's parameters."""
        return tuple(self._declarations)

    def _declare(self, node: Node, declaration: Declaration, *, read_only: bool) -> Any:
        name = declaration.name
        default = self.usual.get(name, declaration.default)
        # Any type at first: a whole number is a number, and errors are to be our own.
        anything = ParameterDescriptor(dynamic_typing=True)
        given = node.declare_parameter(name, _plain(default), anything).value
        node.undeclare_parameter(name)
        value = checked(declaration, given)
        node.declare_parameter(
            name, _plain(value), _descriptor(declaration, read_only), ignore_override=True
        )
        return value

    def taken(self, parameters: Sequence[Parameter]) -> dict[str, Parameter]:
        """Those of some parameters that are of this group, by name, of their declared types.

        Raises:
            ParameterError: A value is not allowed now, or not with the others.
        """
        mine = [p for p in parameters if p.name in self._declarations]
        for p in mine:
            if p.name not in self._live:
                raise ParameterError(
                    p.name, "is read-only while the node runs", "allowed: to set it at the start"
                )
        changes = self._changes(mine)
        if changes and self._check_together is not None:
            self._check_together(replace(self.values, **changes))  # type: ignore[type-var]
        return {name: Parameter(name, value=_plain(value)) for name, value in changes.items()}

    def _take(self, parameters: Sequence[Parameter]) -> None:
        changes = self._changes(parameters)
        if changes:
            self.values = replace(self.values, **changes)  # type: ignore[type-var]
            if self._on_change is not None:
                self._on_change(self.values)

    def _changes(self, parameters: Sequence[Parameter]) -> dict[str, Any]:
        """Checked values of those that are mine."""
        return {
            p.name: checked(self._declarations[p.name], p.value)
            for p in parameters
            if p.name in self._declarations
        }


def set_on(
    node: Node, groups: Sequence[NodeParameters[Any]], parameters: Sequence[Parameter]
) -> tuple[list[Parameter], str]:
    """Parameters as a node declares them, and why they cannot be set; empty if they can.

    `rclpy` refuses a whole number for a real one, and in its own words, before any callback.
    """
    plain = {p.name: p for p in parameters}
    try:
        for name in plain:
            if not node.has_parameter(name):
                known = [n for group in groups for n in group.names]
                alike = nearest(name, known)
                raise ParameterError(
                    name,
                    f"is no parameter of {node.get_name()}{f', perhaps {alike}' if alike else ''}",
                )
        for group in groups:
            plain.update(group.taken(parameters))
    except ParameterError as error:
        return [], str(error)
    return list(plain.values()), ""


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _descriptor(declaration: Declaration, read_only: bool) -> ParameterDescriptor:
    unit = f" [{declaration.unit}]" if declaration.unit else ""
    descriptor = ParameterDescriptor(
        description=declaration.described + unit,
        additional_constraints=declaration.allowed,
        read_only=read_only,
    )
    low, high = declaration.minimum, declaration.maximum
    if declaration.type is float and (low is not None or high is not None):
        descriptor.floating_point_range = [
            FloatingPointRange(
                from_value=-_NO_LIMIT if low is None else float(low),
                to_value=_NO_LIMIT if high is None else float(high),
                step=0.0,
            )
        ]
    if declaration.type is int and (low is not None or high is not None):
        descriptor.integer_range = [
            IntegerRange(
                from_value=-(2**31) if low is None else int(low),
                to_value=2**31 if high is None else int(high),
                step=1,
            )
        ]
    return descriptor
