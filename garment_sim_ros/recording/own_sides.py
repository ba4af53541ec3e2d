"""Cloth on the wrong side of the body: outside of the skin, but with the skin before its outside.

A trouser leg that hangs beside its shin is not *in* the shin. It is on the wrong side of it: it
went around that skin when it was put on, its outer face now looks at it, and on the way along the
limb from there to the root one comes through its fabric. How far from that skin it is counts as
penetration.

Folds turn outer faces to the skin, too, and so do hems that have ridden up and flared. But there
the way along the limb stays under the cloth, or leaves it through an opening.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.recording.limb_lines import LimbLines

if TYPE_CHECKING:  # reading a recording needs no simulation
    from garment_sim_ros.garment.garment import Garment

_FACING = -0.5
"""Cosine between a garment's outward normal and the way from the skin to it, below which its outer
face looks at the skin: folds turn cloth by up to a right angle."""
_UNDER_SKIN = 0.01
"""How deep under the skin its way to the root begins, so that cloth in it is around [m]."""
_MOST = 65536
"""Hits that are kept."""


@dataclass(frozen=True, kw_only=True)
class OwnSides:
    """Which skin garments are worn over.

    Attributes:
        covered: Whether each garment goes around each triangle of the skin at rest, by name,
            shape [t].
        skin_triangles: Vertex indices, shape [t, 3].
        lines: From any skin to the root.
    """

    covered: Mapping[str, NDArray[np.bool_]]
    skin_triangles: IntArray
    lines: LimbLines

    @classmethod
    def of(cls, garments: "Sequence[Garment]", body: Body) -> "OwnSides":
        """By the rest poses of garments and body."""
        skin = Skinner(body.skin).vertices(rest_transforms(body.rig))
        triangles = body.skin.triangles
        under = _under(skin, triangles, np.arange(len(triangles), dtype=np.int32))
        return cls(
            covered={
                g.name: MeshDistance(g.vertices, g.triangles).is_inside(under) for g in garments
            },
            skin_triangles=triangles,
            lines=LimbLines(body.rig, body.skin),
        )

    def behind(
        self,
        name: str,
        cloth: tuple[FloatArray, IntArray],
        normal: FloatArray,
        way: FloatArray,
        triangle: IntArray,
        skin: FloatArray,
    ) -> NDArray[np.bool_]:
        """Which points of a garment have skin that it is worn over before their outside.

        Args:
            name: The garment's name.
            cloth: Its vertices [m], shape [v, 3], and triangles.
            normal: Its outward unit normal at each point, shape [n, 3].
            way: The nearest skin and the point [m], shape [n, 2, 3].
            triangle: The triangle of that skin, shape [n].
            skin: Posed skin vertices [m], shape [s, 3].
        """
        away = way[:, 1] - way[:, 0]
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        faces = np.einsum("ni,ni->n", normal, away) < _FACING * length
        found: NDArray[np.bool_] = faces & self.covered[name][triangle]
        near = np.unique(triangle[found])
        return found & np.isin(triangle, near[self._is_left(near, cloth, skin)])

    def _is_left(
        self, some: IntArray, cloth: tuple[FloatArray, IntArray], skin: FloatArray
    ) -> NDArray[np.bool_]:
        """Whether the way to the root from some triangles of the skin comes through the fabric."""
        points = self.lines.posed(skin)
        joints, index = np.unique(self.lines.joint[some], return_inverse=True)
        paths = [self.lines.to_root(int(j)) for j in joints]
        legs = sorted({pair for path in paths for pair in pairwise(path)})
        first = np.array([path[0] for path in paths], np.int32)[index]
        begins = np.stack([_under(skin, self.skin_triangles, some), points[first]], axis=1)
        ends = np.concatenate([begins, points[np.array(legs, np.int32).reshape(-1, 2)]])
        core, at = np.empty(_MOST, np.int32), np.empty(_MOST)
        count = min(find_hits(ends, *cloth, core, at), _MOST)
        hits = np.bincount(core[:count], minlength=len(ends))
        of_leg = dict(zip(legs, hits[len(some) :].tolist(), strict=True))
        beyond = [sum(of_leg[p] for p in pairwise(path)) for path in paths]
        return np.asarray((hits[: len(some)] + np.array(beyond, np.int64)[index]) % 2 == 1)


def _under(skin: FloatArray, triangles: IntArray, some: IntArray) -> FloatArray:
    """Points just under the middle of some triangles of a skin [m], shape [n, 3]."""
    a, b, c = (skin[triangles[some, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    return np.asarray((a + b + c) / 3.0 - _UNDER_SKIN * normal)
