"""Implicit Euler steps, solved by a quasi-Newton method with a constant sparse matrix.

Each sub-step looks for the positions of least energy: inertia, edges, hinges and contacts. The
matrix is that of projective dynamics (Bouaziz et al. 2014), an upper bound of the energy's Hessian
that is the same for all three axes; it is factored once and, where contacts come and go, in parts
again. The first of the iterations is a step of projective dynamics, which never goes too far; the
following ones learn from those before (Liu, Bouaziz & Kavan 2017, "Quasi-Newton methods for
real-time simulation of hyperelastic materials"). Stretch goes through the whole garment at once;
folding and swinging, which the matrix resists like stretch, take some iterations.

Prediction follows Chen et al. 2024, "Vertex block descent", section 3.7: gravity counts in the
start of the iterations as far as the particle fell freely before.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

from garment_sim_ros.geometry.contact import collide
from garment_sim_ros.geometry.contact_shapes import pose
from garment_sim_ros.geometry.dissection import Fronts, dissect
from garment_sim_ros.geometry.shapes import ColliderPoses
from garment_sim_ros.geometry.transforms import interpolate_poses
from garment_sim_ros.params import ImplicitSettings
from garment_sim_ros.sim.elasticity import (
    GRAVITY,
    Hinges,
    edge_stiffness,
    hinges,
    stretched_by_its_weight,
)
from garment_sim_ros.sim.kernels.implicit_steps import begin_sub_step, end_sub_step
from garment_sim_ros.sim.kernels.sub_steps import same_poses
from garment_sim_ros.sim.model import ClothModel, Parameters
from garment_sim_ros.sim.state import ColliderState, State, Workspace

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
IntArray = NDArray[np.int32]
IndexArray = NDArray[np.uint32]
LongArray = NDArray[np.int64]

_WEIGHTS = 20.0
"""A contact's stiffness: so many times its weight presses a particle in by `_SINK`."""
_SINK = 1e-4
"""See `_WEIGHTS` [m]; thickness has room for it."""
_LIFT = 1e-3
"""How far above a surface contacts are found [m]."""
_BLEND_TIME = 0.2
"""How long a particle's share of free fall is averaged [s]: less, and cloth at rest creeps."""
_HARDLY = 1e-5
"""Strain by a garment's own weight that makes no difference to it."""
_PAST = 5
"""How many steps towards the least energy the next one is found from."""


class Hold(NamedTuple):
    """Contacts as springs, one for each free particle.

    Attributes:
        grip: Stiffness, 0 for none [N/m], shape [free].
        normal: The way out, shape [free, 3].
        level: How far along it the surface is from the local origin [m], shape [free].
        lever: From the particle to its anchor along the surface [m], shape [free, 3].
        ride: How far the surface moves in a sub-step [m], shape [free, 3].
    """

    grip: SingleArray
    normal: SingleArray
    level: SingleArray
    lever: SingleArray
    ride: SingleArray


class Past(NamedTuple):
    """The last steps towards the least energy, and scratch of the next.

    Attributes:
        step: The steps [m], shape [k, 3, free + 1].
        force: How much force each took away [N], shape [k, 3, free + 1].
        curvature: Their inner products [J], shape [k].
        share: Scratch, shape [k].
        now: Scratch: force, shape [3, free + 1].
        next: Scratch, likewise.
        direction: Scratch, likewise [m].
    """

    step: SingleArray
    force: SingleArray
    curvature: FloatArray
    share: FloatArray
    now: SingleArray
    next: SingleArray
    direction: SingleArray

    @classmethod
    def room_for(cls, n: int, kept: int = _PAST) -> "Past":
        """Arrays for so many free particles and steps."""
        return cls(
            step=np.zeros((kept, 3, n + 1), np.float32),
            force=np.zeros((kept, 3, n + 1), np.float32),
            curvature=np.zeros(kept),
            share=np.zeros(kept),
            now=np.zeros((3, n + 1), np.float32),
            next=np.zeros((3, n + 1), np.float32),
            direction=np.zeros((3, n + 1), np.float32),
        )


