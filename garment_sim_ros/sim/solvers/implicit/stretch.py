"""What resists strain in the plane, for `implicit`: springs along edges, or triangles."""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IndexArray, IntArray
from garment_sim_ros.sim.elastic import with_bands
from garment_sim_ros.sim.elasticity import edge_stiffness, no_stiffer
from garment_sim_ros.sim.membrane import Law, membrane
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.rest_shape import edge_lengths
from garment_sim_ros.sim.solvers.implicit.triangles import (
    Triangles,
    no_triangles,
    triangle_bound,
)


class Stretch(NamedTuple):
    """Springs and triangles of a garment.

    Attributes:
        edges: Ends of the springs, shape [s, 2].
        stiffness: Their stiffnesses, none above the highest allowed [N/m], shape [s].
        length: Their rest lengths [m], shape [s].
        triangles: Triangles that act beside them.
        bound: Stiffness for each edge of the garment whose springs together resist at least as
            all that does [N/m], shape [m].
        stiffest: How stiff all edges, or all triangles, would be [N/m].
        of: What these are.
    """

    edges: IntArray
    stiffness: FloatArray
    length: FloatArray
    triangles: Triangles
    bound: FloatArray
    stiffest: FloatArray
    of: str

    @classmethod
    def of_springs(cls, model: ClothModel, edges: IntArray, most: float) -> "Stretch":
        """All edges [m, 2] as springs, at most so stiff [N/m]."""
        triangles = model.particle_triangles
        wanted, length = with_bands(
            model.bands,
            edges,
            edge_stiffness(
                model.rest, triangles, edges, no_stiffer(model.material, most), model.corners
            ),
            edge_lengths(model.corners, triangles, edges),
        )
        stiffness = np.minimum(wanted, most)
        return cls(edges, stiffness, length, no_triangles(), stiffness, wanted, "edges")

    @classmethod
    def of_triangles(
        cls, model: ClothModel, edges: IntArray, most: float, column: IndexArray
    ) -> "Stretch":
        """Triangles whose corners have such columns, and the bands along edges [m, 2]."""
        length = edge_lengths(model.corners, model.particle_triangles, edges)
        band, length = with_bands(model.bands, edges, np.zeros(len(edges)), length)
        band = np.minimum(band, most)
        cloth, law = membrane(model), Law.of(no_stiffer(model.material, most))
        # Of a corner against its opposite side, at most.
        steepest = np.abs(cloth.along).sum(axis=2).max(axis=1) ** 2
        wanted = cloth.area * steepest * max(law[:3])
        cloth = cloth._replace(
            area=cloth.area * np.minimum(1.0, most / np.maximum(wanted, 1e-300))
        )
        bound = band + triangle_bound(edges, cloth, law)
        at = band > 0.0
        made = Triangles.of(cloth, law, column)
        return cls(edges[at], band[at], length[at], made, bound, wanted, "triangles")
