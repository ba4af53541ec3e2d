"""Gusty wind: a steady wind plus band-limited noise, and its drag and lift on cloth.

Gong et al. blow at cloth with a noise field (their ref. [26]). Here it is a sum of plane waves
with wavelengths in a given band, carried along by the steady wind (Taylor's frozen turbulence) and
slowly changing; waves at right angles to their direction make it free of divergence. Drag and lift
act on every triangle by its area and its angle to the air (as in Ling, Damodaran & Gay 1996).
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.jit import kernel
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.state import State

AIR_DENSITY = 1.2
"""At 20 degrees Celsius and sea level [kg/m^3]."""

# Taylor's series of sin(2 pi u), for |u| <= 1/4 good to 4e-6.
_S1, _S3, _S5, _S7, _S9 = (
    np.float32(sign * (2.0 * np.pi) ** n / f)
    for sign, n, f in ((1, 1, 1), (-1, 3, 6), (1, 5, 120), (-1, 7, 5040), (1, 9, 362880))
)
_HALF = np.float32(0.5)
_QUARTER = np.float32(0.25)
_THIRD = np.float32(1.0 / 3.0)
_SLOW = np.float32(1e-9)
_ZERO = np.float32(0.0)
_BLOCK = 64
CHANGE = 0.5
"""Time in which one wind goes over to another [s]."""
_X, _Y, _Z, _U, _V, _W = (_BLOCK * row for row in range(6))
"""Where the rows of a block begin: places [m] and air velocities [m/s]."""


class WindField(NamedTuple):
    """Air velocity as a function of place and time, as flat arrays.

    Attributes:
        velocity: Steady part [m/s], shape [3].
        amplitude: Of each wave [m/s], shape [w, 3].
        wave: Wave vector [rad/m], shape [w, 3].
        frequency: Angular frequency at a fixed place [rad/s], shape [w].
        phase: At the world's origin at time 0 [rad], shape [w].
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


def check_wind(environment: Environment) -> None:
    """See that there is such a wind.

    Raises:
        ParameterError: A longest wave shorter than the shortest.
    """
    e = environment
    if e.gust_longest < e.gust_shortest:
        raise ParameterError(
            "gust_longest",
            f"found {e.gust_longest:g} m",
            f"allowed: from gust_shortest, {e.gust_shortest:g} m",
        )


