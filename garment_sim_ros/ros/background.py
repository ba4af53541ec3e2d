"""Work that a text asks for, beside the node's own thread."""

import threading
import time
from collections.abc import Callable
from typing import Generic, TypeVar

from garment_sim_ros.errors import GarmentSimError, MessageError

Made = TypeVar("Made")

_PAUSE = 1.0
"""Least time after a text that could not be used, before the next [s]."""
_REST = 20.0
"""Least such time per time of work: who sends many of them gets little work done."""


class Background(Generic[Made]):
    """Makes something of texts; the latest wins, those that come meanwhile are left out.

    Nothing is made of the same text again, unless it could not be used.

    Args:
        make: Makes it, in a thread of its own.
        reason: Under which failures are counted.
        after: A thread of a predecessor's to wait for, see `retire`.
    """

    def __init__(
        self, make: Callable[[str], Made], reason: str, after: threading.Thread | None = None
    ) -> None:
        self._make = make
        self._reason = reason
        self._thread: threading.Thread | None = None
        self._made: Made | MessageError | None = None
        self._waiting: str | None = None
        self._text: str | None = None
        self._not_before = 0.0
        self._worked = 0.0
        self._after = after

    def retire(self) -> threading.Thread | None:
        """Begin nothing more; returns the thread that still works, if there is one.

        It cannot be stopped. A successor waits for it, so that threads do not pile up, each with a
        body and garments of its own, where a node is configured sooner than garments are made.
        """
        self._waiting = None
        working = (t for t in (self._thread, self._after) if t is not None and t.is_alive())
        return next(working, None)

    def request(self, text: str) -> None:
        """Have something made of a text."""
        self._waiting = None if text == self._text else text
        self._begin()

    @property
    def busy(self) -> bool:
        """Whether something is being made or waits to be."""
        return self._thread is not None or self._waiting is not None

    def result(self, *, longest: float = 0.0) -> Made | None:
        """What is ready, once; None where nothing is.

        Args:
            longest: Time to wait for it [s].

        Raises:
            MessageError: The text cannot be used.
        """
        self._begin()
        thread = self._thread
        if thread is None:
            if longest and self.busy:
                time.sleep(longest)
            return None
        thread.join(longest)
        if thread.is_alive():
            return None
        made, self._thread, self._made = self._made, None, None
        if isinstance(made, MessageError):
            self._text = None
            self._not_before = time.monotonic() + max(_PAUSE, _REST * self._worked)
            raise made
        self._begin()
        return made

    def _begin(self) -> None:
        text = self._waiting
        if text is None or self._thread is not None:
            return
        if self._after is not None and self._after.is_alive():
            return
        self._after = None
        if time.monotonic() >= self._not_before:
            self._text, self._waiting = text, None
            # A daemon: the end of the process does not wait for it.
            self._thread = threading.Thread(target=self._work, args=(text,), daemon=True)
            self._thread.start()

    def _work(self, text: str) -> None:
        began = time.thread_time()
        try:
            self._made = self._make(text)
        except MessageError as error:
            self._made = error
        except GarmentSimError as error:
            self._made = MessageError(self._reason, str(error))
        except Exception as error:
            self._made = MessageError(self._reason, f"{type(error).__name__}: {error}")
        self._worked = time.thread_time() - began
