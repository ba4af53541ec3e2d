"""Ellipsoids around a body: segmentation, then refinement (Gong et al., 2 and 3).

Also the same without segmentation, as in their ref. [19] (Tang Y. et al. 2013, adaptive
ellipsoids), for comparison and for bodies that are no humans.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.ellipsoids.pruned_kmeans import Clustering, refine
from garment_sim_ros.colliders.ellipsoids.thresholds import REGIONS, TORSO, region_thresholds
from garment_sim_ros.colliders.segmentation.segmentation import (
    Segmentation,
    rig_joints,
    segment,
)
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.mvee import Ellipsoid, mvee
from garment_sim_ros.params import EllipsoidSettings, declarations, validated

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

PARTS = ("torso", *REGIONS[:9])
"""Parts of a body that are refined one by one: the torso's six regions together."""
SEGMENTATIONS = declarations(EllipsoidSettings)["segmentation"].choices
COVERS = ("triangles", "vertices")
_ALWAYS = 1e-9
"""A threshold that every fit error exceeds [m]."""


@dataclass(frozen=True)
class EllipsoidFit:
    """Ellipsoids around the skin of a body in its bind pose.

    Attributes:
        ellipsoids: The ellipsoids.
        region: Name of the region that each was fitted to; ``body`` without segmentation.
        label: Ellipsoid of each skin vertex, shape [v].
        members: Skin vertices that each ellipsoid holds; some are in several.
        error: Mean radial distance of each one's own vertices to it, equation (6) [m].
        segmentation: None without segmentation.
    """

    ellipsoids: tuple[Ellipsoid, ...]
    region: tuple[str, ...]
    label: IntArray
    members: tuple[IntArray, ...]
    error: FloatArray
    segmentation: Segmentation | None

    @property
    def mean_error(self) -> float:
        """Equation (6) over all vertices [m]."""
        return float(self.error[self.label].mean())

    def report(self) -> dict[str, Any]:
        """Counts and errors, whole and by region, and what the segmentation assumed."""
        count = {name: self.region.count(name) for name in dict.fromkeys(self.region)}
        of_region = np.array(self.region)[self.label]
        result: dict[str, Any] = {
            "ellipsoids": len(self.ellipsoids),
            "mean_error_mm": round(1e3 * self.mean_error, 3),
            "largest_error_mm": round(1e3 * float(self.error.max()), 3),
            "ellipsoids_of": {
                name: {
                    "ellipsoids": n,
                    "mean_error_mm": round(
                        1e3 * float(self.error[self.label[of_region == name]].mean()), 3
                    ),
                }
                for name, n in count.items()
                if (of_region == name).any()
            },
        }
        if self.segmentation is not None:
            result["segmentation"] = self.segmentation.report()
        return result


def ellipsoids_around(
    body: Body,
    settings: EllipsoidSettings | None = None,
    *,
    sex: str = "female",
    cover: str = "triangles",
    counts: Mapping[str, int] | None = None,
) -> EllipsoidFit:
    """Fit ellipsoids to a body's skin in its bind pose.

    Args:
        body: Rig and skin.
        settings: Thresholds and more. The torso's six regions share the smallest of theirs; at
            most as many ellipsoids are made as it says, the worst in relation to their thresholds
            being split first.
        sex: For the paper's constants.
        cover: ``triangles``: every triangle is inside one ellipsoid, and so is the whole skin
            inside their union; ``vertices``, as in the paper.
        counts: Ellipsoids of each of `PARTS` (or of ``body`` without segmentation), instead of
            thresholds; the torso has at least 6.

    Raises:
        GeometryError: The body cannot be segmented.
        ParameterError: An option is out of range.
    """
    s = settings or EllipsoidSettings()
    s = validated(
        EllipsoidSettings, {name: getattr(s, name) for name in declarations(EllipsoidSettings)}
    )
    thresholds = region_thresholds(s)
    if cover not in COVERS:
        raise ParameterError("cover", f"found {cover!r}", f"allowed: {COVERS}")
    x = body.skin.vertices
    if s.segmentation == "none":
        whole = Clustering.start(x, np.zeros(len(x), np.int32), sigma=0.0, use_rule=False)
        if counts is None:
            refine([whole], [min(s.mu_torso, s.mu_limb)], s.max_ellipsoids)
        else:
            refine([whole], [_ALWAYS], counts["body"])
        return _gathered(body, [(np.arange(len(x)), whole, ("body",))], None, cover)

    divided = segment_body(body, s.segmentation, sex=sex)
    # Vertices at one place (seams) count once, as on the repaired surface.
    _, first = np.unique(divided.surface.vertex, return_index=True)
    region = divided.region[first]
    parts = []
    thresholds_of_parts = []
    for group in (TORSO, *((i,) for i in range(len(REGIONS)) if i not in TORSO)):
        mine = first[np.isin(region, group)]
        parts.append((mine, Clustering.start(x[mine], divided.region[mine], sigma=s.sigma), group))
        thresholds_of_parts.append(min(thresholds[REGIONS[i]] for i in group))
    if counts is None:
        refine([part for _, part, _ in parts], thresholds_of_parts, s.max_ellipsoids)
    else:
        for name, (_, part, _) in zip(PARTS, parts):
            refine([part], [_ALWAYS], counts[name])
    named = [(mine, part, tuple(REGIONS[i] for i in group)) for mine, part, group in parts]
    return _gathered(body, named, divided, cover)


