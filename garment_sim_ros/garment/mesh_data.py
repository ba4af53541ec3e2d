"""A garment's surface."""

from dataclasses import dataclass

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
    """

    vertices: FloatArray
    triangles: IntArray
    notes: tuple[str, ...] = ()
    flat: FloatArray | None = None
