"""JIT options, decided here and nowhere else.

The fast-math flags leave out ``nnan`` and ``ninf``: comparisons with NaN and infinity must keep
working in every kernel. `np.isfinite` does not, of a sum: it subtracts its argument from itself,
and sums may be reordered until nothing is left. Kernels ask whether a number is below infinity.

A fast kernel that other kernels call is compiled into its callers (``forceinline=True``). It would
otherwise exist twice, by itself and in each caller, reordered differently by fast-math, and which
of the two runs depends on what the process compiled, loaded or called before: two processes would
differ in the last bits. One that no Python code calls is marked ``inner=True``: it goes without an
entry for Python, which takes a fifth of all compiling. What the compiler makes for itself, such as
powers, it keeps for all that the process compiles later, with the options of what asked first.
Here kernels of different options do not share it.

Kernels are cached on disk. The compiler's own cache looks at a kernel's file only and not at those
of the functions and constants compiled into it, so that after an update of one file it would go on
running the old code of others. Here every version of the kernels, taken together with all that
they import, has a cache of its own, in the user's cache directory or where ``NUMBA_CACHE_DIR``
says.
"""

import gc
import hashlib
import os
import re
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import njit
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.core.types import unliteral

from garment_sim_ros.compile_once import compile_once
from garment_sim_ros.uninterrupted import load_uninterrupted

_FAST_FLAGS = {"reassoc", "contract", "arcp", "nsz", "afn"}
_VERSIONS_KEPT = 4


def _cache_of_this_version() -> Path:
    """A folder named after the contents of all files that make the kernels what they are."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "garment_sim_ros" / "kernels" / version_of(Path(__file__).resolve().parent)


def version_of(package: Path) -> str:
    """A name for the kernels of a package, the same while no file that they come from changes.

    These are the files with kernels and all that they import, directly or not: a kernel takes
    functions and constants from there.
    """
    texts = {path: path.read_bytes() for path in package.rglob("*.py")}
    left = {path for path, text in texts.items() if b"kernel(" in text}
    found: set[Path] = set()
    while left:
        found |= left
        left = {used for path in left for used in _imported(texts[path], package)} - found
        left &= texts.keys()
    digest = hashlib.sha256()
    for file in sorted(found):
        for part in (str(file.relative_to(package)).encode(), texts[file]):
            digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()[:16]


def _imported(text: bytes, package: Path) -> set[Path]:
    """Files of a package that a file of it may import: rather too many than too few."""
    name = package.name.encode()
    modules = re.findall(rb"\b%s((?:\.\w+)*)(?: import \(?([\w\s,]*))?" % name, text)
    files: set[Path] = set()
    for dotted, names in modules:
        path = package.joinpath(*dotted.decode().split(".")[1:])
        for one in (path, *(path / n for n in re.findall(r"\w+", names.decode()))):
            files |= {one.with_suffix(".py"), one / "__init__.py"}
    return files


def _drop_old_versions(cache: Path) -> None:
    """Removes the caches of versions that have not been started for longest."""
    versions = sorted(
        (v for v in cache.parent.iterdir() if v != cache), key=lambda v: v.stat().st_mtime
    )
    for version in versions[: 1 - _VERSIONS_KEPT]:
        shutil.rmtree(version, ignore_errors=True)


cache_folder: Path | None = None
"""Where this version's machine code is kept; None where that is left to the compiler."""

if not os.environ.get("NUMBA_CACHE_DIR"):
    try:
        _cache = _cache_of_this_version()
        _cache.mkdir(parents=True, exist_ok=True)
        os.utime(_cache)
        _drop_old_versions(_cache)
        numba.config.CACHE_DIR = str(_cache)  # type: ignore[attr-defined]
        cache_folder = _cache
    except (OSError, RuntimeError):
        pass  # no home directory, or a read-only one: the compiler finds another place, or none

compile_once()
load_uninterrupted()

_dispatcher: Any = Dispatcher
_compile = _dispatcher._compile_for_args
_found: dict[tuple[Dispatcher, tuple[Any, ...]], None] = {}
"""What `kernels_of` has found."""


_origins: dict[Callable[..., Any], tuple[Dispatcher, tuple[Any, ...]]] = {}
"""Of machine code that `compiled` has handed out."""

_ONLY_KERNELS = "{} is an inner kernel: only kernels call it"


_made_within: dict[tuple[Any, ...], dict[Any, Any]] = {}
"""What the compiler made for itself, by options of the kernels that it was made in."""