class Cloth(NamedTuple):
    """Edges, hinges and the matrix as sub-steps need them.

    Attributes:
        edge_particles: Ends, flat, shape [2 m].
        edge_place: Their columns, shape [2 m].
        rest_squared: Squared rest lengths [m^2], shape [m].
        edge_stiffness: Shape [m] [N/m].
        hinge_particles: Shape [h, 4].
        hinge_place: Their columns, shape [h, 4].
        hinge_weight: Shape [h, 4].
        hinge_stiffness: Shape [h] [N/m].
        inertia: Mass over squared sub-step, with damping [N/m], shape [free].
        place: Column of each free particle, shape [free].
        fronts: Order and fronts of the matrix.
        stiffness: Of edges between free particles in the matrix [N/m], shape [inner].
        base: Its diagonal without contacts [N/m], shape [free].
        diagonal: Its diagonal [N/m], shape [free].
        changed: Fronts to be factored again, shape [fronts].
        front: Scratch.
        update: What fronts add to their parents.
        factor: The factor.
        grip: Stiffness of a contact [N/m], shape [free].
        clear: Scratch of a search, shape [free, 3].
        scratch: Scratch of a solution.
    """

    edge_particles: IndexArray
    edge_place: IndexArray
    rest_squared: SingleArray
    edge_stiffness: SingleArray
    hinge_particles: IntArray
    hinge_place: IndexArray
    hinge_weight: SingleArray
    hinge_stiffness: SingleArray
    inertia: SingleArray
    place: LongArray
    fronts: Fronts
    stiffness: FloatArray
    base: FloatArray
    diagonal: FloatArray
    changed: NDArray[np.bool_]
    front: FloatArray
    update: FloatArray
    factor: SingleArray
    grip: SingleArray
    clear: SingleArray
    scratch: SingleArray


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


@dataclass(kw_only=True)
class ImplicitWorkspace(Workspace):
    """Scratch arrays, and what the material makes of the mesh.

    Attributes:
        cloth: Edges, hinges and the matrix.
        hold: Contacts.
        past: Steps of the minimisation.
        share: See `predict_with_share`, shape [free].
        pull: Sum of the matrix's stiffnesses at each free particle [N/m], shape [free].
        prepared_for: The sub-step [s] and rate of damping [1/s] that the matrix is for.
        between: Poses at the start and end of the last sub-step; None before the first.
    """

    cloth: Cloth
    hold: Hold
    past: Past
    share: SingleArray
    pull: FloatArray
    prepared_for: tuple[float, float]
    between: tuple[ColliderPoses, ColliderPoses] | None

    @classmethod
    def room_for(cls, model: ClothModel, shapes: int) -> "ImplicitWorkspace":
        """Arrays for a garment and a number of collider shapes."""
        particle = np.empty(len(model), np.int32)
        particle[model.vertex] = np.arange(len(model), dtype=np.int32)
        triangles = particle[model.triangles]
        rest, n = model.rest, model.free_count
        edges = model.springs.particles.reshape(-1, 2)[model.springs.bending :].astype(np.int32)
        edges = edges[np.argsort(edges.min(axis=1), kind="stable")]
        material = stretched_by_its_weight(model.material, rest, _HARDLY)
        stiffness = edge_stiffness(rest, triangles, edges, material)
        bending = hinges(rest, triangles, model.material)
        used = (bending.particles < n).any(axis=1) & (bending.stiffness > 0.0)
        bending = Hinges(bending.particles[used], bending.weight[used], bending.stiffness[used])
        bound = stiffness + bending_bound(
            edges, bending.particles, bending.weight, bending.stiffness
        )
        inner = (edges < n).all(axis=1)
        fronts = dissect(rest[:n], edges[inner])
        column = np.concatenate([fronts.place, np.full(len(model) - n, n)]).astype(np.uint32)
        pull = np.zeros(len(model))
        np.add.at(pull, edges.ravel(), np.repeat(bound, 2))
        return cls(
            **vars(Workspace.room_for(model, shapes)),
            cloth=Cloth(
                edge_particles=np.ascontiguousarray(edges.ravel(), np.uint32),
                edge_place=column[edges].ravel(),
                rest_squared=((rest[edges[:, 0]] - rest[edges[:, 1]]) ** 2)
                .sum(axis=1)
                .astype(np.float32),
                edge_stiffness=stiffness.astype(np.float32),
                hinge_particles=np.ascontiguousarray(bending.particles),
                hinge_place=column[bending.particles],
                hinge_weight=bending.weight.astype(np.float32),
                hinge_stiffness=bending.stiffness.astype(np.float32),
                inertia=np.zeros(n, np.float32),
                place=fronts.place,
                fronts=fronts,
                stiffness=bound[inner],
                base=np.zeros(n),
                diagonal=np.zeros(n),
                changed=np.ones(len(fronts.parent), np.bool_),
                front=np.zeros(fronts.widest**2),
                update=np.zeros(int(fronts.update_start[-1])),
                factor=np.zeros(int(fronts.factor_start[-1]), np.float32),
                grip=np.zeros(n, np.float32),
                clear=np.zeros((n, 3), np.float32),
                scratch=np.zeros(fronts.widest, np.float32),
            ),
            hold=Hold(
                grip=np.zeros(n, np.float32),
                normal=np.zeros((n, 3), np.float32),
                level=np.zeros(n, np.float32),
                lever=np.zeros((n, 3), np.float32),
                ride=np.zeros((n, 3), np.float32),
            ),
            past=Past.room_for(n),
            share=np.ones(n, np.float32),
            pull=pull[:n],
            prepared_for=(0.0, 0.0),
            between=None,
        )

    def prepare(self, model: ClothModel, dt: float, rate: float) -> None:
        """The matrix for sub-steps of dt [s] and a rate of damping [1/s], unless it is."""
        if self.prepared_for == (dt, rate):
            return
        cloth, mass = self.cloth, model.mass[: model.free_count]
        cloth.inertia[:] = mass * ((1.0 + dt * rate) / dt**2)
        cloth.base[cloth.place] = cloth.inertia + self.pull
        cloth.grip[:] = mass * (GRAVITY * _WEIGHTS / _SINK)
        cloth.changed[:] = True
        self.prepared_for = (dt, rate)


