"""What wind does to cloth: drag and lift.

They act on every triangle by its area and its angle to the air (as in Ling, Damodaran & Gay 1996).
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.jit import kernel
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.state import State
from garment_sim_ros.sim.world.wind_field import WindField

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
_X, _Y, _Z, _U, _V, _W = (_BLOCK * row for row in range(6))
"""Where the rows of a block begin: places [m] and air velocities [m/s]."""


class WindOnCloth:
    """The wind on one garment.

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
        flow = doubled * speed * abs(across)
        k = pressure[0] * flow  # 0.5 rho A |u| |cos|, times u the force
        # The side that the wind comes out of, less its part along the wind, gives the lift.
        strength = pressure[1] * flow * speed
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
