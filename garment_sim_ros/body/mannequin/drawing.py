"""Tools to draw the mannequin's parts from tables in centimetres at 170 cm."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.mannequin import tables
from garment_sim_ros.body.mannequin.surface import Loft

Tape = tuple[FloatArray, FloatArray, FloatArray, float]
"""Plane of a girth: a point inside the body [m], two directions, a rough radius [m]."""

UPRIGHT = np.eye(3)


class Drawing:
    """A figure in the making; all lengths in centimetres at 170 cm until it is finished.

    Args:
        unit: Metres per centimetre at 170 cm.
        sex: 0 for female to 1 for male.
        scale: Factors on the tables at the landmarks.
    """

    def __init__(self, unit: float, sex: float, scale: dict[str, float]) -> None:
        self.unit, self.sex, self.scale = unit, sex, scale
        self.joints = {name: self.mixed(*pair) for name, pair in tables.JOINTS.items()}
        self.parts: dict[str, Loft] = {}
        self.tapes: dict[str, Tape] = {}

    def mixed(self, female: object, male: object) -> FloatArray:
        """Figures between the women's and the men's."""
        f, m = np.asarray(female, dtype=np.float64), np.asarray(male, dtype=np.float64)
        return (1.0 - self.sex) * f + self.sex * m

    def rows(self, table: Sequence[tuple]) -> FloatArray:
        """A table's rows for this sex."""
        return self.mixed([row[0] for row in table], [row[1] for row in table])

    def factor(
        self, at: FloatArray, part: str, ends: tuple[tuple[float, float], ...] = ()
    ) -> FloatArray:
        """Girth factor along a part, level beyond its outermost landmarks and `ends`."""
        known = [
            (s, self.scale[name]) for name, (owner, s) in tables.LANDMARKS.items() if owner == part
        ]
        place, value = np.array(sorted((*known, *ends))).T
        return PchipInterpolator(place, value)(np.clip(at, place[0], place[-1]))

    def tape(self, part: str, at, u, v, centre, radius) -> None:
        """Notes the planes of a part's girths, from centres and radii along it."""
        for name, (owner, s) in tables.LANDMARKS.items():
            if owner == part:
                place = np.array([np.interp(s, at, column) for column in centre.T])
                reach = float(np.interp(s, at, radius))
                self.tapes[name] = (self.unit * place, u, v, self.unit * reach)

    def add(
        self,
        name: str,
        origin: FloatArray,
        frame: FloatArray,
        stations: FloatArray,
        sections: FloatArray,
        caps: tuple[float, float],
        blend: float,
        mirrored: bool = False,
        twin_blend: float = 0.0,
        carved: bool = False,
    ) -> None:
        """Adds a part; see `Loft`."""
        lengths = np.array([self.unit] * 6 + [1.0])
        self.parts[name] = Loft(
            origin=self.unit * origin,
            frame=frame,
            stations=self.unit * stations,
            sections=lengths * sections,
            caps=(self.unit * caps[0], self.unit * caps[1]),
            blend=self.unit * blend,
            mirrored=mirrored,
            twin_blend=self.unit * twin_blend,
            carved=carved,
        )

    def between(
        self,
        name: str,
        start: FloatArray,
        end: FloatArray,
        radii: Sequence[tuple],
        *,
        bow: FloatArray | float = 0.0,
        mirrored: bool = True,
        **loft,
    ) -> None:
        """Adds a part from point to point.

        Args:
            name: Its name.
            start: Start of the axis.
            end: End of the axis.
            radii: Radii along x and across at even steps from start to end.
            bow: Offsets of the centres along x at those steps.
            mirrored: See `Loft`.
            **loft: See `add`.
        """
        length = float(np.linalg.norm(end - start))
        axis = (end - start) / length
        v = np.cross(axis, UPRIGHT[0])
        v /= np.linalg.norm(v)
        n = len(radii)
        a, b = np.array(radii, dtype=np.float64).T
        self.add(
            name,
            start,
            np.array([np.cross(v, axis), v, axis]),
            np.linspace(0.0, length, n),
            np.column_stack([bow + np.zeros(n), np.zeros(n), a, a, b, b, np.full(n, 2.0)]),
            mirrored=mirrored,
            **loft,
        )

    def blob(
        self, name: str, centre: FloatArray, tip: FloatArray, half_axes: FloatArray, **loft
    ) -> None:
        """Adds a mirrored ellipsoid with its own half-axis in each direction.

        Args:
            name: Its name.
            centre: Centre of the left twin.
            tip: Direction of the axis, of any length.
            half_axes: Upwards, downwards, outwards (+y), inwards, and along the axis.
            **loft: See `add`.
        """
        tip = tip / np.linalg.norm(tip)
        up, down, out, inwards, forward = half_axes
        u = UPRIGHT[2] - tip[2] * tip
        u /= np.linalg.norm(u)
        v = np.cross(tip, u)
        sides = (out, inwards) if v[1] > 0.0 else (inwards, out)
        self.add(
            name,
            centre,
            np.array([u, v, tip]),
            1e-3 * forward * np.array([-1.0, 1.0]),
            np.array([[0.0, 0.0, up, down, *sides, 2.0]] * 2),
            caps=(forward, forward),
            mirrored=True,
            **loft,
        )
