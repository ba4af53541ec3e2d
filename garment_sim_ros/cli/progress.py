"""Progress on stderr, for what takes longer than two seconds."""

import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import TypeVar

from tqdm import tqdm

Item = TypeVar("Item")

_DELAY = 2.0


def _interval() -> float:
    """Seconds between updates; fewer lines where they end in a file."""
    return 0.2 if sys.stderr.isatty() else 5.0


def progress(items: Iterable[Item], text: str, total: int | None = None) -> Iterator[Item]:
    """Pass `items` on and show how far it is.

    Args:
        items: What is worked through.
        text: What is being done.
        total: Number of items, where `items` does not know it.
    """
    yield from tqdm(
        items,
        desc=text,
        total=total,
        delay=_DELAY,
        leave=False,
        file=sys.stderr,
        mininterval=_interval(),
    )


class Waiting:
    """Shows for how long something of unknown length has been going on, and what it says.

    Args:
        text: What is being waited for.
    """

    def __init__(self, text: str) -> None:
        self._bar = tqdm(
            desc=text,
            delay=_DELAY,
            leave=False,
            file=sys.stderr,
            mininterval=_interval(),
            bar_format="{desc} {elapsed}{postfix}",
        )

    def __enter__(self) -> "Waiting":
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.close()

    def show(self, words: str) -> None:
        """Still waiting; `words` is the latest news."""
        self._bar.set_postfix_str(words[:70], refresh=False)
        self._bar.update()


class Phases:
    """Shows which of some phases is going on, and how far it is.

    Args:
        text: What is being done.
        phases: Their names, in order.
    """

    def __init__(self, text: str, phases: Sequence[str]) -> None:
        self._text = text
        self._phases = tuple(phases)
        self._phase = ""
        self._bar = tqdm(
            desc=text,
            total=100 * len(self._phases),
            delay=_DELAY,
            leave=False,
            file=sys.stderr,
            mininterval=_interval(),
            bar_format="{desc} {percentage:3.0f}% {bar} {elapsed}",
        )

    def __enter__(self) -> "Phases":
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.close()

    def show(self, phase: str, share: float) -> None:
        """A phase is done to a share, 0 to 1."""
        begins = phase != self._phase
        self._phase = phase
        done = 100 * self._phases.index(phase) + round(100 * min(max(share, 0.0), 1.0))
        self._bar.set_description_str(f"{self._text}: {phase}", refresh=False)
        self._bar.update(max(0, done - self._bar.n))
        if begins and self._bar.format_dict["elapsed"] > _DELAY:
            self._bar.refresh()  # a phase may begin with seconds of compiling
            self._bar.last_print_t = time.time()  # else it takes itself for never shown, and stays
