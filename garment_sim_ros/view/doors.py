"""Who may look at the page, and what a browser may send.

The server of `viser` answers any page that a browser has open, of any site, and takes messages of
many types: a message can ask it for a public address, others set whatever attribute they name.
Here browsers are let in only with a page that came from this server, by a name that is this
machine's, and the few messages that the page needs are let through, their values checked. That
needs insides of `viser`, which stay in this file; a test names the versions that it was checked
with.
"""

import math
from collections import Counter
from collections.abc import Awaitable, Callable
from typing import Any
from urllib.parse import urlsplit

from viser import _messages as messages

CHECKED_WITH = ("1.1",)
"""Major and minor versions of `viser`."""

_CAMERA = {
    **{"wxyz": 4, "position": 3, "look_at": 3, "up_direction": 3},
    **{"fov": 1, "near": 1, "far": 1, "image_height": 1, "image_width": 1},
}
"""How many numbers each field of a camera has."""
_LONGEST_TEXT = 200
_MOST_NUMBERS = 8
_POLICY = 1008
"""Code with which a connection is closed that may not be."""
_OWN_NAMES = ("localhost", "127.0.0.1", "::1")

Handle = Callable[[Any, Any], Awaitable[None]]


class Doors:
    """Watches over the connections of a server.

    Args:
        server: The server; before anybody connects.
        loopback: Whether it serves this machine alone: then names that others may own are
            refused, too.

    Attributes:
        refused: Connections and messages that were refused, by reason.
    """

    def __init__(self, server: Any, *, loopback: bool) -> None:
        self.refused: Counter[str] = Counter()
        self._loopback = loopback
        self._barred: set[int] = set()
        inner = server._websock_server
        self._live = inner._live_connections
        inner._handle_incoming_message = self._checked(inner._handle_incoming_message)
        inner.on_client_connect(self._let_in)

    async def _let_in(self, connection: Any) -> None:
        connection._handle_incoming_message = self._checked(
            connection._handle_incoming_message, count=False
        )
        socket = self._live[connection.client_id]
        headers = socket.request.headers
        if not may_enter(headers.get("Origin"), headers.get("Host"), loopback=self._loopback):
            self.refused["origin"] += 1
            # What it sent before it was closed still comes.
            self._barred.add(connection.client_id)
            await socket.close(_POLICY, "only this server's own page")

    def _checked(self, handle: Handle, *, count: bool = True) -> Handle:
        async def checked(client: Any, message: Any) -> None:
            if client not in self._barred and is_harmless(message):
                await handle(client, message)
            elif count:
                self.refused["message"] += 1

        return checked


def may_enter(origin: str | None, host: str | None, *, loopback: bool) -> bool:
    """Whether a connection may be, by its headers.

    Args:
        origin: Of the page that asks; None where it is no browser.
        host: The name that it asked for.
        loopback: Whether only this machine's own names are good.
    """
    if origin is None:
        return True
    try:
        page, asked = urlsplit(origin), urlsplit(f"//{host}")
        same = page.scheme in ("http", "https") and page.netloc == asked.netloc
        return same and (not loopback or asked.hostname in _OWN_NAMES)
    except ValueError:
        return False


def is_harmless(message: Any) -> bool:
    """Whether a message is one that the page needs, with values that can be used."""
    if isinstance(message, messages.GuiUpdateMessage):
        updates = message.updates
        return (
            isinstance(message.uuid, str)
            and isinstance(updates, dict)
            and set(updates) <= {"value"}
            and all(_is_plain(value) for value in updates.values())
        )
    if isinstance(message, messages.ViewerCameraMessage):
        return all(_are_numbers(getattr(message, key), n) for key, n in _CAMERA.items())
    return isinstance(message, messages.GetRenderResponseMessage)


def _are_numbers(value: Any, count: int) -> bool:
    values = value if isinstance(value, list | tuple) else [value]
    return len(values) == count and all(
        isinstance(v, int | float) and math.isfinite(v) for v in values
    )


def _is_plain(value: Any) -> bool:
    """Whether a value is a short text, a finite number, or a few of these."""
    if isinstance(value, list | tuple):
        return len(value) <= _MOST_NUMBERS and _are_numbers(value, len(value))
    if isinstance(value, str):
        return len(value) <= _LONGEST_TEXT
    return value is None or (isinstance(value, int | float) and math.isfinite(value))
