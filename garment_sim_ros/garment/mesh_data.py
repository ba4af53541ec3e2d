"""A garment's surface."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class GarmentMesh:
    """A clean garment surface in its body's frame, z up, x forward.

    Attributes:
        vertices: Positions [m], shape [v, 3]; the file's vertices in its order, then new ones.
        triangles: Vertex indices, wound consistently, shape [t, 3].
        notes: What was repaired or assumed, one sentence each.
        flat: Where each triangle's corners lie in the panel that it was cut from, weft and warp
            [m], shape [t, 3, 2]; None: it was not cut from panels.
        colours: Painted colours, red, green and blue from 0 to 1, shape [v, 3]; None: none.
        groups: Vertices of each group that its file names.
        seams: Edges at which its texture is cut, as it was read, shape [s, 2].
    """

    vertices: FloatArray
    triangles: IntArray
    notes: tuple[str, ...] = ()
    flat: FloatArray | None = None
    colours: FloatArray | None = None
    groups: Mapping[str, IntArray] = field(default_factory=dict)
    seams: IntArray = field(default_factory=lambda: np.zeros((0, 2), np.int32))