def segment_body(body: Body, segmentation: str = "auto", *, sex: str = "female") -> Segmentation:
    """The 15 regions of a body, its joints taken as `ellipsoids_around` says.

    Raises:
        GeometryError: The body is no human.
        ParameterError: ``none``, ``rig`` without named joints, or an unknown segmentation.
    """
    if segmentation not in SEGMENTATIONS or segmentation == "none":
        raise ParameterError(
            "segmentation", f"found {segmentation!r}", "allowed: one with regions"
        )
    return segment(
        body.skin.vertices,
        body.skin.triangles,
        constants="table1" if segmentation == "table1" else "anthropometry",
        sex=sex,
        joints=_joints(body, segmentation),
    )


def _joints(body: Body, segmentation: str) -> dict[str, FloatArray] | None:
    joints = rig_joints(body)
    if segmentation == "rig" and not joints:
        raise ParameterError("segmentation", "found 'rig'", "the body's rig names no joint")
    return joints if joints and segmentation in ("auto", "rig") else None


def _gathered(
    body: Body,
    parts: list[tuple[NDArray[np.intp], Clustering, tuple[str, ...]]],
    divided: Segmentation | None,
    cover: str,
) -> EllipsoidFit:
    """All parts' ellipsoids in one list, extended over whole triangles where asked."""
    x, triangles = body.skin.vertices, body.skin.triangles
    label = np.full(len(x), -1, dtype=np.int32)
    ellipsoids: list[Ellipsoid] = []
    regions: list[str] = []
    for mine, part, names in parts:
        label[mine] = part.label + len(ellipsoids)
        for i, cluster in enumerate(part.clusters):
            name = names[0]
            if divided is not None and len(names) > 1:
                votes = np.bincount(divided.region[mine[part.label == i]], minlength=len(REGIONS))
                name = REGIONS[int(votes.argmax())]
            ellipsoids.append(cluster.ellipsoid)
            regions.append(name)
    if divided is not None:
        _, first, inverse = np.unique(
            divided.surface.vertex, return_index=True, return_inverse=True
        )
        label = label[first][inverse]
    members = [np.flatnonzero(label == i).astype(np.int32) for i in range(len(ellipsoids))]
    if cover == "triangles":
        members = _over_triangles(x, triangles, label, ellipsoids, members)
        ellipsoids = [mvee(x[m], tolerance=1e-3) for m in members]
    error = np.array(
        [e.radial_error(x[label == i]).mean() for i, e in enumerate(ellipsoids)], np.float64
    )
    return EllipsoidFit(tuple(ellipsoids), tuple(regions), label, tuple(members), error, divided)


def _over_triangles(
    x: FloatArray,
    triangles: IntArray,
    label: IntArray,
    ellipsoids: list[Ellipsoid],
    members: list[IntArray],
) -> list[IntArray]:
    """Members such that every triangle lies within one ellipsoid: the one that grows least."""
    corner = label[triangles]
    mixed = triangles[(corner != corner[:, :1]).any(axis=1)]
    zeta = np.zeros(mixed.shape)
    for k in range(3):
        for o in np.unique(label[mixed[:, k]]):
            own = label[mixed[:, k]] == o
            values = ellipsoids[o].zeta(x[mixed[own]].reshape(-1, 3))
            zeta[own, k] = values.reshape(-1, 3).max(axis=1)
    owner = label[mixed[np.arange(len(mixed)), zeta.argmin(axis=1)]]
    added: dict[int, list[IntArray]] = {}
    for o, t in zip(owner, mixed):
        added.setdefault(int(o), []).append(t)
    return [
        np.unique(np.concatenate([m, *added.get(i, [])])).astype(np.int32)
        for i, m in enumerate(members)
    ]
