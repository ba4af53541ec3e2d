"""Keeps a page up to date with its source, at a rate of its own."""

import threading
import time
from collections.abc import Callable

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.stepping_back import SMALL, step_back
from garment_sim_ros.view.controls import harmless
from garment_sim_ros.view.frame import Frame, Source
from garment_sim_ros.view.levels import PENETRATION
from garment_sim_ros.view.page import Page
from garment_sim_ros.view.panel import Panel
from garment_sim_ros.view.scene import Scene
from garment_sim_ros.view.wearer import Wearer

_Wanted = tuple[tuple[str, str], ColliderSet, bool]
"""A body and the file of its bones' names, its colliders, and whether depths are asked for."""
_SLOW = 0.5
"""Between two times that the panel is brought up to date [s]."""


class Session:
    """A source, shown on a page.

    Args:
        page: The page.
        source: What is shown.
        rate: Frames of the page in a second [Hz].

    Attributes:
        scene: What is to be seen.
        panel: What people set.
        frames: Frames shown so far.
        before: Called before each frame with the time that passed [s].
        slowly: Called about twice a second.
    """

    def __init__(self, page: Page, source: Source, rate: float) -> None:
        self._page, self._source, self._period = page, source, 1.0 / rate
        self.scene = Scene()
        self.panel = Panel(page, self.scene)
        self.frames = 0
        self.before: Callable[[float], None] = lambda seconds: None
        self.slowly: list[Callable[[], None]] = []
        self._frame: Frame | None = None
        self._centre = np.zeros(3)
        self._wanted: _Wanted | None = None
        self._made: tuple[Wearer | None, str] | None = None
        self._body: tuple[tuple[str, str], Body] | None = None
        self._loading = threading.Lock()
        self._watched = 0
        self._next_slow = 0.0

    def run(self, until: Callable[[], bool]) -> None:
        """Until a condition is true."""
        step_back(SMALL)
        last = due = time.monotonic()
        while not until():
            now = time.monotonic()
            self.before(now - last)
            last = now
            self.tick(now)
            due = max(due + self._period, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()) or 1e-3)

    def tick(self, now: float) -> None:
        """Bring the page up to date; `now` is a time [s]."""
        frame = self._source.frame()
        if frame is not None:
            self._frame = frame
        watched = len(self._page.server.get_clients())
        self.scene.dress(self._source.cloths)
        self.scene.set_colliders(self._source.colliders)
        if self.frames:  # the body comes after the first picture
            self._prepare()
        due = frame is not None or self.panel.changed or self.scene.is_behind
        due = due or watched > self._watched
        self._watched = watched
        # Nothing is worked out for nobody, but the first picture waits for whoever comes.
        if self._frame is not None and due and (watched or not self.frames):
            self.panel.changed = False
            self._page.show(self.scene.draw(self._frame))
            self._centre = self.scene.centre(self._frame)
            self.frames += 1
        self._page.look_at(self._centre)
        if now >= self._next_slow:
            self._next_slow = now + _SLOW
            words = [self._source.words()]
            if self.scene.skinless:
                words.append(f"no skin: {harmless(self.scene.skinless)}")
            if refused := sum(self._page.doors.refused.values()):
                words.append(f"{refused} connections or messages of browsers refused")
            self.panel.show_status("\n\n".join(words))
            for call in self.slowly:
                call()

    def _prepare(self) -> None:
        """Have the body made ready beside this thread, when another is known or more is asked."""
        known, colliders = self._source.body(), self._source.colliders
        if known is not None and colliders is not None:
            wanted = (known, colliders, self.scene.shows.colours == PENETRATION.name)
            if self._wanted is None or not _same(wanted, self._wanted):
                self._wanted = wanted
                threading.Thread(target=self._make, args=(wanted,), daemon=True).start()
        if self._made is not None:
            (wearer, why), self._made = self._made, None
            self.scene.set_wearer(wearer, why)
            self.panel.changed = True

    def _make(self, wanted: _Wanted) -> None:
        step_back(SMALL)
        (file, bone_names), colliders, measures = wanted
        try:
            with self._loading:
                if self._body is None or self._body[0] != wanted[0]:
                    self._body = wanted[0], load_body(file, bone_names=bone_names)
                body = self._body[1]
            made: tuple[Wearer | None, str] = Wearer(colliders, body, measures=measures), ""
        except GarmentSimError as error:
            made = None, str(error)
        if self._wanted is wanted:
            self._made = made


def _same(a: _Wanted, b: _Wanted) -> bool:
    """Whether what was made for `b` serves `a`."""
    return a[0] == b[0] and a[1] is b[1] and a[2] <= b[2]
