"""The wind: its noise, and what it does to cloth."""

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import Environment, Material
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.state import State
from garment_sim_ros.sim.world.wind_field import CHANGE, Wind, wind_field
from garment_sim_ros.sim.world.wind_on_cloth import AIR_DENSITY, WindOnCloth

GUSTS = {"wind_drag": 1.2, "wind_lift": 0.4, "gust": 2.0}


def air_velocity(field, points, t):
    """Velocity of the air at places [m], shape [n, 3], and a time [s]: [m/s], shape [n, 3]."""
    angle = points @ field.wave.T - field.frequency * t + field.phase
    return field.velocity + np.cos(angle) @ field.amplitude


def field(**options):
    return wind_field(Environment(**{"wind_drag": 1.2, **options}))


def divergence(f, p, h=1e-4):
    total = 0.0
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = h
        ahead, behind = air_velocity(f, np.array([p + step, p - step]), 0.0)[:, axis]
        total += (ahead - behind) / (2.0 * h)
    return total


def test_off_is_nothing():
    wind = Wind(Environment(wind=(5.0, 0.0, 0.0), gust=1.0))
    assert not wind.acts(0.0)
    assert len(wind.at(0.0).phase) == 0


def test_same_seed_same_wind_other_seed_other_wind():
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (50, 3))
    first, again, other = (
        air_velocity(field(gust=2.0, gust_seed=seed), points, 1.5) for seed in (7, 7, 8)
    )
    assert (first == again).all()
    assert np.abs(first - other).max() > 0.5


def test_root_mean_square_and_mean():
    points = np.random.default_rng(0).uniform(-50.0, 50.0, (4000, 3))
    u = air_velocity(field(wind=(3.0, 0.0, 1.0), gust=2.0), points, 0.0)
    assert u.mean(axis=0) == pytest.approx([3.0, 0.0, 1.0], abs=0.15)
    assert np.sqrt(((u - [3.0, 0.0, 1.0]) ** 2).sum(axis=1).mean()) == pytest.approx(2.0, rel=0.05)


def test_divergence_free_or_not():
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (30, 3))
    free, not_free = (
        np.array([divergence(field(gust=2.0, gust_divergence_free=f), p) for p in points])
        for f in (True, False)
    )
    assert np.abs(free).max() < 1e-5
    assert np.abs(not_free).max() > 1.0


def test_band_limited():
    f = field(gust=1.0, gust_shortest=0.5, gust_longest=2.0)
    length = 2.0 * np.pi / np.linalg.norm(f.wave, axis=1)
    assert length.min() >= 0.5 - 1e-9
    assert length.max() <= 2.0 + 1e-9


def test_carried_by_the_steady_wind():
    f = field(wind=(4.0, 0.0, 0.0), gust=2.0, gust_change=0.0)
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (20, 3))
    later = air_velocity(f, points + np.array([2.0, 0.0, 0.0]), 0.5)
    assert later == pytest.approx(air_velocity(f, points, 0.0))


CALM = {"wind": (1.0, 0.0, 0.0), **GUSTS}
CHANGES = {
    "wind": {"wind": (-4.0, 3.0, 1.0)},
    "wind_drag": {"wind_drag": 0.3},
    "wind_lift": {"wind_lift": 2.0},
    "air that acts no more": {"wind_drag": 0.0, "wind_lift": 0.0},
    "gust": {"gust": 7.0},
    "no gusts": {"gust": 0.0},
    "gust_change": {"gust_change": 5.0},
    "gust_shortest": {"gust_shortest": 1.0},
    "gust_longest": {"gust_longest": 9.0},
    "gust_waves": {"gust_waves": 60},
    "gust_divergence_free": {"gust_divergence_free": False},
    "gust_seed": {"gust_seed": 9},
}
POINTS = np.random.default_rng(0).uniform((197.0, -3.0, -3.0), (203.0, 3.0, 3.0), (40, 3))


