"""Cloth in its plane as triangles of constant strain: an orthotropic membrane.

A triangle's warp and weft, unit vectors at rest, are mapped to f and g, which are linear in the
positions of its corners. Its strains are e = |f| - 1 along the warp, d = |g| - 1 along the weft
and the shear s = (|f + g| - |f - g|) / sqrt 2, the difference of its two diagonals. Per area it
has the energy

    W(e, d, s) = max over p, q of  p e + q d - U(p, q)  + G s^2 / 2,
    U(p, q) = p^2 / 2E + q^2 / 2D - n p q / sqrt(E D),

p and q the stresses of warp and weft, E and D their stiffnesses, G that against shear, n Poisson's
ratio (the geometric mean of both directions: n < 1 is a stable fabric whatever E and D). It is
that of small strains: n falls as 1 / (1 + `FADING` (e^2 + d^2)), as a thread that is pulled to
five times its length would else make the other one shorter than nothing.

Strains are differences of lengths instead of squares (warp and weft as in Baraff & Witkin 1998,
"Large steps in cloth simulation", section 4.2). Stress grows in proportion to stretch. A triangle
without area, or many times too large, has forces that are finite and not too stiff: the curvature
of the energy is at most E, D and 3 G, wherever the corners are. Turned over it is at rest.

**Compression.** Threads buckle long before they are pressed together, into folds that are finer
than any mesh: a membrane that cannot bend carries no compression at all (Pipkin 1986, "The relaxed
energy density for isotropic elastic membranes"; for a net, thread by thread as here, Pipkin 1986,
"Continuously distributed wrinkles in fabrics"). With stress below zero a thread therefore has
`PRESSED` of its stiffness: U has p^2 / (2 `PRESSED` E) then. Not none: what holds a mesh against
compression makes it fold instead of shrinking, and the folds that the mesh can show are those that
its hinges resist. U stays convex and smooth, so that W does, too.
"""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.params import Material
from garment_sim_ros.sim.elasticity import warp_directions
from garment_sim_ros.sim.model import ClothModel

PRESSED = 0.3
"""Stiffness of threads under compression, as a part of that under tension. With a tenth the
border of a coarse curtain that was thrown about stayed rolled up."""
FADING = 4.0
"""How soon Poisson's ratio falls with strain."""
_LEAST = 1e-6
"""Part of the largest stiffness which the others are at least: compliances are then finite."""
_NEAR_ZERO = 1e-9
"""Area of a triangle without shape, as a share of its longest edge's square."""


class Law(NamedTuple):
    """A fabric in its plane.

    Attributes:
        warp: Stiffness along the warp, E above [N/m].
        weft: Along the weft, D above [N/m].
        shear: Against shear, G above [N/m].
        poisson: Poisson's ratio, n above.
    """

    warp: float
    weft: float
    shear: float
    poisson: float

    @classmethod
    def of(cls, material: Material) -> "Law":
        """That of a fabric."""
        asked = (
            material.stretch_stiffness_warp,
            material.stretch_stiffness_weft,
            material.shear_stiffness,
        )
        least = max(_LEAST * max(asked), 1e-6)
        warp, weft, shear = (max(k, least) for k in asked)
        return cls(warp, weft, shear, material.poisson_ratio)

    @property
    def in_shares(self) -> SingleArray:
        """Warp over weft and shear; Poisson's ratio by the weft's strain and the warp's, [4]."""
        root = np.sqrt(self.weft / self.warp)
        shares = (1.0 / root**2, self.warp / self.shear, self.poisson * root, self.poisson / root)
        return np.array(shares, np.float32)


class Membrane(NamedTuple):
    """Triangles of a garment that have a shape.

    Attributes:
        particles: Their corners, shape [t, 3].
        along: How a metre of warp and of weft goes along the sides from the first corner to the
            second and third: f = along[0, 0] (x1 - x0) + along[0, 1] (x2 - x0) [1/m], [t, 2, 2].
        area: Areas [m^2], shape [t].
    """

    particles: IntArray
    along: FloatArray
    area: FloatArray


def membrane(model: ClothModel) -> Membrane:
    """The triangles of a garment of which a corner is free.

    Warp and weft are those of the panels where cloth was cut flat; else the vertical of the rest
    shape in each triangle, see `elasticity.warp_directions`.
    """
    particles, corners = model.particle_triangles, model.corners
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    doubled = np.linalg.norm(normal, axis=1)
    longest = np.maximum.reduce([(s**2).sum(axis=1) for s in (first, second, second - first)])
    used = (doubled > 2.0 * _NEAR_ZERO * longest) & (particles < model.free_count).any(axis=1)
    warp = warp_directions(model.rest, particles, corners)[used]
    weft = np.cross(normal[used] / doubled[used, None], warp)
    flat = np.stack([first[used], second[used]], axis=2)
    axes = np.stack([warp, weft], axis=1)
    return Membrane(
        particles=particles[used],
        along=np.linalg.inv(axes @ flat).transpose(0, 2, 1),
        area=0.5 * doubled[used],
    )


def stored(x: FloatArray, cloth: Membrane, law: Law) -> float:
    """Energy of a membrane whose particles are at x [m], shape [n, 3]; [J]."""
    first = x[cloth.particles[:, 0]]
    sides = np.stack([x[cloth.particles[:, k]] - first for k in (1, 2)], axis=1)
    f, g = (cloth.along @ sides).transpose(1, 0, 2)
    e, d = np.linalg.norm(f, axis=1) - 1.0, np.linalg.norm(g, axis=1) - 1.0
    s = (np.linalg.norm(f + g, axis=1) - np.linalg.norm(f - g, axis=1)) / np.sqrt(2.0)
    both = np.sqrt(law.warp * law.weft)
    n = law.poisson / (1.0 + FADING * (e**2 + d**2))
    # A thread whose stress has the sign of this sum.
    warp = law.warp * e + n * both * np.where(d > 0.0, d, PRESSED * d)
    weft = law.weft * d + n * both * np.where(e > 0.0, e, PRESSED * e)
    a, b = (np.where(stress < 0.0, 1.0 / PRESSED, 1.0) for stress in (warp, weft))
    in_threads = (b * law.warp * e**2 + a * law.weft * d**2 + 2.0 * n * both * e * d) / (
        a * b - n**2
    )
    return float(0.5 * cloth.area @ (in_threads + law.shear * s**2))
