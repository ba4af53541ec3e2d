"""Whole steps against the naive rules put together: their order, and what each hands on."""

import numpy as np
import pytest
from naive.naive_implicit_steps import SubSteps, Tie
from naive.naive_steps import Elastic, Piece, relaxation_step, xpbd_step
from naive.naive_triangles import Triangles

from garment_sim_ros.contact.shapes import Collider
from garment_sim_ros.params import (
    Environment,
    ImplicitSettings,
    Material,
    RelaxationSettings,
    XpbdSettings,
)
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.holds.tethers import Attached
from garment_sim_ros.sim.loop import take_step
from garment_sim_ros.sim.membrane import Law
from garment_sim_ros.sim.membrane import membrane as make_membrane
from garment_sim_ros.sim.model import Parameters, build_model
from garment_sim_ros.sim.piece import Piece as Cloth
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.sim.solvers.implicit.triangles import triangle_bound
from garment_sim_ros.sim.solvers.implicit.workspace import ImplicitWorkspace, bending_bound
from garment_sim_ros.sim.solvers.xpbd.workspace import XpbdWorkspace
from garment_sim_ros.sim.state import State, Workspace
from garment_sim_ros.solver_params import MEMBRANES, SPRINGS

RADIUS, FRICTION, DAMPING = 0.1, 0.3, 2.0
WAY = np.array([0.001, -0.0005, 0.002])


@pytest.fixture
def scene(cloth):
    """An uneven cloth, two pins and some tethers, over a ball that comes up; and its twin."""
    rng = np.random.default_rng(7)
    rest, triangles = cloth.grid(8, 7, 0.015)
    rest += 0.001 * rng.normal(size=rest.shape) + [0.0, 0.0, RADIUS + 0.001]
    material = Material(
        friction=FRICTION, damping=DAMPING, air_drag=0.0, bending_stiffness=1e-4, thickness=0.002
    )
    model = build_model(
        *("cloth", rest, triangles, material),
        pins=np.array([0, 6]),
        pin_collider=np.zeros(2, int),
        pin_position=rest[[0, 6]],
    )
    ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": RADIUS})
    state = State.at(model, rest, np.zeros(3))
    state.x[: model.free_count] += 5e-5 * rng.normal(size=(model.free_count, 3))
    state.v[: model.free_count] = 0.02 * rng.normal(size=(model.free_count, 3)) - [0.1, 0.0, 0.3]
    pin = np.full((model.free_count, 1), model.free_count, np.int32)
    apart = np.linalg.norm(model.rest[:54] - model.rest[54], axis=1)[:, None]
    length = (apart * rng.choice([0.995, 1.1, np.inf], apart.shape)).astype(np.float32)
    colliders = ColliderState.of(cloth.colliders(ball))
    colliders.end.position[:] = WAY
    colliders.pose()
    piece = Piece(
        *(state.x.astype(np.float64), state.v.astype(np.float64)),
        *(model.inverse_mass.astype(np.float64), model.free_count, ball, lambda s: s * WAY),
        *(0.002, FRICTION, np.array([0.0, 0.0, -9.81]), DAMPING, (pin, length.astype(float))),
    )
    attached = Attached.none()._replace(pin=pin, length=length)
    return model, colliders, state, attached, piece


def compare(state, piece, dt):
    assert np.abs(state.x - piece.x).max() < 1e-6
    # Positions of some centimetres are rounded to 4e-9 m, several times in a step.
    assert np.abs(state.v - piece.v).max() < 1e-7 / dt


def test_relaxation(scene):
    model, colliders, state, attached, piece = scene
    dt = 1 / 180
    workspace = Workspace.room_for(model, 1)
    workspace.attached = attached
    params = Parameters(environment=Environment(), settings=RelaxationSettings(sweeps=3))
    cloth = Cloth(model=model, state=state, workspace=workspace)
    take_step(SOLVERS["relaxation"], [cloth], [], colliders, params, dt)
    springs = model.springs
    relaxation_step(piece, springs.particles.reshape(-1, 2), springs.rest_length, 3, dt)
    compare(state, piece, dt)
    assert 5 < workspace.contact_count < 50
    assert attached.held[0] > 0