def felt(wind, t):
    """Air velocity at some places, and both coefficients, at a time."""
    f = wind.at(t)
    return np.append(air_velocity(f, POINTS, t).ravel(), [f.drag, f.lift])


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("late", [1.0, 1000.0])
def test_a_change_of_any_parameter_is_no_jump(change, late):
    """Twice, the second change within the first: every step is of a size that shrinks with it."""
    changed = {**CALM, **CHANGES[change]}
    sizes = []
    for step in (1e-3, 1e-4):
        wind = Wind(Environment(**CALM))
        events = {round(late / step): changed, round((late + 0.2 * CHANGE) / step): CALM}
        events[round((late + 3.0 * CHANGE) / step)] = changed
        first, last = round(late / step) - 2, round((late + 3.0 * CHANGE) / step) + 5
        largest, before = 0.0, felt(wind, (first - 1) * step)
        for n in range(first, last):
            if n in events:
                wind.become(Environment(**events[n]), n * step)
            near = any(abs(n - event) < 4 for event in events)
            near = near or abs(n - round((late + CHANGE) / step)) < 4
            near = near or abs(n - round((late + 2.0 * CHANGE) / step)) < 4
            if near or n % 100 == 0:
                now, before = felt(wind, n * step), felt(wind, (n - 1) * step)
                largest = max(largest, np.abs(now - before).max())
        sizes.append(largest)
    assert sizes[0] > 0.0
    assert sizes[1] < 0.2 * sizes[0]


@pytest.mark.parametrize("change", CHANGES)
def test_after_a_change_the_wind_is_the_one_asked_for(change):
    asked = Environment(**{**CALM, **CHANGES[change]})
    wind = Wind(Environment(**CALM))
    wind.become(asked, 3.0)
    settled, expected = wind.at(3.0 + CHANGE), wind_field(asked)
    assert wind.at(9.0) is settled  # nothing is made anew in a step
    for name in ("velocity", "amplitude", "wave", "frequency", "drag", "lift"):
        assert getattr(settled, name) == pytest.approx(getattr(expected, name))
    assert wind.acts(9.0) == (change != "air that acts no more")


def test_many_changes_in_a_row_do_not_pile_up():
    wind = Wind(Environment(**CALM))
    for n in range(400):
        wind.become(Environment(**CALM, gust_seed=n + 2), 1.0 + 0.01 * n)
        assert len(wind.at(1.0 + 0.01 * n).phase) <= 48
    wind.at(5.5)  # the change before the last one ends
    last = Environment(**CALM, gust_seed=401)
    assert wind.at(9.0).wave == pytest.approx(wind_field(last).wave)


def plate(tilt=0.0, areal_density=1e3, cells=3):
    """A square of 1 m^2 across the x axis, turned about z; heavy, so that it hardly moves."""
    at = np.linspace(0.0, 1.0, cells + 1)
    y, z = (a.ravel() for a in np.meshgrid(at, at, indexing="ij"))
    x = np.stack([-np.sin(tilt) * y, np.cos(tilt) * y, z], axis=1)
    n = cells + 1
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    t = np.concatenate([np.stack([i, i + 1, i + n], 1), np.stack([i + 1, i + n + 1, i + n], 1)])
    return build_model(
        "plate", x, t.astype(np.int32), Material(areal_density=min(areal_density, 10.0))
    )


def pushed(model, velocity=(0.0, 0.0, 0.0), dt=1e-4, **options):
    """Force of a wind on a plate [N]."""
    state = State.at(model, model.rest[np.argsort(model.vertex)], np.zeros(3))
    state.v[:] = velocity
    before = state.v.copy()
    WindOnCloth(model).blow(field(**options), state, np.zeros(3), 0.0, dt)
    return ((state.v - before) * model.mass[:, None]).sum(axis=0) / dt


