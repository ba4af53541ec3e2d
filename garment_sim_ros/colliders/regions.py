"""Rigid and flexible regions of the skin, from the skin weights.

Every vertex belongs to the bone with the largest weight. Regions meet on the line where two bones
weigh the same: a triangle that the line crosses is cut there, so that the regions' pieces cover
all of the surface and not only its vertices.
"""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.major_bones import MajorBones, major_bones
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.geometry.transforms import invert_transform
from garment_sim_ros.geometry.triangles import area_vectors, vertex_areas

_ALSO = ("leftToes", "rightToes")
_LIMBS = tuple(
    (f"{side}{part}", f"{side}{end}")
    for side in ("left", "right")
    for part, end in (("UpperArm", "LowerArm"), ("UpperLeg", "LowerLeg"))
)
_FAR = (2.0, 2.5)
"""Distances from a limb's bone, as multiples of its skin's median distance, from which on the limb
moves skin less, and not at all."""


@dataclass(frozen=True, kw_only=True)
class Regions:
    """The skin divided among bones.

    Attributes:
        names: Joint name of each bone, length m.
        joint: Its joint index, shape [m].
        first: The joint from which on it turns, shape [m], see `MajorBones`.
        human: The humanoid bone that it is, "" for none, length m.
        parent: Region above each, -1 at the top, shape [m].
        weight: Skin weights summed over the joints that belong to each bone, shape [v, m].
        owner: Bone with the largest weight at each vertex, shape [v].
    """

    names: tuple[str, ...]
    joint: IntArray
    first: IntArray
    human: tuple[str, ...]
    parent: IntArray
    weight: FloatArray
    owner: IntArray

    def __len__(self) -> int:
        return len(self.names)


def skin_regions(body: Body, *, merge: float = 0.0) -> Regions:
    """Regions of a body's major bones, and of its toes, which bend far.

    Args:
        body: Rig and skin.
        merge: A region with less than this share of the skin's area joins the one above it, or
            the largest one below it if it is the topmost.
    """
    bones = major_bones(body, also=_ALSO)
    weight = bone_weights(body.skin, bones)
    _give_back_the_trunk(body, bones, weight)
    area = vertex_areas(body.skin.vertices, body.skin.triangles)
    parent = bones.parent.copy()
    alive = np.ones(len(bones), dtype=np.bool_)
    while True:
        owner = np.where(alive, weight, -1.0).argmax(axis=1)
        share = np.bincount(owner, area, minlength=len(bones)) / area.sum()
        small = [m for m in np.flatnonzero(alive) if share[m] < merge]
        if not small or alive.sum() == 1:
            break
        m = min(small, key=lambda r: share[r])
        target = int(parent[m])
        below = np.flatnonzero(alive & (parent == m))
        if target < 0:
            others = below if len(below) else np.flatnonzero(alive & (np.arange(len(bones)) != m))
            target = int(others[np.argmax(share[others])])
            parent[target] = -1
        weight[:, target] += weight[:, m]
        weight[:, m] = 0.0
        alive[m] = False
        parent[below[below != target]] = target
    kept = np.flatnonzero(alive)
    number = np.full(len(bones) + 1, -1, dtype=np.int32)  # the last one is for parent -1
    number[kept] = np.arange(len(kept))
    return Regions(
        names=tuple(bones.names[m] for m in kept),
        joint=bones.joint[kept],
        first=bones.first[kept],
        human=tuple(bones.human[m] for m in kept),
        parent=number[parent[kept]],
        weight=np.ascontiguousarray(weight[:, kept]),
        owner=number[owner],
    )


