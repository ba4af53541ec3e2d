"""The wind: its noise, and what it does to cloth."""

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import Environment, Material
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.state import State
from garment_sim_ros.sim.world.wind_field import AIR_DENSITY, WindOnCloth, air_velocity, wind_field

GUSTS = {"wind_drag": 1.2, "wind_lift": 0.4, "gust": 2.0}


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
    assert wind_field(Environment(wind=(5.0, 0.0, 0.0))) is None


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
    WindOnCloth(field(**options), model).blow(state, np.zeros(3), 0.0, dt)
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
    grip = WindOnCloth(field(wind=(100.0, 0.0, 0.0)), model)
    for _ in range(50):
        grip.blow(state, np.zeros(3), 0.0, 0.1)
    # Particles of several triangles are pushed by each; what their mean overshoots comes back.
    assert state.v[:, 0].mean() == pytest.approx(100.0, rel=0.05)
    assert np.isfinite(state.v).all()


def test_still_air_takes_energy_and_adds_none():
    rng = np.random.default_rng(0)
    model = plate(areal_density=0.2, cells=8)
    state = State.at(model, model.rest[np.argsort(model.vertex)], np.zeros(3))
    state.v[:] = rng.normal(size=state.v.shape) * 3.0
    grip = WindOnCloth(field(wind_lift=0.4), model)
    energy = [np.inf]
    for _ in range(200):
        grip.blow(state, np.zeros(3), 0.0, 1.0 / 180.0)
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
    grip = WindOnCloth(f, model)
    state = State.at(model, x, np.zeros(3))
    state.v[:] = rng.normal(size=x.shape)
    v = state.v.astype(np.float64)
    naive_blow(
        f,
        state.x.astype(np.float64) + origin,
        v,
        grip._triangles,
        model.inverse_mass.astype(np.float64),
        0.7,
        0.01,
    )
    grip.blow(state, origin, 0.7, 0.01)
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
        ({"gust": 1.0}, "gust: "),
        ({"gust_shortest": 2.0, "gust_longest": 1.0}, "gust_longest"),
    ],
)
def test_winds_that_cannot_be(settings, named):
    with pytest.raises(ParameterError, match=named):
        wind_field(Environment(**settings))
