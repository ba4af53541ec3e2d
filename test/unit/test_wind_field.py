"""The wind: its noise, and what it does to cloth."""

import numpy as np
import pytest

from garment_sim_ros.errors import ParameterError
from garment_sim_ros.sim.wind_field import (
    AIR_DENSITY,
    WindSettings,
    air_velocity,
    blow,
    wind_field,
)


def at(field, points, t=0.0):
    return np.array([air_velocity(field, *p, t) for p in points])


def divergence(field, p, h=1e-4):
    total = 0.0
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = h
        total += (at(field, [p + step])[0, axis] - at(field, [p - step])[0, axis]) / (2.0 * h)
    return total


def test_off_is_nothing():
    assert wind_field(WindSettings()) is None


def test_same_seed_same_wind_other_seed_other_wind():
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (50, 3))
    first, again, other = (
        at(wind_field(WindSettings(gust=2.0, seed=seed)), points, 1.5) for seed in (7, 7, 8)
    )
    assert (first == again).all()
    assert np.abs(first - other).max() > 0.5


def test_root_mean_square_and_mean():
    field = wind_field(WindSettings(velocity=(3.0, 0.0, 1.0), gust=2.0))
    u = at(field, np.random.default_rng(0).uniform(-50.0, 50.0, (4000, 3)))
    assert u.mean(axis=0) == pytest.approx([3.0, 0.0, 1.0], abs=0.15)
    assert np.sqrt(((u - [3.0, 0.0, 1.0]) ** 2).sum(axis=1).mean()) == pytest.approx(2.0, rel=0.05)


def test_divergence_free_or_not():
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (30, 3))
    free, not_free = (
        np.array(
            [divergence(wind_field(WindSettings(gust=2.0, divergence_free=f)), p) for p in points]
        )
        for f in (True, False)
    )
    assert np.abs(free).max() < 1e-5
    assert np.abs(not_free).max() > 1.0


def test_band_limited():
    field = wind_field(WindSettings(gust=1.0, shortest=0.5, longest=2.0))
    length = 2.0 * np.pi / np.linalg.norm(field.wave, axis=1)
    assert length.min() >= 0.5 - 1e-9
    assert length.max() <= 2.0 + 1e-9


def test_carried_by_the_steady_wind():
    field = wind_field(WindSettings(velocity=(4.0, 0.0, 0.0), gust=2.0, change=0.0))
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (20, 3))
    later = at(field, points + np.array([2.0, 0.0, 0.0]), 0.5)
    assert later == pytest.approx(at(field, points, 0.0))


def one_triangle(tilt=0.0):
    x = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    c, s = np.cos(tilt), np.sin(tilt)
    return x @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T, np.array([[0, 1, 2]])


def pushed(field, tilt=0.0, mass=1e3, velocity=(0.0, 0.0, 0.0), dt=1e-3):
    """Force on a triangle of three equal particles [N]."""
    x, t = one_triangle(tilt)
    v = np.tile(np.array(velocity, dtype=float), (3, 1))
    before = v.copy()
    blow(field, x, v, t.astype(np.int32), np.full(3, 1.0 / mass), np.zeros(3), 0.0, dt)
    return (v - before).sum(axis=0) * mass / dt


def test_drag_across_and_along():
    field = wind_field(WindSettings(velocity=(10.0, 0.0, 0.0), drag=1.2, lift=0.0))
    expected = 0.5 * AIR_DENSITY * 1.2 * 0.5 * 100.0  # rho/2 C A u^2, area one half
    assert pushed(field) == pytest.approx([expected, 0.0, 0.0], rel=1e-5)
    assert pushed(field, tilt=np.pi / 2) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert pushed(field, tilt=np.pi / 3)[0] == pytest.approx(0.5 * expected, rel=1e-5)
    assert pushed(field, velocity=(10.0, 0.0, 0.0)) == pytest.approx([0.0, 0.0, 0.0])


def test_lift_is_across_the_wind_and_has_a_side():
    field = wind_field(WindSettings(velocity=(10.0, 0.0, 0.0), drag=0.0, lift=0.5))
    one, other = pushed(field, np.pi / 4), pushed(field, -np.pi / 4)
    assert one[0] == pytest.approx(0.0, abs=1e-9)
    assert abs(one[1]) == pytest.approx(0.5 * AIR_DENSITY * 0.5 * 0.5 * 100.0 * 0.5, rel=1e-5)
    assert other[1] == pytest.approx(-one[1])
    assert pushed(field) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_light_cloth_and_long_steps_stay_bounded():
    field = wind_field(WindSettings(velocity=(100.0, 0.0, 0.0), lift=0.0))
    x, t = one_triangle()
    v = np.zeros((3, 3))
    for _ in range(50):
        blow(field, x, v, t.astype(np.int32), np.full(3, 1e5), np.zeros(3), 0.0, 0.1)
    assert v[:, 0].max() <= 100.0 + 1e-6
    assert v[:, 0].min() > 99.0


def test_fixed_particles_and_flat_triangles_stay():
    field = wind_field(WindSettings(velocity=(10.0, 0.0, 0.0)))
    x, t = one_triangle()
    v = np.zeros((3, 3))
    blow(field, x, v, t.astype(np.int32), np.array([0.0, 1.0, 1.0]), np.zeros(3), 0.0, 0.01)
    assert (v[0] == 0.0).all()
    assert (v[1:, 0] > 0.0).all()
    v = np.zeros((3, 3))
    blow(field, x * 0.0, v, t.astype(np.int32), np.ones(3), np.zeros(3), 0.0, 0.01)
    assert (v == 0.0).all()


def naive_blow(field, x, v, triangles, inverse_mass, t, dt):
    for a, b, c in triangles:
        n = np.cross(x[b] - x[a], x[c] - x[a])
        area, n = 0.5 * np.linalg.norm(n), n / np.linalg.norm(n)
        u = np.array(air_velocity(field, *x[[a, b, c]].mean(axis=0), t)) - v[[a, b, c]].mean(
            axis=0
        )
        s = np.linalg.norm(u)
        cos = abs(u @ n) / s
        k = 0.5 * AIR_DENSITY * area * s * cos * field.drag
        lift = 0.5 * AIR_DENSITY * area * s**2 * cos * field.lift
        lift = lift * (np.sign(u @ n) * n - cos * u / s)
        force = (k * u + lift) / (1.0 + dt * k * inverse_mass[[a, b, c]].sum() / 9.0)
        for p in (a, b, c):
            v[p] += dt * inverse_mass[p] * force / 3.0


def test_plain_twin(cloth):
    x, t = cloth.grid(6, 7)
    rng = np.random.default_rng(0)
    x = x + rng.normal(size=x.shape) * 0.004
    v = rng.normal(size=x.shape)
    mass = rng.uniform(0.0, 1e3, len(x))
    field = wind_field(WindSettings(velocity=(3.0, -1.0, 0.5), gust=2.0))
    expected = v.copy()
    naive_blow(field, x, expected, t, mass, 0.7, 0.01)
    blow(field, x, v, t.astype(np.int32), mass, np.zeros(3), 0.7, 0.01)
    assert v == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    "settings", [{"gust": -1.0}, {"shortest": 2.0, "longest": 1.0}, {"seed": -1}, {"waves": 0}]
)
def test_bad_settings(settings):
    with pytest.raises(ParameterError):
        wind_field(WindSettings(**settings))
