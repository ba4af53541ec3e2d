"""Output that appears whole or not at all."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from garment_sim_ros.errors import InputFileError


@contextmanager
def staged(folder: str | Path, option: str = "--out", mark: str = "") -> Iterator[Path]:
    """A temporary folder whose contents move into `folder` at the end.

    When the block fails or is interrupted nothing is left behind and what was in `folder` stays;
    otherwise files and folders of the same name are replaced.

    Args:
        folder: Made where it is missing.
        option: Name of the option for error messages.
        mark: By which `remove_staged` finds it.

    Raises:
        InputFileError: The folder cannot be made or written to.
    """
    folder = Path(folder)
    made = [p for p in (folder, *folder.parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=f".partial-{mark}", dir=folder))
    except OSError as error:
        raise InputFileError(
            f"{option} {folder}", error.strerror or str(error), "allowed: a folder to write into"
        ) from None
    try:
        yield stage
        for item in sorted(stage.iterdir()):
            _replace(item, folder / item.name)
    except BaseException:
        shutil.rmtree(stage, ignore_errors=True)
        for path in made:
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        raise
    shutil.rmtree(stage)


def remove_staged(folder: Path, mark: str) -> None:
    """Remove what processes with a mark have left in a folder, as they were killed."""
    for stage in folder.glob(f".partial-{mark}*"):
        shutil.rmtree(stage, ignore_errors=True)


def _replace(item: Path, target: Path) -> None:
    if target.is_dir() and not target.is_symlink():
        shutil.rmtree(target)
    item.replace(target)
