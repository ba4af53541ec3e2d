"""Cloth is shown over skin that leaves the shapes.

Contact keeps cloth out of the shapes. Where a rig moves skin as no shape moves, cloth lies on the
shapes beneath it, and skin shows through. Vertices there are seen over the skin, their neighbours
with them, so far that no edge is stretched much. What is simulated stays as it is.
"""

import math

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.geometry.vectors import along, cross, dot, length, less, plus, row
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.bare_skin import BareSkin

_NEAR = 0.2
"""Vertices that are farther from the skin at rest have nothing to do with it [m]."""
_DEEP = np.float32(0.05)
"""How far off the skin a vertex may be to be shown over it [m]."""
_STEPS = 8
"""Triangles that a vertex may pass in a frame."""
_STEEP = np.float32(0.5)
"""Cosine of the angle between the skin's normal and that of a triangle; below it is crumpled."""
_SLOPE = np.float32(0.5)
"""How much less a vertex is lifted than its neighbour, as a part of the edge between them."""
_LONG = np.float32(3.2)
"""Edges of so many steps of that length are not made longer."""
_PASSES, _EVEN, _ROUNDS, _SHORT = 4, 4, 3, 20
"""Passes over the edges: that lift neighbours; that even out, and how often these are done, in
turns with staying out of shapes; and, at most, that keep edges short."""
_BACK, _SPEED = 0.1, 2.0
"""Time in which a vertex that need not be lifted any more comes down to a third [s], and how fast
one is lifted [m/s]."""
_TINY = np.float32(1e-6)
"""What differs by less is alike [m]: the square of a smaller number may be none."""
_ZERO, _ONE = np.float32(0.0), np.float32(1.0)


class OverSkin:
    """How far a garment's vertices are to be shown off their places to lie over bare skin.

    Args:
        skin: The body's.
        T_world_rest: Where its colliders are at rest, shape [n, 4, 4]; NaN where not known.
        x: The garment's vertices on the body at rest [m], shape [v, 3].
        triangles: The garment's, shape [t, 3].
        held: Vertices that stay.

    Attributes:
        lift: What each vertex is off its place [m], shape [v, 3].
    """

    def __init__(
        self,
        skin: BareSkin,
        T_world_rest: FloatArray,
        x: FloatArray,
        triangles: IntArray,
        held: IntArray,
    ) -> None:
        self._patch = skin.patch
        vertex: IntArray = np.zeros(0, np.int32)
        home: IntArray = np.zeros(0, np.int32)
        there = skin.at_rest(T_world_rest)
        if np.isfinite(there).all():
            points = np.asarray(x, np.float64)
            _, closest, nearest = MeshDistance(there, skin.patch.triangles).signed_distance(points)
            near = np.linalg.norm(points - closest, axis=1) < _NEAR
            vertex = np.flatnonzero(near).astype(np.int32)
            home = nearest[vertex].astype(np.int32)
        self._places = vertex, home.copy(), home
        edges = mesh_topology(triangles).edges
        self._stays: IntArray = np.zeros(len(x), np.bool_)
        self._stays[held] = True
        step = _SLOPE * np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)
        self._edges = edges, step.astype(np.float32)
        self._size = np.zeros(len(x), np.float32)
        self._asked, self._lifted, self.lift = (np.zeros((len(x), 3), np.float32) for _ in "abc")

    def look(
        self,
        x: SingleArray,
        normal: SingleArray,
        particle: IntArray,
        contacts: Contacts,
        clear: float,
        time: float,
    ) -> None:
        """Finds where cloth is to be seen.

        Args:
            x: Positions of the vertices [m], shape [v, 3].
            normal: Their normals, of any length, shape [v, 3].
            particle: The particle that each vertex is, or is nearest to, shape [v].
            contacts: What the last search found for the particles.
            clear: What they are to keep from the skin [m].
            time: Since the last look [s].
        """
        lift_over_skin(x, normal, self._patch, *self._places, np.float32(clear), self._asked)
        keep, way = np.float32(math.exp(-time / _BACK)), np.float32(_SPEED * min(time, 1.0))
        go_on(self._asked, keep, way, self._lifted)
        self.lift[:] = self._lifted
        spread(*self._edges, self._size, self.lift)
        self.lift[self._stays] = 0.0
        for _ in range(_ROUNDS):
            even_out(x, *self._edges, self._size, self.lift)
            self.lift[self._stays] = 0.0
            stay_out(self.lift, particle, contacts)
        keep_short(x, *self._edges, self.lift)

    def forget(self) -> None:
        """Shows all in its place until the next look."""
        self._lifted[:] = self.lift[:] = 0.0


