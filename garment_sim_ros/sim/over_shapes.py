"""Cloth is shown over the shapes that it lies on, between its particles, too.

Contact keeps particles out of the shapes. A triangle between three of them is flat: over a knee or
a shin its middle is inside, and skin shows through it. Seen are such triangles as much farther out
as they are too deep. What is simulated stays as it is: a particle for every place where cloth may
touch would take twice the time.
"""

import math

import numpy as np

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.geometry.vectors import along, dot, less, plus, row
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.detail.surface import Surface
from garment_sim_ros.sim.model import ClothModel

_CLEAR = 0.5
"""The middle of a triangle, or a vertex between particles, keeps so much of the thickness."""
_DEEP = 0.25
"""How deep they may be because triangles are flat, in long edges; what is deeper is no matter of
showing."""
_LONG = 95.0
"""Percentile of the edges at rest that is long."""
_BACK = 0.1
"""Time in which a vertex that need not be lifted any more comes down to a third [s]."""
_ZERO, _FAR = np.float32(0.0), np.float32(np.inf)


class OverShapes:
    """How far a garment's vertices are shown off their places to lie over the shapes.

    Args:
        model: What of it is simulated.
        surface: All its vertices over those; None where they are the same.

    Attributes:
        lift: What each vertex is off its place [m], shape [v, 3].
    """

    def __init__(self, model: ClothModel, surface: Surface | None) -> None:
        self._surface = surface
        self._triangles = model.triangles if surface is None else surface.triangles
        count = len(model) if surface is None else len(surface)
        self.lift, self._asked = (np.zeros((count, 3), np.float32) for _ in range(2))
        self._particle = model.particle
        if surface is not None:
            self._corner = np.ascontiguousarray(model.particle[surface.corner], np.int32)
        sides = side_lengths(model.rest[model.particle_triangles])
        self._deep = np.float32(_DEEP * np.percentile(sides, _LONG))

    def look(
        self,
        x: SingleArray,
        contacts: Contacts,
        colliders: ColliderState,
        thickness: float,
        time: float,
    ) -> None:
        """Finds where cloth is to be seen.

        Args:
            x: Positions of the vertices [m], shape [v, 3].
            contacts: What the last search found for the particles.
            colliders: The shapes, posed.
            thickness: What particles keep from them [m].
            time: Since the last look [s].
        """
        if not len(colliders.shapes.kind):
            return
        clear = np.float32(_CLEAR * thickness)
        met = contacts, colliders.shapes, colliders.posed, clear, self._deep, self._asked
        if self._surface is None:
            lift_triangles(x, self._triangles, self._particle, *met)
        else:
            lift_vertices(x, self._corner, *met)
        come_down(self.lift, self._asked, np.float32(math.exp(-time / _BACK)))

    def forget(self) -> None:
        """Shows all in its place until the next look."""
        self.lift[:] = 0.0


def side_lengths(corners: FloatArray) -> FloatArray:
    """Lengths of the sides of triangles [m], from each corner to the next, shape [t, 3]."""
    found: FloatArray = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    return found


@lean_kernel()
def lift_triangles(x, triangles, particle, contacts, shapes, posed, clear, deep, lift):
    """Lifts the corners of each triangle whose middle is too deep.

    A vertex goes as far as the one of its triangles asks that asks for most. Only free particles
    go anywhere.

    Args:
        x: Positions of the vertices [m], shape [n, 3].
        triangles: The mesh, shape [t, 3].
        particle: The particle that each vertex is, shape [n].
        contacts: What touches the free ones.
        shapes: Packed shapes.
        posed: The same, posed.
        clear: Distance that middles keep [m].
        deep: How deep they may be because triangles are flat [m].
        lift: Output: what each vertex is lifted by [m], shape [n, 3].
    """
    for v in range(lift.shape[0]):
        lift[v, 0], lift[v, 1], lift[v, 2] = _ZERO, _ZERO, _ZERO
    free, third = contacts.shape.size, np.float32(1.0 / 3.0)
    for t in range(triangles.shape[0]):
        u, v, w = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        a, b, c = particle[u], particle[v], particle[w]
        if not _touches(contacts, free, a, b, c):
            continue
        xa, xb, xc = row(x, u), row(x, v), row(x, w)
        middle = along((_ZERO, _ZERO, _ZERO), plus(plus(xa, xb), xc), third)
        if (
            _is_clear(contacts, free, a, middle, xa, clear)
            or _is_clear(contacts, free, b, middle, xb, clear)
            or _is_clear(contacts, free, c, middle, xc, clear)
        ):
            continue
        way = _way_out(contacts, free, a, b, c, shapes, posed, middle, clear, deep)
        far = dot(way, way)
        for k in range(3):
            v = triangles[t, k]
            if particle[v] < free and far > dot(row(lift, v), row(lift, v)):
                lift[v, 0], lift[v, 1], lift[v, 2] = way


