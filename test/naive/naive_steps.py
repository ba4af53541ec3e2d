"""Whole steps of `relaxation` and `xpbd` again, of the naive rules; nothing but tests runs this.

One garment over one sphere, both moved without turning, from when nothing touches.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.shapes import Collider
from naive import naive, naive_triangles, naive_xpbd
from naive.naive_attached import pull_tethers
from naive.naive_contact import (
    leave_sphere,
    return_to_plane,
    stop_at_contact,
    touch_plane,
)
from naive.naive_triangles import Triangles


@dataclass
class Piece:
    """A garment, a sphere, and the outer forces.

    Attributes:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        inverse_mass: 0 for pins, which are the last ones [1/kg], shape [n].
        free: Number of free particles.
        sphere: The collider.
        way: Where sphere and pins are at a share of the step, relative to its start [m], [3].
        gap: Distance to keep [m].
        friction: Coulomb coefficient.
        gravity: [m/s^2], shape [3].
        damping: Rate at which velocity is damped [1/s].
        tethers: Pins and lengths, shapes [free, k].
    """

    x: FloatArray
    v: FloatArray
    inverse_mass: FloatArray
    free: int
    sphere: Collider
    way: Callable[[float], FloatArray]
    gap: float
    friction: float
    gravity: FloatArray
    damping: float
    tethers: tuple[IntArray, FloatArray]

    def fall(self, keep: float, push: FloatArray, dt: float) -> None:
        """Free particles, by their velocities and a push [m/s] of the sub-step."""
        f = self.free
        self.v[:f] = keep * self.v[:f] + push
        self.x[:f] += dt * self.v[:f]

    def move_pins(self, move: FloatArray, dt: float) -> None:
        """Pins, by so much [m]."""
        self.x[self.free :] += move
        self.v[self.free :] = move / dt

    def hold(self, rate: float) -> None:
        """Lets tethers act; they change velocities by what they move times `rate` [1/s]."""
        pull_tethers(self.x, self.v, *self.tethers, rate)

    def meet(
        self, x_start: FloatArray, shift: FloatArray, share: float
    ) -> list[tuple[FloatArray, float]]:
        """Contact of the free particles with the sphere; the way out and depth of each."""
        there = (self.sphere, self.way(share), np.eye(3))
        found = []
        for p in range(self.free):
            self.x[p], normal, depth = leave_sphere(
                self.x[p], x_start[p], shift, there, self.gap, self.friction
            )
            found.append((normal, depth))
        return found


def relaxation_step(
    piece: Piece, springs: IntArray, rest_length: FloatArray, sweeps: int, dt: float
) -> None:
    """One step of the first paper's solver."""
    keep = 1.0 / (1.0 + dt * piece.damping)
    x_start = piece.x.copy()
    piece.fall(keep, keep * dt * piece.gravity, dt)
    x_predicted = piece.x.copy()
    shift = piece.way(1.0) - piece.way(0.0)
    piece.move_pins(shift, dt)
    piece.x[:] = naive.correct_springs(piece.x, springs, rest_length, piece.inverse_mass, sweeps)
    piece.hold(0.0)
    found = piece.meet(x_start, shift, 1.0)
    f = piece.free
    piece.v[:f] = naive.update_velocities(
        *(piece.x[:f], piece.v[:f], x_start[:f], x_predicted[:f]),
        np.array([0 if depth > 0.0 else -1 for _, depth in found], np.int32),
        np.array([normal for normal, _ in found]),
        *(np.hstack([np.zeros((3, 3)), shift[:, None]])[None], dt),
    )


@dataclass
class Elastic:
    """Edges and hinges in the order in which they are solved.

    Attributes:
        edges: Ends, shape [m, 2].
        rest_length: Shape [m] [m].
        stiffness: Shape [m] [N/m].
        hinges: Particles, shape [h, 4].
        weight: Of their curvature, shape [h, 4].
        hinge_stiffness: Shape [h] [N/m].
        triangles: What acts beside the edges.
    """

    edges: IntArray
    rest_length: FloatArray
    stiffness: FloatArray
    hinges: IntArray
    weight: FloatArray
    hinge_stiffness: FloatArray
    triangles: Triangles | None = None


def bending(
    piece: Piece, elastic: Elastic, count: int, every: int, dt: float
) -> tuple[int, FloatArray]:
    """Sub-steps of dt [s] for each pass over the hinges, and the stiffnesses for that [N/m].

    The largest divisor of `count`, up to `every`, in which no hinge swings through more than 60
    degrees by itself; where there is none, one, and those that do are taken as just so stiff.
    """
    lightness = (piece.inverse_mass[elastic.hinges] * elastic.weight**2).sum(axis=1)
    rate = np.sqrt(elastic.hinge_stiffness * lightness)
    slow = [
        n for n in range(1, every + 1) if count % n == 0 and (rate * n * dt <= np.pi / 3).all()
    ]
    n = max(slow, default=1)
    return n, np.minimum(elastic.hinge_stiffness, (np.pi / 3) ** 2 / (lightness * (n * dt) ** 2))


def xpbd_step(
    piece: Piece, elastic: Elastic, count: int, iterations: int, every: int, dt: float
) -> None:
    """So many sub-steps of dt [s], with a search for contacts after each `every`."""
    f, x, v = piece.free, piece.x, piece.v
    keep = 1.0 / (1.0 + dt * piece.damping)
    planes: dict[int, tuple[FloatArray, FloatArray]] = {}
    held_friction = piece.friction if f < len(x) else 0.0
    radius = float(piece.sphere.geometry["radius"])  # type: ignore[arg-type]
    bend_every, hinge_stiffness = bending(piece, elastic, count, every, dt)
    for s in range(count):
        if s % bend_every == 0:
            long = bend_every * dt
            bent = naive_xpbd.bend(
                *(x, v, elastic.hinges, elastic.weight, hinge_stiffness),
                *(piece.inverse_mass / (1.0 + long * piece.damping), long),
            )
            push = keep * dt * piece.gravity + (bent - v)[:f] / bend_every
        x_start = x.copy()
        piece.fall(keep, push, dt)
        shift = piece.way((s + 1) / count) - piece.way(s / count)
        piece.move_pins(shift, dt)
        solved = x
        if elastic.triangles is not None:
            solved = naive_triangles.solve_triangles(
                *(x, elastic.triangles, keep * piece.inverse_mass, dt, iterations)
            )
        solved = naive_xpbd.solve_edges(
            *(solved, elastic.edges, elastic.rest_length, elastic.stiffness),
            *(keep * piece.inverse_mass, dt, iterations, False),
        )
        v[:f] += (solved - x)[:f] / dt
        x[:] = solved
        piece.hold(1.0 / dt)
        if (s + 1) % every != 0 and s > 0:
            for p, (place, normal) in planes.items():
                planes[p] = place + shift, normal
                x[p], v[p] = touch_plane(
                    x[p], v[p], x_start[p], place + shift, shift, normal, False, piece.friction, dt
                )
            continue
        if s > 0:
            for p, (place, normal) in planes.items():
                x[p], v[p] = return_to_plane(
                    x[p], v[p], x_start[p], place + shift, shift, normal, radius, held_friction, dt
                )
        before = x.copy()
        found = piece.meet(x_start, shift, (s + 1) / count)
        planes = {p: (x[p].copy(), n) for p, (n, depth) in enumerate(found) if depth > 0.0}
        for p, (_, normal) in planes.items():
            v[p] = stop_at_contact(
                v[p], x[p] - before[p], shift / dt, normal, found[p][1], piece.friction
            )
