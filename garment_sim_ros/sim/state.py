"""What changes while a garment is simulated.

Positions are float32, relative to a local origin near the body, and velocity is kept by itself
instead of as a difference of two positions. In Verlet's printed form, x(t+h) = 2 x(t) - x(t-h) +
h^2 a, a step of 1e-4 s adds 1e-7 m for gravity, less than half a unit in the last place of a
float32 coordinate 2 m from the origin: the cloth would not fall. Here gravity adds 1e-3 m/s to a
velocity, and constraints change velocity by what they moved, never by the rounding of a position.
In exact arithmetic both forms are the same.
"""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.guard.guard import Guard
from garment_sim_ros.contact.papers.earliest.contact import EarliestContact
from garment_sim_ros.contact.sides import Sides
from garment_sim_ros.sim.holds.pins import Pins
from garment_sim_ros.sim.holds.tethers import Attached
from garment_sim_ros.sim.model import ClothModel


@dataclass(kw_only=True)
class State:
    """Motion of one garment's particles, in the order of its model.

    Attributes:
        x: Positions relative to the local origin [m], shape [n, 3].
        v: Velocities in the world [m/s], shape [n, 3].
    """

    x: SingleArray
    v: SingleArray

    @classmethod
    def at(cls, model: ClothModel, x_world: FloatArray, origin: FloatArray) -> "State":
        """At rest, with the mesh's vertices at `x_world` [m], shape [v, 3]."""
        x = (np.asarray(x_world, dtype=np.float64) - origin)[model.vertex]
        return cls(x=np.ascontiguousarray(x, np.float32), v=np.zeros(x.shape, np.float32))

    def copy(self) -> "State":
        """An independent copy."""
        return State(x=self.x.copy(), v=self.v.copy())

    def assign(self, other: "State") -> None:
        """Takes over another state of the same model, without allocating."""
        np.copyto(self.x, other.x)
        np.copyto(self.v, other.v)


@dataclass(kw_only=True)
class Workspace:
    """Scratch arrays of one garment's step, allocated once.

    Attributes:
        x_start: Positions when the step starts [m], shape [n, 3].
        x_predicted: Positions that the outer forces lead to [m], shape [n, 3].
        wide: Scratch: positions as fours, flat [m], shape [4 n].
        push: Velocity that outer forces add in a sub-step [m/s], shape [3].
        keep: Part of velocity that is kept in it.
        contacts: Contacts of the free particles in the last step.
        contact_count: Number of free particles in contact in the last step.
        attached: Tethers and soft attachments.
        pins: What is pinned.
        guard: What keeps body parts from changing sides of the garment.
        limited: Whether distance limits act on the garment.
        earliest: Scratch of contact by the earliest hit; None until a step needs it.
        limits: What the solver does not take as the material has it, in words.
        motion: Sum of squared speeds and highest squared speed after the last step [m^2/s^2],
            shape [2]; not finite as soon as any velocity is.
    """

    x_start: SingleArray
    x_predicted: SingleArray
    wide: SingleArray
    push: SingleArray
    contacts: Contacts
    sides: Sides
    contact_count: int
    motion: FloatArray
    attached: Attached
    guard: Guard
    pins: Pins
    keep: float = 1.0
    limited: bool = False
    earliest: EarliestContact | None = None
    limits: tuple[str, ...] = ()

    @classmethod
    def room_for(cls, model: ClothModel, shapes: int) -> "Workspace":
        """Arrays for a garment and a number of collider shapes."""
        return cls(
            x_start=np.zeros((len(model), 3), np.float32),
            x_predicted=np.zeros((len(model), 3), np.float32),
            wide=np.zeros(4 * len(model), np.float32),
            push=np.zeros(3, np.float32),
            contacts=Contacts.room_for(model.free_count, shapes),
            sides=Sides.all_under(model.free_count, shapes),
            contact_count=0,
            motion=np.zeros(2),
            attached=Attached.none(),
            guard=Guard.none(model.free_count),
            pins=Pins.of(model),
        )
