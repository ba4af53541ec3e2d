"""The page: a server of `viser` on one port, and the meshes on it."""

import contextlib
import errno
import io
import logging
import os
import socket
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import viser
from PIL import Image

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GarmentSimError, ParameterError
from garment_sim_ros.view.doors import Doors
from garment_sim_ros.view.scene import Drawn

_PORT_OVERRIDE = "_VISER_PORT_OVERRIDE"
_ROOT = "/avatar"
_EYE = (1.2, -2.1, 1.35)
_MIDDLE = (0.0, 0.0, 0.88)
_FIELD = 0.8
"""Vertical field of view [rad]."""
_FOLLOW = 0.15
"""Share of the way to the avatar that the view goes in one frame."""
_LOST = 3.0
"""Beyond this distance the view jumps [m]."""
_THERE = 1e-3
"""Within this distance the view stands still [m]."""
_SHOT_LIMIT = 20.0
"""For a browser to draw a picture [s]."""
_LARGEST_SHOT = 4096


class Page:
    """A page with a scene.

    Args:
        host: Address to serve at.
        port: TCP port; 0 for any that is free.

    Attributes:
        server: What serves it.
        doors: Who was refused.
        url: Where it is.
        follows: Whether the view follows the avatar.

    Raises:
        ParameterError: The address or port cannot be had.
    """

    def __init__(self, host: str, port: int) -> None:
        address, loopback = _free(host, port)
        # The library would move elsewhere, without a word, where it cannot have what it was told.
        os.environ.pop(_PORT_OVERRIDE, None)
        # Connections that send nonsense are ended; that is no news.
        logging.getLogger("websockets").setLevel(logging.CRITICAL)
        with _quiet():
            self.server = viser.ViserServer(host=address, port=port, verbose=False)
        self.port = self.server.get_port()
        if port not in (0, self.port):
            self.close()
            raise _taken(port)
        self.doors = Doors(self.server, loopback=loopback)
        self.url = f"http://{f'[{host}]' if ':' in host else host}:{self.port}"
        self.follows = True
        self._meshes: dict[str, Any] = {}
        self._offset = np.full(3, np.nan)
        gui = self.server.gui
        gui.configure_theme(show_share_button=False, show_logo=False, control_width="medium")
        gui.set_panel_label("garment-sim view")
        self.server.initial_camera.position = _EYE
        self.server.initial_camera.look_at = _MIDDLE
        self.server.initial_camera.fov = _FIELD
        self.server.initial_camera.up = (0.0, 0.0, 1.0)
        self._root = self.server.scene.add_frame(_ROOT, show_axes=False)
        self.server.scene.add_grid(
            f"{_ROOT}/floor", infinite_grid=True, fade_distance=14.0, shadow_opacity=0.2,
            plane_color=(236, 238, 241), plane_opacity=1.0,
        )  # fmt: skip

    @property
    def is_watched(self) -> bool:
        """Whether a browser has the page open."""
        return bool(self.server.get_clients())

    def show(self, drawn: Sequence[Drawn]) -> None:
        """Show these meshes and no others."""
        with self.server.atomic():
            for d in drawn:
                self._show(d)
            names = {d.name for d in drawn}
            for name, handle in self._meshes.items():
                if name not in names:
                    handle.visible = False

    def forget(self) -> None:
        """Take away all meshes, for others of the same names."""
        for handle in self._meshes.values():
            handle.remove()
        self._meshes.clear()

    def _show(self, d: Drawn) -> None:
        handle = self._meshes.get(d.name)
        if handle is None:
            self._meshes[d.name] = self.server.scene.add_mesh_simple(
                f"{_ROOT}/{d.name}",
                d.vertices,
                d.triangles.astype(np.uint32),
                color=d.colour,
                opacity=d.opacity,
                side=d.side,
                cast_shadow=d.opacity is None and d.side != "back",
                receive_shadow=False,
            )
            return
        handle.vertices = d.vertices
        handle.faces = d.triangles
        handle.color = d.colour
        handle.visible = True

    def look_at(self, centre: FloatArray) -> None:
        """Go a part of the way to a place; to be called again and again.

        Args:
            centre: The middle of the avatar in the world [m], shape [3].
        """
        target = np.array([centre[0], centre[1], 0.0]) if self.follows else np.zeros(3)
        if not np.isfinite(target).all():
            return
        way = target - self._offset
        far = float(np.linalg.norm(way))
        if far < _THERE:
            return
        near = far < _LOST  # not at first: then it is not a number
        self._offset = self._offset + _FOLLOW * way if near else target
        self._root.position = tuple(-self._offset)

    def picture(self, client: "viser.ClientHandle") -> bytes:
        """What a browser shows, without the panel, as PNG.

        Raises:
            GarmentSimError: It did not draw it.
        """
        camera = client.camera
        height = min(max(int(camera.image_height), 16), _LARGEST_SHOT)
        width = min(max(int(camera.image_width), 16), _LARGEST_SHOT)
        try:
            pixels = client.get_render(height, width, transport_format="png", timeout=_SHOT_LIMIT)
        except (RuntimeError, TimeoutError) as error:
            raise GarmentSimError(f"screenshot: {error}") from None
        # Where nothing is drawn the picture is transparent.
        opaque = pixels[..., 3:].astype(np.float32) / 255.0
        flat = pixels[..., :3] * opaque + 255.0 * (1.0 - opaque)
        out = io.BytesIO()
        Image.fromarray(flat.astype(np.uint8)).save(out, "PNG")
        return out.getvalue()

    def close(self) -> None:
        """End serving."""
        with _quiet():
            self.server.stop()


def _free(host: str, port: int) -> tuple[str, bool]:
    """The numeric address of a host, and whether only this machine reaches it.

    Raises:
        ParameterError: There is no such address, or the port is taken.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (OSError, UnicodeError):
        raise ParameterError(
            "--host", f"found {host!r}", "allowed: a name or address of this machine"
        ) from None
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        # As the server will: what a server left a moment ago is free.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(address)
        except PermissionError:
            raise ParameterError(
                "--port", f"{port} is not for users", "allowed: above 1023"
            ) from None
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise _taken(port) from None
            raise ParameterError(
                "--host", f"found {host!r}", "allowed: a name or address of this machine"
            ) from None
    numeric = str(address[0])
    return numeric, numeric == "::1" or numeric.startswith("127.")


def _taken(port: int) -> ParameterError:
    return ParameterError("--port", f"{port} is taken", "allowed: a free port, or 0 for any")


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """What the library prints is for its own users."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