class _Kernel(CPUDispatcher):
    """A kernel that is compiled for types only: one called with 0 and then with i exists once."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return super().get_call_template([unliteral(one) for one in args], kws)

    def compile(self, sig: Any) -> Any:
        """As the base class does, an eighth faster: a compiler makes objects that stay."""
        with global_compiler_lock:
            context = self.targetdescr.target_context
            shared = context.cached_internal_func
            context.cached_internal_func = _made_within.setdefault(self._options(), {})
            collects = gc.isenabled()
            gc.disable()
            try:
                return super().compile(sig)
            finally:
                context.cached_internal_func = shared
                if collects:
                    gc.enable()

    def _options(self) -> tuple[Any, ...]:
        """Of the options of a kernel, those that what is made within it takes over."""
        options = self.targetoptions
        fast = options["fastmath"] or ()
        return tuple(sorted(fast)), options.get("_nrt", True)


class _Inner(_Kernel):
    """A kernel that only kernels call: its machine code has no entry for Python."""

    def __call__(self, *arguments: Any) -> Any:
        if _dispatcher._compile_for_args is not _compile:  # Run as plain Python.
            return _dispatcher._compile_for_args(self)(*arguments)
        raise TypeError(_ONLY_KERNELS.format(self.py_func.__qualname__))


def _decorator(*, inner: bool = False, **options: Any) -> Callable[[Any], Any]:
    # None is ever called by way of C: leaving that entry out saves a tenth of the compiling.
    options = {"cache": True, "nogil": True, "no_cfunc_wrapper": True, **options}
    if inner:
        options |= {"no_cpython_wrapper": True, "forceinline": bool(options["fastmath"])}

    def decorate(function: Any) -> Any:
        made = njit(error_model="numpy", **options)(function)
        if isinstance(made, CPUDispatcher):
            made.__class__ = _Inner if inner else _Kernel
        return made

    return decorate


kernel = partial(_decorator, fastmath=_FAST_FLAGS)
"""Decorator factory for hot loops: ``@kernel()``, ``@kernel(inner=True)``."""

lean_kernel = partial(kernel, _nrt=False)
"""The same for small functions that are handed many arrays, millions of times a second: they do
not count references to arrays, which takes longer than what they do, and so cannot make any."""

exact_kernel = partial(_decorator, fastmath=False)
"""Decorator factory where IEEE order of operations matters: geometric predicates, hashing."""


def kernels_of(run: Callable[[], object]) -> list[tuple[Dispatcher, tuple[Any, ...]]]:
    """The kernels that something calls, with the types of their arguments, in order.

    Nothing is compiled: kernels run as plain Python. For processes that do nothing else.
    """
    depth = 0
    _found.clear()

    def note(kernel_: Dispatcher, *_: Any) -> Callable[..., Any]:
        def plain(*arguments: Any) -> Any:
            nonlocal depth
            if depth == 0:
                _found[kernel_, tuple(numba.typeof(a) for a in arguments)] = None
            depth += 1
            try:
                result = kernel_.py_func(*arguments)
            finally:
                depth -= 1
            return result if depth else _as_returned(result)

        return plain

    _dispatcher._compile_for_args = note
    try:
        with np.errstate(all="ignore"):
            run()
    finally:
        _dispatcher._compile_for_args = _compile
    return list(_found)


def _as_returned(result: Any) -> Any:
    """What a kernel returns, with Python's numbers as compiled ones have them."""
    if type(result) is tuple:
        return tuple(_as_returned(part) for part in result)
    return result.item() if isinstance(result, np.generic) else result


def compiled(function: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """The machine code of a kernel for arguments such as these, to be called many times.

    To choose it by the types of a hundred arrays takes longer than many a kernel. It does not
    look at its arguments: they must have exactly these types.
    """
    if not isinstance(function, Dispatcher):
        return function  # Compilation is switched off.
    if isinstance(function, _Inner):
        raise TypeError(_ONLY_KERNELS.format(function.py_func.__qualname__))
    types = tuple(numba.typeof(argument) for argument in arguments)
    if _dispatcher._compile_for_args is not _compile:  # Calls are only noted.
        _found[function, types] = None
        return function
    return machine_code(function, types)


def machine_code(function: Dispatcher, types: tuple[Any, ...]) -> Callable[..., Any]:
    """The same for types of arguments as the compiler has them."""
    function.compile(types)
    machine: Any = function.overloads[types]
    code: Callable[..., Any] = machine.entry_point
    _origins[code] = function, types
    return code


def origin_of(code: Callable[..., Any]) -> tuple[Dispatcher, tuple[Any, ...]] | None:
    """The kernel, and types, of what `compiled` returned; None for what else there is."""
    return _origins.get(code)
