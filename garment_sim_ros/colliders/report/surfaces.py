"""Triangle meshes of collider shapes, for pictures."""

from garment_sim_ros.contact.kinds.kind import Surface
from garment_sim_ros.contact.shapes import Collider
from garment_sim_ros.errors import GeometryError


def surface(collider: Collider, *, directions: int = 400, finest: float = 0.0) -> Surface:
    """A collider's surface in its own frame.

    Args:
        collider: Any but a frame.
        directions: Points on a round shape.
        finest: Least size of the triangles of a sampled shape [m].

    Returns:
        Vertices [m], shape [v, 3], and triangles, counter-clockwise seen from outside, [t, 3].

    Raises:
        GeometryError: The kind has no surface.
    """
    if collider.shape is None:
        raise GeometryError(f"collider {collider.name!r}: kind {collider.kind!r} has no surface")
    return collider.shape.surface(collider.geometry, directions, finest)
