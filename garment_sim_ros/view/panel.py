"""The panel beside the scene: what is shown, playing, the node's parameters, graphs."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.declaration import checked
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.view.controls import (
    CLOTH,
    PLAYER,
    SHOWN,
    Controls,
    declaration,
    harmless,
    hint,
    is_live,
)
from garment_sim_ros.view.levels import LEVELS, PENETRATION, STRAIN, Scale, colour
from garment_sim_ros.view.page import Page
from garment_sim_ros.view.playback import SPEEDS, Playback
from garment_sim_ros.view.scene import COLOURS, LAYER, PLAIN, Scene

_GRAPH_POINTS = 600
_SCALES = {s.name: s for s in (STRAIN, PENETRATION)}
_LEGENDS = {
    PLAIN: "One colour for each garment; the inside is darker.",
    LAYER: "One colour for each layer; grey: not known.",
}
_STYLE = "padding:0 1em;font-size:0.8em"
_WAIT_FOR_OWN = 1.5
"""After a change the value that the node tells may still be the old one [s]."""


class Panel:
    """What people set.

    Args:
        page: The page.
        scene: What it shows.

    Attributes:
        changed: Whether something was set since it was last made false.
    """

    def __init__(self, page: Page, scene: Scene) -> None:
        self._page, self._gui, self._scene = page, page.server.gui, scene
        self.changed = True
        self._status = self._gui.add_markdown("starting")
        self._said = ""
        self._add_shot()

    def _add_shot(self) -> None:
        button = self._gui.add_button("Screenshot (PNG)")

        @button.on_click
        def _(event: Any) -> None:
            if event.client is None:
                return
            try:
                data = self._page.picture(event.client)
            except GarmentSimError as error:
                self.tell(str(error))
                return
            event.client.send_file_download("garment-sim.png", data, save_immediately=True)

    def add_looks(self) -> None:
        """What is shown, and in which colours."""
        shows = self._scene.shows
        with self._gui.add_folder("Show"):
            for name in ("body", "garments", "colliders"):
                self._bind(self._gui.add_checkbox(name, getattr(shows, name)), shows, name)
            self._bind(self._gui.add_checkbox("follow", self._page.follows), self._page, "follows")
            pick = self._gui.add_dropdown("colours", COLOURS, initial_value=shows.colours)
            legend = self._gui.add_html(_legend(shows.colours))

        @pick.on_update
        def _(event: Any) -> None:
            if pick.value in COLOURS:
                shows.colours = pick.value
                legend.content = _legend(pick.value)
                self.changed = True

    def _bind(self, box: Any, owner: object, name: str) -> None:
        @box.on_update
        def _(event: Any) -> None:
            setattr(owner, name, bool(box.value))
            self.changed = True

    def add_playing(self, playback: Playback) -> Callable[[], None]:
        """Play, pause, speed and time of a recording; returns what shows the present time."""
        with self._gui.add_folder("Recording"):
            play = self._gui.add_checkbox("play", playback.playing)
            speed = self._gui.add_dropdown(
                "speed", tuple(f"{s:g}" for s in SPEEDS), initial_value=f"{playback.speed:g}"
            )
            length = max(playback.duration, 1e-3)
            at: Any = self._gui.add_slider("time [s]", 0.0, length, min(0.01, length), 0.0)

        @play.on_update
        def _(event: Any) -> None:
            playback.playing = bool(play.value)

        @speed.on_update
        def _(event: Any) -> None:
            if speed.value in [f"{s:g}" for s in SPEEDS]:
                playback.speed = float(speed.value)

        @at.on_update
        def _(event: Any) -> None:
            if event.client is not None:  # not what `show` sets
                playback.seek(float(at.value))
                self.changed = True

        def show() -> None:
            at.value = round(min(playback.time, length), 2)

        return show

    def add_controls(self, controls: Controls) -> Callable[[], None]:
        """Pause, reset and parameters of a running avatar; returns what shows their values."""
        with self._gui.add_folder("Run"):
            for label, node in (("pause cloth", CLOTH), ("pause body", PLAYER)):
                self._bind_pause(controls, label, node)
            for label, node in (("Put garments on anew", CLOTH), ("Begin clip again", PLAYER)):
                self._bind_reset(controls, label, node)
        with self._gui.add_folder("Cloth node"):
            fields = {name: _Field(self, controls, name) for name in SHOWN}

        def show() -> None:
            values = controls.values()
            for name, field in fields.items():
                field.show(values.get(name))

        return show

    def _bind_pause(self, controls: Controls, label: str, node: str) -> None:
        box = self._gui.add_checkbox(label, False)

        @box.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                controls.pause(node, bool(box.value), self._told(f"pause {node}"))

    def _bind_reset(self, controls: Controls, label: str, node: str) -> None:
        button = self._gui.add_button(label)

        @button.on_click
        def _(event: Any) -> None:
            controls.reset(node, self._told(f"reset {node}"))

    def _told(self, what: str) -> Callable[[str], None]:
        return lambda wrong: self.tell(f"{what}: {wrong or 'done'}")

    def add_graphs(self) -> Callable[..., None]:
        """Rate and errors; returns what takes their points."""
        with self._gui.add_folder("Graphs"):
            rate = self._gui.add_uplot(
                (np.zeros(0), np.zeros(0)),
                ({"label": "s"}, {"label": "cloth [Hz]", "stroke": "#2f7f8c", "width": 2}),
                title="Rate", scales={"x": {"time": False}}, height=150,
            )  # fmt: skip
            errors = self._gui.add_uplot(
                (np.zeros(0), np.zeros(0), np.zeros(0)),
                (
                    {"label": "s"},
                    {"label": "strain p95 [%]", "stroke": "#d4654c", "width": 2},
                    {"label": "inside [%]", "stroke": "#6b5b95", "width": 2},
                ),
                title="Errors", scales={"x": {"time": False}}, height=150,
            )  # fmt: skip

        def show(rates: tuple[FloatArray, FloatArray], wrong: tuple[FloatArray, ...]) -> None:
            rate.data = _thinned(rates)
            errors.data = _thinned((wrong[0], 100.0 * wrong[1], 100.0 * wrong[2]))

        return show

    def tell(self, text: str) -> None:
        """Say something for a while."""
        self._said = harmless(text)
        self._said_until = time.monotonic() + 8.0

    def show_status(self, text: str) -> None:
        """The line at the top; `text` is safe to show."""
        if self._said and time.monotonic() < self._said_until:
            text += f"\n\n**{self._said}**"
        self._status.content = text

    @property
    def gui(self) -> "viser.GuiApi":
        """Where fields are added."""
        return self._gui


class _Field:
    """One parameter of the cloth node on the page."""

    def __init__(self, panel: Panel, controls: Controls, name: str) -> None:
        self._declaration = d = declaration(name)
        self._own_until = 0.0
        self._sending = False
        live, gui = is_live(name), panel.gui
        options: dict[str, Any] = {"hint": hint(name), "disabled": not live}
        label = f"{name} [{d.unit}]" if d.unit else name
        if d.type is tuple:
            self._input: Any = gui.add_vector3(label, d.default, step=0.1, **options)
        elif d.type is float:
            self._input = gui.add_number(
                label, float(d.default), min=d.minimum, max=d.maximum, step=0.1, **options
            )
        else:
            self._input = gui.add_text(label, str(d.default), disabled=True, hint=hint(name))
        if not live:
            return

        @self._input.on_update
        def _(event: Any) -> None:
            if event.client is None:  # what `show` sets
                return
            try:
                value = checked(d, self._input.value)
            except GarmentSimError as error:
                panel.tell(str(error))
                self._own_until = 0.0
                return
            self._own_until = time.monotonic() + _WAIT_FOR_OWN
            controls.set(name, value, self._done(panel, name))

    def _done(self, panel: Panel, name: str) -> Callable[[str], None]:
        def done(wrong: str) -> None:
            if wrong:
                self._own_until = 0.0
                panel.tell(f"{name}: {wrong}")

        return done

    def show(self, value: Any) -> None:
        """The value that the node has."""
        if value is None or time.monotonic() < self._own_until:
            return
        shown = value if self._declaration.type in (tuple, float) else str(value)
        if self._input.value != shown:
            self._input.value = shown


def _legend(name: str) -> str:
    scale = _SCALES.get(name)
    if scale is None:
        return f'<div style="{_STYLE}">{_LEGENDS[name]}</div>'
    return f'<div style="{_STYLE}">{_bar(scale)}</div>'


def _bar(scale: Scale) -> str:
    cells = "".join(
        '<span style="display:inline-block;height:1em;'
        f'width:{100 / LEVELS:.2f}%;background:rgb{colour(level)}"></span>'
        for level in range(LEVELS)
    )
    top = scale.factor * scale.top * (LEVELS - 1) / LEVELS
    return (
        f'<div style="line-height:1">{cells}</div>'
        f'<div style="display:flex;justify-content:space-between">'
        f"<span>0</span><span>{scale.name} [{scale.unit}]</span><span>{top:g} +</span></div>"
    )


def _thinned(rows: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
    """At most so many points of each, evenly spread."""
    step = max(1, -(-len(rows[0]) // _GRAPH_POINTS))
    return tuple(np.ascontiguousarray(row[::step], np.float64) for row in rows)
