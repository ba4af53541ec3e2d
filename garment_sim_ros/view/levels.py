"""Colours by a number: levels of a scale, each a mesh of one colour.

A page changes the colour of a whole mesh at no cost, but not that of its vertices; so the
triangles of a garment are divided among the levels of a scale.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.recording.metrics import GarmentMesh

Rgb = tuple[int, int, int]

LEVELS = 12
_ANCHORS = ("2b3f8c", "2f8fa8", "6fb86b", "e3cf4f", "e0812f", "b3202c")


@dataclass(frozen=True, kw_only=True)
class Scale:
    """What a colour means.

    Attributes:
        name: Of the number.
        top: Value from which on the last level begins to be reached; the first begins at 0.
        unit: As shown.
        factor: From the value to the unit shown.
    """

    name: str
    top: float
    unit: str
    factor: float

    def levels(self, values: FloatArray) -> NDArray[np.uint8]:
        """Level of each value, 0 to `LEVELS` - 1; what is no number is in the last."""
        share = np.nan_to_num(np.asarray(values, np.float64) / self.top, nan=1.0, posinf=1.0)
        return np.clip(share * LEVELS, 0, LEVELS - 1).astype(np.uint8)


STRAIN = Scale(name="strain", top=0.24, unit="%", factor=100.0)
PENETRATION = Scale(name="penetration", top=0.012, unit="mm", factor=1000.0)


def colour(level: int) -> Rgb:
    """Of a level, from blue over yellow to red."""
    at = level / (LEVELS - 1) * (len(_ANCHORS) - 1)
    first = min(int(at), len(_ANCHORS) - 2)
    a, b = (np.array([*bytes.fromhex(_ANCHORS[first + k])]) for k in (0, 1))
    r, g, b = np.rint(a + (at - first) * (b - a)).astype(int)
    return int(r), int(g), int(b)


def strain_of_triangles(mesh: GarmentMesh, edges: IntArray, x: SingleArray) -> FloatArray:
    """Largest strain of each triangle's edges, shape [t].

    Args:
        mesh: The garment at rest.
        edges: Its edges of each triangle, shape [t, 3].
        x: Vertices now [m], shape [v, 3].
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # an edge without length
        strain = mesh.strain(np.asarray(x, np.float64))
    of_triangles: FloatArray = strain[edges].max(axis=1)
    return of_triangles


def edges_of_triangles(mesh: GarmentMesh) -> IntArray:
    """Which edges each triangle has, shape [t, 3]."""
    # As `samples` are ordered: particles, edges, triangles.
    return mesh.samples_of_triangle[:, 3:6] - np.int32(mesh.vertices)


def part(triangles: IntArray, x: SingleArray) -> tuple[SingleArray, IntArray]:
    """Some of a mesh's triangles as a mesh of their own.

    Args:
        triangles: Those, shape [t, 3].
        x: Vertices of the whole mesh [m], shape [v, 3].

    Returns:
        Vertices that they have, and the triangles by these.
    """
    used = np.zeros(len(x), np.bool_)
    used[triangles] = True
    place = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return x[used], place[triangles]