@pytest.mark.parametrize("membrane", MEMBRANES)
@pytest.mark.parametrize(
    ("iterations", "every", "moving"), [(1, 3, True), (1, 3, False), (4, 2, True), (1, 1, True)]
)
def test_xpbd(scene, iterations, every, moving, membrane):
    """With edges solved in a hurry, as where cloth moves, and apart."""
    model, colliders, state, attached, piece = scene
    dt, count = 1 / 1200, 6
    workspace = XpbdWorkspace.room_for(model, 1)
    workspace.attached = attached
    workspace.motion[0] = 1e3 if moving else 0.0
    # Small cloth has shorter ones.
    settings = XpbdSettings(
        sub_step=1.25 * dt, iterations=iterations, search_every=every, membrane=membrane
    )
    params = Parameters(environment=Environment(), settings=settings)
    cloth = Cloth(model=model, state=state, workspace=workspace)
    take_step(SOLVERS["xpbd"], [cloth], [], colliders, params, count * dt)
    ready = workspace.prepared
    springs = workspace.springs if membrane == SPRINGS else workspace.bands
    elastic = Elastic(
        edges=ready.springs.particles.reshape(-1, 2).astype(np.int32),
        rest_length=np.sqrt(springs.rest_squared),
        stiffness=springs.stiffness,
        triangles=None if membrane == SPRINGS else twin_of(workspace.shapes, model),
        hinges=ready.hinge_particles,
        weight=workspace.hinge_weight,
        hinge_stiffness=workspace.hinge_stiffness,
    )
    xpbd_step(piece, elastic, count, iterations, every, dt)
    compare(state, piece, dt)
    assert 5 < workspace.contact_count < 50
    assert attached.held[0] > 0 or membrane != SPRINGS  # Triangles give less there.


def twin_of(shapes, model):
    """Triangles in the order of a pass, each once."""
    corners = shapes.ready.particles.reshape(-1, 3).astype(np.int32)
    first = np.sort(np.unique(corners, axis=0, return_index=True)[1])
    law = Law.of(model.material)
    return Triangles(corners[first], shapes.along[first], shapes.area[first], law)


@pytest.mark.parametrize("membrane", MEMBRANES)
@pytest.mark.parametrize(("iterations", "most"), [(1, 1), (4, 4), (1, 3), (2, 5)])
def test_implicit(scene, iterations, most, membrane):
    """With springs to places on the body, one of them so stiff that it does not give way.

    With and without more steps where they gain much: what single precision rounds grows with
    their number.
    """
    model, colliders, state, attached, piece = scene
    dt, count, f = 1 / 240, 3, model.free_count
    piece.tethers = (np.zeros((0, 1), np.int32), np.zeros((0, 1)))
    who = np.array([3, 17, 30, 44], np.int32)
    rate = np.array([[1e4, 0.0], [0.0, 50.0], [3e3, 20.0], [1e18, 0.0]])
    attached = attached._replace(
        pin=piece.tethers[0],
        length=np.zeros((0, 1), np.float32),
        particle=who,
        collider=np.array([0, 1, 1, 0], np.int32),
        place=model.rest[who] + [0.0, 0.001, 0.0],
        rate=rate,
        target=np.full((4, 3), np.nan, np.float32),
    )
    workspace = ImplicitWorkspace.room_for(model, 1)
    workspace.attached = attached
    workspace.share[:] = np.linspace(0.0, 1.0, f)
    share = workspace.share.astype(np.float64)
    settings = ImplicitSettings(
        sub_step=dt, iterations=iterations, most_iterations=most, membrane=membrane
    )
    params = Parameters(environment=Environment(), settings=settings)
    cloth = Cloth(model=model, state=state, workspace=workspace)
    take_step(SOLVERS["implicit"], [cloth], [], colliders, params, count * dt)
    ready = workspace.cloth
    triangles, resisted = None, ready.edge_stiffness.astype(np.float64)
    if membrane != SPRINGS:
        cloth_, law = make_membrane(model), Law.of(model.material)
        triangles = Triangles(cloth_.particles, cloth_.along, cloth_.area, law)
        resisted = triangle_bound(workspace.edges, cloth_, law)
    elastic = Elastic(
        edges=ready.edge_particles.reshape(-1, 2).astype(np.int32),
        rest_length=np.sqrt(ready.rest_squared.astype(np.float64)),
        stiffness=ready.edge_stiffness.astype(np.float64),
        triangles=triangles,
        hinges=ready.hinge_particles,
        weight=ready.hinge_weight.astype(np.float64),
        hinge_stiffness=ready.hinge_stiffness.astype(np.float64),
    )
    edges = workspace.edges
    bound = resisted + bending_bound(
        edges, elastic.hinges, elastic.weight, elastic.hinge_stiffness
    )
    ties = [
        Tie(int(p), place, *(model.mass[p] * np.minimum(r, 1e12)), r[0] > 1e9)
        for p, place, r in zip(who, attached.place, rate)
    ]
    twin = SubSteps(
        *(
            piece,
            elastic,
            edges,
            bound,
            ties,
            ready.contact_stiffness.astype(np.float64),
            workspace.lift,
        ),
        dt / 0.2,
        model.mass[:f].sum() * (3e-4 * np.ptp(model.rest, axis=0).max() / dt) ** 2,
        share,
    )
    for s in range(count):
        pressed = twin.run(s / count, (s + 1) / count, dt, iterations, most)
    assert workspace.contact_count == pressed > 5
    compare(state, piece, dt)
    assert np.abs(workspace.share - twin.share).max() < 1e-4
    for p, lever in twin.levers.items():
        assert np.abs(workspace.hold.lever[p] - lever).max() < 1e-6
