"""A collider of kind ``mesh`` or ``bare_skin``: skin, posed from the frames of its set.

Its geometry is that of a skin in the bind pose: ``vertices`` [v, 3], ``triangles`` [t, 3],
``frame`` [v, k] (which of the set's colliders of kind frame each influence is, counted from 0),
``weight`` [v, k] (rows sum to 1), and ``bind``, the inverse bind matrices of all frames [f, 3, 4].
It has no pose of its own: vertices follow the frames by linear blending.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.carrying import carry
from garment_sim_ros.geometry.transforms import transform_from

_UNIT = 1e-5
"""How far the sum of a vertex's weights may be from 1."""


class SkinnedMesh:
    """One such collider of a set.

    Attributes:
        triangles: Vertex indices, shape [t, 3].

    Args:
        colliders: The set.
        skin: The collider.

    Raises:
        GeometryError: A geometry that cannot be used.
    """

    def __init__(self, colliders: ColliderSet, skin: Collider) -> None:
        name, g = skin.name, skin.geometry
        self._frames = np.flatnonzero([c.is_frame for c in colliders.colliders])
        try:
            x, weight, bind = (
                np.array(g[key], dtype=np.float64) for key in ("vertices", "weight", "bind")
            )
            triangles, frame = (np.array(g[key], dtype=np.int64) for key in ("triangles", "frame"))
        except (KeyError, TypeError, ValueError) as error:
            raise GeometryError(f"collider {name!r}: {skin.kind} needs numbers: {error}") from None
        v, f = len(x), len(self._frames)
        for label, array, shape in (
            ("vertices", x, (v, 3)),
            ("triangles", triangles, (max(len(triangles), 1), 3)),
            ("frame", frame, (v, *frame.shape[1:2])),
            ("weight", weight, frame.shape),
            ("bind", bind, (f, 3, 4)),
        ):
            if array.shape != shape:
                raise GeometryError(
                    f"collider {name!r}: {label} has shape {array.shape}; allowed: {shape}"
                )
        for label, array, count in (("triangles", triangles, v), ("frame", frame, f)):
            if array.size and (array.min() < 0 or array.max() >= count):
                raise GeometryError(f"collider {name!r}: {label} must be indices 0..{count - 1}")
        if not all(np.isfinite(a).all() for a in (x, weight, bind)):
            raise GeometryError(f"collider {name!r}: found numbers that are not finite")
        if weight.min(initial=0.0) < 0.0 or (np.abs(weight.sum(axis=1) - 1.0) > _UNIT).any():
            raise GeometryError(f"collider {name!r}: weights must be positive and sum to 1")
        self.triangles = triangles.astype(np.int32)
        self._x = x
        self._bind = np.tile(np.eye(4), (f, 1, 1))
        self._bind[:, :3] = bind
        self._frame, self._weight = frame.astype(np.int32), weight

    @classmethod
    def only(cls, colliders: ColliderSet) -> "SkinnedMesh":
        """That of a set with one collider of kind mesh.

        Raises:
            GeometryError: Other shapes beside it, or a geometry that cannot be used.
        """
        shapes = [c for c in colliders.colliders if c.is_met]
        if len(shapes) != 1 or not shapes[0].record.is_skin:
            found = ", ".join(sorted({c.kind for c in shapes})) or "none"
            raise GeometryError(f"a mesh must be the only shape of its set; found {found}")
        return cls(colliders, shapes[0])

    def vertices(self, poses: ColliderPoses) -> FloatArray:
        """World positions of the skin [m], shape [v, 3].

        Args:
            poses: World poses of the whole set.
        """
        return self.carried_by(transform_from(poses.position, poses.orientation))

    def carried_by(self, T_world_collider: FloatArray) -> FloatArray:
        """The same for transforms of the whole set, shape [n, 4, 4]; NaN by those of frames."""
        T = T_world_collider[self._frames] @ self._bind
        posed = np.empty_like(self._x)
        carry(self._x, self._frame, self._weight, T, posed)
        return posed
