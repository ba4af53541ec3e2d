"""Cloth on the wrong side of the body: outside of the skin, but with the skin before its outside.

A trouser leg that hangs beside its shin is not *in* the shin. It is on the wrong side of it: its
outer face looks at skin that it is worn over. How far from that skin it is counts as penetration.
Folds turn outer faces to the skin, too, but there the cloth itself lies between.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.contact.packed import pack
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.contact.sides import UNDER
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.sim.sides import shape_sides

_FACING = -0.5
"""Cosine between a garment's outward normal and the way from the skin to it, below which its outer
face looks at the skin: folds turn cloth by up to a right angle."""
_SHORT = 0.05
"""Share of the way next to a point in which cloth is the one that the point is on."""
_MOST = 65536
"""Hits that are kept: one for each point would do."""


@dataclass(frozen=True, kw_only=True)
class OwnSides:
    """Which skin belongs under which points of garments.

    Attributes:
        bone: Bone of each triangle of the skin, an index into the columns of `under`, shape [t].
        under: Whether each bone belongs under each vertex, by garment, shape [v, b].
    """

    bone: IntArray
    under: Mapping[str, NDArray[np.bool_]]

    @classmethod
    def of(cls, garments: Sequence[Garment], body: Body, colliders: ColliderSet) -> "OwnSides":
        """By the sides on which colliders are in the garments' rest pose, see `shape_sides`."""
        shapes = pack(colliders)
        bone_of_shape = [colliders.colliders[i].bone for i in shapes.collider]
        bones = sorted(set(bone_of_shape))
        number = {name: k for k, name in enumerate(bones)}
        column = np.array([number[name] for name in bone_of_shape], np.int64)
        under = {}
        for garment in garments:
            row, side = shape_sides(garment, colliders, shapes)
            belongs = np.ones((len(side), len(bones) + 1), bool)
            belongs[:, -1] = False
            for shape, k in enumerate(column):
                belongs[:, k] &= side[:, shape] == UNDER
            under[garment.name] = belongs[row]
        rig = body.rig
        of_joint = np.full(len(rig), len(bones), np.int32)
        for j, name in enumerate(rig.joint_names):
            above = int(rig.parent[j])
            of_joint[j] = number.get(name, of_joint[above] if above >= 0 else len(bones))
        skin = body.skin
        first = np.take_along_axis(skin.bone, skin.weight.argmax(axis=1)[:, None], axis=1)[:, 0]
        return cls(bone=of_joint[first[skin.triangles[:, 0]]], under=under)

    def behind(
        self,
        name: str,
        corners: IntArray,
        normal: FloatArray,
        way: FloatArray,
        triangle: IntArray,
        cloth: tuple[FloatArray, IntArray],
    ) -> NDArray[np.bool_]:
        """Which points of a garment have skin that they are worn over before their outside.

        Args:
            name: The garment's name.
            corners: A vertex that each point belongs to, shape [n].
            normal: The garment's outward unit normal at each, shape [n, 3].
            way: The nearest skin and the point [m], shape [n, 2, 3].
            triangle: The triangle of that skin, shape [n].
            cloth: The garment's vertices [m], shape [v, 3], and triangles.
        """
        away = way[:, 1] - way[:, 0]
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        faces = np.einsum("ni,ni->n", normal, away) < _FACING * length
        found: NDArray[np.bool_] = faces & self.under[name][corners, self.bone[triangle]]
        some = np.flatnonzero(found)
        ends = way[some]
        ends[:, 1] -= _SHORT * away[some]
        core, at = np.empty(_MOST, np.int32), np.empty(_MOST)
        count = find_hits(ends, *cloth, core, at)
        found[some[core[: min(count, _MOST)]]] = False
        return found
