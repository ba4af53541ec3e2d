"""Sub-steps of `implicit` again, with dense matrices; nothing but tests runs this."""

from dataclasses import dataclass, field

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from naive import naive_triangles
from naive.naive_contact import leave_sphere
from naive.naive_implicit import (
    contact_force,
    edge_forces,
    hinge_forces,
    laplacian,
    quasi_newton_direction,
)
from naive.naive_steps import Elastic, Piece


@dataclass
class Contact:
    """A spring that presses a particle out of a surface, and one that holds it along it.

    Attributes:
        contact_stiffness: Stiffness [N/m].
        normal: The way out, shape [3].
        level: How far along it the surface is [m].
        shift: How far the surface moves in the sub-step [m], shape [3].
        lever: From the particle to its anchor along the surface [m], shape [3].
    """

    contact_stiffness: float
    normal: FloatArray
    level: float
    shift: FloatArray
    lever: FloatArray


@dataclass
class Tie:
    """A soft attachment to a place that goes with the sphere.

    Attributes:
        particle: Whom it pulls.
        place: Where the place is at the start of the step [m], shape [3].
        spring: [N/m].
        damper: [N s/m].
        is_firm: Whether the particle is simply put there.
    """

    particle: int
    place: FloatArray
    spring: float
    damper: float
    is_firm: bool


