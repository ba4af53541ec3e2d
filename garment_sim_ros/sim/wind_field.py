"""Gusty wind: a steady wind plus band-limited noise, and its drag and lift on cloth.

Gong et al. blow at cloth with a noise field (their ref. [26]). Here it is a sum of plane waves
with wavelengths in a given band, carried along by the steady wind (Taylor's frozen turbulence) and
slowly changing; waves at right angles to their direction make it free of divergence. Drag and lift
act on every triangle by its area and its angle to the air (as in Ling, Damodaran & Gay 1996).
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.jit import kernel
from garment_sim_ros.params import parameter, validated

FloatArray = NDArray[np.float64]

AIR_DENSITY = 1.2
"""At 20 degrees Celsius and sea level [kg/m^3]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class WindSettings:
    """What the wind is like."""

    velocity: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), "Steady wind.", unit="m/s", minimum=-200.0, maximum=200.0
    )
    gust: float = parameter(
        0.0, "Root mean square speed of the noise.", unit="m/s", minimum=0.0, maximum=200.0
    )
    shortest: float = parameter(
        0.3, "Shortest wavelength of the noise.", unit="m", minimum=0.01, maximum=1e3
    )
    longest: float = parameter(
        3.0, "Longest wavelength of the noise.", unit="m", minimum=0.01, maximum=1e3
    )
    change: float = parameter(
        0.5, "Rate at which the noise changes by itself.", unit="1/s", minimum=0.0, maximum=100.0
    )
    divergence_free: bool = parameter(True, "Air neither appears nor vanishes.")
    waves: int = parameter(24, "Number of plane waves.", minimum=1, maximum=512)
    seed: int = parameter(1, "The same seed gives the same wind.", minimum=0, maximum=2**31 - 1)
    drag: float = parameter(1.2, "Drag coefficient across the cloth.", minimum=0.0, maximum=10.0)
    lift: float = parameter(0.4, "Lift coefficient.", minimum=0.0, maximum=10.0)


class WindField(NamedTuple):
    """Air velocity as a function of place and time, as flat arrays.

    Attributes:
        velocity: Steady part [m/s], shape [3].
        amplitude: Of each wave [m/s], shape [w, 3].
        wave: Wave vector [rad/m], shape [w, 3].
        frequency: Angular frequency at a fixed place [rad/s], shape [w].
        phase: At the origin at time 0 [rad], shape [w].
        drag: Drag coefficient.
        lift: Lift coefficient.
    """

    velocity: FloatArray
    amplitude: FloatArray
    wave: FloatArray
    frequency: FloatArray
    phase: FloatArray
    drag: float
    lift: float