def test_force_on_a_plate():
    q = 0.5 * AIR_DENSITY * 100.0  # of a wind of 10 m/s on 1 m^2
    wind = {"wind": (10.0, 0.0, 0.0)}
    # The step is short; the plate of 10 kg still gives way by 1e-4 of the wind's speed.
    assert pushed(plate(), **wind) == pytest.approx([1.2 * q, 0, 0], rel=1e-3, abs=1e-3)
    assert pushed(plate(np.pi / 2), **wind) == pytest.approx([0, 0, 0], abs=1e-3)
    assert pushed(plate(np.pi / 3), **wind)[0] == pytest.approx(0.6 * q, rel=1e-3)
    assert pushed(plate(), velocity=(10.0, 0, 0), **wind) == pytest.approx([0, 0, 0], abs=1e-3)


def test_lift_is_across_the_wind_and_has_a_side():
    wind = {"wind": (10.0, 0.0, 0.0), "wind_drag": 0.0, "wind_lift": 0.5}
    one, other = pushed(plate(np.pi / 4), **wind), pushed(plate(-np.pi / 4), **wind)
    assert one[0] == pytest.approx(0.0, abs=1e-2)
    # 0.5 rho A C u^2 |cos| sin
    assert abs(one[1]) == pytest.approx(0.5 * AIR_DENSITY * 0.5 * 100.0 * 0.5, rel=1e-3)
    assert other[1] == pytest.approx(-one[1], rel=1e-3)
    assert pushed(plate(), **wind) == pytest.approx([0, 0, 0], abs=1e-2)


def test_light_cloth_and_long_steps_stay_bounded():
    model = plate(areal_density=1e-3)
    state = State.at(model, model.rest[np.argsort(model.vertex)], np.zeros(3))
    blown, wind = WindOnCloth(model), field(wind=(100.0, 0.0, 0.0))
    for _ in range(50):
        blown.blow(wind, state, np.zeros(3), 0.0, 0.1)
    # Particles of several triangles are pushed by each; what their mean overshoots comes back.
    assert state.v[:, 0].mean() == pytest.approx(100.0, rel=0.05)
    assert np.isfinite(state.v).all()


def test_still_air_takes_energy_and_adds_none():
    rng = np.random.default_rng(0)
    model = plate(areal_density=0.2, cells=8)
    state = State.at(model, model.rest[np.argsort(model.vertex)], np.zeros(3))
    state.v[:] = rng.normal(size=state.v.shape) * 3.0
    blown, wind = WindOnCloth(model), field(wind_lift=0.4)
    energy = [np.inf]
    for _ in range(200):
        blown.blow(wind, state, np.zeros(3), 0.0, 1.0 / 180.0)
        energy.append(float((model.mass[:, None] * state.v**2).sum()))
        assert energy[-1] <= energy[-2] * (1.0 + 1e-6)
    assert energy[-1] < 0.7 * energy[1]


def naive_blow(f, x, v, triangles, inverse_mass, t, dt):
    for corners in triangles:
        a, b, c = corners
        n = np.cross(x[b] - x[a], x[c] - x[a])
        area, n = 0.5 * np.linalg.norm(n), n / np.linalg.norm(n)
        u = air_velocity(f, x[corners], t).mean(axis=0) - v[corners].mean(axis=0)
        s = np.linalg.norm(u)
        cos = abs(u @ n) / s
        k = 0.5 * AIR_DENSITY * area * s * cos * f.drag
        lift = 0.5 * AIR_DENSITY * area * s**2 * cos * f.lift
        lift = lift * (np.sign(u @ n) * n - cos * u / s)
        force = (k * u + lift) / (1.0 + dt * k * inverse_mass[corners].sum() / 9.0)
        for p in corners:
            v[p] += dt * inverse_mass[p] * force / 3.0


