"""Motion and rest of `xpbd` and `implicit` against solutions in closed form."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.params import Environment, ImplicitSettings, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

G = 9.81
WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))
SETTINGS = {"xpbd": XpbdSettings, "implicit": ImplicitSettings}


def cases(names, *rows):
    """Rows of values, the solver's name first; those of `implicit` are slow."""
    marks = {"xpbd": (), "implicit": pytest.mark.slow}
    return pytest.mark.parametrize(
        names, [pytest.param(*row, marks=marks[row[0]]) for row in rows]
    )


def dressed(cloth, solver, garment, *shapes, step=1 / 60, environment=None, **settings):
    return Simulation(
        (garment,),
        cloth.colliders(*shapes),
        solver=solver,
        settings=SETTINGS[solver](**settings),
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


def expected_strain(simulation, rows=11):
    """Weight below each row over the tensile stiffness; the strip is 0.02 m wide."""
    model = simulation.model("cloth")
    mass = np.zeros(2 * rows)
    mass[model.vertex] = model.mass
    below = np.cumsum(mass.reshape(rows, 2).sum(axis=1)[::-1])[::-1][1:]
    return below * G / (20.0 * 0.02)


def row_strain(simulation, rows=11, spacing=0.02):
    x = simulation.positions("cloth").reshape(rows, 2, 3).astype(np.float64).mean(axis=1)
    return -np.diff(x[:, 2]) / spacing - 1.0


@cases(
    ("solver", "step", "steps"),
    *((s, *row) for s in SETTINGS for row in ((1e-4, 1000), (1 / 60, 30), (1 / 3, 4))),
)
@pytest.mark.parametrize("away", [0.0, 100.0])
def test_free_fall_is_the_discrete_solution(cloth, solver, step, steps, away):
    """x_n = x_0 - g h^2 n (n + 1) / 2 with h the sub-step."""
    vertices, triangles = cloth.grid(9, 9)
    vertices = vertices + away
    sub_step = min(step, 1 / 120) if solver == "xpbd" else step
    settings = {"search_every": 1} if solver == "xpbd" else {}
    simulation = dressed(
        *(cloth, solver, cloth.garment(vertices, triangles)),
        step=step,
        sub_step=sub_step,
        **settings,
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


@cases(
    ("solver", "settings"),
    ("xpbd", {"iterations": 20}),
    *(("implicit", {"sub_step": h}) for h in (1 / 15, 1 / 60, 1 / 240, 1 / 1000)),
)
def test_a_hanging_strip_stretches_by_its_weight_over_its_stiffness(cloth, solver, settings):
    """In every row; at any sub-step where the solver is exact."""
    step = max(settings.get("sub_step", 0.0), 1 / 60)
    simulation = dressed(cloth, solver, hanging_strip(cloth), step=step, **settings)
    advance(simulation, 6.0, step)
    assert row_strain(simulation) == pytest.approx(expected_strain(simulation), rel=0.01)


@pytest.mark.parametrize(
    ("sub_step", "iterations"),
    [(1 / 240, 60), (1 / 240, 120), (1 / 480, 30), (1 / 1200, 10)],
)
def test_extension_does_not_depend_on_sub_steps_or_iterations(cloth, sub_step, iterations):
    """Past convergence; compliance of 1/20 m/N per metre of width and metre of length."""
    simulation = dressed(
        cloth, "xpbd", hanging_strip(cloth), sub_step=sub_step, iterations=iterations
    )
    advance(simulation, 5.0)
    expected = 0.02 * expected_strain(simulation).sum()
    assert (0.02 * row_strain(simulation)).sum() == pytest.approx(expected, rel=0.01)


def test_stretch_error_falls_with_the_square_of_the_sub_step(cloth):
    """One pass: what it leaves is proportional to h^2 g."""
    stiff = hanging_strip(cloth, stretch_stiffness_warp=1e6, stretch_stiffness_weft=1e6)
    errors = []
    for sub_step in (1 / 240, 1 / 480, 1 / 960):
        # The search divides the sub-steps evenly: none is added.
        simulation = dressed(cloth, "xpbd", stiff, sub_step=sub_step, search_every=4)
        advance(simulation, 3.0)
        errors.append(row_strain(simulation).mean())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.15)


@cases(
    ("solver", "seconds", "settings"),
    ("xpbd", 4.0, {"sub_step": 1 / 2400, "search_every": 1}),
    ("implicit", 8.0, {"sub_step": 1 / 480}),
)
def test_a_cantilever_bends_by_its_weight_over_its_bending_stiffness(
    cloth, solver, seconds, settings
):
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
    simulation = dressed(cloth, solver, garment, environment=weak, **settings)
    advance(simulation, seconds)
    z = simulation.positions("cloth").reshape(rows, columns, 3)[:, :, 2].mean(axis=1)
    length = (rows - 1.5) * height
    strip = 2.5e-4 * (1.0 - 1.0 / 9.0)
    # Edges at the free sides have no hinge, which is 10 % of this strip.
    assert -z[-1] == pytest.approx(0.1 * 0.02 * length**4 / (8 * strip), rel=0.12)


def swing(cloth, solver, step, stiffness, **settings):
    """Amplitude that a rigid pendulum keeps in 5 s, and its period over the exact one."""
    height, angle = 0.5, 0.3
    corners = np.array([[0.0, 0.0, 0.0], [0.0, -0.05, -height], [0.0, 0.05, -height]])
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    rigid = dict.fromkeys(
        ("stretch_stiffness_warp", "stretch_stiffness_weft", "shear_stiffness"), stiffness
    )
    garment = cloth.garment(corners @ turn.T, [[0, 1, 2]], pins=[0], **rigid)
    simulation = dressed(cloth, solver, garment, step=step, **settings)
    side = []
    for _ in range(round(5.0 / step)):
        advance(simulation, step, step)
        side.append(simulation.positions("cloth")[1, 0])
    side = np.array(side)
    second = round(1.6 / step)
    crossed = np.flatnonzero(np.sign(side[:-1]) != np.sign(side[1:]))
    times = (crossed + side[crossed] / (side[crossed] - side[crossed + 1])) * step
    expected = 2 * np.pi * np.sqrt(height / G) * (1 + angle**2 / 16)
    kept = np.abs(side[-second:]).max() / np.abs(side[:second]).max()
    return kept, 2 * np.diff(times).mean() / expected


def test_a_pendulum_keeps_its_amplitude(cloth):
    """95 % after 5 s, without damping, and the period of a rigid pendulum."""
    kept, period = swing(cloth, "xpbd", 1 / 240, 1e5)
    assert 0.95 < kept < 1.001
    assert period == pytest.approx(1.0, rel=5e-3)


@pytest.mark.slow
def test_a_pendulum_comes_near_the_exact_one_with_the_sub_step(cloth):
    """Long sub-steps of `implicit` slow it down and damp it; it never gains."""
    coarse, fine = (swing(cloth, "implicit", h, 1e3, sub_step=h) for h in (1 / 250, 1 / 1000))
    assert 0.9 < fine[0] < 1.001
    assert fine[1] == pytest.approx(1.0, rel=0.02)
    assert coarse[0] < 1.001


@cases("solver", ("xpbd",), ("implicit",))
def test_linear_momentum_stays(cloth, solver):
    vertices, triangles = cloth.grid(12, 12)
    simulation = dressed(cloth, solver, cloth.garment(vertices, triangles), environment=WEIGHTLESS)
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
    if solver == "xpbd":  # `implicit` damps what turns, as implicit Euler does.
        assert np.linalg.norm(turning) == pytest.approx(np.linalg.norm(angular), rel=0.05)


@cases(
    ("solver", "sub_step"),
    ("xpbd", XpbdSettings().sub_step),
    ("implicit", 1 / 60),
    ("implicit", 1 / 480),
)
def test_energy_does_not_grow(cloth, solver, sub_step):
    """A cloth that swings by a corner, without damping, over 10 s."""
    vertices, triangles = cloth.grid(8, 8)
    simulation = dressed(
        cloth, solver, cloth.garment(vertices, triangles, pins=[0]), sub_step=sub_step
    )
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


@cases(
    ("solver", "friction", "seconds"),
    ("xpbd", 0.4, 10.0),
    ("xpbd", 0.2, 0.7),
    ("implicit", 0.4, 20.0),
    ("implicit", 0.2, 0.7),
)
def test_cloth_on_a_slope_stays_below_the_friction_angle(cloth, solver, friction, seconds):
    """A cloth on a ball so large that it is nearly a plane; gravity leans by atan 0.3."""
    lean = np.arctan(0.3)
    gravity = (G * np.sin(lean), 0.0, -G * np.cos(lean))
    vertices, triangles = cloth.grid(6, 6)
    garment = cloth.garment(vertices + np.array([0.0, 0.0, 0.002]), triangles, friction=friction)
    ball = Collider(name="a", kind="sphere", bone="bone", geometry={"radius": 10.0})
    settings = {"sub_step": 1 / 240} if solver == "implicit" else {}
    simulation = dressed(
        cloth, solver, garment, ball, environment=Environment(gravity=gravity), **settings
    )
    still = ColliderPoses.identity(2)
    still.position[1, 2] = -10.0
    for _ in range(round(seconds * 60)):
        simulation.advance(still, still, 1 / 60)
    slid = simulation.positions("cloth")[:, 0].mean()
    if friction > 0.3:
        assert abs(slid) < 0.002
    else:
        expected = 0.5 * G * (np.sin(lean) - friction * np.cos(lean)) * seconds**2
        # The springs of `implicit`'s contacts are in its matrix: they hold back what starts to
        # slide.
        least, most = (0.88, 1.12) if solver == "xpbd" else (0.5, 1.05)
        assert least * expected < slid < most * expected


@cases(("solver", "settings"), ("xpbd", {}), ("implicit", {"sub_step": 1 / 240}))
def test_a_turned_scene_gives_the_turned_motion(cloth, solver, settings):
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
        simulation = dressed(cloth, solver, garment, **settings)
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
    simulation = dressed(cloth, "xpbd", garment, sub_step=1 / 2400, search_every=4)
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


@pytest.mark.slow
def test_a_cloth_by_two_corners_hardly_stretches_at_large_steps(cloth):
    """Frames of 1/3 s at default settings: at rest and under 1 %, in 95 % of the edges."""
    vertices, triangles = cloth.grid(20, 20, 0.05)
    garment = cloth.garment(
        vertices,
        triangles,
        pins=[0, 19],
        areal_density=0.2,
        stretch_stiffness_warp=2000.0,
        stretch_stiffness_weft=2000.0,
        shear_stiffness=500.0,
        damping=2.0,
    )
    simulation = dressed(cloth, "implicit", garment, step=1 / 3)
    advance(simulation, 20.0, 1 / 3)
    x = simulation.positions("cloth").astype(np.float64)
    edges = np.unique(
        np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0
    )
    rest = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    stretch = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1) / rest - 1.0
    assert np.percentile(stretch, 95) < 0.01
    assert simulation.health("cloth").rms_speed < 0.005
