"""Triangles of constant strain again, in float64 and one at a time, for tests to compare."""

from itertools import product
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.sim.membrane import FADING, PRESSED


class Triangles(NamedTuple):
    """A membrane.

    Attributes:
        corners: Of the triangles, in the order in which they are solved, shape [t, 3].
        along: See `sim.membrane.Membrane`, shape [t, 2, 2].
        area: Shape [t] [m^2].
        law: Stiffness of warp, weft and shear [N/m], and Poisson's ratio.
    """

    corners: IntArray
    along: FloatArray
    area: FloatArray
    law: tuple[float, ...]


def threads(x: FloatArray, along: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What a triangle [3, 3] makes of a metre of warp and of weft."""
    f, g = along @ np.array([x[1] - x[0], x[2] - x[0]])
    return f, g


def strains(x: FloatArray, along: FloatArray) -> FloatArray:
    """Of warp and weft, and the shear."""
    f, g = threads(x, along)
    shear = (np.linalg.norm(f + g) - np.linalg.norm(f - g)) / np.sqrt(2.0)
    return np.array([np.linalg.norm(f) - 1.0, np.linalg.norm(g) - 1.0, shear])


def compliance(
    strain: FloatArray, law: tuple[float, ...], softer: tuple[float, float]
) -> FloatArray:
    """Strain for each stress [m/N], with threads under compression so much softer."""
    warp, weft, shear, poisson = law
    both = -poisson / (1.0 + FADING * strain[:2] @ strain[:2]) / np.sqrt(warp * weft)
    return np.array(
        [
            [softer[0] / warp, both, 0.0],
            [both, softer[1] / weft, 0.0],
            [0.0, 0.0, 1.0 / shear],
        ]
    )


def softness(strain: FloatArray, law: tuple[float, ...]) -> tuple[float, float]:
    """The pair for which stresses have the signs that it is for; there is only one."""
    for pair in product((1.0, 1.0 / PRESSED), repeat=2):
        stress = np.linalg.solve(compliance(strain, law, pair), strain)
        if all((s < 0.0) == (one > 1.0) for s, one in zip(stress, pair)):
            return pair
    raise AssertionError(strain)


def energy(x: FloatArray, along: FloatArray, area: float, law: tuple[float, ...]) -> float:
    """Of one triangle [J]: the largest of strain times stress less what the stress costs."""
    strain = strains(x, along)
    C = compliance(strain, law, softness(strain, law))
    return float(0.5 * area * strain @ np.linalg.solve(C, strain))


def gradient(x: FloatArray, along: FloatArray) -> FloatArray:
    """Of the three strains by the coordinates of the corners [1/m], shape [3, 9]."""
    f, g = threads(x, along)
    share = np.concatenate([-along.sum(axis=1, keepdims=True), along], axis=1)  # thread, corner
    to = np.array([f / np.linalg.norm(f), g / np.linalg.norm(g)])
    a, b = (way / np.linalg.norm(way) / np.sqrt(2.0) for way in (f + g, f - g))
    return np.array(
        [
            np.outer(share[0], to[0]).ravel(),
            np.outer(share[1], to[1]).ravel(),
            (np.outer(share[0], a - b) + np.outer(share[1], a + b)).ravel(),
        ]
    )


def forces(x: FloatArray, cloth: Triangles) -> FloatArray:
    """Less the gradient of the energy [N], shape [n, 3]."""
    force = np.zeros_like(x, dtype=np.float64)
    for corners, along, area in zip(cloth.corners, cloth.along, cloth.area):
        strain = strains(x[corners], along)
        C = compliance(strain, cloth.law, softness(strain, cloth.law))
        stress = np.linalg.solve(C, strain)
        # Poisson's ratio falls with strain: U has - n p q / sqrt(E D).
        small = 1.0 / (1.0 + FADING * strain[:2] @ strain[:2])
        falls = -2.0 * FADING * small**2 * cloth.law[3] * strain[:2]
        stress[:2] += falls * stress[0] * stress[1] / np.sqrt(cloth.law[0] * cloth.law[1])
        force[corners] -= area * (stress @ gradient(x[corners], along)).reshape(3, 3)
    return force


def solve_triangles(
    x: FloatArray, cloth: Triangles, inverse_mass: FloatArray, dt: float, iterations: int
) -> FloatArray:
    """Positions [n, 3] after passes over triangles: equation 18 of XPBD, in blocks."""
    x = np.array(x, dtype=np.float64)
    multiplier = np.zeros((len(cloth.corners), 3))
    for _ in range(iterations):
        for t, corners in enumerate(cloth.corners):
            J, w = gradient(x[corners], cloth.along[t]), np.repeat(inverse_mass[corners], 3)
            strain = strains(x[corners], cloth.along[t])
            C = compliance(strain, cloth.law, softness(strain, cloth.law))
            C /= cloth.area[t] * dt**2
            A = J * w @ J.T
            A[np.diag_indices(3)] *= 1.001
            change = np.linalg.solve(A + C, strain - C @ multiplier[t])
            multiplier[t] += change
            x[corners] -= (w * (change @ J)).reshape(3, 3)
    return x
