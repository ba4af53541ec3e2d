"""Elastic bands sewn to cloth: edges that pull with a tension.

A band lies along edges of the cloth, a linear spring beside each edge's own. Two springs side by
side are one: as stiff as both, at rest at the mean of their lengths by stiffness. So bands cost
nothing in a step, and every solver has them. Slack, a band would not push; here it does, weakly,
below the length that it is slack at.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray


class ElasticEdges(NamedTuple):
    """Edges of a garment that elastic bands run along.

    Attributes:
        edges: Vertex pairs, each an edge of the mesh, shape [b, 2].
        tension: What the band pulls with where the edge is as long as it was cut [N], shape [b].
        slack: Share of that length at which it pulls no more, shape [b].
    """

    edges: IntArray
    tension: FloatArray
    slack: FloatArray

    @classmethod
    def none(cls) -> "ElasticEdges":
        """No band."""
        return cls(np.zeros((0, 2), np.int32), np.zeros(0), np.zeros(0))

    def renamed(self, number: IntArray) -> "ElasticEdges":
        """The same with vertex i called number[i]."""
        return self._replace(edges=np.asarray(number, np.int32)[self.edges])


def with_bands(
    bands: ElasticEdges, edges: IntArray, stiffness: FloatArray, length: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Stiffnesses [N/m] and rest lengths [m] of edges with the bands along them, shape [m] each.

    Args:
        bands: The bands, in the numbers of `edges`.
        edges: Ends of the edges, shape [m, 2].
        stiffness: Their stiffness without bands [N/m], shape [m].
        length: Their rest length without bands [m], shape [m].
    """
    if not len(bands.edges):
        return stiffness, length
    n = int(max(edges.max(), bands.edges.max())) + 1
    both = edges.astype(np.int64), bands.edges.astype(np.int64)
    keys, wanted = (np.sort(pairs, axis=1) @ np.array([n, 1]) for pairs in both)
    order = np.argsort(keys, kind="stable")
    place = np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)
    there = keys[order][place] == wanted  # others lie between two pins
    at, band = order[place[there]], np.flatnonzero(there)
    slack = bands.slack[band]
    pull = bands.tension[band] / ((1.0 - slack) * length[at])
    more, drawn = np.zeros_like(stiffness), np.zeros_like(length)
    np.add.at(more, at, pull)
    np.add.at(drawn, at, pull * slack * length[at])
    total = stiffness + more
    shorter = (stiffness * length + drawn) / np.where(total > 0.0, total, 1.0)
    return total, np.where(more > 0.0, shorter, length)