@lean_kernel()
def lift_over_skin(x, normal, patch, vertex, near, home, clear, asked):
    """Lifts vertices that are in bare skin to the nearest place over it.

    Where each is over the skin is followed from triangle to triangle, across the edge that it is
    farthest beyond.

    Args:
        x: Positions of a garment's vertices [m], shape [v, 3].
        normal: Their normals, of any length, shape [v, 3].
        patch: The skin: `bare_skin.Patch`.
        vertex: Vertices that may be over it, shape [n].
        near: The triangle that each is over, changed in place, shape [n].
        home: That at rest, where it is looked for after it was off the skin, shape [n].
        clear: What vertices keep from the skin [m].
        asked: Output: what each vertex is asked to be off its place [m], shape [v, 3].
    """
    for v in range(asked.shape[0]):
        asked[v, 0], asked[v, 1], asked[v, 2] = _ZERO, _ZERO, _ZERO
    for n in range(vertex.size):
        v, t = vertex[n], near[n]
        place = row(x, v)
        came = np.int32(-1)
        weight = _weights(patch, t, place)
        for _ in range(_STEPS):
            across, least = np.int32(-1), _ZERO
            for edge, beyond in ((0, weight[2]), (1, weight[0]), (2, weight[1])):
                there = patch.across[t, edge]
                if beyond < least and there >= 0 and there != came:
                    across, least = there, beyond
            if across < 0:
                break
            came, t = t, across
            weight = _weights(patch, t, place)
        near[n] = t
        wa, wb, wc = max(weight[0], _ZERO), max(weight[1], _ZERO), max(weight[2], _ZERO)
        total = wa + wb + wc
        wa, wb, wc = wa / total, wb / total, wc / total
        a, b, c = patch.triangles[t, 0], patch.triangles[t, 1], patch.triangles[t, 2]
        way = less(place, _mean(patch.x, a, b, c, wa, wb, wc))
        if not dot(way, way) < _DEEP * _DEEP:
            near[n] = home[n]
            continue
        out = _mean(patch.normal, a, b, c, wa, wb, wc)
        share = wa * patch.share[a] + wb * patch.share[b] + wc * patch.share[c]
        xa = row(patch.x, a)
        flat = cross(less(row(patch.x, b), xa), less(row(patch.x, c), xa))
        area, long = length(flat), length(out)
        if not dot(flat, out) > _STEEP * area * long or dot(row(normal, v), out) <= _ZERO:
            continue
        if not dot(way, flat) < clear * area:
            continue
        far = less(along((_ZERO, _ZERO, _ZERO), out, clear / long), way)
        asked[v, 0], asked[v, 1], asked[v, 2] = along((_ZERO, _ZERO, _ZERO), far, share)


@lean_kernel()
def go_on(asked, keep, way, lifted):
    """Lifts vertices, so far at most, and lets others down slowly.

    Args:
        asked: What each is asked to be off its place [m], shape [v, 3].
        keep: Part that is kept of what is no longer asked for.
        way: How far a vertex is lifted at most [m].
        lifted: What each is off its place, changed in place [m], shape [v, 3].
    """
    for v in range(asked.shape[0]):
        there, now = row(asked, v), row(lifted, v)
        if dot(there, there) < keep * keep * dot(now, now):
            there = along((_ZERO, _ZERO, _ZERO), now, keep)
        left = less(there, now)
        far = length(left)
        if far > max(way, _TINY):
            there = along(now, left, way / far)
        lifted[v, 0], lifted[v, 1], lifted[v, 2] = there


@lean_kernel()
def spread(edges, step, size, lift):
    """Lifts the neighbours of lifted vertices, by less and less.

    Args:
        edges: Of the garment, shape [e, 2].
        step: By how much less the other end of each is lifted [m], shape [e].
        size: Output: how far each vertex is lifted [m], shape [v].
        lift: What each vertex is lifted by, changed in place [m], shape [v, 3].
    """
    for v in range(size.size):
        size[v] = length(row(lift, v))
    for _ in range(_PASSES):
        done = True
        for e in range(edges.shape[0]):
            a, b = edges[e, 0], edges[e, 1]
            of_a, of_b = size[a], size[b]
            if abs(of_a - of_b) <= step[e] + _TINY:
                continue
            if of_a < of_b:
                a, b, of_a = b, a, of_b
            part = (of_a - step[e]) / of_a
            lift[b, 0], lift[b, 1], lift[b, 2] = (
                part * lift[a, 0],
                part * lift[a, 1],
                part * lift[a, 2],
            )
            size[b], done = of_a - step[e], False
        if done:
            break


