"""Published curves of normal walking over one stride, as Fourier series.

Knee and ankle follow the averages at natural cadence in D. A. Winter, The Biomechanics and Motor
Control of Human Gait (2nd ed., 1991), read at every 5 % of the stride from heel strike to heel
strike. The thigh against the vertical follows J. Perry, Gait Analysis (1992), chapter 6: 20
degrees forward at heel strike, as much back in terminal stance, 25 forward in mid swing; shoulder
and elbow its chapter 8. Turn and list of the pelvis: J. Saunders, V. Inman, H. Eberhart, The major
determinants in normal and pathological gait (J. Bone Joint Surg. 35-A, 1953). Stride and cadence:
N. Sekiya et al. (1996), by whom step length over cadence is the same at every speed.
"""

import numpy as np

from garment_sim_ros.arrays import FloatArray

_HARMONICS = 6

_THIGH = (
    *(21.0, 20.0, 17.0, 12.5, 7.5, 2.5, -2.5, -8.0, -13.0, -17.5),
    *(-20.5, -20.0, -15.0, -6.0, 4.0, 12.5, 19.0, 23.0, 24.5, 23.0),
)
_KNEE = (
    *(4.0, 10.5, 16.0, 17.5, 15.5, 12.0, 8.5, 6.5, 5.5, 7.0),
    *(12.5, 22.0, 36.5, 52.0, 62.0, 63.0, 55.0, 38.0, 18.0, 5.0),
)
_ANKLE = (
    *(0.0, -4.5, -3.5, 0.5, 3.5, 5.5, 7.0, 8.5, 9.5, 9.0),
    *(5.0, -4.0, -16.0, -18.5, -10.0, -4.0, 0.0, 1.5, 1.5, 0.5),
)

WALK_RATIO = 0.0063
"""Step length over cadence [m / (steps / min)]."""
TOE_OFF = 0.57
"""Share of the stride after which a foot begins to leave the ground; its toes do at 0.62."""


def stride_at(speed: float) -> tuple[float, float]:
    """Length [m] and duration [s] of a stride at a speed [m/s]."""
    cadence = np.sqrt(60.0 * speed / WALK_RATIO)
    return float(2.0 * WALK_RATIO * cadence), float(120.0 / cadence)


def _series(samples: tuple[float, ...], phase: FloatArray) -> FloatArray:
    """The Fourier series through equally spaced samples of one stride, at any phase [strides]."""
    coefficients = np.fft.rfft(samples)[: _HARMONICS + 1] / len(samples)
    k = np.arange(_HARMONICS + 1)
    waves = np.exp(2j * np.pi * np.multiply.outer(phase, k))
    return (np.where(k == 0, 1.0, 2.0) * coefficients * waves).sum(axis=-1).real


def thigh_pitch(phase: FloatArray) -> FloatArray:
    """Thigh before the vertical [rad]."""
    return np.radians(_series(_THIGH, phase))


def knee_flexion(phase: FloatArray) -> FloatArray:
    """Bend of the knee [rad]."""
    return np.radians(_series(_KNEE, phase))


def ankle_dorsiflexion(phase: FloatArray) -> FloatArray:
    """Foot raised towards the shank [rad]."""
    return np.radians(_series(_ANKLE, phase))


def shoulder_flexion(phase: FloatArray) -> FloatArray:
    """Upper arm before the trunk: 24 degrees back at heel strike, 8 forward half a stride on."""
    return np.radians(-8.0 - 16.0 * np.cos(2 * np.pi * phase))


def elbow_flexion(phase: FloatArray) -> FloatArray:
    """Bend of the elbow, most when the arm is in front [rad]."""
    return np.radians(30.0 - 14.0 * np.cos(2 * np.pi * (phase - 0.04)))


def pelvis_turn(phase: FloatArray) -> FloatArray:
    """Turn about the vertical that brings the side of this phase forward at its heel strike."""
    return np.radians(4.5 * np.cos(2 * np.pi * phase))


def pelvis_list(phase: FloatArray) -> FloatArray:
    """How far the other side hangs lower, most while it swings [rad]."""
    return np.radians(4.0 * np.sin(2 * np.pi * (phase + 0.07)))
