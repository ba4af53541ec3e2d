"""What the kernels of an `xpbd` step are given, in a few tuples."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.guard.guard import Guard
from garment_sim_ros.contact.packed import PackedShapes, PosedShapes
from garment_sim_ros.contact.sides import Sides
from garment_sim_ros.contact.sweep import Sweep
from garment_sim_ros.sim.holds.tethers import Attached
from garment_sim_ros.sim.piece import Step
from garment_sim_ros.sim.solvers.xpbd.coarse import CoarseLevel
from garment_sim_ros.sim.solvers.xpbd.prepared import Prepared
from garment_sim_ros.sim.world.path import Path


class Particles(NamedTuple):
    """Motion of one garment of n particles, the first f of which move freely.

    Attributes:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        x_start: Positions before the sub-step [m], shape [n, 3].
        x_predicted: Scratch: positions or ways before constraints [m], shape [n, 3].
        wide_x: Scratch: positions as fours, flat [m], shape [4 n].
        wide_v: Scratch: velocities likewise [m/s], shape [4 n].
        x_search: Positions at the last search for contacts [m], shape [n, 3].
        x_coast: Those that they coast to until the next one [m], shape [n, 3].
        x_end: Positions at the end of the last step [m], shape [n, 3].
        low: What positions are short of by rounding [m], shape [3 f].
        push: Velocity that outer forces and bending add in a sub-step [m/s], shape [3 f].
        motion: Output, sum and maximum of squared speeds [m^2/s^2], shape [2].
        flags: Whether the step is fast enough for the quick pass over edges, and whether the
            contacts of the step before still hold, shape [2].
    """

    x: SingleArray
    v: SingleArray
    x_start: SingleArray
    x_predicted: SingleArray
    wide_x: SingleArray
    wide_v: SingleArray
    x_search: SingleArray
    x_coast: SingleArray
    x_end: SingleArray
    low: SingleArray
    push: SingleArray
    motion: FloatArray
    flags: IntArray


class Elastic(NamedTuple):
    """What acts between the particles, and between them and frames.

    Attributes:
        ready: Edges and hinges.
        coarse: A coarse level of the edges.
        attached: Tethers and soft attachments.
        pin_collider: Collider that each pin follows, shape [p].
        pin_place: Its place in that collider's frame [m], shape [p, 3].
        pin_step: How far that moves in a sub-step [m], shape [p, 3].
    """

    ready: Prepared
    coarse: CoarseLevel
    attached: Attached
    pin_collider: IntArray
    pin_place: FloatArray
    pin_step: FloatArray


class Frames(NamedTuple):
    """Where colliders are in the sub-steps up to a search for contacts.

    Attributes:
        position: World positions at the end of each [m], see `world.path.Path`, shape [k, c, 3].
        orientation: Unit quaternions, shape [k, c, 4].
        origin: World position of the local origin [m], shape [3].
        carry: How points move with the shapes in the first sub-step of a step, see `PosedShapes`,
            shape [m, 3, 4].
    """

    position: FloatArray
    orientation: FloatArray
    origin: FloatArray
    carry: SingleArray


class Planes(NamedTuple):
    """Tangent planes in which particles touched shapes at the last search, see `xpbd.planes`.

    Attributes:
        shape: Shape that each free particle touches, -1 for none, shape [f].
        normal: Outward normal there, shape [f, 3].
        depth: How deep it was [m], infinite where shapes press it from two sides, shape [f].
        caught: Whether it is deep between the two, see `contact.pinch`, shape [f].
        place: A point of each plane [m], shape [f, 3].
        shift: How far that moves in a sub-step [m], shape [f, 3].
    """

    shape: IntArray
    normal: SingleArray
    depth: SingleArray
    caught: NDArray[np.bool_]
    place: SingleArray
    shift: SingleArray

    @classmethod
    def room_for(cls, free: int) -> "Planes":
        """Arrays for so many free particles, none of which touches."""
        return cls(
            shape=np.full(free, -1, np.int32),
            normal=np.zeros((free, 3), np.float32),
            depth=np.zeros(free, np.float32),
            caught=np.zeros(free, np.bool_),
            place=np.zeros((free, 3), np.float32),
            shift=np.zeros((free, 3), np.float32),
        )


class Bodies(NamedTuple):
    """What a search for contacts needs.

    Attributes:
        shapes: Packed shapes.
        posed: The same, posed for the sub-step.
        since: The same, with the way since the last search.
        way: See `contact.sweep.Sweep`.
        sides: Which shapes are on the outer side of which particle.
        contacts: Contacts of the last search.
        guard: What keeps cores out of triangles.
    """

    shapes: PackedShapes
    posed: PosedShapes
    since: PosedShapes
    way: Sweep
    sides: Sides
    contacts: Contacts
    guard: Guard


class Rule(NamedTuple):
    """Numbers of a step.

    Attributes:
        free: Number of free particles.
        dt: Sub-step [s].
        keep: Part of velocity kept in a sub-step.
        pull: Velocity that outer forces add in a sub-step [m/s], shape [3].
        thickness: Distance to keep from surfaces [m].
        friction: Coulomb coefficient.
        held_friction: The same in cloth that something else holds, 0 in loose cloth; see
            `xpbd.planes`.
        strain_limit: Strain that edges do not grow beyond, 0 without limit.
        iterations: Passes over the edges in each sub-step.
        bend_every: Sub-steps for each pass over the hinges.
        search_every: Sub-steps for each search for contacts.
        slow: RMS speed below which edges are solved more exactly [m/s].
    """

    free: int
    dt: np.float32
    keep: np.float32
    pull: SingleArray
    thickness: np.float32
    friction: np.float32
    held_friction: np.float32
    strain_limit: np.float32
    iterations: int
    bend_every: int
    search_every: int
    slow: float


class Given(NamedTuple):
    """What the kernels are given in steps of one kind.

    Attributes:
        step: Such a step.
        path: The path of the colliders that `to_solve` has.
        own: See above.
        rule: Likewise.
        to_solve: For `sub_steps.solve`, but for the sub-steps.
        to_meet: For `sub_steps.meet`, but for its last argument.
    """

    step: Step
    path: Path
    own: Particles
    rule: Rule
    to_solve: tuple[Particles, Elastic, Frames, Planes, Planes, Rule]
    to_meet: tuple[Particles, Bodies, Prepared, Planes, Planes, IntArray, Rule]

    def fits(self, step: Step) -> bool:
        """Whether it is for steps such as this one, however many sub-steps it has."""
        return (
            self.path is step.colliders.path
            and self.step._replace(sub_steps=step.sub_steps) == step
        )
