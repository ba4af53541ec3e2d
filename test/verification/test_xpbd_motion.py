"""Motion and rest of the `xpbd` solver against solutions in closed form."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.geometry.shapes import Collider, ColliderPoses
from garment_sim_ros.params import Environment, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

G = 9.81
WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))


def dressed(cloth, garment, *shapes, step=1 / 60, environment=None, **settings):
    return Simulation(
        (garment,),
        cloth.colliders(*shapes),
        solver="xpbd",
        settings=XpbdSettings(**settings),
        solver_step=step,
        environment=environment,
    )


def advance(simulation, seconds, step=1 / 60):
    still = ColliderPoses.identity(len(simulation.collider_set))
    for _ in range(round(seconds / step)):
        simulation.advance(still, still, step)


def hanging_strip(cloth, rows=11, **material):
    """A strip of two columns that hangs along its warp by its top edge."""
    vertices, triangles = cloth.grid(rows, 2)
    strip = np.stack([vertices[:, 1] * 0.0, vertices[:, 1], -vertices[:, 0]], axis=1)
    values = {
        "areal_density": 0.2,
        "stretch_stiffness_warp": 20.0,
        "stretch_stiffness_weft": 20.0,
        "shear_stiffness": 0.0,
        "bending_stiffness": 0.0,
        "damping": 5.0,
    }
    return cloth.garment(strip, triangles, pins=[0, 1], **{**values, **material})


def row_strain(simulation, rows=11, spacing=0.02):
    x = simulation.positions("cloth").reshape(rows, 2, 3).astype(np.float64).mean(axis=1)
    return -np.diff(x[:, 2]) / spacing - 1.0


@pytest.mark.parametrize(("step", "steps"), [(1e-4, 1000), (1 / 60, 30), (1 / 3, 4)])
@pytest.mark.parametrize("away", [0.0, 100.0])
def test_free_fall_is_the_discrete_solution(cloth, step, steps, away):
    """x_n = x_0 - g h^2 n (n + 1) / 2 with h the sub-step."""
    vertices, triangles = cloth.grid(6, 6)
    vertices = vertices + away
    sub_step = min(step, 1 / 120)
    simulation = dressed(
        cloth,
        cloth.garment(vertices, triangles),
        step=step,
        sub_step=sub_step,
        bending_every=1,
    )
    still = ColliderPoses.identity(1)
    still.position[:] = away
    for _ in range(steps):
        simulation.advance(still, still, step)
    n = steps * max(1, round(step / sub_step))
    fallen = G * sub_step**2 * n * (n + 1) / 2
    x = simulation.state("cloth").x + simulation.origin
    expected = vertices[simulation.model("cloth").vertex] - [0.0, 0.0, fallen]
    assert np.abs(x - expected)[:, 2].max() < 2e-5 * fallen + 4e-6


def test_a_hanging_strip_stretches_by_its_weight_over_its_stiffness(cloth):
    """Strain of each row: the weight per width below it over the tensile stiffness."""
    simulation = dressed(cloth, hanging_strip(cloth), iterations=20)
    advance(simulation, 6.0)
    model = simulation.model("cloth")
    mass = np.zeros(22)
    mass[model.vertex] = model.mass
    below = np.cumsum(mass.reshape(11, 2).sum(axis=1)[::-1])[::-1][1:]
    strain = row_strain(simulation)
    # The width is 0.02 m; the two edges of a row share its load.
    assert strain == pytest.approx(below * G / (20.0 * 0.02), rel=0.01)


@pytest.mark.parametrize(
    ("sub_step", "iterations"),
    [(1 / 240, 60), (1 / 240, 120), (1 / 480, 30), (1 / 1200, 10)],
)
def test_extension_does_not_depend_on_sub_steps_or_iterations(cloth, sub_step, iterations):
    """Past convergence; compliance of 1/20 m/N per metre of width and metre of length."""
    simulation = dressed(cloth, hanging_strip(cloth), sub_step=sub_step, iterations=iterations)
    advance(simulation, 5.0)
    model = simulation.model("cloth")
    mass = np.zeros(22)
    mass[model.vertex] = model.mass
    below = np.cumsum(mass.reshape(11, 2).sum(axis=1)[::-1])[::-1][1:]
    expected = (0.02 * below * G / (20.0 * 0.02)).sum()
    assert (0.02 * row_strain(simulation)).sum() == pytest.approx(expected, rel=0.01)


def test_stretch_error_falls_with_the_square_of_the_sub_step(cloth):
    """One pass: what it leaves is proportional to h^2 g."""
    stiff = hanging_strip(cloth, stretch_stiffness_warp=1e6, stretch_stiffness_weft=1e6)
    errors = []
    for sub_step in (1 / 240, 1 / 480, 1 / 960):
        simulation = dressed(cloth, stiff, sub_step=sub_step)
        advance(simulation, 3.0)
        errors.append(row_strain(simulation).mean())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.15)


def test_a_cantilever_bends_by_its_weight_over_its_bending_stiffness(cloth):
    """Small deflection at the tip: q l^4 / (8 B (1 - n^2)), q the weight per area.

    B is the stiffness of a plate bent to a cylinder; a mesh of equilateral triangles has a
    Poisson's ratio n of 1/3, by which a strip with free sides is softer.
    """
    rows, columns, spacing = 24, 9, 0.01
    height = spacing * np.sqrt(0.75)
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    sheet = np.stack([i * height, (j + 0.5 * (i % 2)) * spacing, 0.0 * i], axis=-1)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    even = (i[:-1, :-1] % 2 == 0).ravel()[:, None]
    a, b, c, d = (corner.ravel() for corner in (a, b, c, d))
    first = np.where(even, np.stack([a, b, d], -1), np.stack([a, b, c], -1))
    second = np.where(even, np.stack([b, c, d], -1), np.stack([a, c, d], -1))
    garment = cloth.garment(
        sheet.reshape(-1, 3),
        np.concatenate([first, second]),
        pins=range(2 * columns),
        areal_density=0.1,
        bending_stiffness=2.5e-4,
        stretch_stiffness_warp=1e3,
        stretch_stiffness_weft=1e3,
        shear_stiffness=3e2,
        damping=5.0,
    )
    weak = Environment(gravity=(0.0, 0.0, -0.02))
    simulation = dressed(cloth, garment, environment=weak, sub_step=1 / 2400, bending_every=1)
    advance(simulation, 4.0)
    z = simulation.positions("cloth").reshape(rows, columns, 3)[:, :, 2].mean(axis=1)
    length = (rows - 1.5) * height
    strip = 2.5e-4 * (1.0 - 1.0 / 9.0)
    # Edges at the free sides have no hinge, which is 10 % of this strip.
    assert -z[-1] == pytest.approx(0.1 * 0.02 * length**4 / (8 * strip), rel=0.12)


def test_a_pendulum_keeps_its_amplitude(cloth):
    """95 % after 5 s, without damping, and the period of a rigid pendulum."""
    height, angle = 0.5, 0.3
    corners = np.array([[0.0, 0.0, 0.0], [0.0, -0.05, -height], [0.0, 0.05, -height]])
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    rigid = dict.fromkeys(
        ("stretch_stiffness_warp", "stretch_stiffness_weft", "shear_stiffness"), 1e5
    )
    garment = cloth.garment(corners @ turn.T, [[0, 1, 2]], pins=[0], **rigid)
    step = 1 / 240
    simulation = dressed(cloth, garment, step=step)
    side = []
    for _ in range(round(5.0 / step)):
        advance(simulation, step, step)
        side.append(simulation.positions("cloth")[1, 0])
    side = np.array(side)
    first, last = np.abs(side[:400]).max(), np.abs(side[-400:]).max()
    assert 0.95 < last / first < 1.001
    crossed = np.flatnonzero(np.sign(side[:-1]) != np.sign(side[1:]))
    times = (crossed + side[crossed] / (side[crossed] - side[crossed + 1])) * step
    expected = 2 * np.pi * np.sqrt(height / G) * (1 + angle**2 / 16)
    assert 2 * np.diff(times).mean() == pytest.approx(expected, rel=5e-3)


def test_linear_momentum_stays(cloth):
    vertices, triangles = cloth.grid(12, 12)
    simulation = dressed(cloth, cloth.garment(vertices, triangles), environment=WEIGHTLESS)
    state, mass = simulation.state("cloth"), simulation.model("cloth").mass.astype(np.float64)
    rng = np.random.default_rng(1)
    spin = np.cross([0.5, 1.0, 3.0], state.x)
    state.v[:] = spin + rng.normal([0.4, -0.3, 0.2], 0.05, state.v.shape)

    def momentum():
        x, v = state.x.astype(np.float64), state.v.astype(np.float64)
        centre = (mass[:, None] * x).sum(axis=0) / mass.sum()
        linear = (mass[:, None] * v).sum(axis=0)
        return linear, (mass[:, None] * np.cross(x - centre, v)).sum(axis=0)

    linear, angular = momentum()
    advance(simulation, 1.0)
    later, turning = momentum()
    assert later == pytest.approx(linear, rel=1e-3)
    assert np.linalg.norm(turning) == pytest.approx(np.linalg.norm(angular), rel=0.05)


def test_energy_does_not_grow(cloth):
    """A cloth that swings by a corner, without damping, over 12,000 sub-steps."""
    vertices, triangles = cloth.grid(8, 8)
    simulation = dressed(cloth, cloth.garment(vertices, triangles, pins=[0]))
    model, state = simulation.model("cloth"), simulation.state("cloth")
    mass = model.mass.astype(np.float64)

    def energy():
        kinetic = 0.5 * (mass[:, None] * state.v.astype(np.float64) ** 2).sum()
        return kinetic + G * (mass * state.x[:, 2]).sum()

    start, highest = energy(), []
    for _ in range(20):
        advance(simulation, 0.5)
        highest.append(energy())
    assert max(highest) < start + 0.01 * G * mass.sum() * 0.2


@pytest.mark.parametrize(("friction", "holds"), [(0.4, True), (0.2, False)])
def test_cloth_on_a_slope_stays_below_the_friction_angle(cloth, friction, holds):
    """A cloth on a ball so large that it is nearly a plane; gravity leans by atan 0.3."""
    lean = np.arctan(0.3)
    gravity = (G * np.sin(lean), 0.0, -G * np.cos(lean))
    vertices, triangles = cloth.grid(6, 6)
    garment = cloth.garment(vertices + np.array([0.0, 0.0, 0.002]), triangles, friction=friction)
    ball = Collider(name="a", kind="sphere", bone="bone", geometry={"radius": 10.0})
    simulation = dressed(cloth, garment, ball, environment=Environment(gravity=gravity))
    still = ColliderPoses.identity(2)
    still.position[1, 2] = -10.0
    seconds = 10.0 if holds else 0.7
    for _ in range(round(seconds * 60)):
        simulation.advance(still, still, 1 / 60)
    slid = simulation.positions("cloth")[:, 0].mean()
    if holds:
        assert abs(slid) < 0.002
    else:
        expected = 0.5 * G * (np.sin(lean) - friction * np.cos(lean)) * seconds**2
        assert slid == pytest.approx(expected, rel=0.12)


def test_a_turned_scene_gives_the_turned_motion(cloth):
    """Rotation by 90 degrees about z and a shift: the same cloth, turned and shifted."""
    vertices, triangles = cloth.grid(10, 10)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    isotropic = {"stretch_stiffness_warp": 1000.0, "stretch_stiffness_weft": 1000.0}
    ends = []
    for R, shift in ((np.eye(3), np.zeros(3)), (turn, np.array([0.25, -0.5, 0.125]))):
        garment = cloth.garment(
            vertices @ R.T + shift, triangles, pins=range(10), bending_stiffness=1e-4, **isotropic
        )
        garment = dataclasses.replace(garment, T_world_frame_rest=frame_at(shift))
        simulation = dressed(cloth, garment)
        still = ColliderPoses.identity(1)
        still.position[:] = shift
        for _ in range(15):
            simulation.advance(still, still, 1 / 60)
        ends.append((simulation.positions("cloth") - shift) @ R)
    assert np.ptp(ends[0][:, 2]) > 0.1
    # Particles are numbered along the axes, so that passes differ in order: not the same bits.
    assert np.abs(ends[0] - ends[1]).max() < 0.001


def frame_at(position):
    T = np.eye(4)[None].copy()
    T[0, :3, 3] = position
    return T


def test_a_symmetric_scene_stays_symmetric(cloth):
    """A cloth that hangs by one edge, its quads split to mirror each other."""
    vertices, triangles = split_both_ways(cloth, 9, 9)
    garment = cloth.garment(vertices, triangles, pins=range(9), bending_stiffness=1e-4)
    simulation = dressed(cloth, garment, sub_step=1 / 2400)
    advance(simulation, 0.25)
    x = simulation.positions("cloth").reshape(9, 9, 3)
    mirrored = x[:, ::-1] * [1.0, -1.0, 1.0]
    assert np.abs(x - mirrored).max() < 0.001


def split_both_ways(cloth, rows, columns):
    """A grid whose quads are split in alternation."""
    vertices, triangles = cloth.grid(rows, columns)
    first, second = np.split(triangles, 2)
    i, j = np.divmod(np.arange(len(first)), columns - 1)
    other = (i + j) % 2 == 1
    a, b, c, d = first[:, 0], first[:, 1], first[:, 2], second[:, 2]
    first = np.where(other[:, None], np.stack([a, b, d], -1), first)
    second = np.where(other[:, None], np.stack([b, c, d], -1), second)
    return vertices, np.concatenate([first, second])
