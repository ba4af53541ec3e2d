"""Edges between pins: neighbours of a pin that gives way follow it.

Of a band that a thigh pushes out at one place, the edge beside that place would be stretched by
all that the pin next to it was moved. A pin follows a neighbour that is farther from its home than
it is itself, where the edge between them would be stretched by more than a limit: the band goes
around what pushes it.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.model import ClothModel

_STRETCH = 0.3
"""Strain of such an edge from which on pins follow; the strain limit of other edges by default."""
_PASSES = 30


class PinEdges(NamedTuple):
    """Edges of a mesh between two pinned particles.

    Attributes:
        pins: Both ends, as numbers among the pins, shape [e, 2].
        length: Rest lengths [m], shape [e].
    """

    pins: IntArray
    length: FloatArray

    @classmethod
    def of(cls, model: ClothModel) -> "PinEdges":
        """Those of a garment."""
        edges = mesh_topology(model.particle_triangles).edges
        edges = edges[edges.min(axis=1) >= model.free_count]
        length = np.linalg.norm(model.rest[edges[:, 0]] - model.rest[edges[:, 1]], axis=1)
        return cls(np.ascontiguousarray(edges - model.free_count, np.int32), length)


@kernel(inner=True)
def keep_together(x, away, edges):
    """Moves pins after neighbours that are farther from home.

    Args:
        x: Pins [m], changed in place, shape [p, 3].
        away: How far each is from home [m], changed in place, shape [p].
        edges: `PinEdges`.
    """
    for _ in range(_PASSES):
        followed = False
        for e in range(edges.length.size):
            p, q = edges.pins[e, 0], edges.pins[e, 1]
            if away[p] > away[q]:
                p, q = q, p
            dx, dy, dz = x[q, 0] - x[p, 0], x[q, 1] - x[p, 1], x[q, 2] - x[p, 2]
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            longest = (1.0 + _STRETCH) * edges.length[e]
            if not (length > longest and away[q] > 0.0):
                continue
            part = (length - longest) / length
            x[p, 0] += part * dx
            x[p, 1] += part * dy
            x[p, 2] += part * dz
            away[p] = min(away[p] + part * length, away[q])
            followed = True
        if not followed:
            break
