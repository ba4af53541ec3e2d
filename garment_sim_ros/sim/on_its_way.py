"""Cloth that was moved elsewhere is shown on its way there.

Where a garment is wound back it is simulated from where it is put at once: only there can contact
hold it. Seen is it on the way, as it would else jump by tens of centimetres in a frame: what it
was off from there goes to zero evenly, turning with the skin, as fast as an eye can follow. It may
pass through a limb on the way, as it was through one before.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.sim.placement import GarmentLike

_SPEED = 2.1
"""Of the particle with the longest way, against the skin [m/s]: 3.5 cm in a 60th of a second."""
_LONGEST = 0.23
"""Longest time on the way [s]; what is farther is faster: 5 cm in a 60th from 69 cm on."""


class OnItsWay:
    """What a garment is shown off its place.

    Args:
        garment: The garment.
        speed: Of the vertex with the longest way, against the skin [m/s].
        longest: Longest time on the way [s].

    Attributes:
        left: How much of the way is left, from 1 to 0.
    """

    def __init__(
        self, garment: GarmentLike, speed: float = _SPEED, longest: float = _LONGEST
    ) -> None:
        self._speed, self._longest = speed, longest
        self._index = np.asarray(garment.frame_index)
        self._weight = np.asarray(garment.frame_weight, dtype=np.float64)
        self.left = 0.0
        self._rate = 0.0
        self._off: FloatArray = np.zeros((0, 3))
        self._R_then: FloatArray = np.zeros((0, 3, 3))
        self._now: SingleArray = np.zeros((0, 3), np.float32)

    def begin(self, off: FloatArray, T_world_frame: FloatArray) -> None:
        """Sets out.

        Args:
            off: Where each vertex is seen, less where it is put [m], shape [v, 3].
            T_world_frame: World transforms of the garment's frames, shape [b, 4, 4].
        """
        longest = float(np.linalg.norm(off, axis=1).max(initial=0.0))
        self.left = 1.0 if 0.0 < longest < np.inf else 0.0
        self._rate = 1.0 / max(min(longest / self._speed, self._longest), 1e-9)
        self._off, self._now = off.copy(), off.astype(np.float32)
        self._R_then = T_world_frame[:, :3, :3].copy()

    def go(self, dt: float, T_world_frame: FloatArray) -> None:
        """Goes on for some time [s], with the frames where they are then."""
        self.left = max(0.0, self.left - self._rate * dt)
        if self.left > 0.0:
            turned = turn_with(
                self._off, self._index, self._weight, self._R_then, T_world_frame[:, :3, :3]
            )
            self._now = (self.left * turned).astype(np.float32)

    def add_to(self, x_world: SingleArray) -> None:
        """Moves vertices [m], shape [v, 3], to where they are seen, in place."""
        if self.left > 0.0:
            x_world += self._now

    def end(self) -> None:
        """It is seen where it is from now on."""
        self.left = 0.0


def turn_with(
    off: FloatArray,
    index: NDArray[np.integer],
    weight: FloatArray,
    R_then: FloatArray,
    R_now: FloatArray,
) -> FloatArray:
    """Turns what vertices are off their places as skin there turned.

    Args:
        off: Offsets [m], shape [v, 3].
        index: Frames that each vertex follows, shape [v, k].
        weight: By how much, shape [v, k].
        R_then: Rotations of the frames, shape [b, 3, 3].
        R_now: The same later.

    Returns:
        Offsets of the same lengths, shape [v, 3].
    """
    turned = R_now @ R_then.transpose(0, 2, 1)
    R = (weight[:, :, None, None] * turned[index]).sum(axis=1)
    length = np.linalg.norm(off, axis=1, keepdims=True)
    result: FloatArray = np.einsum("vij,vj->vi", R, off)
    # A blend of rotations shortens.
    result *= length / np.maximum(np.linalg.norm(result, axis=1, keepdims=True), 1e-9)
    return result