def wind_field(environment: Environment) -> WindField:
    """The field of an environment.

    Raises:
        ParameterError: As `check_wind`.
    """
    e = environment
    check_wind(e)
    velocity = np.array(e.wind, dtype=np.float64)
    rng = np.random.default_rng(e.gust_seed)
    acts = e.wind_drag > 0.0 or e.wind_lift > 0.0
    w = e.gust_waves if e.gust > 0.0 and acts else 0
    direction = rng.normal(size=(w, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    length = e.gust_shortest * (e.gust_longest / e.gust_shortest) ** rng.uniform(size=w)
    amplitude = rng.normal(size=(w, 3))
    if e.gust_divergence_free:
        amplitude -= (amplitude * direction).sum(axis=1, keepdims=True) * direction
    # Equal energy per ratio of wavelengths would be rough; this is Kolmogorov's -5/3 of it.
    amplitude *= (length ** (1.0 / 3.0))[:, None]
    if w:
        amplitude *= e.gust / np.sqrt(0.5 * (amplitude**2).sum())
    wave = direction * (2.0 * np.pi / length)[:, None]
    frequency = wave @ velocity + rng.normal(size=w) * 2.0 * np.pi * e.gust_change
    phase = rng.uniform(0.0, 2.0 * np.pi, w)
    return WindField(velocity, amplitude, wave, frequency, phase, e.wind_drag, e.wind_lift)


class Wind:
    """The wind of a simulation: a field, and for a while its change to another.

    Velocity, amplitudes, frequencies and coefficients change evenly; phases go on, so that no
    place sees a jump. Waves that only one of two fields has fade out or in.

    Args:
        environment: Outer forces.

    Raises:
        ParameterError: As `check_wind`.
    """

    def __init__(self, environment: Environment) -> None:
        self.begin(environment)

    def begin(self, environment: Environment) -> None:
        """Be this wind at time 0, without a change."""
        self._field = wind_field(environment)
        self._environment = environment
        self._change: _Change | None = None
        self._next: Environment | None = None

    def become(self, environment: Environment, t: float) -> None:
        """Go over to another wind from a time [s] on.

        Raises:
            ParameterError: As `check_wind`; the wind stays as it was.
        """
        if environment == self._environment:
            self._next = None
            return
        after = wind_field(environment)
        now = self.at(t)
        if self._change is not None and not (_are_same(now, after)):
            # Its waves would be a third set; the sooner change has a short way to go.
            self._next = environment
            return
        self._environment, self._next = environment, None
        self._change = _Change.of(now, after, t)

    def at(self, t: float) -> WindField:
        """The field at a time [s], whose phases belong to that time."""
        change = self._change
        if change is None:
            return self._field
        if t < change.since + CHANGE:
            return change.at(t)
        self._field, self._change = change.settled(), None
        if self._next is not None:
            self.become(self._next, t)
        return self.at(t)

    def acts(self, t: float) -> bool:
        """Whether air acts on triangles at a time [s]."""
        field = self.at(t)
        return field.drag > 0.0 or field.lift > 0.0

    def environment(self, t: float, asked: Environment) -> Environment:
        """The environment asked for, with the steady wind as it is at a time [s]."""
        if self._change is None and self._next is None:
            return asked
        x, y, z = self.at(t).velocity
        return dataclasses.replace(asked, wind=(float(x), float(y), float(z)))


class _Change(NamedTuple):
    """From one field to another with the same waves.

    Attributes:
        before: Phases at time 0 if its frequencies had always been.
        after: Its phases do not matter.
        since: When it began [s].
    """

    before: WindField
    after: WindField
    since: float

    @classmethod
    def of(cls, before: WindField, after: WindField, since: float) -> "_Change":
        """A change between any two fields: each gets the other's waves, without amplitude."""
        if not _are_same(before, after):
            old, new = len(before.phase), len(after.phase)
            wave = np.concatenate([before.wave, after.wave])
            frequency = np.concatenate([before.frequency, after.frequency])
            phase = np.concatenate([before.phase, after.phase])
            before = before._replace(
                wave=wave,
                frequency=frequency,
                phase=phase,
                amplitude=np.concatenate([before.amplitude, np.zeros((new, 3))]),
            )
            after = after._replace(
                wave=wave,
                frequency=frequency,
                phase=phase,
                amplitude=np.concatenate([np.zeros((old, 3)), after.amplitude]),
            )
        return cls(before, after, since)

    def at(self, t: float) -> WindField:
        """The field in between, at a time [s]."""
        b, a = self.before, self.after
        s = t - self.since
        share = s / CHANGE
        faster = a.frequency - b.frequency
        frequency = b.frequency + share * faster
        # Phases are the integral of frequencies that change evenly.
        passed = b.frequency * t + 0.5 * s * share * faster
        return WindField(
            b.velocity + share * (a.velocity - b.velocity),
            b.amplitude + share * (a.amplitude - b.amplitude),
            b.wave,
            frequency,
            b.phase - passed + frequency * t,
            b.drag + share * (a.drag - b.drag),
            b.lift + share * (a.lift - b.lift),
        )

    def settled(self) -> WindField:
        """The field afterwards, without waves that have faded out."""
        b, a = self.before, self.after
        left = a.amplitude.any(axis=1)
        phase = b.phase + (a.frequency - b.frequency) * (self.since + 0.5 * CHANGE)
        return a._replace(
            wave=a.wave[left],
            amplitude=a.amplitude[left],
            frequency=a.frequency[left],
            phase=phase[left],
        )


def _are_same(one: WindField, other: WindField) -> bool:
    """Whether two fields have the same waves."""
    return np.array_equal(one.wave, other.wave)


def air_velocity(field: WindField, points: FloatArray, t: float) -> FloatArray:
    """Velocity of the air at places [m], shape [n, 3], and a time [s]: [m/s], shape [n, 3]."""
    angle = points @ field.wave.T - field.frequency * t + field.phase
    u: FloatArray = field.velocity + np.cos(angle) @ field.amplitude
    return u


class WindOnCloth:
    """The wind's grip on one garment.

    Args:
        model: The garment.
    """

    def __init__(self, model: ClothModel) -> None:
        triangles = model.particle_triangles
        self._triangles = np.ascontiguousarray(triangles[np.argsort(triangles.min(axis=1))])
        self._inverse_mass = model.inverse_mass
        self._gust = np.zeros((len(model), 3), np.float32)
        self._rows = np.zeros(6 * _BLOCK, np.float32)
        self._field: WindField | None = None

    def blow(
        self, field: WindField, state: State, origin: FloatArray, t: float, dt: float
    ) -> None:
        """Adds the wind's drag and lift of one step to the velocities.

        Args:
            field: The wind.
            state: The garment's motion; velocities are changed in place.
            origin: World position of the coordinates' origin [m], shape [3].
            t: Time of the step's start [s].
            dt: Its duration [s].
        """
        f = field
        if f is not self._field:
            self._take(f)
        # In double precision, far from the world's origin and late, too.
        turns = (f.wave @ origin - f.frequency * t + f.phase) / (2.0 * np.pi)
        self._waves[3] = turns - np.floor(turns)
        if len(f.phase):
            gusts(state.x, self._waves, self._rows, self._gust)
        blow(
            state.x,
            state.v,
            self._triangles,
            self._inverse_mass,
            self._velocity,
            self._gust,
            self._pressure,
            np.float32(dt),
        )

    def _take(self, field: WindField) -> None:
        """What does not depend on time and place, in single precision."""
        self._field = field
        turns = 1.0 / (2.0 * np.pi)
        self._waves = np.concatenate(
            [turns * field.wave.T, np.zeros((1, len(field.phase))), field.amplitude.T]
        ).astype(np.float32)
        self._velocity = field.velocity.astype(np.float32)
        self._pressure = np.array([field.drag, field.lift], np.float32) * np.float32(
            0.25 * AIR_DENSITY
        )
        if not len(field.phase):
            self._gust[:] = 0.0


@kernel()
def gusts(x, waves, rows, gust):
    """The air's noise at every particle.

    Args:
        x: Positions [m], shape [n, 3].
        waves: Rows: wave vector [1/m], phase at the coordinates' origin [turns], amplitude [m/s];
            shape [7, w].
        rows: Scratch: one flat array, so that the compiler knows that rows do not overlap.
        gust: Output [m/s], shape [n, 3].
    """
    n = x.shape[0]
    for begin in range(0, n, _BLOCK):
        for i in range(_BLOCK):
            p = min(begin + i, n - 1)
            rows[_X + i] = x[p, 0]
            rows[_Y + i] = x[p, 1]
            rows[_Z + i] = x[p, 2]
            rows[_U + i] = _ZERO
            rows[_V + i] = _ZERO
            rows[_W + i] = _ZERO
        for w in range(waves.shape[1]):
            kx, ky, kz, phase = waves[0, w], waves[1, w], waves[2, w], waves[3, w]
            ax, ay, az = waves[4, w], waves[5, w], waves[6, w]
            for i in range(_BLOCK):
                s = kx * rows[_X + i] + ky * rows[_Y + i] + kz * rows[_Z + i] + phase
                # The cosine as a sine of the quarter turn next to it, in turns.
                s = _QUARTER - abs(s - np.floor(s + _HALF))
                r = s * s
                s *= _S1 + r * (_S3 + r * (_S5 + r * (_S7 + r * _S9)))
                rows[_U + i] += ax * s
                rows[_V + i] += ay * s
                rows[_W + i] += az * s
        for p in range(begin, min(begin + _BLOCK, n)):
            i = p - begin
            gust[p, 0] = rows[_U + i]
            gust[p, 1] = rows[_V + i]
            gust[p, 2] = rows[_W + i]


@kernel()
def blow(x, v, triangles, inverse_mass, velocity, gust, pressure, dt):
    """Drag and lift of one step on every triangle.

    The drag of a triangle is limited so that it never turns its motion relative to the air round,
    however light the cloth and long the step: ``dv = dt k (u - v) / (1 + dt k)``.

    Args:
        x: Positions [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        triangles: Particles, shape [t, 3].
        inverse_mass: 0 for fixed particles [1/kg], shape [n].
        velocity: Of the steady wind [m/s], shape [3].
        gust: Noise on it at every particle [m/s]; a triangle takes the mean of its corners. Shape
            [n, 3].
        pressure: A quarter of the air's density times the coefficients of drag and lift [kg/m^3],
            shape [2].
        dt: Step [s].
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
        ux, uy, uz = gust[a, 0] - v[a, 0], gust[a, 1] - v[a, 1], gust[a, 2] - v[a, 2]
        ux, uy, uz = (
            ux + gust[b, 0] - v[b, 0],
            uy + gust[b, 1] - v[b, 1],
            uz + gust[b, 2] - v[b, 2],
        )
        ux, uy, uz = (
            ux + gust[c, 0] - v[c, 0],
            uy + gust[c, 1] - v[c, 1],
            uz + gust[c, 2] - v[c, 2],
        )
        ux = velocity[0] + ux * _THIRD
        uy = velocity[1] + uy * _THIRD
        uz = velocity[2] + uz * _THIRD
        speed = np.sqrt(ux * ux + uy * uy + uz * uz)
        if not speed > _SLOW:
            continue
        across = (ux * nx + uy * ny + uz * nz) / speed  # cosine of the angle of attack
        grip = doubled * speed * abs(across)
        k = pressure[0] * grip  # 0.5 rho A |u| |cos|, times u the force
        # The side that the wind comes out of, less its part along the wind, gives the lift.
        strength = pressure[1] * grip * speed
        side = np.copysign(strength, across)
        along = k - strength * abs(across) / speed
        # A third of the force goes to each corner; together they move like share / 9 per force.
        limit = dt / (np.float32(1.0) + dt * k * share / np.float32(9.0)) * _THIRD
        gx = limit * (along * ux + side * nx)
        gy = limit * (along * uy + side * ny)
        gz = limit * (along * uz + side * nz)
        for r in range(3):
            p = triangles[i, r]
            v[p, 0] += inverse_mass[p] * gx
            v[p, 1] += inverse_mass[p] * gy
            v[p, 2] += inverse_mass[p] * gz