def wind_field(settings: WindSettings) -> WindField | None:
    """The field of some settings; None where there is no wind, which then costs nothing.

    Raises:
        ParameterError: A value out of range, or the longest wave is shorter than the shortest.
    """
    settings = validated(WindSettings, dataclasses.asdict(settings))
    if settings.longest < settings.shortest:
        raise ParameterError(
            "longest", f"found {settings.longest}", f"allowed: from {settings.shortest} m"
        )
    velocity = np.array(settings.velocity, dtype=np.float64)
    if settings.gust == 0.0 and not velocity.any():
        return None
    rng = np.random.default_rng(settings.seed)
    w = settings.waves if settings.gust > 0.0 else 0
    direction = rng.normal(size=(w, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    length = settings.shortest * (settings.longest / settings.shortest) ** rng.uniform(size=w)
    amplitude = rng.normal(size=(w, 3))
    if settings.divergence_free:
        amplitude -= (amplitude * direction).sum(axis=1, keepdims=True) * direction
    # Equal energy per ratio of wavelengths would be rough; this is Kolmogorov's -5/3 of it.
    amplitude *= (length ** (1.0 / 3.0))[:, None]
    if w:
        amplitude *= settings.gust / np.sqrt(0.5 * (amplitude**2).sum())
    wave = direction * (2.0 * np.pi / length)[:, None]
    frequency = wave @ velocity + rng.normal(size=w) * 2.0 * np.pi * settings.change
    return WindField(
        velocity,
        amplitude,
        wave,
        frequency,
        rng.uniform(0.0, 2.0 * np.pi, w),
        float(settings.drag),
        float(settings.lift),
    )


@kernel(forceinline=True)
def air_velocity(field, x, y, z, t):
    """Velocity of the air at a place [m] and time [s], [m/s]."""
    u = field.velocity[0]
    v = field.velocity[1]
    w = field.velocity[2]
    for i in range(field.phase.size):
        k = field.wave[i]
        s = np.cos(k[0] * x + k[1] * y + k[2] * z - field.frequency[i] * t + field.phase[i])
        u += field.amplitude[i, 0] * s
        v += field.amplitude[i, 1] * s
        w += field.amplitude[i, 2] * s
    return u, v, w


@kernel()
def blow(field, x, velocity, triangles, inverse_mass, origin, t, dt):
    """Adds the wind's drag and lift of one step to the velocities of cloth.

    The drag of a triangle is limited so that it never turns its motion relative to the air round,
    however light the cloth and long the step: ``dv = dt k (u - v) / (1 + dt k)``.

    Args:
        field: The wind.
        x: Positions relative to `origin` [m], shape [n, 3].
        velocity: Velocities, changed in place [m/s], shape [n, 3].
        triangles: Vertex indices, shape [t, 3].
        inverse_mass: 0 for fixed particles [1/kg], shape [n].
        origin: World position of the coordinates' origin [m], shape [3].
        t: Time of the step's start [s].
        dt: Its duration [s].
    """
    for i in range(triangles.shape[0]):
        a = triangles[i, 0]
        b = triangles[i, 1]
        c = triangles[i, 2]
        ex, ey, ez = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        fx, fy, fz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
        nx, ny, nz = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
        doubled = np.sqrt(nx * nx + ny * ny + nz * nz)
        share = inverse_mass[a] + inverse_mass[b] + inverse_mass[c]
        if not doubled > 0.0 or not share > 0.0:
            continue
        nx, ny, nz = nx / doubled, ny / doubled, nz / doubled
        ux, uy, uz = air_velocity(
            field,
            origin[0] + (x[a, 0] + x[b, 0] + x[c, 0]) / 3.0,
            origin[1] + (x[a, 1] + x[b, 1] + x[c, 1]) / 3.0,
            origin[2] + (x[a, 2] + x[b, 2] + x[c, 2]) / 3.0,
            t,
        )
        ux -= (velocity[a, 0] + velocity[b, 0] + velocity[c, 0]) / 3.0
        uy -= (velocity[a, 1] + velocity[b, 1] + velocity[c, 1]) / 3.0
        uz -= (velocity[a, 2] + velocity[b, 2] + velocity[c, 2]) / 3.0
        speed = np.sqrt(ux * ux + uy * uy + uz * uz)
        if not speed > 1e-9:
            continue
        across = (ux * nx + uy * ny + uz * nz) / speed  # cosine of the angle of attack
        pressure = 0.25 * AIR_DENSITY * doubled * speed * abs(across)  # 0.5 rho A |u| |cos|
        k = field.drag * pressure
        # The side that the wind comes out of, less its part along the wind, gives the lift.
        side = 1.0 if across > 0.0 else -1.0
        lx = side * nx - abs(across) * ux / speed
        ly = side * ny - abs(across) * uy / speed
        lz = side * nz - abs(across) * uz / speed
        strength = field.lift * pressure * speed
        # A third of the force goes to each corner; together they move like share / 9 per force.
        limit = dt / (1.0 + dt * k * share / 9.0) / 3.0
        gx = limit * (k * ux + strength * lx)
        gy = limit * (k * uy + strength * ly)
        gz = limit * (k * uz + strength * lz)
        for r in range(3):
            p = triangles[i, r]
            velocity[p, 0] += inverse_mass[p] * gx
            velocity[p, 1] += inverse_mass[p] * gy
            velocity[p, 2] += inverse_mass[p] * gz