def _assign(poses: ColliderPoses, others: ColliderPoses) -> None:
    poses.position[:] = others.position
    poses.orientation[:] = others.orientation


def step(
    model: ClothModel,
    colliders: ColliderState,
    params: Parameters,
    state: State,
    workspace: Workspace,
    dt: float,
) -> None:
    """Advances one garment by one step, in equal sub-steps.

    Each sub-step: a prediction, pins, a search for contacts there, `iterations` steps towards the
    least energy, velocities. Does not allocate arrays after the first step of a length.

    Args:
        model: The garment.
        colliders: Colliders at the start and end of the step.
        params: Outer forces and `ImplicitSettings`.
        state: Its motion, changed in place.
        workspace: Its `ImplicitWorkspace`.
        dt: Step [s].
    """
    assert isinstance(workspace, ImplicitWorkspace)
    settings = params.settings
    assert isinstance(settings, ImplicitSettings)
    count = max(1, math.ceil(dt / settings.sub_step - 1e-6))
    h = dt / count
    material, environment = model.material, params.environment
    drag = material.air_drag / material.areal_density
    rate = material.damping + drag
    workspace.prepare(model, h, rate)
    keep = 1.0 / (1.0 + h * rate)
    for k in range(3):
        pull = environment.gravity[k] + drag * environment.wind[k]
        workspace.push[k] = keep * h * pull
    start, end, hold = colliders.start, colliders.end, workspace.hold
    if workspace.between is None:
        workspace.between = (end.copy(), start.copy())
    before, after = workspace.between
    if not same_poses(start.position, start.orientation, after.position, after.orientation):
        hold.grip[:] = 0.0  # Put somewhere else: what was touched is gone.
    # One sub-step is the step that the shapes are posed for; what stands still, stands.
    between_poses = count > 1 and not same_poses(
        start.position, start.orientation, end.position, end.orientation
    )
    _assign(after, start if between_poses else end)
    for s in range(count):
        if between_poses:
            _assign(before, after)
            interpolate_poses(
                start.position,
                start.orientation,
                end.position,
                end.orientation,
                (s + 1) / count,
                after.position,
                after.orientation,
            )
            pose(colliders.shapes, before, after, colliders.origin, colliders.posed)
        begin_sub_step(
            state.x,
            state.v,
            model.free_count,
            workspace.x_start,
            workspace.x_predicted,
            workspace.cloth.clear,
            workspace.share,
            model.pin_collider,
            model.pin_position,
            after.position,
            after.orientation,
            colliders.origin,
            workspace.push,
            np.float32(keep),
            np.float32(h),
        )
        collide(
            colliders.shapes,
            colliders.posed,
            workspace.sides,
            workspace.cloth.clear,
            workspace.x_start[: model.free_count],
            max(material.thickness, colliders.thickness) + _LIFT,
            0.0,
            workspace.contacts,
        )
        workspace.contact_count = end_sub_step(
            state.x,
            state.v,
            model.free_count,
            workspace.x_start,
            workspace.x_predicted,
            workspace.cloth.clear,
            workspace.cloth,
            hold,
            workspace.past,
            workspace.share,
            workspace.contacts,
            colliders.posed.carry,
            np.float32(material.friction),
            np.float32(_LIFT),
            workspace.push,
            np.float32(keep),
            np.float32(h),
            np.float32(min(1.0, h / _BLEND_TIME)),
            settings.iterations,
            workspace.motion,
        )
    _assign(after, end)
