"""Ellipsoids around a body: segmentation, then refinement (Gong et al., 2 and 3).

Also the same without segmentation, as in their ref. [19] (Tang Y. et al. 2013, adaptive
ellipsoids), for comparison and for bodies that are no humans.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import EllipsoidSettings
from garment_sim_ros.colliders.ellipsoids.pruned_kmeans import Clustering, refine
from garment_sim_ros.colliders.ellipsoids.skin_points import SkinPoints, border_points
from garment_sim_ros.colliders.ellipsoids.thresholds import REGIONS, TORSO, region_thresholds
from garment_sim_ros.colliders.segmentation.segmentation import (
    Segmentation,
    rig_joints,
    segment,
)
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.mvee import Ellipsoid, mvee
from garment_sim_ros.params import declarations, validated

PARTS = ("torso", *REGIONS[:9])
"""Parts of a body that are refined one by one: the torso's six regions together."""
SEGMENTATIONS = declarations(EllipsoidSettings)["segmentation"].choices
COVERS = declarations(EllipsoidSettings)["cover"].choices


@dataclass(frozen=True)
class EllipsoidFit:
    """Ellipsoids around the skin of a body in its bind pose.

    Attributes:
        ellipsoids: The ellipsoids.
        region: Name of the region that each was fitted to; ``body`` without segmentation.
        label: Ellipsoid of each skin vertex, shape [v].
        members: Skin points that each ellipsoid holds: its vertices, and where it meets others.
        error: Mean radial distance of each one's own vertices to it, equation (6) [m].
        mu: Error that was asked of each [m]; infinite where a count was.
        segmentation: None without segmentation.
    """

    ellipsoids: tuple[Ellipsoid, ...]
    region: tuple[str, ...]
    label: IntArray
    members: tuple[SkinPoints, ...]
    error: FloatArray
    mu: FloatArray
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
            "over_mu": int((self.error > self.mu).sum()),
            "over_mu_mm_max": round(1e3 * max(float((self.error - self.mu).max()), 0.0), 3),
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
    cover: str | None = None,
) -> EllipsoidFit:
    """Fit ellipsoids to a body's skin in its bind pose.

    Args:
        body: Rig and skin.
        settings: Thresholds and more. The torso's six regions share the smallest of theirs; at
            most as many ellipsoids are made as it says, the worst in relation to their thresholds
            being split first. Thresholds hold for the ellipsoids as they are returned.
        cover: What is inside the union, in the place of what the settings say.

    Raises:
        GeometryError: The body cannot be segmented.
        ParameterError: An option is out of range.
    """
    s = settings or EllipsoidSettings()
    s = validated(
        EllipsoidSettings, {name: getattr(s, name) for name in declarations(EllipsoidSettings)}
    )
    thresholds = region_thresholds(s)
    cover = cover or s.cover
    if cover not in COVERS:
        raise ParameterError("cover", f"found {cover!r}", f"allowed: {COVERS}")
    x = body.skin.vertices
    divided = None
    if s.segmentation == "none":
        whole = Clustering.start(x, np.zeros(len(x), np.int32), sigma=0.0, use_rule=False)
        parts = [_Part("body", np.arange(len(x)), whole, ("body",), min(s.mu_torso, s.mu_limb))]
    else:
        divided = segment_body(body, s.segmentation, sex=s.sex, paths=s.paths)
        # Vertices at one place (seams) count once, as on the repaired surface.
        _, first = np.unique(divided.surface.vertex, return_index=True)
        region = divided.region[first]
        parts = []
        for name, group in zip(PARTS, (TORSO, *((i,) for i in range(TORSO[0])))):
            mine = first[np.isin(region, group)]
            clusters = Clustering.start(x[mine], divided.region[mine], sigma=s.sigma)
            mu = min(thresholds[REGIONS[i]] for i in group)
            parts.append(_Part(name, mine, clusters, tuple(REGIONS[i] for i in group), mu))
    refine([p.clusters for p in parts], [p.mu for p in parts], s.max_ellipsoids)
    while True:
        fit = _gathered(body, parts, divided, cover)
        if not _split_worst(parts, fit, s.max_ellipsoids):
            return fit