@lean_kernel()
def lift_vertices(x, corner, contacts, shapes, posed, clear, deep, lift):
    """Lifts each vertex over a coarser mesh that is too deep in what the mesh touches there.

    Args:
        x: Positions of the vertices [m], shape [v, 3].
        corner: Particles that each vertex lies between, shape [v, 3].
        contacts: What touches the free ones.
        shapes: Packed shapes.
        posed: The same, posed.
        clear: Distance that vertices keep [m].
        deep: How deep they may be because triangles are flat [m].
        lift: Output: what each vertex is lifted by [m], shape [v, 3].
    """
    free = contacts.shape.size
    for v in range(corner.shape[0]):
        a, b, c = corner[v, 0], corner[v, 1], corner[v, 2]
        way = _ZERO, _ZERO, _ZERO
        if _touches(contacts, free, a, b, c):
            place = row(x, v)
            way = _way_out(contacts, free, a, b, c, shapes, posed, place, clear, deep)
        lift[v, 0], lift[v, 1], lift[v, 2] = way


@lean_kernel()
def come_down(lift, asked, keep):
    """Lifts vertices at once, and lets them down slowly: contact comes and goes.

    Args:
        lift: What each is lifted by, changed in place [m], shape [v, 3].
        asked: What each is asked to be [m], shape [v, 3].
        keep: Part of it that is kept.
    """
    for v in range(lift.shape[0]):
        now, before = row(asked, v), row(lift, v)
        if dot(now, now) < keep * keep * dot(before, before):
            now = keep * before[0], keep * before[1], keep * before[2]
        lift[v, 0], lift[v, 1], lift[v, 2] = now


@lean_kernel(inner=True)
def _touches(contacts, free, a, b, c):
    """Whether one of three particles touches a shape, and none is pressed between two."""
    found = False
    for p in (a, b, c):
        if p < free and contacts.shape[p] >= 0:
            if not contacts.depth[p] < _FAR:
                return False
            found = True
    return found


@lean_kernel(inner=True)
def _is_clear(contacts, free, p, point, place, clear):
    """Whether a point is clear of what particle p touches.

    Convex shapes are on one side of a plane through the point that p is over by twice as much.
    """
    if p >= free or contacts.shape[p] < 0:
        return False
    return dot(row(contacts.normal, p), less(point, place)) >= -clear


@lean_kernel(inner=True)
def _way_out(contacts, free, a, b, c, shapes, posed, point, clear, deep):
    """The way that a point is to go to be clear of the shapes that three particles touch [m].

    What is deeper than flat triangles bring about goes less far, the deeper the less.
    """
    least, nx, ny, nz = clear, _ZERO, _ZERO, _ZERO
    last = np.int64(-1)
    for p in (a, b, c):
        if p < free:
            k = np.int64(contacts.shape[p])
            if k >= 0 and k != last:
                last = k
                px, py, pz = point
                d, ux, uy, uz = shape_distance(shapes, posed, k, px, py, pz, clear)
                if d < least:
                    least, nx, ny, nz = d, ux, uy, uz
    depth = clear - least
    depth = max(_ZERO, min(depth, deep + deep - depth))
    return depth * nx, depth * ny, depth * nz
