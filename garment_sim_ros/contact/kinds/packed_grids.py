"""Sampled distances as flat arrays."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.errors import GeometryError


class PackedGrids(NamedTuple):
    """Distance grids as flat arrays.

    Attributes:
        sample: All samples, grid by grid, x slowest, flat.
        first: Where each grid starts, shape [g].
        nodes: Samples along each axis, shape [g, 3].
        middle: Half of the cells along each axis, shape [g, 3].
        cell: Cell [m], cells per length, metres per unit of a sample, and how steep the
            interpolation is at most, shape [g, 4].
        box: Lowest and highest corner of each shape's box [m], shape [g, 6].
    """

    sample: NDArray[np.int16]
    first: IntArray
    nodes: IntArray
    middle: SingleArray
    cell: SingleArray
    box: SingleArray


def pack_grids(geometries: Mapping[str, Mapping[str, object]]) -> PackedGrids:
    """Grids given by a collider's name and geometry, as flat arrays.

    Raises:
        GeometryError: Unusable numbers.
    """
    grids = []
    for name, geometry in geometries.items():
        try:
            grids.append(DistanceGrid.of(geometry))
        except (TypeError, ValueError, GeometryError) as error:
            raise GeometryError(f"collider {name!r}: {error}") from None
    nodes = np.array([g.distance.shape for g in grids], np.int32).reshape(-1, 3)
    return PackedGrids(
        sample=np.concatenate([g.distance.ravel() for g in grids]),
        first=np.cumsum([0, *(g.distance.size for g in grids)])[:-1].astype(np.int32),
        nodes=nodes,
        middle=(0.5 * (nodes - 1.0)).astype(np.float32),
        cell=np.array(
            [[g.cell, 1.0 / g.cell, g.step, g.steepest()] for g in grids], np.float32
        ).reshape(-1, 4),
        box=np.array([g.box() for g in grids], np.float32).reshape(-1, 6),
    )
