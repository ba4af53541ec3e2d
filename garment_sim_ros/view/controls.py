"""What of a running avatar can be changed from the page, and how that is asked for."""

from collections.abc import Callable
from typing import Any, Protocol

from garment_sim_ros.declaration import Declaration
from garment_sim_ros.nodes import NODES

CLOTH, COLLIDERS, PLAYER = "cloth_node", "collider_node", "mocap_player"
SHOWN = ("preset", "solver", "gravity", "wind", "wind_drag", "wind_lift", "gust")
"""Parameters of the cloth node on the page."""
_LONGEST = 200
_PLAIN = frozenset(" .,:;=+-/%'()")

Done = Callable[[str], None]
"""Called once with what went wrong; empty where nothing did."""


class Controls(Protocol):
    """A running avatar's nodes, by name."""

    def values(self) -> dict[str, Any]:
        """Values of the cloth node's parameters as last heard; without those never heard of."""

    def set(self, name: str, value: Any, done: Done) -> None:
        """Set a parameter of the cloth node."""

    def pause(self, node: str, on: bool, done: Done) -> None:
        """Pause a node, or let it go on."""

    def reset(self, node: str, done: Done) -> None:
        """Reset a node."""


def declaration(name: str) -> Declaration:
    """Of a parameter of the cloth node."""
    return NODES[CLOTH].declared()[name]


def is_live(name: str) -> bool:
    """Whether a parameter of the cloth node can be set while it runs."""
    return any(name in section.live for section in NODES[CLOTH].sections)


def hint(name: str) -> str:
    """What a parameter is, for people."""
    d = declaration(name)
    unit = f" [{d.unit}]" if d.unit else ""
    when = "" if is_live(name) else " Set at the start: the node has to be started anew."
    return f"{d.described}{unit}{when}"


def harmless(text: str) -> str:
    """Text from outside as a line that a page can show: nothing in it is markup."""
    kept = (c if c.isascii() and (c.isalnum() or c in _PLAIN or c == "_") else " " for c in text)
    return " ".join("".join(kept).replace("_", " ").split())[:_LONGEST]
