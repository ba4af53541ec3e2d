"""Edges and hinges, prepared for sub-steps of one length."""

from typing import NamedTuple

from garment_sim_ros.arrays import IndexArray, IntArray, SingleArray


class Prepared(NamedTuple):
    """Edges and hinges as a sub-step needs them.

    Attributes:
        edge_particles: Ends of the edges, flat, in the order of a pass, shape [2 m].
        edges: See `solvers.xpbd.edges.prepare_edges`, shape [4, m].
        fours: So many edges, the first ones, are in fours without a common end.
        pull: Scratch of several passes, shape [m].
        hinge_particles: Particles of the hinges, shape [h, 4].
        hinges: See `solvers.xpbd.hinges.prepare_hinges`, shape [h, 8].
    """

    edge_particles: IndexArray
    edges: SingleArray
    fours: int
    pull: SingleArray
    hinge_particles: IntArray
    hinges: SingleArray
