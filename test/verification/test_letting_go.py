"""Cloth that hangs overstretched on what only passes it by, and cloth that is only brushed."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from particles import simulated

from garment_sim_ros.contact.guard.guard import Guard
from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.contact.sides import LET_GO, PASSING
from garment_sim_ros.sim.simulation import Simulation

FRAME = 1 / 60
RADIUS, LENGTH = 0.03, 0.3
LAID = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
"""Turns the axis of a capsule from z to -y."""


def strip(cloth, ends):
    """A strip along x, pinned at one end or at both, and a passing capsule across it."""
    vertices, triangles = cloth.grid(15, 4)
    edge = vertices[:, 0].max() - 0.001
    pins = np.flatnonzero(vertices[:, 0] > edge if ends == 1 else abs(vertices[:, 0]) > edge)
    garment = cloth.garment(vertices, triangles, pins, damping=2.0, air_drag=0.05, friction=0.3)
    arm = Collider(
        name="arm",
        kind="capsule",
        bone="arm",
        geometry={"radius0": RADIUS, "radius1": RADIUS, "length": LENGTH},
    )
    return Simulation(
        (dataclasses.replace(garment, passed_by=("arm",)),),
        cloth.colliders(arm),
        solver="xpbd",
        solver_step=FRAME,
    )


def at(x, z):
    """The capsule's axis is that of y."""
    poses = ColliderPoses.identity(2)
    poses.position[1] = [x, LENGTH / 2, z]
    poses.orientation[1] = LAID
    return poses


def let_go(simulation):
    return int((simulation.sides("cloth").side == LET_GO).any(axis=0).sum())


def strains(simulation):
    model = simulation.model("cloth")
    edges = model.springs.particles.reshape(-1, 2)[model.springs.bending :]
    x = simulation.state("cloth").x.astype(np.float64)
    length = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)
    return length / model.springs.rest_length[model.springs.bending :] - 1.0


def go(simulation, way):
    """Takes the capsule along a way of (x, z); what is let go of after each frame."""
    counts = []
    for start, end in pairwise(way):
        simulation.advance(at(*start), at(*end))
        counts.append(let_go(simulation))
    assert simulation.health("cloth").resets == 0
    return counts


def line(start, end, frames):
    return np.linspace(start, end, frames + 1)


def gap(simulation, x, z):
    """How far the cloth's particles are from the capsule [m]."""
    away = simulated(simulation)[:, [0, 2]] - [x, z]
    return np.linalg.norm(away, axis=1).min() - RADIUS


def check_letting_go(simulation, frames, depth):
    """The capsule goes so far down through a strip of 28 cm that hangs from both ends."""
    simulation.reset(at(0.0, 0.5))
    hung = simulated(simulation)
    simulation.reset(at(0.0, 0.05))
    counts = go(simulation, line([0.0, 0.05], [0.0, -depth], frames))
    counts += go(simulation, line([0.0, -depth], [0.0, -depth], 270))
    assert max(counts) > 0
    assert counts[-1] == 0
    assert (simulation.sides("cloth").side == PASSING).all()
    # It ends where a strip hangs that nothing has touched, strained by its weight only.
    assert simulated(simulation) == pytest.approx(hung, abs=1e-3)
    assert np.percentile(strains(simulation), 95) < 0.02
    assert simulation.health("cloth").rms_speed < 1e-3
    return counts


@pytest.mark.parametrize("frames", [6, 30])
def test_what_is_let_go_of_hangs_as_before(cloth, frames):
    check_letting_go(strip(cloth, 2), frames, 0.5)


@pytest.mark.parametrize("frames", [6, 30])
def test_what_is_overstretched_is_let_go_of_until_it_is_clear(cloth, frames, monkeypatch):
    """By contact alone: the guard outranks it, see the next test."""
    monkeypatch.setattr(Guard, "of", lambda *args: Guard.none(args[-1].shape[1]))
    simulation = strip(cloth, 2)
    check_letting_go(simulation, frames, 0.8)
    # The capsule counts again: from below it lifts the strip's middle.
    counts = go(simulation, line([0.0, -0.8], [0.0, 0.0], 96))
    assert max(counts) == 0
    thickness = simulation.model("cloth").material.thickness
    # It keeps its thickness, to what a float32 of the local origin's frame rounds to.
    assert gap(simulation, 0.0, 0.0) == pytest.approx(thickness, abs=1e-6)
    assert simulated(simulation)[:, 2].max() == pytest.approx(RADIUS + thickness, abs=1e-3)


@pytest.mark.parametrize("frames", [6, 30])
@pytest.mark.parametrize(("depth", "held"), [(0.25, True), (0.5, False)])
def test_the_guard_outranks_letting_go(cloth, frames, depth, held):
    """The guard holds what contact lets go of, as far as fabric could be pulled and farther.

    In both cases the strip hangs as before when the capsule is back.
    """
    simulation = strip(cloth, 2)
    simulation.reset(at(0.0, 0.5))
    hung = simulated(simulation)
    simulation.reset(at(0.0, 0.05))
    go(simulation, line([0.0, 0.05], [0.0, -depth], frames))
    go(simulation, line([0.0, -depth], [0.0, -depth], 60))
    lowest = simulated(simulation)[:, 2].min()
    assert (lowest < -depth) if held else (lowest > -0.05)
    go(simulation, line([0.0, -depth], [0.0, 0.5], 60))
    go(simulation, line([0.0, 0.5], [0.0, 0.5], 270))
    assert simulated(simulation) == pytest.approx(hung, abs=2e-3)
    assert np.percentile(strains(simulation), 95) < 0.02


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_what_brushes_cloth_pushes_it(cloth, speed):
    """A strip that hangs from one end, at x = 14 cm, and a capsule that goes 7 cm farther."""
    simulation = strip(cloth, 1)
    simulation.reset(at(-0.2, -0.2))
    hung = simulated(simulation)[:, 0]
    assert hung.min() > 0.13
    counts, nearest = [], []
    way = line([-0.2, -0.2], [0.21, -0.2], round(0.41 / speed / FRAME))
    for start, end in pairwise(way):
        counts += go(simulation, [start, end])
        nearest.append(gap(simulation, *end))
    assert max(counts) == 0
    # It is never in the cloth, which keeps its thickness as closely as for other shapes.
    assert min(nearest) > simulation.model("cloth").material.thickness - 1e-4
    assert (simulated(simulation)[:, 0] - hung).max() > 0.07
