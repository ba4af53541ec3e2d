"""What `implicit` keeps of a garment: its energy, its matrix, contacts, and the last few steps."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix

from garment_sim_ros.arrays import FloatArray, IndexArray, IntArray, SingleArray
from garment_sim_ros.constants import GRAVITY
from garment_sim_ros.sim.elasticity import Hinges, hinges, stiffness_by_weight
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.solvers.implicit.dissection import dissect
from garment_sim_ros.sim.solvers.implicit.given import Cloth, Hold, Past, Ties
from garment_sim_ros.sim.solvers.implicit.stretch import Stretch
from garment_sim_ros.sim.state import Workspace

_WEIGHTS = 20.0
"""A contact's stiffness: so many times its weight presses a particle in by `_SINK`."""
_SINK = 1e-4
"""See `_WEIGHTS` [m]; thickness has room for it."""
_LIFT = 1e-3
"""How far above a surface contacts are found [m]."""
_SMALL = 0.1
"""Extent of a garment [m]; with smaller ones the two lengths before shrink."""
_HARDLY = 1e-5
"""Strain by a garment's own weight that makes no difference to it."""
_ENOUGH = 3e-4
"""A step towards the least energy may be the last where what it gains would not carry the whole
garment through more than this share of its extent in a sub-step."""
_FIRM = 1e4
"""An attachment that is stiffer, in stiffnesses of all else at its particle, does not give way."""


def bending_bound(
    edges: IntArray, particles: IntArray, weight: FloatArray, k: FloatArray
) -> FloatArray:
    """Stiffness for each edge [m, 2] whose springs together resist at least as the hinges do.

    The weights of a hinge sum to zero, so that its curvature is sum_j w_j (x_j - x_0) over the
    three particles j beside x_0, all of them neighbours; its square is at most
    sum_j |w_j| times sum_j |w_j| |x_j - x_0|^2. The mean of that from both ends of the hinge.
    """
    if not len(edges):
        return np.zeros(0)
    rows, columns, values = [edges.min(axis=1)], [edges.max(axis=1)], [np.zeros(len(edges))]
    for middle, others in ((0, (1, 2, 3)), (1, (0, 2, 3))):
        total = np.abs(weight[:, others]).sum(axis=1)
        for other in others:
            pair = particles[:, (middle, other)]
            rows.append(pair.min(axis=1))
            columns.append(pair.max(axis=1))
            values.append(0.5 * k * total * np.abs(weight[:, other]))
    n = int(max(column.max(initial=0) for column in columns)) + 1
    joined = (np.concatenate(rows), np.concatenate(columns))
    matrix = coo_matrix((np.concatenate(values), joined), shape=(n, n)).tocsr()
    return np.asarray(matrix[edges.min(axis=1), edges.max(axis=1)]).ravel()


def _limits(
    model: ClothModel, most: float, stretch: Stretch, hinges: FloatArray
) -> tuple[str, ...]:
    """What is stiffer than `most` [N/m] and therefore counts as that, in words.

    In single precision a coordinate's last place is a force then that outweighs particles, and
    cloth sticks wherever it is.

    Args:
        model: The garment.
        most: See above.
        stretch: Edges or triangles, of the material already limited.
        hinges: Of the corners of hinges that resist most, shape [h].
    """
    names = ("stretch_stiffness_warp", "stretch_stiffness_weft", "shear_stiffness")
    values = {name: getattr(model.material, name) for name in names}
    limits = [f"{n} counts as {most:.3g} N/m, not {v:g}" for n, v in values.items() if v > most]
    for what, found in ((stretch.of, stretch.stiffest), ("hinges", hinges)):
        if (count := int((found > most).sum())) > 0:
            limits.append(
                f"{count} of {len(found)} {what}, in triangles narrow or small, are as stiff as "
                f"{most:.3g} N/m, not up to {found.max():.3g}"
            )
    return tuple(limits)


