"""What the kernels of `implicit` are given of a garment, as tuples."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IndexArray, IntArray, LongArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.sim.holds.tethers import Attached
from garment_sim_ros.sim.solvers.implicit.dissection import Fronts
from garment_sim_ros.sim.solvers.implicit.triangles import Triangles

_PAST = 5
"""How many steps towards the least energy the next one is found from."""


class Hold(NamedTuple):
    """Contacts as springs, one for each free particle.

    Attributes:
        stiffness: Stiffness, 0 for none [N/m], shape [free].
        normal: The way out, shape [free, 3].
        level: How far along it the surface is from the local origin [m], shape [free].
        lever: From the particle to its anchor along the surface [m], shape [free, 3].
        shift: How far the surface moves in a sub-step [m], shape [free, 3].
    """

    stiffness: SingleArray
    normal: SingleArray
    level: SingleArray
    lever: SingleArray
    shift: SingleArray


class Moving(NamedTuple):
    """A garment's particles in a sub-step; the first ones are free, the others pinned.

    Attributes:
        x: Positions [m], shape [n, 3].
        v: Velocities [m/s], shape [n, 3].
        x_start: Positions at its start [m], shape [n, 3].
        behind: See `predict_with_share`, shape [n, 3].
        share: See `predict_with_share`, shape [free].
    """

    x: SingleArray
    v: SingleArray
    x_start: SingleArray
    behind: SingleArray
    share: SingleArray


class PinFrames(NamedTuple):
    """Colliders that pinned particles move with.

    Attributes:
        collider: Collider of each pin, shape [p].
        place: Its place in that collider's frame [m], shape [p, 3].
        step: How far that moves in the sub-step [m], shape [p, 3].
        position: World positions of all colliders at the end of the sub-step [m], shape [c, 3].
        orientation: Their unit quaternions, shape [c, 4].
        origin: World position of the local origin [m], shape [3].
    """

    collider: IntArray
    place: FloatArray
    step: FloatArray
    position: FloatArray
    orientation: FloatArray
    origin: FloatArray


class Met(NamedTuple):
    """What a search for contacts found.

    Attributes:
        contacts: The contacts.
        carry: How points move with the shapes in the sub-step, see `PosedShapes`.
        inner: Radius of a ball that fits into each shape [m], shape [m].
        lift: How far above a surface contacts are found [m].
        swift: See `take_hold` [1/m].
        friction: Coulomb coefficient.
    """

    contacts: Contacts
    carry: SingleArray
    inner: SingleArray
    lift: np.float32
    swift: np.float32
    friction: np.float32


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


class Ties(NamedTuple):
    """Soft attachments, s of them, as a sub-step needs them.

    Attributes:
        particle: Whom they pull, shape [s].
        collider: Collider that the place of each is on, shape [s].
        spot: The place in that collider's frame [m], shape [s, 3].
        target: The places when the last sub-step ended [m], NaN where not known, shape [s, 3].
        pull: Stiffness of spring and damper together [N/m], shape [s].
        spring: The spring's share of that, shape [s].
        firm: Whether that is so stiff that the particle is at its place, shape [s].
        lead: From the particle to where it is pulled to [m], shape [s, 3].
    """

    particle: IntArray
    collider: IntArray
    spot: FloatArray
    target: SingleArray
    pull: SingleArray
    spring: FloatArray
    firm: NDArray[np.bool_]
    lead: SingleArray

    @classmethod
    def of(cls, attached: Attached) -> "Ties":
        """Those of a garment, without stiffness yet."""
        s = len(attached.particle)
        return cls(
            particle=attached.particle,
            collider=attached.collider,
            spot=attached.place,
            target=attached.target,
            pull=np.zeros(s, np.float32),
            spring=np.zeros(s),
            firm=np.zeros(s, np.bool_),
            lead=np.zeros((s, 3), np.float32),
        )


class Cloth(NamedTuple):
    """Edges, hinges and the matrix as sub-steps need them.

    Attributes:
        edge_particles: Ends, flat, shape [2 m].
        edge_place: Their columns, shape [2 m].
        rest_squared: Squared rest lengths [m^2], shape [m].
        edge_stiffness: Shape [m] [N/m].
        triangles: Triangles that act instead of springs.
        hinge_particles: Shape [h, 4].
        hinge_place: Their columns, shape [h, 4].
        hinge_weight: Shape [h, 4].
        hinge_stiffness: Shape [h] [N/m].
        inertia: Mass over squared sub-step, with damping [N/m], shape [free].
        enough: What a step towards the least energy gains at most where it may be the last [J].
        place: Column of each free particle, shape [free].
        fronts: Order and fronts of the matrix.
        stiffness: Of edges between free particles in the matrix [N/m], shape [inner].
        base: Its diagonal without contacts [N/m], shape [free].
        diagonal: Its diagonal [N/m], shape [free].
        changed: Fronts to be factored again, shape [fronts].
        front: Scratch.
        update: What fronts add to their parents.
        factor: The factor.
        contact_stiffness: Stiffness of a contact [N/m], shape [free].
        clear: Scratch of a search, shape [n, 3].
        scratch: Scratch of a solution.
    """

    edge_particles: IndexArray
    edge_place: IndexArray
    rest_squared: SingleArray
    edge_stiffness: SingleArray
    triangles: Triangles
    hinge_particles: IntArray
    hinge_place: IndexArray
    hinge_weight: SingleArray
    hinge_stiffness: SingleArray
    inertia: SingleArray
    enough: float
    place: LongArray
    fronts: Fronts
    stiffness: FloatArray
    base: FloatArray
    diagonal: FloatArray
    changed: NDArray[np.bool_]
    front: FloatArray
    update: FloatArray
    factor: SingleArray
    contact_stiffness: SingleArray
    clear: SingleArray
    scratch: SingleArray