def _give_back_the_trunk(body: Body, bones: MajorBones, weight: FloatArray) -> None:
    """Takes from limbs the weights of skin that lies far from them.

    A rig may hang a strip of the trunk's side on the upper arm: a collider of both would go
    through cloth, as a wing, with every move of the arm.

    Args:
        body: Rig and skin.
        bones: Its major bones.
        weight: Skin weights of each bone, changed in place, shape [v, m].
    """
    x = body.skin.vertices
    place = {
        bone: invert_transform(body.skin.T_bone_bind[number])[:3, 3]
        for bone, number in zip(bones.human, bones.first, strict=True)
    }
    for bone, below in _LIMBS:
        if bone not in place or below not in place:
            continue
        m = bones.human.index(bone)
        start, along = place[bone], place[below] - place[bone]
        s = np.clip((x - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        distance = np.linalg.norm(x - start - s[:, None] * along, axis=1)
        own = weight.argmax(axis=1) == m
        if not own.any():
            continue
        share = (_FAR[1] - distance / np.median(distance[own])) / (_FAR[1] - _FAR[0])
        kept = weight[:, m] * np.clip(share, 0.0, 1.0)
        others = weight.sum(axis=1) - weight[:, m]
        # What nothing else moves stays, however far.
        far = (kept < weight[:, m]) & (others > 1e-3)
        scale = 1.0 + (weight[:, m] - kept)[far] / others[far]
        weight[far] *= scale[:, None]
        weight[far, m] = kept[far]


def region_surface(skin: Skin, regions: Regions, region: int) -> FloatArray:
    """A region's piece of the surface in the bind pose: corners of triangles [m], shape [t, 3, 3].

    Triangles that several regions share are cut where two bones weigh the same, those of three
    regions also at their centres, so that all pieces together are the whole surface.
    """
    owner = regions.owner[skin.triangles]
    mine = owner == region
    count = mine.sum(axis=1)
    pieces = [skin.vertices[skin.triangles[count == 3]]]
    for lone in (True, False):  # one corner is ours, or one is not
        cut = np.flatnonzero(count == (1 if lone else 2))
        first = np.argmax(mine[cut] == lone, axis=1)
        a, b, c = (skin.triangles[cut, (first + k) % 3] for k in range(3))
        ab, ac = _border(skin, regions, a, b), _border(skin, regions, a, c)
        xa, xb, xc = skin.vertices[a], skin.vertices[b], skin.vertices[c]
        if not lone:
            pieces += [np.stack([ab, xb, xc], axis=1), np.stack([ab, xc, ac], axis=1)]
            continue
        pieces.append(np.stack([xa, ab, ac], axis=1))
        three = regions.owner[b] != regions.owner[c]
        centre = (xa + xb + xc)[three] / 3.0
        pieces.append(np.stack([ab[three], centre, ac[three]], axis=1))
    return np.concatenate(pieces)


def _border(skin: Skin, regions: Regions, i: IntArray, j: IntArray) -> FloatArray:
    """Where the owners of vertices i and j weigh the same on the edge between, shape [n, 3]."""
    swap = i > j  # the same bits from both sides
    i, j = np.where(swap, j, i), np.where(swap, i, j)
    a, b = regions.owner[i], regions.owner[j]
    lead = regions.weight[i, a] - regions.weight[i, b]
    lag = regions.weight[j, b] - regions.weight[j, a]
    s = (lead / np.maximum(lead + lag, 1e-12))[:, None]
    return (1.0 - s) * skin.vertices[i] + s * skin.vertices[j]


def bone_weights(skin: Skin, bones: MajorBones) -> FloatArray:
    """Skin weights summed over the joints that each major bone owns, shape [v, m]."""
    vertices, influences = skin.bone.shape
    weights = np.zeros((vertices, len(bones.names)))
    row = np.repeat(np.arange(vertices), influences)
    np.add.at(weights, (row, bones.owner[skin.bone].ravel()), skin.weight.ravel())
    return weights


def skin_normals(skin: Skin) -> FloatArray:
    """Area-weighted unit normals, zero where there is no area, shape [v, 3]."""
    vectors = area_vectors(skin.vertices, skin.triangles)
    normals = np.zeros_like(skin.vertices)
    for corner in range(3):
        np.add.at(normals, skin.triangles[:, corner], vectors)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0.0, length, 1.0)
