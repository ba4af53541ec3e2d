"""A human surface in 15 named regions (Gong et al., 2.2).

The surface alone decides, in the body's own frame: a body that lies or stands on its head has the
same regions. A vertex belongs to the head, an arm or a leg if it is nearer to that part's end than
the neck, armpit or crotch is, by geodesic distance; arms and legs are split at elbow and knee in
the same way; what remains is the torso, split in six by waist, chest and the plane between the
armpits.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.ellipsoids.thresholds import REGIONS, SIDES, TORSO
from garment_sim_ros.colliders.segmentation.body_surface import BodySurface, body_surface
from garment_sim_ros.colliders.segmentation.feature_points import FeaturePoints, feature_points
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.geodesics import mesh_graph
from garment_sim_ros.geometry.topology import edge_table

_NEEDED = ("front", "crotch", "neck", "armpits")
_DOUBT = 1.5
"""With so much doubt in these, one less the confidence each, a surface with five ends is none of a
human. Bodies of games have up to 0.4."""
_FEW = 4
"""A region with fewer vertices than this is none."""
_TIE = 1e-6
"""Lengths that differ by less than this share of the stature are equal."""
_JOINTS = {
    "neck": "neck",
    "left_elbow": "leftLowerArm",
    "right_elbow": "rightLowerArm",
    "left_knee": "leftLowerLeg",
    "right_knee": "rightLowerLeg",
}


@dataclass(frozen=True)
class Segmentation:
    """A body's surface in regions.

    Attributes:
        region: Index into `REGIONS` of each vertex of the file, shape [n].
        surface: The repaired surface.
        surface_region: The same of each of its vertices, shape [v].
        features: What the division follows.
    """

    region: IntArray
    surface: BodySurface
    surface_region: IntArray
    features: FeaturePoints

    @property
    def confidence(self) -> float:
        """How sure the whole is: as sure as its least sure decision, 0 to 1."""
        return min(self.features.confidence.values())

    def report(self) -> dict[str, Any]:
        """Feature points, what was assumed and repaired, and how sure it is."""
        f = self.features
        return {
            "height_m": round(f.ends.height, 4),
            "confidence": round(self.confidence, 3),
            "confidence_of": {k: round(v, 3) for k, v in f.confidence.items()},
            "assumed": [*self.surface.notes, *f.notes],
            "points": {k: np.round(p, 4).tolist() for k, p in f.point.items()},
            "regions": {name: int((self.region == i).sum()) for i, name in enumerate(REGIONS)},
        }


def rig_joints(body: Body) -> dict[str, FloatArray]:
    """Positions of the joints that the rig of a body names among neck, elbows and knees [m]."""
    origin = rest_transforms(body.rig)[:, :3, 3]
    return {
        name: origin[body.rig.index(body.humanoid[bone])]
        for name, bone in _JOINTS.items()
        if bone in body.humanoid
    }


def segment(
    vertices: FloatArray,
    triangles: IntArray,
    *,
    constants: str = "anthropometry",
    sex: str = "female",
    paths: str = "unfolded",
    joints: Mapping[str, FloatArray] | None = None,
) -> Segmentation:
    """Divide a human surface into the 15 regions.

    Args:
        vertices: Positions [m], shape [n, 3].
        triangles: Vertex indices, shape [t, 3].
        constants: Where elbow, knee and neck are taken from, see `feature_points`.
        sex: For the paper's constants.
        paths: Kind of geodesic, see `mesh_graph`.
        joints: Joints of a rig, see `rig_joints`; None: the surface alone decides.

    Raises:
        GeometryError: The surface is not that of one human.
    """
    surface = body_surface(vertices, triangles)
    graph = mesh_graph(surface.vertices, surface.triangles, paths=paths, bridges=surface.bridges)
    features = feature_points(surface, graph, constants=constants, sex=sex, joints=joints)
    doubt = {k: 1.0 - features.confidence[k] for k in _NEEDED}
    if sum(doubt.values()) > _DOUBT:
        missing = [k for k, d in doubt.items() if d > 0.5]
        raise GeometryError(f"no human shape: nothing like {', '.join(missing)} was found")
    region = _divide(surface, features)
    _connect(surface, region)
    empty = [REGIONS[i] for i in range(len(REGIONS)) if (region == i).sum() < _FEW]
    if empty:
        raise GeometryError(
            f"no vertices in {', '.join(empty)}: the mesh is too coarse or no human"
        )
    return Segmentation(region[surface.vertex], surface, region, features)


def _divide(surface: BodySurface, features: FeaturePoints) -> IntArray:
    """Region of every vertex, by equation (3)."""
    x, ends, level = surface.vertices, features.ends, features.level
    height = x @ ends.axes[2]
    normal, offset = features.mid_plane
    offset -= _TIE * ends.height  # what lies on the plane is of one side, whatever the rounding
    row = np.where(height > features.chest, 0, np.where(height > features.waist, 1, 2))
    region = (TORSO[0] + 2 * row + (x @ normal < offset)).astype(np.int32)
    # Where two limbs claim a vertex, the one whose inner end is relatively farther has it.
    claim = np.ones(len(x))
    parts = [("head", "head", "neck", "", "head")]
    for side in SIDES:
        parts.append(
            (
                f"{side}_hand",
                f"{side}_upper_arm",
                f"{side}_armpit",
                f"{side}_elbow",
                f"{side}_forearm",
            )
        )
        parts.append(
            (f"{side}_foot", f"{side}_thigh", f"{side}_crotch", f"{side}_knee", f"{side}_calf")
        )
    for end, inner, whole, joint, outer in parts:
        way = ends.of(end)
        share = way / level[whole]
        mine = share < claim - _TIE
        claim[mine] = share[mine]
        region[mine] = REGIONS.index(inner)
        if joint:
            region[mine & (way < level[joint])] = REGIONS.index(outer)
    return region


def _connect(surface: BodySurface, region: IntArray) -> None:
    """Make every region connected: fragments go to the region they border most."""
    pairs = np.concatenate([edge_table(surface.triangles)[0], surface.bridges])
    v = len(region)
    for _ in range(len(REGIONS)):
        inner = region[pairs[:, 0]] == region[pairs[:, 1]]
        a, b = pairs[inner].T
        links = coo_matrix((np.ones(len(a), np.int8), (a, b)), shape=(v, v))
        count, part = connected_components(links, directed=False)
        size = np.bincount(part, minlength=count)
        region_of = np.zeros(count, np.int32)
        region_of[part] = region
        # The largest part of each region is the region.
        order = np.lexsort((-size, region_of))
        first = np.concatenate([[True], region_of[order][1:] != region_of[order][:-1]])
        fragment = np.ones(count, bool)
        fragment[order[first]] = False
        if not fragment.any():
            return
        border = pairs[~inner]
        border = np.concatenate([border, border[:, ::-1]])
        border = border[fragment[part[border[:, 0]]] & ~fragment[part[border[:, 1]]]]
        if not len(border):
            return
        key = part[border[:, 0]].astype(np.int64) * len(REGIONS) + region[border[:, 1]]
        votes, times = np.unique(key, return_counts=True)
        chosen: dict[int, tuple[int, int]] = {}
        for k, n in zip(votes.tolist(), times.tolist()):
            own, other = divmod(k, len(REGIONS))
            if n > chosen.get(own, (0, 0))[0]:
                chosen[own] = (n, other)
        for own, (_, other) in chosen.items():
            region[part == own] = other
