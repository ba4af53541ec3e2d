"""A recording whose first frame is shown before all of it is read."""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path

from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.recording.shown import read_opening
from garment_sim_ros.view.frame import Cloth, Frame
from garment_sim_ros.view.playback import Playback


class Opening:
    """The first frame of a bag; all of it once it is read, beside the thread that shows it.

    Args:
        path: A rosbag2 folder.
        body: The body that was recorded; empty leaves it out.
        bone_names: YAML file of its bones' names.
        when_read: Called once with all of it, by `advance`.

    Attributes:
        cloths: As recorded.
        colliders: As recorded; None before all is read.

    Raises:
        InputFileError: The bag cannot be read, or has no garments.
    """

    def __init__(
        self, path: Path, body: str, bone_names: str, when_read: Callable[[Playback], None]
    ) -> None:
        self._read = lambda: Playback(path, body, bone_names)
        self._when_read = when_read
        self._whole: Future[Playback] = Future()
        self._shown = threading.Event()
        self._is_given = self._is_whole = False
        shown = read_opening(path)
        if shown is None:  # its first messages do not have all of a frame
            self._now = self._read()
            self._whole.set_result(self._now)
        else:
            self._now = Playback(path, shown=shown)
            # Now: the thread that shows steps back, and so would one that it starts.
            threading.Thread(target=self._read_all, daemon=True).start()
        self.cloths: Mapping[str, Cloth] = self._now.cloths
        self.colliders: ColliderSet | None = self._now.colliders

    def advance(self, seconds: float) -> None:
        """Let time pass, once all is read.

        Raises:
            InputFileError: What was read meanwhile cannot be shown.
        """
        if self._whole.done() and not self._is_whole:
            self._is_whole, self._now = True, self._whole.result()
            self.cloths, self.colliders = self._now.cloths, self._now.colliders
            self._when_read(self._now)
        if self._is_given:
            self._shown.set()
        if self._is_whole:
            self._now.advance(seconds)

    def frame(self) -> Frame | None:
        """See `Source`."""
        self._is_given = True
        return self._now.frame()

    def body(self) -> tuple[str, str] | None:
        """See `Source`."""
        return self._now.body()

    def words(self) -> str:
        """See `Source`."""
        return self._now.words() if self._is_whole else "reading the recording"

    def _read_all(self) -> None:
        self._shown.wait()  # reading would keep the first frame waiting
        try:
            self._whole.set_result(self._read())
        except BaseException as error:  # goes on to the thread that shows
            self._whole.set_exception(error)
