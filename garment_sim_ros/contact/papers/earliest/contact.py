"""Contact by the earliest hit (Gong et al., 4), an option of the `relaxation` solver.

What `contact.papers.earliest.hit` does, on the shapes as a simulation has posed them. All shapes
count for all particles: there are no sides, and nothing passes.
"""

import numpy as np

from garment_sim_ros.arrays import IntArray, SingleArray
from garment_sim_ros.contact.kinds.ellipsoid import ELLIPSOID
from garment_sim_ros.contact.packed import PackedShapes, PosedShapes
from garment_sim_ros.contact.papers.earliest.hit import meet, response_numbers, room_for
from garment_sim_ros.jit import kernel
from garment_sim_ros.params import RelaxationSettings

_ELLIPSOID = ELLIPSOID.code


class EarliestContact:
    """Scratch arrays of one garment's contact.

    Args:
        shapes: The shapes, spheres and ellipsoids.
    """

    def __init__(self, shapes: PackedShapes) -> None:
        m = len(shapes.kind)
        self._start = np.zeros((m, 15))
        self._end = np.zeros((m, 15))
        self._scratch = room_for(m)

    def meet(
        self,
        shapes: PackedShapes,
        posed: PosedShapes,
        x_start: SingleArray,
        x: SingleArray,
        v: SingleArray,
        thickness: float,
        friction: float,
        settings: RelaxationSettings,
        dt: float,
        hit: IntArray,
    ) -> int:
        """Moves particles out of all shapes and changes their velocities.

        Args:
            shapes: Packed shapes.
            posed: The same, posed for this step.
            x_start: Positions at the start of the step [m], shape [n, 3].
            x: Proposed positions at its end, corrected in place [m], shape [n, 3].
            v: Velocities, corrected in place [m/s], shape [n, 3].
            thickness: Distance to keep from the surfaces [m]: radii grow by it.
            friction: Coulomb coefficient.
            settings: Which response, and its restitution.
            dt: Step [s].
            hit: Output: the shape that each particle met, -1 for none, shape [n].

        Returns:
            Number of particles that met a shape.
        """
        if len(shapes.kind) == 0:
            hit[:] = -1
            return 0
        _fill(shapes, posed, thickness, self._start, self._end)
        return int(
            meet(
                self._start,
                self._end,
                self._scratch,
                x_start,
                x,
                v,
                dt,
                *response_numbers(settings.response, settings.restitution, friction),
                hit,
            )
        )


@kernel()
def _fill(shapes, posed, thickness, start, end):
    """Tables (`PosedEllipsoids.table`) of inflated shapes at both ends of the step."""
    for k in range(shapes.kind.size):
        C = posed.carry[k]
        R = posed.rotation[k]
        for r in range(3):
            # A point p fixed to the shape ends at p + C p + offset: back by the transpose.
            centre = 0.0
            for c in range(3):
                turned = C[c, r] + (1.0 if c == r else 0.0)
                centre += turned * (posed.centre[k, c] - C[c, 3])
            start[k, r] = centre
            end[k, r] = posed.centre[k, r]
            radius = shapes.size[k, r if shapes.kind[k] == _ELLIPSOID else 0] + thickness
            start[k, 12 + r] = radius
            end[k, 12 + r] = radius
            for c in range(3):
                before = 0.0
                for i in range(3):
                    before += (C[i, c] + (1.0 if i == c else 0.0)) * R[i, r]
                start[k, 3 + 3 * r + c] = before / radius
                end[k, 3 + 3 * r + c] = R[c, r] / radius
