"""Contact with the exact moving skin, in the place of collider shapes; `relaxation` only.

`contact.mesh.collide` moves particles out; this adds friction and says how the surface moved
where each particle met it. In double precision, allocating as it likes: a yardstick.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.mesh.collide import MeshCollider
from garment_sim_ros.contact.mesh.skinned import SkinnedMesh
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet


class SkinContact:
    """The skin of one body.

    Args:
        colliders: A set with one mesh.

    Raises:
        GeometryError: A mesh that cannot be used.
    """

    def __init__(self, colliders: ColliderSet) -> None:
        self._mesh = SkinnedMesh.only(colliders)
        self._start = self._end = self._mesh.vertices(ColliderPoses.identity(len(colliders)))
        self._collider = MeshCollider(self._end, self._mesh.triangles)

    def move(self, start: ColliderPoses, end: ColliderPoses, origin: FloatArray) -> None:
        """Pose the skin for one step.

        Args:
            start: World poses of the set when the step starts.
            end: World poses when it ends.
            origin: World position that particle positions are relative to [m], shape [3].
        """
        self._start = self._mesh.vertices(start) - origin
        self._end = self._mesh.vertices(end) - origin
        self._collider.update(self._end, self._start)

    def meet(
        self,
        x: SingleArray,
        x_start: SingleArray,
        thickness: float,
        friction: float,
        contacts: Contacts,
    ) -> tuple[int, SingleArray]:
        """Moves particles out of the skin.

        Friction takes from the proposed position what it slips along the moving surface, at most
        `friction` times how deep it was, as with other shapes.

        Args:
            x: Proposed positions at the end of the step, corrected in place [m], shape [n, 3].
            x_start: Positions at its start [m], shape [n, 3].
            thickness: Distance to keep from the skin [m].
            friction: Coulomb coefficient.
            contacts: Output; the shape that a particle meets is its own surface point, so that it
                has the particle's number.

        Returns:
            Number of particles in contact, and `PosedShapes.carry` for those shapes.
        """
        p, q = x_start.astype(np.float64), x.astype(np.float64)
        y, normal, triangle = self._collider.collide(q, p, thickness)
        met = triangle >= 0
        held = np.flatnonzero(met)
        if friction > 0.0 and len(held):
            n = normal[held]
            depth = np.einsum("ni,ni->n", (y - q)[held], n)
            slip = (q - p - self._shift(y, triangle))[held]
            slip -= np.einsum("ni,ni->n", slip, n)[:, None] * n
            length = np.linalg.norm(slip, axis=1)
            share = friction * np.maximum(depth, 0.0) / np.maximum(length, 1e-300)
            slowed = q[held] - np.minimum(share, 1.0)[:, None] * slip
            y[held], n, t = self._collider.collide(slowed, p[held], thickness)
            # Held back by friction, a particle may just miss the skin that did so.
            again = held[t >= 0]
            normal[again], triangle[again] = n[t >= 0], t[t >= 0]
        carry = np.zeros((len(x), 3, 4), np.float32)
        carry[:, :, 3] = self._shift(y, triangle)
        contacts.depth[:] = np.linalg.norm(y - x, axis=1)
        x[met] = y[met]
        contacts.normal[:] = normal
        contacts.shape[:] = np.where(met, np.arange(len(x)), -1)
        return int(met.sum()), carry

    def _shift(self, points: FloatArray, triangle: IntArray) -> FloatArray:
        """How far the skin under points has come in the step, zero where no triangle was met."""
        corners = self._mesh.triangles[np.maximum(triangle, 0)]
        a, b, c = self._end[corners].transpose(1, 0, 2)
        u, v, w = b - a, c - a, points - a
        uu, uv, vv = (np.einsum("ni,ni->n", *pair) for pair in ((u, u), (u, v), (v, v)))
        wu, wv = (np.einsum("ni,ni->n", w, side) for side in (u, v))
        area2 = np.maximum(uu * vv - uv * uv, 1e-300)
        s = np.clip((vv * wu - uv * wv) / area2, 0.0, 1.0)
        t = np.clip((uu * wv - uv * wu) / area2, 0.0, 1.0 - s)
        moved = (self._end - self._start)[corners]
        shift = (1.0 - s - t)[:, None] * moved[:, 0] + s[:, None] * moved[:, 1]
        shift += t[:, None] * moved[:, 2]
        return np.where((triangle >= 0)[:, None], shift, 0.0)
