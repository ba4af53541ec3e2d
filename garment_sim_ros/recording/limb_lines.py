"""Lines through the middle of the limbs, from any skin to the root: what a garment is worn along.

A point of the line is the mean of the skin of a joint, or of the skin that it shares with the
joint above it, so that the line follows the skin in every pose, without the rig.
"""

import numpy as np
from scipy.sparse import csr_matrix

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.body.skin import Skin

_SHARES = 0.2
"""Weight of both joints from which on they share a vertex."""


class LimbLines:
    """The lines of one body.

    Args:
        rig: Its skeleton.
        skin: Its surface.

    Attributes:
        joint: The joint that the first corner of each triangle follows most, shape [t].
    """

    def __init__(self, rig: Rig, skin: Skin) -> None:
        weight = np.zeros((len(skin.vertices), len(rig)))
        np.add.at(weight, (np.arange(len(weight))[:, None], skin.bone), skin.weight)
        most = weight.argmax(axis=1)
        self.joint: IntArray = most[skin.triangles[:, 0]].astype(np.int32)
        rows: list[IntArray] = []
        middle = np.full(len(rig), -1)
        self._path: list[list[int]] = [[] for _ in range(len(rig))]
        for j in range(len(rig)):
            above = int(rig.parent[j])
            while above >= 0 and middle[above] < 0:
                above = int(rig.parent[above])
            own = np.flatnonzero(most == j)
            path = [] if above < 0 else self._path[above]
            if len(own):
                shared = [] if above < 0 else weight[:, [above, j]].min(axis=1) >= _SHARES
                ring = np.flatnonzero(shared)
                if len(ring):
                    path = [len(rows), *path]
                    rows.append(ring.astype(np.int32))
                middle[j] = len(rows)
                path = [len(rows), *path]
                rows.append(own.astype(np.int32))
            self._path[j] = path
        start = np.cumsum([0, *map(len, rows)])
        share = np.repeat([1.0 / len(r) for r in rows], np.diff(start))
        shape = (len(rows), len(weight))
        self._mean = csr_matrix((share, np.concatenate([*rows, []]), start), shape=shape)

    def posed(self, skin: FloatArray) -> FloatArray:
        """Points of all lines [m], shape [p, 3], from posed skin vertices [m]."""
        return np.asarray(self._mean @ skin)

    def to_root(self, joint: int) -> list[int]:
        """Points of the line from a joint's middle to the root's."""
        return self._path[joint]