@lean_kernel()
def even_out(x, edges, step, size, lift):
    """Draws the lifts of neighbours together where they differ by more than a step.

    They differ by less where the edge is long already.

    Args:
        x: Positions of a garment's vertices [m], shape [v, 3].
        edges: Of the garment, shape [e, 2].
        step: By how much those of the ends of each may differ [m], shape [e].
        size: 0 where a vertex is not lifted, changed in place, shape [v].
        lift: What each vertex is lifted by, changed in place [m], shape [v, 3].
    """
    for _ in range(_EVEN):
        done = True
        for e in range(edges.shape[0]):
            a, b = edges[e, 0], edges[e, 1]
            if size[a] + size[b] == _ZERO:
                continue
            apart = less(row(lift, a), row(lift, b))
            far2 = dot(apart, apart)
            left = _LONG * step[e] - length(less(row(x, a), row(x, b)))
            most = max(min(step[e], left), _ZERO)
            if far2 <= (most + _TINY) * (most + _TINY):
                continue
            half = np.float32(0.5) - np.float32(0.5) * most / np.sqrt(far2)
            lift[a, 0], lift[a, 1], lift[a, 2] = along(row(lift, a), apart, -half)
            lift[b, 0], lift[b, 1], lift[b, 2] = along(row(lift, b), apart, half)
            size[a], size[b], done = _ONE, _ONE, False
        if done:
            break


@lean_kernel()
def stay_out(lift, particle, contacts):
    """Leaves out what would lead vertices into the shapes that they touch.

    In an armpit the skin of the trunk is in the arm.

    Args:
        lift: What each vertex is lifted by, changed in place [m], shape [v, 3].
        particle: The particle that each vertex is, or is nearest to, shape [v].
        contacts: What touches the free ones.
    """
    for v in range(lift.shape[0]):
        p = particle[v]
        if p < contacts.shape.size and contacts.shape[p] >= 0:
            now, normal = row(lift, v), row(contacts.normal, p)
            lift[v, 0], lift[v, 1], lift[v, 2] = along(now, normal, -min(dot(now, normal), _ZERO))


@lean_kernel()
def keep_short(x, edges, step, lift):
    """Lifts the ends of edges alike that would be too long: the higher as the lower one.

    Args:
        x: Positions of a garment's vertices [m], shape [v, 3].
        edges: Of the garment, shape [e, 2].
        step: A part of the length of each at rest, see `_LONG` [m], shape [e].
        lift: What each vertex is lifted by, changed in place [m], shape [v, 3].
    """
    for _ in range(_SHORT):
        done = True
        for e in range(edges.shape[0]):
            a, b = edges[e, 0], edges[e, 1]
            of_a, of_b = row(lift, a), row(lift, b)
            apart = less(of_a, of_b)
            if not dot(apart, apart) > _TINY * _TINY:
                continue
            edge = less(row(x, a), row(x, b))
            longer = length(plus(edge, apart))
            if longer > _LONG * step[e] and longer > length(edge):
                if dot(of_a, of_a) > dot(of_b, of_b):
                    lift[a, 0], lift[a, 1], lift[a, 2] = of_b
                else:
                    lift[b, 0], lift[b, 1], lift[b, 2] = of_a
                done = False
        if done:
            break


@lean_kernel(inner=True)
def _weights(patch, t, place):
    """Barycentric coordinates of a point's foot on the plane of a triangle; below 0 beside it."""
    a = row(patch.x, patch.triangles[t, 0])
    u = less(row(patch.x, patch.triangles[t, 1]), a)
    v = less(row(patch.x, patch.triangles[t, 2]), a)
    w = less(place, a)
    uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v)
    area2 = uu * vv - uv * uv
    if not area2 > _ZERO:
        return _ONE, _ZERO, _ZERO
    b, c = (vv * wu - uv * wv) / area2, (uu * wv - uv * wu) / area2
    return _ONE - b - c, b, c


@lean_kernel(inner=True)
def _mean(values, a, b, c, wa, wb, wc):
    """Mean of three rows by weights that sum to 1."""
    at = along((_ZERO, _ZERO, _ZERO), row(values, a), wa)
    return plus(along(at, row(values, b), wb), along((_ZERO, _ZERO, _ZERO), row(values, c), wc))
