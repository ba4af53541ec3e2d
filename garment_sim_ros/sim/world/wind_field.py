"""Gusty wind: a steady wind plus band-limited noise.

Gong et al. blow at cloth with a noise field (their ref. [26]). Here it is a sum of plane waves
with wavelengths in a given band, carried along by the steady wind (Taylor's frozen turbulence) and
slowly changing; waves at right angles to their direction make it free of divergence. What it does
to cloth: `wind_on_cloth`.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import Environment

CHANGE = 0.5
"""Time in which one wind goes over to another [s]."""


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
