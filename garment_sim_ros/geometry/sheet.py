"""A rectangular piece of cloth."""

from collections.abc import Sequence

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import ParameterError

PINS = ("corners", "top", "top corners")
"""Names of vertices that a sheet may be pinned at."""

_MOST = 4_000_000
"""Most vertices of a sheet."""


def sheet(
    width: float,
    height: float,
    *,
    edge: float,
    at: Sequence[float] = (0.0, 0.0, 0.0),
    upright: bool = False,
) -> tuple[FloatArray, IntArray, int]:
    """A rectangle of squares, split like a chequerboard so that no diagonal is preferred.

    Args:
        width: Extent along x [m].
        height: Extent along y, or along z where it is upright [m].
        edge: Length of the squares' sides, about [m].
        at: Its middle [m], shape [3].
        upright: Whether it is in the x-z plane instead of the x-y plane.

    Returns:
        Vertices [m], row by row from the largest y or z, each along x; triangles, whose front
        looks to +z, or to -y where it is upright; the number of vertices in a row.

    Raises:
        ParameterError: A measure that is not positive, or too many vertices.
    """
    for name, value in (("width", width), ("height", height), ("edge", edge)):
        if not 0.0 < value < np.inf:
            raise ParameterError(name, f"found {value!r}", "allowed: above 0 m, finite")
    columns = max(1.0, np.round(width / edge)) + 1.0
    rows = max(1.0, np.round(height / edge)) + 1.0
    if columns * rows > _MOST:
        raise ParameterError(
            "edge", f"{edge!r} m gives {columns * rows:.3g} vertices", f"allowed: up to {_MOST}"
        )
    x = width * np.linspace(-0.5, 0.5, int(columns))
    y = height * np.linspace(0.5, -0.5, int(rows))
    along, across = np.meshgrid(x, y)
    zero = np.zeros_like(along)
    plane = (along, zero, across) if upright else (along, across, zero)
    vertices = np.stack(plane, axis=-1).reshape(-1, 3) + np.asarray(at, dtype=np.float64)
    index = np.arange(len(vertices), dtype=np.int32).reshape(along.shape)
    a, b = index[1:, :-1], index[1:, 1:]
    d, c = index[:-1, :-1], index[:-1, 1:]
    even = (np.add.outer(*map(np.arange, a.shape)) % 2 == 0)[..., None]
    first = np.where(even, np.stack([a, b, c], -1), np.stack([a, b, d], -1))
    second = np.where(even, np.stack([a, c, d], -1), np.stack([b, c, d], -1))
    triangles = np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])
    return vertices, np.ascontiguousarray(triangles, np.int32), len(x)


def pins_of(pins: str | Sequence[int] | IntArray, count: int, columns: int) -> IntArray:
    """Vertices of a sheet by name or number.

    Args:
        pins: One of `PINS`, or vertices.
        count: Number of its vertices.
        columns: Number of them in a row.

    Raises:
        ParameterError: Another name.
    """
    if not isinstance(pins, str):
        return np.array(pins, dtype=np.int32)
    top = np.arange(columns, dtype=np.int32)
    named = {
        "corners": np.array([0, columns - 1, count - columns, count - 1], np.int32),
        "top": top,
        "top corners": top[[0, -1]],
    }
    if pins not in named:
        allowed = f"allowed: vertices, or one of {', '.join(PINS)}"
        raise ParameterError("pins", f"found {pins!r}", allowed)
    return named[pins]
