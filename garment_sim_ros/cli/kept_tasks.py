"""Tasks whose rows are kept in a folder: what is there is not done again."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from garment_sim_ros.cli.processes import over_processes
from garment_sim_ros.cli.progress import progress
from garment_sim_ros.errors import GarmentSimError, InputFileError
from garment_sim_ros.tradeoff.table import Kept, Row

Task = tuple[Callable[..., Row], tuple[Any, ...]]
"""What to call, and with what."""


def kept_in(folder: Path) -> Kept:
    """The rows that a folder has, which is made where it is missing.

    Raises:
        InputFileError: It cannot be made or read.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return Kept(folder / "rows.jsonl")
    except OSError as error:
        raise InputFileError(
            f"--out {folder}", error.strerror or str(error), "allowed: a folder to write into"
        ) from None


def kept_or_done(tasks: dict[str, Task], kept: Kept, jobs: int, text: str) -> list[Row]:
    """The rows of tasks, in order; those that are kept are not done again.

    Args:
        tasks: By what makes two rows the same.
        kept: Where rows are, and are put.
        jobs: Number of processes.
        text: What is being done.
    """
    missing = {key: task for key, task in tasks.items() if kept.get(key) is None}
    for key, row in done(missing, jobs, text):
        kept.put(key, row)
    return [row for row in map(kept.get, tasks) if row is not None]


def done(tasks: dict[str, Task], jobs: int, text: str) -> Iterator[tuple[str, Row]]:
    """Results as they come; arguments as for `kept_or_done`.

    Raises:
        GarmentSimError: A task did.
    """
    if jobs == 1 or len(tasks) < 2:
        for key, (call, asked) in progress(tasks.items(), text, len(tasks)):
            yield key, call(*asked)
        return
    keys = list(tasks)
    with contextlib.closing(over_processes(_called, list(tasks.values()), jobs)) as results:
        for k, row in progress(results, text, len(tasks)):
            if isinstance(row, GarmentSimError):
                raise row
            yield keys[k], row


def _called(task: Task) -> Row:
    call, asked = task
    return call(*asked)
