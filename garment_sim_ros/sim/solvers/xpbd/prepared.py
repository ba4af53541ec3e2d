"""Edges, triangles and hinges, prepared for sub-steps of one length."""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import IndexArray, IntArray, SingleArray


class Edges(NamedTuple):
    """Edges as a sub-step needs them, m of them.

    Attributes:
        particles: Ends, flat, in the order of a pass, shape [2 m].
        numbers: See `solvers.xpbd.edges.prepare_edges`, shape [4, m].
        fours: So many edges, the first ones, are in fours without a common end.
        pull: Scratch of several passes, shape [m].
    """

    particles: IndexArray
    numbers: SingleArray
    fours: int
    pull: SingleArray

    @classmethod
    def none(cls) -> "Edges":
        """No edges."""
        return cls(
            particles=np.zeros(0, np.uint32),
            numbers=np.zeros((4, 0), np.float32),
            fours=0,
            pull=np.zeros(0, np.float32),
        )


class Triangles(NamedTuple):
    """Triangles as a sub-step needs them, t of them, in fours; some are there four times.

    Attributes:
        particles: Corners, flat, in the order of a pass, shape [3 t].
        numbers: See `solvers.xpbd.triangles.prepare_triangles`, shape [11 t].
        law: See `solvers.xpbd.triangles.solve_triangles`, shape [4].
        stress: Scratch of several passes, shape [3 t].
    """

    particles: IndexArray
    numbers: SingleArray
    law: SingleArray
    stress: SingleArray

    @classmethod
    def none(cls) -> "Triangles":
        """No triangles."""
        return cls(
            particles=np.zeros(0, np.uint32),
            numbers=np.zeros(0, np.float32),
            law=np.zeros(4, np.float32),
            stress=np.zeros(0, np.float32),
        )


class Prepared(NamedTuple):
    """What acts between particles, as a sub-step needs it.

    Attributes:
        edges: All edges.
        springs: Those of them that act as springs.
        triangles: Triangles that act instead of the others.
        hinge_particles: Particles of the hinges, shape [h, 4].
        hinges: See `solvers.xpbd.hinges.prepare_hinges`, shape [h, 8].
    """

    edges: Edges
    springs: Edges
    triangles: Triangles
    hinge_particles: IntArray
    hinges: SingleArray
