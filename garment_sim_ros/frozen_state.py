"""Objects in motion, arrays and compiled code among them, to bytes and back.

For bytes that this program wrote itself, in the user's own cache: to read them runs code. They are
of no use to another version of it.
"""

import importlib
import io
import pickle
import threading
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher
from numpy.typing import NDArray

from garment_sim_ros.jit import machine_code, origin_of

_PROTOCOL = 5


def freeze(thing: object) -> bytes:
    """All of an object; arrays that share memory do so again afterwards.

    Raises:
        Exception: Something in it cannot be kept; whatever that raises.
    """
    data = io.BytesIO()
    _Freezer(data, _PROTOCOL).dump(thing)
    return data.getvalue()


def thaw(data: bytes) -> Any:
    """An object from what `freeze` made of it, in the same version of the package.

    Raises:
        Exception: They are other bytes; whatever their content leads to.
    """
    return _Thawer(io.BytesIO(data)).load()


class _Freezer(pickle.Pickler):
    """Names compiled code instead of copying it, and keeps views of arrays as views."""

    def persistent_id(self, obj: Any) -> Any:
        if isinstance(obj, Dispatcher):
            return _name(obj), None
        if isinstance(obj, type(print)) and (origin := origin_of(obj)) is not None:
            function, types = origin
            return _name(function), types
        return None

    def reducer_override(self, obj: Any) -> Any:
        if type(obj) is np.ndarray and (owner := _owner(obj)) is not obj:
            start = owner.__array_interface__["data"][0]
            offset = obj.__array_interface__["data"][0] - start
            return _view, (owner, offset, obj.dtype, obj.shape, obj.strides, obj.flags.writeable)
        if isinstance(obj, threading.Event):
            return threading.Event, ()  # nobody waits in a simulation without nodes
        return NotImplemented


class _Thawer(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Any:
        (module, name), types = pid
        function = getattr(importlib.import_module(module), name)
        return function if types is None else machine_code(function, types)


def _name(function: Dispatcher) -> tuple[str, str]:
    return function.py_func.__module__, function.py_func.__qualname__


def _owner(array: NDArray[Any]) -> NDArray[Any]:
    """The array that has the memory, as far as arrays go."""
    while type(array.base) is np.ndarray:
        array = array.base
    return array


def _view(
    owner: NDArray[Any],
    offset: int,
    dtype: np.dtype[Any],
    shape: tuple[int, ...],
    strides: tuple[int, ...],
    writeable: bool,
) -> NDArray[Any]:
    view: NDArray[Any] = np.ndarray(shape, dtype, owner, offset, strides)
    view.flags.writeable = writeable
    return view
