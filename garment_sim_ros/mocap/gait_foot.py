"""A foot's way over the ground in normal gait: heel strike, flat, heel off, swing.

On the ground it follows from not sliding: the foot turns about its heel, then stands, then turns
about its ball, by the pitch of the published curves. In the air it follows the published angles.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.mocap import gait_curves as gait
from garment_sim_ros.mocap.walker import ANKLE, BALL, HEEL, SHANK, THIGH

_CLEARANCE = 0.01
"""Height of toes and heel above the ground in mid swing, as a fraction of the height."""


class FootPath:
    """One foot's way over the ground, from heel strike to heel strike.

    Args:
        phase: Time in strides since a heel strike of this foot, shape [f].
        stride: Length of a stride [m].
        height: Height of the walker [m].

    Attributes:
        height: Height of the walker [m].
        pitch: Toes up [rad], shape [f].
        toes: Toes bent up against the foot [rad], shape [f].
        ahead: Ankle before the walker [m], shape [f].
        up: Ankle above the ground [m], shape [f].
    """

    def __init__(self, phase: FloatArray, stride: float, height: float) -> None:
        p = np.mod(phase, 1.0)
        self._stride, self.height = stride, height
        self.pitch = self._pitch(p)
        planted = self._planted_ahead()
        ahead, up = self._rolled(self.pitch)
        ahead += planted - stride * p
        swinging = p > gait.TOE_OFF
        ahead[swinging], up[swinging] = self._swing(p[swinging], planted)
        self.ahead, self.up = ahead, up + self._lift(p)
        # The toes stay on the ground while the foot rolls over its ball, then relax.
        relaxed = _smooth_step((p - gait.TOE_OFF) / 0.12)
        self.toes = np.maximum(-self.pitch, 0.0) * (p > 0.3) * (1.0 - relaxed)

    def _pitch(self, p: FloatArray) -> FloatArray:
        pitch = gait.thigh_pitch(p) - gait.knee_flexion(p) + gait.ankle_dorsiflexion(p)
        flat = _smooth_step((p - 0.03) / 0.06) * (1.0 - _smooth_step((p - 0.28) / 0.14))
        return pitch * (1.0 - flat)

    def _rolled(self, pitch: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Ankle before its place when flat, and above the ground, of a foot that rolls."""
        heel, ball, ankle = (k * self.height for k in (HEEL, BALL, ANKLE))
        pivot = np.where(pitch > 0.0, -heel, ball)
        c, s = np.cos(pitch), np.sin(pitch)
        return pivot - pivot * c - ankle * s, ankle * c - pivot * s

    def _of_curves(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Ankle before and above the hip by the published angles."""
        thigh = gait.thigh_pitch(p)
        shank = thigh - gait.knee_flexion(p)
        return (
            self.height * (THIGH * np.sin(thigh) + SHANK * np.sin(shank)),
            -self.height * (THIGH * np.cos(thigh) + SHANK * np.cos(shank)),
        )

    def _lift(self, p: FloatArray) -> FloatArray:
        """What the swinging ankle must be raised so that toes and heel clear the ground."""

        def hump(s: FloatArray) -> FloatArray:
            return 16.0 * s**2 * (1.0 - s) ** 2

        s = np.linspace(0.15, 0.9, 76)
        swing = gait.TOE_OFF + (1.0 - gait.TOE_OFF) * s
        pitch = self._pitch(swing)
        sole = np.minimum(BALL * np.sin(pitch), -HEEL * np.sin(pitch)) - ANKLE * np.cos(pitch)
        low = self._swing(swing, self._planted_ahead())[1] + self.height * sole
        missing = max(float((_CLEARANCE * self.height - low / hump(s)).max()), 0.0)
        return missing * hump(np.clip((p - gait.TOE_OFF) / (1.0 - gait.TOE_OFF), 0.0, 1.0))

    def _planted_ahead(self) -> float:
        """How far before the walker a foot is set down: as in the curves, on the average."""
        p = np.linspace(0.0, gait.TOE_OFF, 50)
        rolled, _ = self._rolled(self._pitch(p))
        return float(np.mean(self._of_curves(p)[0] - rolled + self._stride * p))

    def _swing(self, p: FloatArray, planted: float) -> tuple[FloatArray, FloatArray]:
        """The curves' way of the ankle, led to where the foot left and will meet the ground."""
        step = 1e-4
        ends = np.array([gait.TOE_OFF - step, gait.TOE_OFF, 1.0, 1.0 + step])
        rolled, up = self._rolled(self._pitch(np.mod(ends, 1.0)))
        wanted = (
            rolled + planted - self._stride * np.array([ends[0], ends[1], 0.0, step]),
            up,
        )
        s = (p - gait.TOE_OFF) / (1.0 - gait.TOE_OFF)
        basis = np.stack([(1 + 2 * s) * (1 - s) ** 2, s * (1 - s) ** 2,
                          s**2 * (3 - 2 * s), s**2 * (s - 1)])  # fmt: skip
        led = []
        for curve, at_ends, target in zip(self._of_curves(p), self._of_curves(ends), wanted):
            gap = target - at_ends
            slope = (1.0 - gait.TOE_OFF) / step
            hermite = np.array(
                [gap[1], slope * (gap[1] - gap[0]), gap[2], slope * (gap[3] - gap[2])]
            )
            led.append(curve + hermite @ basis)
        return led[0], led[1]


def _smooth_step(s: FloatArray) -> FloatArray:
    """From 0 to 1 between s = 0 and 1, with level ends."""
    s = np.clip(s, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)