@pytest.mark.parametrize("far", [0.0, 3000.0])
def test_plain_twin_also_far_from_the_origin(cloth, far):
    x, t = cloth.grid(6, 7)
    rng = np.random.default_rng(0)
    x = x + rng.normal(size=x.shape) * 0.004
    model = build_model("cloth", x, t, Material(), pins=np.array([0, 6], np.int32))
    f = wind_field(Environment(wind=(3.0, -1.0, 0.5), **GUSTS))
    origin = np.array([far, 0.0, 0.0])
    blown = WindOnCloth(model)
    state = State.at(model, x, np.zeros(3))
    state.v[:] = rng.normal(size=x.shape)
    v = state.v.astype(np.float64)
    naive_blow(
        f,
        state.x.astype(np.float64) + origin,
        v,
        blown._triangles,
        model.inverse_mass.astype(np.float64),
        0.7,
        0.01,
    )
    blown.blow(f, state, origin, 0.7, 0.01)
    # Single precision, and a cosine good to 4e-6 of the noise.
    assert state.v == pytest.approx(v, abs=2e-4)
    assert (state.v[model.free_count :] == v[model.free_count :]).all()


def flown(cloth, steps, solver="relaxation", *, step=1 / 180, areal_density=0.15, **options):
    """A cloth of 1 m^2 that falls or flies freely, after some steps."""
    x, t = cloth.grid(9, 9, 0.125)
    garment = cloth.garment(x, t, areal_density=areal_density)
    simulation = Simulation(
        (garment,),
        cloth.colliders(),
        environment=Environment(**options),
        solver=solver,
        solver_step=step,
    )
    poses = ColliderPoses.identity(1)
    for _ in range(steps):
        simulation.advance(poses, poses)
    return simulation


@pytest.mark.parametrize("solver", ["relaxation", "xpbd"])
def test_terminal_speed(cloth, solver):
    """A level sheet falls at the speed where its drag carries its weight.

    Drag is taken at the end of the step, which is off by half of what gravity adds in one: 0.4 %.
    """
    simulation = flown(cloth, 960, solver, step=1 / 720, areal_density=0.2, wind_drag=1.2)
    v = simulation.state("cloth").v
    expected = np.sqrt(2.0 * 0.2 * 9.81 / (AIR_DENSITY * 1.2))
    assert -v[:, 2].mean() == pytest.approx(expected, rel=0.01)


def test_gusts_repeat_bit_for_bit_and_begin_anew_at_a_reset(cloth):
    options = {"wind": (2.0, 0.0, 0.0), **GUSTS}
    one, two, other = (
        flown(cloth, 30, **options, gust_seed=seed).positions("cloth").copy() for seed in (1, 1, 2)
    )
    assert (one == two).all()
    assert np.abs(one - other).max() > 1e-3
    simulation = flown(cloth, 30, **options)
    simulation.reset(ColliderPoses.identity(1))
    assert simulation.time == 0.0


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"gust_shortest": 2.0, "gust_longest": 1.0}, "gust_longest"),
    ],
)
def test_winds_that_cannot_be(settings, named):
    with pytest.raises(ParameterError, match=named):
        wind_field(Environment(**settings))


def test_a_wind_that_is_changed_while_cloth_flies(cloth):
    simulation = flown(cloth, 30, **CALM)
    poses = ColliderPoses.identity(1)
    before = simulation.parameters
    for name, change in CHANGES.items():
        environment = Environment(**{**CALM, **change})
        simulation.parameters = before.in_environment(environment)
        v = simulation.state("cloth").v.copy()
        simulation.advance(poses, poses)
        # A step of 1/180 s: weight alone changes speeds by 0.05 m/s.
        assert np.abs(simulation.state("cloth").v - v).max() < 1.0, name
        for _ in range(100):
            simulation.advance(poses, poses)
    with pytest.raises(ParameterError, match="gust_longest"):
        simulation.parameters = before.in_environment(Environment(gust_longest=0.1))
    assert simulation.parameters.environment == environment
    simulation.advance(poses, poses)
    assert np.isfinite(simulation.state("cloth").x).all()
