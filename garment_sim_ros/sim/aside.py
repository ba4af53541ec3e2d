"""How far a garment's vertices are shown off the places that simulated ones give them.

Creases are round, see `round_creases`, and cloth lies over the shapes, see `over_shapes`, and over
skin that leaves them, see `over_skin`.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.geometry.vectors import dot, less, plus, row
from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.detail.surface import Surface
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.motion import to_file_order
from garment_sim_ros.sim.over_shapes import OverShapes
from garment_sim_ros.sim.over_skin import OverSkin
from garment_sim_ros.sim.round_creases import RoundCreases

_STRETCHED = 1.7
"""What lengthens an edge that is so many times as long as at rest is no matter of showing."""
_PASSES = 2
"""Vertices that are shown nearer to their places leave others apart from them."""
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)
_TINY = np.float32(1e-18)
"""Of a squared length [m^2]; what is shorter is none."""
_NOWHERE = np.zeros(3)
_NO_CONTACTS = Contacts.room_for(0, 1)


class Aside:
    """What a garment is shown off its places.

    Args:
        model: What of it is simulated.
        surface: All its vertices over those; None where they are the same.
        rest: Its vertices at rest [m], shape [v, 3].
        held: Vertices that stay, as pins do.
        over_skin: What is to lie over skin that leaves the shapes; None where there is none.

    Attributes:
        off: What each vertex is off its place [m], shape [v, 3].
        over: The part of it by which cloth lies over the shapes.
        over_skin: That by which it lies over skin that leaves them; None where there is none.
    """

    def __init__(
        self,
        model: ClothModel,
        surface: Surface | None,
        rest: FloatArray,
        held: IntArray,
        over_skin: OverSkin | None = None,
    ) -> None:
        self._model, self._surface, self._particle = model, surface, model.particle
        if surface is not None:
            nearest = surface.share.argmax(axis=1)
            self._particle = model.particle[surface.corner[np.arange(len(surface)), nearest]]
        triangles = model.triangles if surface is None else surface.triangles
        self._creases = RoundCreases(triangles, rest, held)
        self.over, self.over_skin = OverShapes(model, surface), over_skin
        self.off, self._place, self._x = (np.zeros((len(rest), 3), np.float32) for _ in range(3))
        edges = mesh_topology(triangles).edges
        sides = np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
        most = (_STRETCHED * sides).astype(np.float32)
        share = np.ones(len(rest), np.float32)
        self._simulated: SingleArray = np.zeros((len(model), 3), np.float32)
        self._all = self._x, self._place, edges, most, share, self.off, self.over.lift

    def look(
        self,
        x: SingleArray,
        contacts: Contacts,
        kept: IntArray,
        colliders: ColliderState,
        thickness: float,
        time: float,
    ) -> None:
        """Finds where cloth is to be seen.

        Args:
            x: Positions of the particles [m], shape [n, 3].
            contacts: What the last search found for them.
            kept: What the guard keeps of the free ones, see `Guard`, shape [f].
            colliders: The shapes, posed.
            thickness: What particles keep from them [m].
            time: Since the last look [s].
        """
        if self._surface is None:
            to_file_order(x, self._model.vertex, _NOWHERE, self._place)
        else:
            to_file_order(x, self._model.vertex, _NOWHERE, self._simulated)
            self._surface.follow(self._simulated, _NOWHERE, self._place)
        self._x[:] = self._place
        self._creases.round(self._x)
        if self._surface is None:
            self._creases.stay_outside(
                *(self._x, self._place, self._particle, contacts, colliders),
                thickness,
            )
        # A vertex over a coarser mesh is not pressed where the particle nearest to it is.
        pressed = contacts if self._surface is None else _NO_CONTACTS
        self._creases.stay_put(self._x, self._place, self._particle, pressed, kept, time)
        self.over.look(self._x, contacts, colliders, thickness, time)
        find_off(*self._all)
        if self.over_skin is not None:
            np.add(self._place, self.off, out=self._x)
            met = self._creases.normals, self._particle, contacts, thickness
            self.over_skin.look(self._x, *met, time)
            self.off += self.over_skin.lift

    def forget(self) -> None:
        """Shows all in its place until the next look."""
        self.off[:] = 0.0
        self._creases.forget()
        self.over.forget()
        if self.over_skin is not None:
            self.over_skin.forget()


@lean_kernel()
def find_off(x, place, edges, most, share, off, lift):
    """What vertices are shown off their places; the less, the longer edges would get by it.

    An edge gets no longer than `most`, or than it is: where two parts of a body close on cloth, as
    thigh and belly, there is no place over both.

    Args:
        x: Where vertices are seen without `lift` [m], shape [v, 3].
        place: Where they are [m], shape [v, 3].
        edges: Edges of the mesh, shape [e, 2].
        most: Length from which on each is stretched [m], shape [e].
        share: Scratch, shape [v].
        off: Output: what each vertex is off its place [m], shape [v, 3].
        lift: The part of it by which it lies over the shapes, changed in place [m], shape [v, 3].
    """
    for v in range(share.size):
        off[v, 0], off[v, 1], off[v, 2] = plus(less(row(x, v), row(place, v)), row(lift, v))
        share[v] = _ONE
    for _ in range(_PASSES):
        found = False
        for e in range(edges.shape[0]):
            a, b = edges[e, 0], edges[e, 1]
            apart = less(row(off, a), row(off, b))
            size = dot(apart, apart)
            if size > _TINY:
                edge = less(row(place, a), row(place, b))
                now, longest = dot(edge, edge), most[e] * most[e]
                opens = dot(edge, apart)
                if now + opens + opens + size > max(now, longest):
                    part = _as_far(now, opens, size, max(now, longest))
                    share[a], share[b] = min(share[a], part), min(share[b], part)
                    found = True
        if not found:
            break
        for v in range(share.size):
            if share[v] < _ONE:
                for k in range(3):
                    off[v, k] *= share[v]
                    lift[v, k] *= share[v]
                share[v] = _ONE


@lean_kernel(inner=True)
def _as_far(now, opens, size, longest):
    """How far, from 0 to 1, the ends of an edge may go apart for it to get as long as it may.

    Args:
        now: Its squared length [m^2].
        opens: Its product with how its ends go apart [m^2].
        size: That, squared [m^2].
        longest: Squared length that it may have, `now` or more [m^2].
    """
    root = np.sqrt(max(opens * opens + size * (longest - now), _ZERO))
    return min(max((root - opens) / size, _ZERO), _ONE)