@dataclass
class SubSteps:
    """What lasts from one sub-step to the next, and numbers of the method.

    Attributes:
        piece: Garment, sphere and outer forces; contact is `lift` [m] above its `gap`.
        elastic: Edges and hinges.
        edges: Ends of the matrix's springs, shape [m, 2].
        bound: Their stiffness [N/m], shape [m].
        ties: Soft attachments.
        contact_stiffness: Stiffness of a contact of each particle [N/m], shape [free].
        lift: How far above a surface contacts are found [m].
        blend: How much of the last sub-step counts in the share of free fall.
        enough: What a step towards the least energy gains at most where it may be the last [J].
        share: How freely each particle fell of late, shape [free].
        levers: Of particles that touched in the last sub-step.
    """

    piece: Piece
    elastic: Elastic
    edges: IntArray
    bound: FloatArray
    ties: list[Tie]
    contact_stiffness: FloatArray
    lift: float
    blend: float
    enough: float
    share: FloatArray
    levers: dict[int, FloatArray] = field(default_factory=dict)

    def _touch(self, x_start: FloatArray, shift: FloatArray, share: float) -> dict[int, Contact]:
        """Contacts at the predicted positions."""
        piece, found = self.piece, {}
        there = (piece.sphere, piece.way(share), np.eye(3))
        for p in range(piece.free):
            gap = piece.gap + self.lift
            clear, normal, depth = leave_sphere(piece.x[p], x_start[p], shift, there, gap, 0.0)
            if depth > 0.0:
                way = clear - piece.x[p]
                length = float(np.linalg.norm(way))
                normal = way / length if length > 0.1 * self.lift else normal
                level = float(normal @ clear) - self.lift
                lever = self.levers.get(p, np.zeros(3))
                found[p] = Contact(float(self.contact_stiffness[p]), normal, level, shift, lever)
        return found

    def _forces(
        self,
        x_start: FloatArray,
        behind: FloatArray,
        contacts: dict[int, Contact],
        ends: list[tuple[Tie, FloatArray, FloatArray]],
        inertia: FloatArray,
        dt: float,
    ) -> FloatArray:
        """Less the gradient of the energy [N], shape [free, 3]."""
        piece, e = self.piece, self.elastic
        force = edge_forces(piece.x, e.edges, e.rest_length, e.stiffness, False)
        if e.triangles is not None:
            force += naive_triangles.forces(piece.x, e.triangles)
        force += hinge_forces(piece.x, e.hinges, e.weight, e.hinge_stiffness)
        force = force[: piece.free] + inertia[:, None] * behind
        for p, c in contacts.items():
            gap = c.level - float(piece.x[p] @ c.normal)
            if gap > 0.0:
                anchor = x_start[p] + c.lever + c.shift
                apart = anchor - piece.x[p]
                force[p] += c.contact_stiffness * contact_force(
                    apart, c.normal, gap, piece.friction
                )
        for tie, goal, moved in ends:
            p = tie.particle
            force[p] += tie.spring * (goal - piece.x[p])
            force[p] += tie.damper / dt * (moved - (piece.x[p] - x_start[p]))
            if tie.is_firm:
                force[p] = 0.0
        return force

    def run(self, begin: float, end: float, dt: float, iterations: int, most: int) -> int:
        """A sub-step of dt [s] from one share of the step to another; counts whom contact presses.

        Places of ties are not known before the first one, which begins at 0.
        """
        piece, f = self.piece, self.piece.free
        keep = 1.0 / (1.0 + dt * piece.damping)
        push = keep * dt * piece.gravity
        x_start = piece.x.copy()
        shift = piece.way(end) - piece.way(begin)
        fall = np.maximum(0.0, 2.0 * self.share - 1.0)[:, None]
        free_end = x_start[:f] + dt * (keep * piece.v[:f] + push)
        started = free_end - dt * (1.0 - fall) * push
        piece.x[:f] = started
        piece.move_pins(shift, dt)
        ends = []
        for tie in self.ties:
            goal = tie.place + piece.way(end)
            along = shift if begin > 0.0 else piece.x[tie.particle] - x_start[tie.particle]
            ends.append((tie, goal, along))
            if tie.is_firm:
                piece.x[tie.particle] = goal
        contacts = self._touch(x_start, shift, end)
        self._minimise(x_start, free_end, contacts, ends, dt, iterations, most)
        return self._velocities(x_start, free_end, started, contacts, push, dt)

    def _minimise(
        self,
        x_start: FloatArray,
        free_end: FloatArray,
        contacts: dict[int, Contact],
        ends: list[tuple[Tie, FloatArray, FloatArray]],
        dt: float,
        iterations: int,
        most: int,
    ) -> None:
        """So many steps towards the least energy, up to `most` where they gain much."""
        piece, f = self.piece, self.piece.free
        inertia = (1.0 + dt * piece.damping) / dt**2 / piece.inverse_mass[:f]
        matrix = laplacian(self.edges, self.bound, len(piece.x))[:f, :f]
        matrix += np.diag(inertia)
        for p, c in contacts.items():
            matrix[p, p] += c.contact_stiffness
        firm = [tie.particle for tie in self.ties if tie.is_firm]
        for tie in self.ties:
            matrix[tie.particle, tie.particle] += tie.spring + tie.damper / dt
        matrix[firm, firm] = 1e15

        def forces() -> FloatArray:
            behind = free_end - piece.x[:f]
            return self._forces(x_start, behind, contacts, ends, inertia, dt).T

        steps: list[FloatArray] = []
        changes: list[FloatArray] = []
        force = forces()
        for i in range(max(iterations, most)):
            way = quasi_newton_direction(force, matrix, steps, changes)
            piece.x[:f] += way.T
            now = forces()
            fell, grows = float((force * way).sum()), -float((now * way).sum())
            last = i + 1 >= (iterations if fell <= self.enough else max(iterations, most))
            if grows > 0.9 * fell and (steps or not last):
                part = fell / (fell + grows)
                piece.x[:f] += (part - 1.0) * way.T
                way, now = part * way, forces()
            if last:
                break
            if (way * (force - now)).sum() > 0.0:
                steps.append(way)
                changes.append(force - now)
            force = now

    def _velocities(
        self,
        x_start: FloatArray,
        free_end: FloatArray,
        started: FloatArray,
        contacts: dict[int, Contact],
        push: FloatArray,
        dt: float,
    ) -> int:
        """Velocities, shares and levers at the end; counts whom contact presses."""
        piece, f = self.piece, self.piece.free
        piece.v[:f] = (piece.x[:f] - x_start[:f]) / dt
        gained = (push - (free_end - piece.x[:f]) / dt) @ push
        now = np.clip(gained / (push @ push), 0.0, 1.0)
        self.share = self.share + self.blend * (now - self.share)
        self.levers = {}
        pressed = 0
        for p, c in contacts.items():
            gap = c.level - float(piece.x[p] @ c.normal)
            if max(gap, c.level - float(started[p] @ c.normal)) > 0.0:
                pressed += 1
                leaving = max(float((piece.v[p] - c.shift / dt) @ c.normal), 0.0)
                piece.v[p] -= leaving * c.normal
            if gap > 0.0:
                apart = x_start[p] + c.lever + c.shift - piece.x[p]
                held = contact_force(apart, c.normal, gap, piece.friction)
                self.levers[p] = held - gap * c.normal
        return pressed
