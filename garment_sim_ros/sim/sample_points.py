"""Contact of a garment between its particles: at edge midpoints and triangle centres.

A cone pokes between the corners of a triangle that is wider than it. Points on edges and triangles
meet the shapes as particles do; what moves such a point out moves its corners, by its barycentric
weights and their inverse masses (so that the point itself ends where it should).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.contact.collide import Contacts, collide_particles
from garment_sim_ros.contact.sides import Sides
from garment_sim_ros.contact.sweep import sweep
from garment_sim_ros.geometry.locality import spatial_order
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.model import ClothModel

SingleArray = NDArray[np.float32]
IntArray = NDArray[np.int32]


class SamplePoints(NamedTuple):
    """Points on a garment's edges and triangles, s of them.

    Attributes:
        corner: Particles that each lies between; on an edge the last two are the same, [s, 3].
        weight: Its barycentric weights there, shape [s, 3].
        share: How far each of them goes where the point shall go 1, shape [s, 3].
        x: Scratch: positions [m], shape [s, 3].
        x_start: Scratch: positions at the start of the step [m], shape [s, 3].
        x_coast: Scratch: positions that they would coast to [m], shape [s, 3].
        contacts: Their contacts.
        sides: On which side of them the shapes are.
    """

    corner: IntArray
    weight: SingleArray
    share: SingleArray
    x: SingleArray
    x_start: SingleArray
    x_coast: SingleArray
    contacts: Contacts
    sides: Sides

    @classmethod
    def of(cls, model: ClothModel, sides: Sides, where: str) -> "SamplePoints":
        """Points on the edges, triangles, or both of a garment.

        Args:
            model: The garment.
            sides: On which side of its free particles the shapes are.
            where: ``edges``, ``triangles`` or ``both``.
        """
        triangles = model.particle_triangles
        edges = mesh_topology(triangles).edges[:, [0, 1, 1]]
        groups = []
        if where in ("edges", "both"):
            groups.append((edges, (0.5, 0.25, 0.25)))
        if where in ("triangles", "both"):
            groups.append((triangles, (1 / 3, 1 / 3, 1 / 3)))
        corner = np.concatenate([c for c, _ in groups])
        weight = np.concatenate([np.tile(w, (len(c), 1)) for c, w in groups])
        used = (corner < model.free_count).any(axis=1)
        corner, weight = corner[used], weight[used]
        order = spatial_order(np.einsum("sk,ski->si", weight, model.rest[corner]))
        corner, weight = corner[order], weight[order]
        # Corners named twice count with the sum of their weights.
        total = np.where(corner[:, 1:2] == corner[:, 2:3], weight + weight[:, [0, 2, 1]], weight)
        total[:, 0] = weight[:, 0]
        mobility = total * model.inverse_mass[corner]
        share = mobility / (weight * mobility).sum(axis=1, keepdims=True)
        shape = np.zeros((len(corner), 3), np.float32)
        return cls(
            corner=np.ascontiguousarray(corner, np.int32),
            weight=np.ascontiguousarray(weight, np.float32),
            share=np.ascontiguousarray(share, np.float32),
            x=shape,
            x_start=shape.copy(),
            x_coast=shape.copy(),
            contacts=Contacts.room_for(len(corner), len(sides.side)),
            sides=Sides.of(np.arange(len(corner), dtype=np.int32), _rows(sides.side, corner)),
        )

    def follow(self, side: NDArray[np.int8]) -> None:
        """Takes over on which sides of the free particles the shapes are now, shape [m, free]."""
        self.sides.side[:] = _rows(side, self.corner).T


def _rows(side: NDArray[np.int8], corner: IntArray) -> NDArray[np.int8]:
    """Side of each shape for each point, shape [s, m]."""
    # A point is as far from under as the farthest of its corners; pins have everything under them.
    padded = np.zeros((len(side), max(side.shape[1], corner.max(initial=0) + 1)), np.int8)
    padded[:, : side.shape[1]] = side
    rows: NDArray[np.int8] = padded[:, corner].max(axis=2).T
    return rows


@kernel(forceinline=True)
def place_points(corner, weight, x, out):
    """Positions [s, 3] of points between particles at x [n, 3]."""
    for s in range(corner.shape[0]):
        i, j, k = corner[s, 0], corner[s, 1], corner[s, 2]
        a, b, c = weight[s, 0], weight[s, 1], weight[s, 2]
        for d in range(3):
            out[s, d] = a * x[i, d] + b * x[j, d] + c * x[k, d]


@kernel(forceinline=True)
def meet_between(
    shapes, posed, points, x, x_start, since, x_since, x_coast, way, thickness, friction, contacts
):
    """Moves particles so that points between them are out of all shapes.

    One after the other, each by what is left of its way out: no corner goes farther than the
    deepest of its points asks for. A particle that touches nothing itself is then in contact with
    what its point touched.

    Args:
        shapes: Packed shapes.
        posed: The same, posed.
        points: `SamplePoints`.
        x: Positions of all particles, corrected in place [m], shape [n, 3].
        x_start: Positions at the start of the step [m], shape [n, 3].
        since: The shapes with their way since a time before, see `sweep`.
        x_since: Positions at that time [m], shape [n, 3].
        x_coast: Where particles would have coasted from there, see `sweep` [m], shape [n, 3].
        way: See `Sweep`.
        thickness: Distance to keep from the surfaces [m].
        friction: Coulomb coefficient.
        contacts: Contacts of the free particles, added to.
    """
    corner, weight, share = points.corner, points.weight, points.share
    place_points(corner, weight, x, points.x)
    place_points(corner, weight, x_since, points.x_start)
    place_points(corner, weight, x_coast, points.x_coast)
    sweep(
        shapes, since, points.sides.side, way, points.x, points.x_start, points.x_coast, thickness
    )
    place_points(corner, weight, x_start, points.x_start)
    found = points.contacts
    if not collide_particles(
        shapes, posed, points.sides, points.x, points.x_start, thickness, friction, found
    ):
        return
    free = contacts.shape.size
    for s in range(corner.shape[0]):
        if found.shape[s] < 0:
            continue
        nx, ny, nz = found.normal[s, 0], found.normal[s, 1], found.normal[s, 2]
        px, py, pz = points.x[s, 0], points.x[s, 1], points.x[s, 2]
        for n in range(3):
            i = corner[s, n]
            px -= weight[s, n] * x[i, 0]
            py -= weight[s, n] * x[i, 1]
            pz -= weight[s, n] * x[i, 2]
        if not px * nx + py * ny + pz * nz > np.float32(0.0):
            continue
        for n in range(3):
            i = corner[s, n]
            if i >= free or (n == 2 and i == corner[s, 1]):
                continue
            x[i, 0] += share[s, n] * px
            x[i, 1] += share[s, n] * py
            x[i, 2] += share[s, n] * pz
            if contacts.shape[i] < 0:
                contacts.shape[i] = found.shape[s]
                contacts.normal[i, 0] = nx
                contacts.normal[i, 1] = ny
                contacts.normal[i, 2] = nz
                contacts.depth[i] = share[s, n] * (px * nx + py * ny + pz * nz)
