"""Tethers and soft attachments, in every solver."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.params import Environment, ImplicitSettings, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.holds.attaching import nearest_pins
from garment_sim_ros.sim.holds.tethers import Attached
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.placement import SoftAttachments
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.state import State

SOLVERS = ("relaxation", "xpbd")
ALL = (*SOLVERS, pytest.param("implicit", marks=pytest.mark.slow))
COARSE = {
    "relaxation": RelaxationSettings(sweeps=1),
    "xpbd": XpbdSettings(sub_step=1 / 360, search_every=2),
}


def curtain(cloth, rows, columns):
    """A cloth that hangs down, its top row last; vertices and triangles."""
    vertices, triangles = cloth.grid(rows, columns)
    return vertices[:, [2, 1, 0]], triangles


def at(x):
    poses = ColliderPoses.identity(1)
    poses.position[:, 0] = x
    return poses


@pytest.mark.parametrize("solver", ALL)
@pytest.mark.parametrize("stiffness", [0.05, 1.0, 50.0, 1e4, np.inf])
def test_soft_attachments_give_way_by_weight_over_stiffness(cloth, solver, stiffness):
    vertices, triangles = curtain(cloth, 10, 10)
    top = np.arange(90, 100)
    soft = SoftAttachments(
        vertices=top,
        frame=np.zeros(10, np.int32),
        stiffness=np.full(10, stiffness),
        damping=np.full(10, 1e-3),
    )
    garment = dataclasses.replace(cloth.garment(vertices, triangles, damping=1.0), soft=soft)
    simulation = Simulation((garment,), cloth.colliders(), solver=solver)
    simulation.reset(at(0.0))
    for _ in range(60):
        simulation.advance(at(0.0), at(0.0), 1 / 60)
    weight = 9.81 * float(simulation.model("cloth").mass.sum())
    sunk = vertices[top, 2] - simulation.positions("cloth")[top, 2].astype(float)
    # Half a percent, and the rounding of a coordinate of 0.1 m in single precision.
    assert sunk.mean() == pytest.approx(weight / (10.0 * stiffness), rel=5e-3, abs=1e-8)
    assert simulation.health("cloth").rms_speed < 1e-3
    assert simulation.health("cloth").resets == 0


@pytest.mark.parametrize("solver", ALL)
def test_soft_attachments_ride_with_their_bone(cloth, solver):
    """Far enough for the local origin to follow; as fast as the bone, whatever the damping."""
    vertices, triangles = curtain(cloth, 4, 4)
    soft = SoftAttachments(
        vertices=np.arange(16),
        frame=np.zeros(16, np.int32),
        stiffness=np.full(16, 100.0),
        damping=np.full(16, 10.0),
    )
    garment = dataclasses.replace(cloth.garment(vertices, triangles), soft=soft)
    simulation = Simulation((garment,), cloth.colliders(), solver=solver)
    simulation.reset(at(0.0))
    for k in range(60):
        simulation.advance(at(0.05 * k), at(0.05 * (k + 1)), 1 / 60)
    off = simulation.positions("cloth") - vertices - [3.0, 0.0, 0.0]
    assert np.abs(off).max() < 2e-4
    assert simulation.state("cloth").v[:, 0] == pytest.approx(3.0, abs=2e-3)


def test_a_single_spring_is_backward_euler(cloth):
    """Step by step against its closed form."""
    vertices, triangles = curtain(cloth, 2, 2)
    model = build_model("cloth", vertices, triangles, cloth.garment(vertices, triangles).material)
    k, c, h = 40.0, 0.3, 0.02
    attached = Attached.none()._replace(
        particle=np.array([1], np.int32),
        collider=np.zeros(1, np.int32),
        place=model.rest[1:2],
        rate=np.array([[k, c]]) / model.mass[1],
        target=np.full((1, 3), np.nan, np.float32),
    )
    state = State.at(model, vertices + np.array([0.01, 0.0, 0.0]), np.zeros(3))
    x, v = 0.01, 0.0
    poses = ColliderPoses.identity(1)
    scrap = [state.x.copy() for _ in range(3)]
    attached.pull(*scrap, poses, np.zeros(3), keep=1.0, dt=h, rate=0.0)  # learns the place
    m = float(model.mass[1])
    for _ in range(20):
        start = state.x.copy()
        state.x += np.float32(h) * state.v
        attached.pull(*(state.x, state.v, start, poses, np.zeros(3)), keep=1.0, dt=h, rate=1.0 / h)
        v = (m * v - h * k * x) / (m + h * c + h * h * k)
        x += h * v
        assert state.x[1, 0] - model.rest[1, 0] == pytest.approx(x, abs=2e-7)


@pytest.mark.slow
def test_springs_and_dampers_of_the_implicit_solver_are_backward_euler(cloth):
    """A cloth put aside as a whole, all with one stiffness and damping per mass: x and v."""
    vertices, triangles = curtain(cloth, 3, 3)
    garment = cloth.garment(vertices, triangles)
    model = build_model("cloth", vertices, triangles, garment.material)
    mass = np.empty(9)
    mass[model.vertex] = model.mass
    a, b, h = 400.0, 3.0, 0.02
    soft = SoftAttachments(
        vertices=np.arange(9),
        frame=np.zeros(9, np.int32),
        stiffness=a * mass,
        damping=b * mass,
    )
    simulation = Simulation(
        (dataclasses.replace(garment, soft=soft),),
        cloth.colliders(),
        solver="implicit",
        settings=ImplicitSettings(sub_step=h),
        environment=Environment(gravity=(0.0, 0.0, 0.0)),
        solver_step=h,
    )
    simulation.advance(at(0.0), at(0.0))  # Learns the places.
    simulation.state("cloth").x[:, 0] += np.float32(0.01)
    x, v = 0.01, 0.0
    for _ in range(20):
        simulation.advance(at(0.0), at(0.0))
        v = (v - h * a * x) / (1.0 + h * b + h * h * a)
        x += h * v
        moved = simulation.positions("cloth") - vertices
        assert moved == pytest.approx(np.outer(np.ones(9), [x, 0.0, 0.0]), abs=1e-6)


@pytest.mark.parametrize("solver", SOLVERS)
def test_tethers_keep_a_long_cloth_short(cloth, solver):
    vertices, triangles = curtain(cloth, 40, 5)
    longest = []
    for tethers in (None, 0.02):
        garment = dataclasses.replace(
            cloth.garment(vertices, triangles, range(195, 200)), tethers=tethers
        )
        simulation = Simulation(
            (garment,),
            cloth.colliders(),
            solver=solver,
            settings=COARSE[solver],
            solver_step=1 / 60,
        )
        model, held = simulation.model("cloth"), 0
        pin, length = nearest_pins(model)
        worst = 0.0
        for k in range(60):
            a, b = (at(0.1 * np.sin(0.2 * n)) for n in (k, k + 1))
            simulation.advance(a, b)
            x = simulation.state("cloth").x
            way = np.linalg.norm(x[: model.free_count] - x[pin[:, 0]], axis=1)
            worst = max(worst, float((way / length[:, 0]).max()))
            held = max(held, simulation.health("cloth").held)
        longest.append(worst)
        assert (held > 0) == (tethers is not None)
    assert longest[0] > 1.1
    assert longest[1] <= 1.02 + 1e-5


@pytest.mark.parametrize("solver", ALL)
def test_slack_tethers_change_nothing(cloth, solver):
    vertices, triangles = curtain(cloth, 8, 8)
    found = []
    for tethers in (None, 1.0):
        garment = dataclasses.replace(
            cloth.garment(vertices, triangles, range(56, 64)), tethers=tethers
        )
        simulation = Simulation((garment,), cloth.colliders(), solver=solver)
        for k in range(30):
            simulation.advance(at(0.002 * k), at(0.002 * (k + 1)))
        found.append(simulation.positions("cloth").copy())
    assert (found[0] == found[1]).all()


def test_each_group_of_pins_has_its_own_tether(cloth):
    vertices, triangles = cloth.grid(9, 9)
    garment = cloth.garment(vertices, triangles)
    pins = np.array([0, 1, 2, 8])
    model = build_model(
        "cloth",
        vertices,
        triangles,
        garment.material,
        pins=pins,
        pin_collider=np.zeros(4, np.int32),
        pin_position=vertices[pins],
    )
    pin, length = nearest_pins(model)
    assert pin.shape == (77, 2)
    away = np.linalg.norm(model.rest[:77, None] - model.rest[pin], axis=2)
    # A flat cloth: ways over it are straight, up to the few directions that a path has.
    assert (length >= away - 1e-12).all()
    assert (length <= 1.09 * away).all()
    assert (np.diff(length, axis=1) >= 0.0).all()
    single = model.vertex[pin] == 8
    assert (single.sum(axis=1) == 1).all()
    near = np.linalg.norm(model.rest[:77, None] - vertices[None, :3], axis=2).min(axis=1)
    assert away[~single] == pytest.approx(near, rel=0.1)


def test_tethers_need_pins(cloth):
    garment = dataclasses.replace(cloth.garment(*cloth.grid(3, 3)), tethers=0.02)
    with pytest.raises(GeometryError, match="nothing that they could hang from"):
        Simulation((garment,), cloth.colliders())
