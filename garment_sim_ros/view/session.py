"""Keeps a page up to date with its source, at a rate of its own."""

import threading
import time
from collections.abc import Callable

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.stepping_back import SMALL, step_back
from garment_sim_ros.view.controls import harmless
from garment_sim_ros.view.frame import Frame, Source
from garment_sim_ros.view.page import Page
from garment_sim_ros.view.panel import Panel
from garment_sim_ros.view.scene import Scene

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
        self._loading: tuple[str, str] | None = None
        self._loaded: tuple[Body | None, str] | None = None
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
        due = frame is not None or self.panel.changed or self.scene.is_behind
        due = due or watched > self._watched
        self._watched = watched
        self._load_body()
        self.scene.dress(self._source.cloths)
        self.scene.set_colliders(self._source.colliders)
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

    def _load_body(self) -> None:
        """Have the body loaded beside this thread, when another is known."""
        known = self._source.body()
        if known != self._loading and known is not None:
            self._loading = known
            threading.Thread(target=self._load, args=known, daemon=True).start()
        if self._loaded is not None:
            (body, why), self._loaded = self._loaded, None
            self.scene.set_body(body, why)
            self.panel.changed = True

    def _load(self, file: str, bone_names: str) -> None:
        step_back(SMALL)
        try:
            loaded: tuple[Body | None, str] = load_body(file, bone_names=bone_names), ""
        except GarmentSimError as error:
            loaded = None, str(error)
        if self._loading == (file, bone_names):
            self._loaded = loaded
