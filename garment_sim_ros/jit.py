"""JIT options, decided here and nowhere else.

The fast-math flags leave out ``nnan`` and ``ninf``: comparisons with NaN and infinity must keep
working in every kernel. `np.isfinite` does not, of a sum: it subtracts its argument from itself,
and sums may be reordered until nothing is left. Kernels ask whether a number is below infinity.

What a kernel calls is inlined (``forceinline=True``) where it is more than a few lines. A function
that is compiled for itself and again into its caller exists twice, reordered differently by
fast-math, and which of the two a caller gets depends on what the process compiled or called
before: a first run would differ in the last bits from all later ones.

Kernels are cached on disk. The compiler's own cache looks at a kernel's file only and not at those
of the functions compiled into it, so that after an update of one file it would go on running the
old code of others. Here every version of the kernels, taken together, has a cache of its own, in
the user's cache directory or where ``NUMBA_CACHE_DIR`` says.
"""

import hashlib
import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numba
from numba import njit
from numba.core.dispatcher import Dispatcher

from garment_sim_ros.compile_once import compile_once

_FAST_FLAGS = {"reassoc", "contract", "arcp", "nsz", "afn"}
_VERSIONS_KEPT = 4


def _cache_of_this_version() -> Path:
    """A folder named after the contents of all files with kernels."""
    package = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        text = file.read_bytes()
        if b"kernel(" in text:
            digest.update(str(file.relative_to(package)).encode() + text)
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "garment_sim_ros" / "kernels" / digest.hexdigest()[:16]


def _drop_old_versions(cache: Path) -> None:
    """Removes the caches of versions that have not been started for longest."""
    versions = sorted(
        (v for v in cache.parent.iterdir() if v != cache), key=lambda v: v.stat().st_mtime
    )
    for version in versions[: 1 - _VERSIONS_KEPT]:
        shutil.rmtree(version, ignore_errors=True)


if not os.environ.get("NUMBA_CACHE_DIR"):
    try:
        _cache = _cache_of_this_version()
        _cache.mkdir(parents=True, exist_ok=True)
        os.utime(_cache)
        _drop_old_versions(_cache)
        numba.config.CACHE_DIR = str(_cache)  # type: ignore[attr-defined]
    except (OSError, RuntimeError):
        pass  # no home directory, or a read-only one: the compiler finds another place, or none

compile_once()

kernel = partial(njit, cache=True, nogil=True, error_model="numpy", fastmath=_FAST_FLAGS)
"""Decorator factory for hot loops: ``@kernel()``."""

lean_kernel = partial(kernel, _nrt=False)
"""The same for small functions that are handed many arrays, millions of times a second: they do
not count references to arrays, which takes longer than what they do, and so cannot make any."""

exact_kernel = partial(njit, cache=True, nogil=True, error_model="numpy", fastmath=False)
"""Decorator factory where IEEE order of operations matters: geometric predicates, hashing."""


def compiled(function: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """The machine code of a kernel for arguments such as these, to be called many times.

    To choose it by the types of a hundred arrays takes longer than many a kernel. It does not
    look at its arguments: they must have exactly these types.
    """
    if not isinstance(function, Dispatcher):
        return function  # Compilation is switched off.
    types = tuple(numba.typeof(argument) for argument in arguments)
    function.compile(types)
    machine: Any = function.overloads[types]
    return machine.entry_point