@dataclass
class _Part:
    """A part of the skin that is refined by itself.

    Attributes:
        name: One of `PARTS`, or ``body``.
        vertices: Its skin vertices, shape [n].
        clusters: Their clusters.
        regions: Names of the regions that it consists of.
        mu: Error above which a cluster is split [m].
    """

    name: str
    vertices: NDArray[np.intp]
    clusters: Clustering
    regions: tuple[str, ...]
    mu: float


def _split_worst(parts: list[_Part], fit: EllipsoidFit, most: int) -> bool:
    """Splits the worse half of the ellipsoids whose error as they are exceeds mu.

    Refinement saw vertices only; around all of the skin ellipsoids are larger. Returns whether
    any was split: each time there is one more cluster, or one less that can be split.
    """
    which = [(part, i) for part in parts for i in range(len(part.clusters.clusters))]
    excess = np.array(
        [
            0.0 if part.clusters.clusters[i].final else error / part.mu
            for (part, i), error in zip(which, fit.error)
        ]
    )
    over = np.flatnonzero(excess > 1.0)
    worst = over[np.argsort(-excess[over], kind="stable")]
    room = most - len(which)
    for k in worst[: (len(worst) + 1) // 2]:
        if room <= 0:
            return bool(k != worst[0])
        part, i = which[k]
        room -= part.clusters.split(i)
    return bool(len(worst))


def segment_body(
    body: Body, segmentation: str = "auto", *, sex: str = "female", paths: str = "unfolded"
) -> Segmentation:
    """The 15 regions of a body, its joints taken as `ellipsoids_around` says.

    Raises:
        GeometryError: The body is no human.
        ParameterError: ``none``, ``rig`` without named joints, or an unknown segmentation.
    """
    if segmentation not in SEGMENTATIONS or segmentation == "none":
        regions = ", ".join(name for name in SEGMENTATIONS if name != "none")
        raise ParameterError("segmentation", f"found {segmentation!r}", f"allowed: {regions}")
    return segment(
        body.skin.vertices,
        body.skin.triangles,
        constants="table1" if segmentation == "table1" else "anthropometry",
        sex=sex,
        paths=paths,
        joints=_joints(body, segmentation),
    )


def _joints(body: Body, segmentation: str) -> dict[str, FloatArray] | None:
    joints = rig_joints(body)
    if segmentation == "rig" and not joints:
        raise ParameterError(
            "segmentation",
            "found 'rig' with a body of which no joint is known",
            "allowed: auto or surface, or a YAML file of bone names",
        )
    return joints if joints and segmentation in ("auto", "rig") else None


def _gathered(
    body: Body, parts: list[_Part], divided: Segmentation | None, cover: str
) -> EllipsoidFit:
    """All parts' ellipsoids in one list, extended to where they meet if asked."""
    x = body.skin.vertices
    label = np.full(len(x), -1, dtype=np.int32)
    ellipsoids: list[Ellipsoid] = []
    regions: list[str] = []
    mu: list[float] = []
    for part in parts:
        own = part.clusters.label
        label[part.vertices] = own + len(ellipsoids)
        for i, cluster in enumerate(part.clusters.clusters):
            name = part.regions[0]
            if divided is not None and len(part.regions) > 1:
                votes = np.bincount(divided.region[part.vertices[own == i]])
                name = REGIONS[int(votes.argmax())]
            ellipsoids.append(cluster.ellipsoid)
            regions.append(name)
            mu.append(part.mu)
    if divided is not None:
        _, first, inverse = np.unique(
            divided.surface.vertex, return_index=True, return_inverse=True
        )
        label = label[first][inverse]
    mine = [np.flatnonzero(label == i).astype(np.int32) for i in range(len(ellipsoids))]
    members = [SkinPoints.at(vertices) for vertices in mine]
    if cover == "triangles":
        border = border_points(x, body.skin.triangles, label, ellipsoids)
        members = [m.with_more(more) for m, more in zip(members, border)]
        ellipsoids = [mvee(m.of(x), tolerance=1e-3) for m in members]
    error = np.array([e.radial_error(x[m]).mean() for e, m in zip(ellipsoids, mine)], np.float64)
    return EllipsoidFit(
        tuple(ellipsoids), tuple(regions), label, tuple(members), error, np.array(mu), divided
    )
