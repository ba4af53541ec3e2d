"""Whether a garment rode up: a tight skirt that wide steps have rolled up around the hips.

Cloth that cannot stretch as far as a pose asks slides up where the body is narrower. What is loose
falls again; a roll of tight cloth stays, where a person would pull it down.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.topology import boundary_loops
from garment_sim_ros.jit import exact_kernel
from garment_sim_ros.sim.placement import Carried, GarmentLike

_SHORTEST = 0.25
"""Hems nearer than this to what holds their garment are left alone: cuffs of short sleeves [m]."""
_RODE_UP = 0.5
"""A hem rode up where it is nearer to what holds it than this part of what it would be as skin."""
_BELOW = 0.5
"""As skin it would hang by this part of that distance below; else gravity is no help."""


class Hung(NamedTuple):
    """How the hems of a garment hang.

    Attributes:
        rode_up: Whether one is where a person would pull it down again.
        upside_down: Whether gravity turns the garment over: as skin a hem would be above what
            holds it.
    """

    rode_up: bool
    upside_down: bool


class Hem(NamedTuple):
    """Vertices of one hem, and for each the nearest at rest that holds the garment, shape [n]."""

    vertex: IntArray
    held: IntArray


@exact_kernel()
def sums_over_hems(x, vertex, held, first, skin, down, sums):
    """How far hems are from what holds them.

    Args:
        x: World positions of the garment's vertices [m], shape [v, 3].
        vertex: Those of all hems, one after the other, shape [n].
        held: The one that holds the garment for each of them, shape [n].
        first: Where each hem starts, one more at the end, shape [h + 1].
        skin: Where `vertex`, and then `held`, would be as skin [m], shape [2, n, 3].
        down: The direction of gravity, shape [3].
        sums: Output, for each hem the sums of its vertices' distances as skin and as they are, and
            of how far below they would hang [m], shape [h, 3].
    """
    for hem in range(first.size - 1):
        length = now = below = 0.0
        for n in range(first[hem], first[hem + 1]):
            as_skin = as_cloth = 0.0
            for k in range(3):
                way = skin[0, n, k] - skin[1, n, k]
                as_skin += way * way
                as_cloth += (x[vertex[n], k] - x[held[n], k]) ** 2
                below += way * down[k]
            length += np.sqrt(as_skin)
            now += np.sqrt(as_cloth)
        sums[hem, 0], sums[hem, 1], sums[hem, 2] = length, now, below


class RidingUp:
    """The hems of one garment.

    Args:
        garment: The garment. Without pins and attachments no hem of it counts.

    Attributes:
        hems: Those that are far enough from what holds the garment.
    """

    def __init__(self, garment: GarmentLike) -> None:
        soft = () if garment.soft is None else garment.soft.vertices
        held = np.union1d(np.asarray(garment.pins), soft).astype(np.int32)
        self.hems: list[Hem] = []
        try:
            loops = boundary_loops(garment.triangles) if len(held) else []
        except GeometryError:  # openings that touch
            loops = []
        for loop in loops:
            if np.isin(loop, held).any():
                continue
            away, nearest = cKDTree(garment.vertices[held]).query(garment.vertices[loop])
            if away.mean() > _SHORTEST:
                self.hems.append(Hem(np.asarray(loop, np.int32), held[nearest]))
        none = np.zeros(0, np.int32)
        self._vertex = np.concatenate([none, *(hem.vertex for hem in self.hems)])
        self._held = np.concatenate([none, *(hem.held for hem in self.hems)])
        self._first = np.cumsum([0, *(len(hem.vertex) for hem in self.hems)], dtype=np.int32)
        self._sums = np.zeros((len(self.hems), 3))
        self._skin = Carried(garment, np.concatenate([self._vertex, self._held]))

    def look(self, x: SingleArray, T_world_frame: FloatArray, gravity: FloatArray) -> Hung:
        """How the hems hang.

        Args:
            x: World positions of the vertices [m], shape [v, 3].
            T_world_frame: Transforms of the garment's frames, shape [b, 4, 4].
            gravity: Of the world [m/s^2], shape [3].
        """
        strength = float(np.linalg.norm(gravity))
        if strength == 0.0:
            return Hung(False, False)
        skin = self._skin.at(T_world_frame)
        sums_over_hems(
            *(x, self._vertex, self._held, self._first),
            *(skin.reshape(2, -1, 3), gravity / strength, self._sums),
        )
        length, now, below = self._sums.T
        return Hung(
            rode_up=bool(((below > _BELOW * length) & (now < _RODE_UP * length)).any()),
            upside_down=bool((below < 0.0).any()),
        )
