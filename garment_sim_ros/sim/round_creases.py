"""Creases are shown round.

Bunched cloth folds more finely than its mesh has vertices: what is simulated there is a zigzag
from vertex to vertex, which looks torn. Vertices at which triangles turn sharply, more than at
rest, are seen nearer to the middle of their neighbours; those at a border go along it. What is
simulated stays as it is.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.geometry.vectors import along, cross, dot, length, less, plus, row
from garment_sim_ros.jit import compiled, lean_kernel
from garment_sim_ros.sim.colliders import ColliderState

_BENT, _SHARP = 0.7, 0.4
"""Cosines of the angle between the normals of a vertex and of a triangle around it: below the
first one the vertex moves, at the second one as far as vertices go. Two triangles turn by twice
that angle against each other."""
_WAY = 0.5
"""How far vertices go in a pass, as a share of the way to the middle of their neighbours."""
_PASSES = 3
_HOLD, _EASE = 0.5, 0.3
"""How long a vertex stays in its place after what held it there, and how long it takes to go from
there [s]. Whether shapes press cloth from two sides hangs on micrometres."""
_ZERO = np.float32(0.0)


class RoundCreases:
    """Which vertices of a garment are in creases, and where they are seen.

    Args:
        triangles: The mesh, shape [t, 3].
        rest: Its vertices at rest [m], shape [v, 3].
        held: Vertices that stay, as pins do.

    Attributes:
        normals: Those of the vertices before the last `round`, of any length, shape [v, 3].
    """

    def __init__(self, triangles: IntArray, rest: FloatArray, held: IntArray) -> None:
        self._triangles, count = triangles, len(rest)
        self._start, self._neighbour = _neighbours(triangles, count, held)
        self._normal = np.zeros((len(triangles), 3), np.float32)
        self.normals, self._to = (np.zeros((count, 3), np.float32) for _ in range(2))
        self._cosine, self._weight = (np.zeros(count, np.float32) for _ in range(2))
        self._listed, self._count = np.zeros(count, np.int32), 0
        self._moves_for = np.full(count, np.inf, np.float32)
        self._code: Callable[..., None] | None = None
        turn_at_vertices(
            *(np.ascontiguousarray(rest, np.float32), triangles, self._normal, self.normals),
            self._cosine,
        )
        self._bent = np.minimum(self._cosine, np.float32(_BENT))

    def round(self, x: SingleArray) -> None:
        """Moves vertices that are in creases.

        Args:
            x: Positions of the vertices, changed in place [m], shape [v, 3].
        """
        turn_at_vertices(x, self._triangles, self._normal, self.normals, self._cosine)
        self._count = list_bent(self._cosine, self._bent, self._start, self._weight, self._listed)
        move_to_neighbours(
            *(x, self._start, self._neighbour, self._weight, self._listed, self._count, self._to),
        )

    def stay_outside(
        self,
        x: SingleArray,
        place: SingleArray,
        particle: IntArray,
        contacts: Contacts,
        colliders: ColliderState,
        keep: float,
    ) -> None:
        """Takes back what led vertices into shapes.

        Args:
            x: As `round` moved them, changed in place [m], shape [v, 3].
            place: As they were before [m], shape [v, 3].
            particle: The particle that each vertex is, shape [v].
            contacts: What touches the free ones.
            colliders: The shapes, posed.
            keep: Distance that vertices keep [m].
        """
        given = (
            *(x, place, particle, contacts, colliders.shapes, colliders.posed, np.float32(keep)),
            *(self._start, self._neighbour, self._listed, self._count),
        )
        if self._code is None:
            self._code = compiled(stay_outside, *given)
        self._code(*given)

    def stay_put(
        self,
        x: SingleArray,
        place: SingleArray,
        particle: IntArray,
        contacts: Contacts,
        kept: IntArray,
        time: float,
    ) -> None:
        """Takes back what moved vertices that the guard keeps, or shapes press from two sides.

        Args:
            x: As `round` moved them, changed in place [m], shape [v, 3].
            place: As they were before [m], shape [v, 3].
            particle: The particle that each vertex is, or is nearest to, shape [v].
            contacts: What touches the free ones.
            kept: What the guard keeps of the free ones, see `Guard`, shape [f].
            time: Since the last call [s].
        """
        stay_put(
            *(x, place, particle, contacts.shape, contacts.depth, kept),
            *(self._moves_for, np.float32(time)),
            *(self._start, self._neighbour, self._listed, self._count),
        )

    def forget(self) -> None:
        """Nothing held any vertex in its place."""
        self._moves_for[:] = np.inf


def _neighbours(triangles: IntArray, count: int, held: IntArray) -> tuple[IntArray, IntArray]:
    """Neighbours of vertices: entries `start[v]` to `start[v + 1]`; none of those that stay.

    Those of one at a border are at this border.
    """
    topology = mesh_topology(triangles)
    edges = topology.edges
    at_border = np.zeros(count, np.bool_)
    border = topology.triangle_count == 1
    at_border[edges[border]] = True
    stays = np.zeros(count, np.bool_)
    stays[held] = True
    pairs = np.concatenate([edges, edges[:, ::-1]])
    along_border = np.concatenate([border, border])
    pairs = pairs[(along_border | ~at_border[pairs[:, 0]]) & ~stays[pairs[:, 0]]]
    ones = np.ones(len(pairs), np.int8)
    table = sp.csr_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    table.sort_indices()
    return table.indptr.astype(np.int32), table.indices.astype(np.int32)


@lean_kernel()
def turn_at_vertices(x, triangles, normal, total, cosine):
    """How sharply triangles turn around vertices.

    Args:
        x: Positions of the vertices [m], shape [v, 3].
        triangles: The mesh, shape [t, 3].
        normal: Scratch: unit normals of the triangles, shape [t, 3].
        total: Scratch: their sums at the vertices, shape [v, 3].
        cosine: Output: least cosine of the angle between a vertex's normal and that of a triangle
            around it; 1 without triangles, 0 where one has no area; shape [v].
    """
    one = np.float32(1.0)
    for v in range(cosine.size):
        total[v, 0], total[v, 1], total[v, 2] = _ZERO, _ZERO, _ZERO
        cosine[v] = np.float32(np.inf)
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        xa = row(x, a)
        n = cross(less(row(x, b), xa), less(row(x, c), xa))
        size = length(n)
        scale = one / size if size > _ZERO else _ZERO
        n = scale * n[0], scale * n[1], scale * n[2]
        normal[t, 0], normal[t, 1], normal[t, 2] = n
        for v in (a, b, c):
            total[v, 0], total[v, 1], total[v, 2] = plus(row(total, v), n)
    for t in range(triangles.shape[0]):
        n = row(normal, t)
        for k in range(3):
            v = triangles[t, k]
            cosine[v] = min(cosine[v], dot(n, row(total, v)))
    for v in range(cosine.size):
        size = length(row(total, v))
        if cosine[v] == np.float32(np.inf):
            cosine[v] = one
        else:
            cosine[v] = cosine[v] / size if size > _ZERO else _ZERO


@lean_kernel()
def list_bent(cosine, bent, start, weight, listed):
    """Lists vertices in creases, and how far each goes.

    Args:
        cosine: As `turn_at_vertices` has it, shape [v].
        bent: Cosine from which on each goes, shape [v].
        start: Where each one's neighbours begin, shape [v + 1].
        weight: Output: part of the way to the middle of its neighbours, shape [v].
        listed: Output: those that go, the first ones, shape [v].

    Returns:
        How many go.
    """
    count = 0
    for v in range(cosine.size):
        sharper = (bent[v] - cosine[v]) / np.float32(_BENT - _SHARP)
        if sharper > _ZERO and start[v + 1] > start[v]:
            weight[v] = np.float32(_WAY) * min(sharper, np.float32(1.0))
            listed[count] = v
            count += 1
    return count


@lean_kernel()
def move_to_neighbours(x, start, neighbour, weight, listed, count, to):
    """Moves vertices towards the middle of their neighbours, all at once in each pass.

    Args:
        x: Positions of the vertices, changed in place [m], shape [v, 3].
        start: Where each one's neighbours begin, shape [v + 1].
        neighbour: Neighbours, shape [any].
        weight: Part of the way that each goes, shape [v].
        listed: Those that go, the first `count`, shape [v].
        count: How many go.
        to: Scratch, shape [v, 3].
    """
    for _ in range(_PASSES):
        for n in range(count):
            v = listed[n]
            total = _ZERO, _ZERO, _ZERO
            for k in range(start[v], start[v + 1]):
                total = plus(total, row(x, neighbour[k]))
            part = weight[v] / np.float32(start[v + 1] - start[v])
            rest = np.float32(1.0) - weight[v]
            for k in range(3):
                to[n, k] = rest * x[v, k] + part * total[k]
        for n in range(count):
            v = listed[n]
            x[v, 0], x[v, 1], x[v, 2] = row(to, n)


@lean_kernel()
def stay_outside(
    x, place, particle, contacts, shapes, posed, keep, start, neighbour, listed, count
):
    """Takes back what led vertices into shapes that they or their neighbours touch.

    What touches goes along the surface. Out of what neighbours touch it is moved again, as far as
    it was before: in a crease a vertex touches now the one side, now the other.

    Args:
        x: Positions of the vertices, changed in place [m], shape [v, 3].
        place: What they were before [m], shape [v, 3].
        particle: The particle that each vertex is, shape [v].
        contacts: What touches the free ones.
        shapes: Packed shapes.
        posed: The same, posed.
        keep: Distance that vertices keep [m].
        start: Where each one's neighbours begin, shape [v + 1].
        neighbour: Neighbours, shape [any].
        listed: Those that were moved, the first `count`, shape [v].
        count: How many were.
    """
    free = contacts.shape.size
    for n in range(count):
        v = listed[n]
        p = particle[v]
        last = np.int64(-1)
        if p < free and contacts.shape[p] >= 0:
            way, normal = less(row(x, v), row(place, v)), row(contacts.normal, p)
            x[v, 0], x[v, 1], x[v, 2] = along(row(x, v), normal, -min(dot(way, normal), _ZERO))
            last = np.int64(contacts.shape[p])
        for k in range(start[v], start[v + 1]):
            q = particle[neighbour[k]]
            c = np.int64(contacts.shape[q]) if q < free else np.int64(-1)
            if c < 0 or c == last:
                continue
            last = c
            d, nx, ny, nz = shape_distance(shapes, posed, c, x[v, 0], x[v, 1], x[v, 2], keep)
            if d < keep:
                px, py, pz = row(place, v)
                before, _, _, _ = shape_distance(shapes, posed, c, px, py, pz, keep)
                out = max(min(keep, before) - d, _ZERO)
                x[v, 0], x[v, 1], x[v, 2] = along(row(x, v), (nx, ny, nz), out)


@lean_kernel()
def stay_put(
    x, place, particle, shape, depth, kept, moves_for, time, start, neighbour, listed, count
):
    """Takes back what moved vertices that the guard keeps, or beside those, and pressed ones.

    Limbs are close to what the guard keeps: what is shown elsewhere may be through one. What
    shapes press from two sides has nowhere to go.

    Args:
        x: Positions of the vertices, changed in place [m], shape [v, 3].
        place: What they were before [m], shape [v, 3].
        particle: The particle that each vertex is, or is nearest to, shape [v].
        shape: What touches the free ones, -1 for nothing, shape [f].
        depth: How deep these are in it, infinite for pressed ones [m], shape [f].
        kept: What the guard keeps of them, -1 for nothing, shape [f].
        moves_for: Time since something held each vertex, changed in place [s], shape [v].
        time: Since the last call [s].
        start: Where each one's neighbours begin, shape [v + 1].
        neighbour: Neighbours, shape [any].
        listed: Those that were moved, the first `count`, shape [v].
        count: How many were.
    """
    one = np.float32(1.0)
    for v in range(moves_for.size):
        moves_for[v] += time
    for n in range(count):
        v = listed[n]
        p = particle[v]
        stays = p < shape.size and shape[p] >= 0 and depth[p] == np.float32(np.inf)
        stays = stays or (p < kept.size and kept[p] >= 0)
        for k in range(start[v], start[v + 1]):
            q = particle[neighbour[k]]
            stays = stays or (q < kept.size and kept[q] >= 0)
        if stays:
            moves_for[v] = _ZERO
        share = (moves_for[v] - np.float32(_HOLD)) / np.float32(_EASE)
        if share < one:
            way = less(row(x, v), row(place, v))
            x[v, 0], x[v, 1], x[v, 2] = along(row(place, v), way, max(share, _ZERO))