@dataclass(kw_only=True)
class ImplicitWorkspace(Workspace):
    """Scratch arrays, and what the material makes of the mesh.

    Attributes:
        extent: Of the garment at rest, the largest [m].
        sink: See `_WEIGHTS` [m].
        lift: How far above a surface contacts are found [m].
        cloth: Edges, hinges and the matrix.
        hold: Contacts.
        past: Steps of the minimisation.
        ties: Soft attachments; None before the first step.
        share: See `predict_with_share`, shape [free].
        coast: Where particles would be without inner forces [m], shape [n, 3].
        pull: Sum of the matrix's stiffnesses at each free particle [N/m], shape [free].
        edges: Ends of all edges, shape [m, 2].
        bent: Stiffness for each edge that bounds what hinges resist [N/m], shape [m].
        most: What is stiffer counts as so stiff [N/m].
        folding: What each hinge resists the corner that bends it most [N/m], shape [h].
        column: Column of each particle, the last one for pins, shape [n].
        prepared_for: The sub-step [s] and rate of damping [1/s] that the matrix is for, and
            whether it is for triangles.
    """

    extent: float
    sink: float
    lift: float
    cloth: Cloth
    hold: Hold
    past: Past
    ties: Ties | None
    share: SingleArray
    coast: SingleArray
    pull: FloatArray
    edges: IntArray
    bent: FloatArray
    most: float
    folding: FloatArray
    column: IndexArray
    prepared_for: tuple[float, float, bool]

    @classmethod
    def room_for(cls, model: ClothModel, shapes: int) -> "ImplicitWorkspace":
        """Arrays for a garment and a number of collider shapes."""
        triangles = model.particle_triangles
        rest, n = model.rest, model.free_count
        extent = float(np.ptp(rest, axis=0).max())
        most = stiffness_by_weight(model.material, extent, _HARDLY)
        edges = model.springs.particles.reshape(-1, 2)[model.springs.bending :].astype(np.int32)
        edges = edges[np.argsort(edges.min(axis=1), kind="stable")]
        stretch = Stretch.of_springs(model, edges, most)
        bending = hinges(rest, triangles, model.material, model.corners)
        used = (bending.particles < n).any(axis=1) & (bending.stiffness > 0.0)
        bending = Hinges(bending.particles[used], bending.weight[used], bending.stiffness[used])
        steepest = (bending.weight**2).max(axis=1, initial=0.0)
        folding = bending.stiffness * steepest
        soft = np.minimum(bending.stiffness, most / np.maximum(steepest, 1e-300))
        bending = bending._replace(stiffness=soft)
        bent = bending_bound(edges, bending.particles, bending.weight, bending.stiffness)
        fronts = dissect(rest[:n], edges[(edges < n).all(axis=1)])
        column = np.concatenate([fronts.place, np.full(len(model) - n, n)]).astype(np.uint32)
        made = cls(
            **vars(Workspace.room_for(model, shapes)),
            extent=extent,
            sink=_SINK * min(1.0, extent / _SMALL),
            lift=_LIFT * min(1.0, extent / _SMALL),
            cloth=Cloth(
                edge_particles=np.zeros(0, np.uint32),
                edge_place=np.zeros(0, np.uint32),
                rest_squared=np.zeros(0, np.float32),
                edge_stiffness=np.zeros(0, np.float32),
                triangles=stretch.triangles,
                hinge_particles=np.ascontiguousarray(bending.particles),
                hinge_place=column[bending.particles],
                hinge_weight=bending.weight.astype(np.float32),
                hinge_stiffness=bending.stiffness.astype(np.float32),
                inertia=np.zeros(n, np.float32),
                enough=0.0,
                place=fronts.place,
                fronts=fronts,
                stiffness=np.zeros(0),
                base=np.zeros(n),
                diagonal=np.zeros(n),
                changed=np.ones(len(fronts.parent), np.bool_),
                front=np.zeros(fronts.widest**2),
                update=np.zeros(int(fronts.update_start[-1])),
                factor=np.zeros(int(fronts.factor_start[-1]), np.float32),
                contact_stiffness=np.zeros(n, np.float32),
                clear=np.zeros((len(model), 3), np.float32),
                scratch=np.zeros(fronts.widest, np.float32),
            ),
            hold=Hold(
                stiffness=np.zeros(n, np.float32),
                normal=np.zeros((n, 3), np.float32),
                level=np.zeros(n, np.float32),
                lever=np.zeros((n, 3), np.float32),
                shift=np.zeros((n, 3), np.float32),
            ),
            past=Past.room_for(n),
            ties=None,
            share=np.ones(n, np.float32),
            coast=np.zeros((len(model), 3), np.float32),
            pull=np.zeros(n),
            edges=edges,
            bent=bent,
            most=most,
            folding=folding,
            column=column,
            prepared_for=(0.0, 0.0, False),
        )
        made._take(model, stretch)
        return made

    def _take(self, model: ClothModel, stretch: Stretch) -> None:
        """Has springs or triangles act; the matrix has to be made anew."""
        n = len(self.share)
        self.limits = _limits(model, self.most, stretch, self.folding)
        bound = stretch.bound + self.bent
        self.cloth = self.cloth._replace(
            edge_particles=np.ascontiguousarray(stretch.edges.ravel(), np.uint32),
            edge_place=self.column[stretch.edges].ravel(),
            rest_squared=(stretch.length**2).astype(np.float32),
            edge_stiffness=stretch.stiffness.astype(np.float32),
            triangles=stretch.triangles,
            stiffness=bound[(self.edges < n).all(axis=1)],
        )
        pull = np.zeros(len(self.column))
        np.add.at(pull, self.edges.ravel(), np.repeat(bound, 2))
        self.pull[:] = pull[:n]

    def prepare(
        self, model: ClothModel, dt: float, rate: float, *, triangles: bool = False
    ) -> Ties:
        """The matrix for sub-steps of dt [s], a rate of damping [1/s], springs or triangles.

        Unless it is.
        """
        if self.ties is not None and self.prepared_for == (dt, rate, triangles):
            return self.ties
        if triangles != self.prepared_for[2]:
            self._take(model, self._stretch(model, triangles))
        mass = model.mass[: model.free_count]
        self.cloth = cloth = self.cloth._replace(
            enough=float(mass.sum()) * (_ENOUGH * self.extent / dt) ** 2
        )
        cloth.inertia[:] = mass * ((1.0 + dt * rate) / dt**2)
        cloth.base[cloth.place] = cloth.inertia + self.pull
        cloth.contact_stiffness[:] = mass * (GRAVITY * _WEIGHTS / self.sink)
        cloth.changed[:] = True
        self.prepared_for = (dt, rate, triangles)
        self.ties = ties = Ties.of(self.attached)
        column = cloth.place[ties.particle]
        spring, damper = (self.attached.rate * model.mass[ties.particle, None]).T
        stiffness = spring + damper / dt
        ties.spring[:] = spring / np.maximum(stiffness, 1e-300)
        ties.firm[:] = stiffness > _FIRM * cloth.base[column]
        ties.pull[:] = np.minimum(stiffness, _FIRM * cloth.base[column])
        np.add.at(
            cloth.base, column, np.where(ties.firm, _FIRM**2 * cloth.base[column], ties.pull)
        )
        return ties

    def _stretch(self, model: ClothModel, triangles: bool) -> Stretch:
        if triangles:
            return Stretch.of_triangles(model, self.edges, self.most, self.column)
        return Stretch.of_springs(model, self.edges, self.most)
