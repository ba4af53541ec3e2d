"""The nodes: what each is for, and which parameters it has under which solver."""

import json
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from garment_sim_ros.declaration import Declaration, declarations, in_yaml, nearest
from garment_sim_ros.params import (
    ClothNodeParameters,
    ColliderNodeParameters,
    Environment,
    ImplicitSettings,
    LifecycleParameters,
    MocapPlayerParameters,
    RelaxationSettings,
    XpbdSettings,
)
from garment_sim_ros.version import VERSION

_WIDTH = 96


@dataclass(frozen=True, kw_only=True)
class Section:
    """A group of a node's parameters.

    Attributes:
        title: What they are.
        group: The group.
        live: Names of those that may be set while the node runs.
        solver: The solver that has them; empty for all.
    """

    title: str
    group: type
    live: tuple[str, ...] = ()
    solver: str = ""


@dataclass(frozen=True, kw_only=True)
class NodeCard:
    """What there is to know of a node without starting it.

    Attributes:
        name: The executable's, and the node's unless it is remapped.
        text: What it does.
        sections: Its parameters.
    """

    name: str
    text: str
    sections: tuple[Section, ...]

    def section(self, group: type) -> Section:
        """The section of a group."""
        return next(s for s in self.sections if s.group is group)

    def declared(self) -> dict[str, Declaration]:
        """Parameters by name; where solvers share a name, one of theirs."""
        return {k: d for s in self.sections for k, d in declarations(s.group).items()}

    def help(self) -> str:
        """What `--help` prints."""
        lines = [
            f"{self.name}: {self.text}",
            "",
            f"usage: ros2 run garment_sim_ros {self.name} --ros-args -p NAME:=VALUE "
            "--params-file FILE.yaml",
            f"       {self.name} --help | --version",
        ]
        for section in self.sections:
            lines += ["", f"{section.title}:"]
            for d in declarations(section.group).values():
                kind = f"{len(d.default)} floats" if d.type is tuple else d.type.__name__
                default = in_yaml(d.default) if d.default != "" else '""'
                unit = f" {d.unit}" if d.unit else ""
                live = "; may be set while it runs" if d.name in section.live else ""
                lines.append(f"  {d.name} ({kind}, default {default}{unit})")
                text = f"{d.described} {d.allowed[0].upper()}{d.allowed[1:]}{live}."
                lines += textwrap.wrap(
                    text, _WIDTH, initial_indent="      ", subsequent_indent="      "
                )
        return "\n".join(lines)

    def parameter_file(self) -> str:
        """A parameter file with every default; of the solvers' only those of the default one."""
        lines = [
            f"# Parameters of {self.name}, all at their defaults.",
            "# What stands here wins over a preset: keep the lines that you change.",
            "/**:",
            "  ros__parameters:",
        ]
        solver = getattr(self.sections[0].group(), "solver", "")
        for section in sorted(self.sections, key=lambda s: s is not _COMMON):
            if section.solver in ("", solver):
                for d in declarations(section.group).values():
                    value = json.dumps(d.default)  # JSON is YAML
                    lines += [
                        f"    # {d.described} {d.allowed[0].upper()}{d.allowed[1:]}.",
                        f"    {d.name}: {value}",
                    ]
        return "\n".join(lines) + "\n"

    def unknown(self, name: str, solver: str = "") -> str:
        """What to say of a name that is given and is none of the node's parameters.

        Args:
            name: The name.
            solver: Name of the solver that the node runs, if it does.
        """
        others = [s.solver for s in self.sections if s.solver and name in declarations(s.group)]
        if others:
            return (
                f"{name}: does nothing with the solver {solver}; "
                f"it acts with solver {' or '.join(others)}"
            )
        elsewhere = [n for n, card in NODES.items() if n != self.name and name in card.declared()]
        if elsewhere:
            return f"{name}: does nothing here; it is a parameter of {' and '.join(elsewhere)}"
        alike = nearest(name, [*self.declared(), "use_sim_time"])
        return (
            f"{name}: is no parameter of {self.name} and does nothing"
            f"{f', perhaps {alike}' if alike else ''}; allowed: see {self.name} --help"
        )


def version() -> str:
    """What `--version` prints."""
    return f"garment_sim_ros {VERSION}"


_COMMON = Section(title="of every node", group=LifecycleParameters)
_SOLVERS = {
    "relaxation": RelaxationSettings,
    "xpbd": XpbdSettings,
    "implicit": ImplicitSettings,
}

NODES: Mapping[str, NodeCard] = MappingProxyType(
    {
        card.name: card
        for card in (
            NodeCard(
                name="mocap_player",
                text="publishes a clip as joint states, with the skeleton that they move.",
                sections=(
                    Section(title="parameters", group=MocapPlayerParameters, live=("speed",)),
                    _COMMON,
                ),
            ),
            NodeCard(
                name="collider_node",
                text="fits colliders to a body and poses them as a skeleton's joint states say.",
                sections=(
                    Section(title="parameters", group=ColliderNodeParameters),
                    _COMMON,
                ),
            ),
            NodeCard(
                name="cloth_node",
                text="simulates an outfit on posed colliders and publishes the garments.",
                sections=(
                    Section(
                        title="parameters",
                        group=ClothNodeParameters,
                        live=("delay", "frame_budget_ms"),
                    ),
                    Section(
                        title="outer forces",
                        group=Environment,
                        live=tuple(declarations(Environment)),
                    ),
                    *(
                        Section(
                            title=f"of the solver {solver}",
                            group=group,
                            live=tuple(declarations(group)),
                            solver=solver,
                        )
                        for solver, group in _SOLVERS.items()
                    ),
                    _COMMON,
                ),
            ),
        )
    }
)
"""The nodes by name."""
