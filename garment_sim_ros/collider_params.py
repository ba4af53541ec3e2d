"""Parameters of fits: which colliders a body gets."""

import dataclasses

from garment_sim_ros.declaration import needs, parameter

METHODS = HULLS, CAPSULES, ELLIPSOIDS, SPHERES, SDF, MESH = (
    "hulls",
    "capsules",
    "ellipsoids",
    "spheres",
    "sdf",
    "mesh",
)
"""Ways to fit colliders; `colliders.fitting.METHODS` has what each does."""
METHOD_ALIASES = {name.removesuffix("s"): name for name in METHODS if name.endswith("s")}
"""Other spellings of them."""

_ON_HULLS = (needs("method", HULLS),)
_ON_HULLS_AND_GRIDS = (needs("method", HULLS, SDF),)
_ON_GRIDS = (needs("method", SDF),)
_ON_ELLIPSOIDS = (needs("method", ELLIPSOIDS),)


@dataclasses.dataclass(frozen=True, kw_only=True)
class HullSettings:
    """How to fit hulls; all other methods but the mesh take `delta` of these."""

    delta: float = parameter(
        0.003,
        "Inflation: how far all shapes are grown outwards.",
        unit="m",
        minimum=0.0,
        maximum=0.05,
        needs=(needs("method", HULLS, CAPSULES, ELLIPSOIDS, SPHERES, SDF),),
    )
    max_faces: int = parameter(
        80,
        "Target number of triangles of a hull. A hull that cannot be reduced so far keeps more.",
        minimum=4,
        maximum=100000,
        needs=_ON_HULLS,
    )
    reach: float = parameter(
        3.0,
        "Largest distance that a simplified hull may reach out of the planes of the un-inflated "
        "hull, as a multiple of delta.",
        minimum=1.0,
        maximum=100.0,
        needs=_ON_HULLS,
    )
    placement: str = parameter(
        "volume",
        "Position of the vertices of a simplified hull. quadric: near the inflated hull; volume: "
        "least volume within reach.",
        choices=("quadric", "volume"),
        needs=_ON_HULLS,
    )
    deletion: str = parameter(
        "any",
        "What is deleted to simplify a hull. any: triangles and edges, in turns with moving the "
        "vertices that are left to better places; triangles: whole triangles, the cheapest first, "
        "and nothing else, as in Sun et al. 2007.",
        choices=("any", "triangles"),
        needs=_ON_HULLS,
    )
    inflation: str = parameter(
        "vertices",
        "Inflation by delta. vertices: moves the vertices, as in Sun et al. 2007; planes: moves "
        "the faces, by the whole delta.",
        choices=("vertices", "planes"),
        needs=_ON_HULLS,
    )
    merge: float = parameter(
        0.0,
        "Smallest region, as a fraction of the skin; smaller ones join a neighbour.",
        minimum=0.0,
        maximum=1.0,
        needs=_ON_HULLS_AND_GRIDS,
    )
    split: float = parameter(
        0.005,
        "Least saving for which a region is cut in two, as a fraction of the volume of all hulls; "
        "1: never.",
        minimum=1e-4,
        maximum=1.0,
        needs=_ON_HULLS,
    )
    joints: str = parameter(
        "auto",
        "Colliders at joints. auto: spheres inside the skin that turn by half the joint's "
        "rotation, hulls where gaps remain, and all hulls grown to skin that leaves them in "
        "motion; spheres: those of Sun et al. 2007, which contain all skin that bends; none.",
        choices=("auto", "spheres", "none"),
        needs=_ON_HULLS_AND_GRIDS,
    )
    flexible: float = parameter(
        0.001,
        "Least skin weight with which skin counts as bending with a joint, so that the joint's "
        "sphere contains it. Of the weights of the joint's two sides the lesser one counts.",
        minimum=0.001,
        maximum=0.49,
        needs=(needs("method", HULLS), needs("joints", "spheres")),
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class SdfSettings:
    """How to sample signed distances."""

    voxel: float = parameter(
        0.01,
        "Grid spacing of a signed distance field.",
        unit="m",
        minimum=0.001,
        maximum=0.1,
        needs=_ON_GRIDS,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class EllipsoidSettings:
    """How to fit ellipsoids."""

    mu_torso: float = parameter(
        0.018,
        "Fit error above which an ellipsoid of the torso is split.",
        unit="m",
        minimum=1e-6,
        maximum=1.0,
        needs=_ON_ELLIPSOIDS,
    )
    mu_limb: float = parameter(
        0.012,
        "Fit error above which an ellipsoid of the head, an arm or a leg is split.",
        unit="m",
        minimum=1e-6,
        maximum=1.0,
        needs=_ON_ELLIPSOIDS,
    )
    mu: str = parameter(
        "",
        "Fit error above which an ellipsoid of a named region is split: REGION=METRES, separated "
        "by spaces, e.g. left_thigh=0.03.",
        needs=_ON_ELLIPSOIDS,
    )
    sigma: float = parameter(
        1e-3,
        "K-means stops when no centre moves farther than this.",
        unit="m",
        minimum=0.0,
        maximum=1.0,
        needs=_ON_ELLIPSOIDS,
    )
    max_ellipsoids: int = parameter(
        90,
        "Largest number of ellipsoids; those with the largest error are split first.",
        minimum=15,
        maximum=1000,
        needs=_ON_ELLIPSOIDS,
    )
    segmentation: str = parameter(
        "auto",
        "How the body is divided into regions. rig: by the joints of the rig; surface: by the "
        "surface alone; auto: rig where it has the joints, else surface; table1: by the "
        "constants of Table 1 of Gong et al. 2018; none: one region.",
        choices=("auto", "rig", "surface", "table1", "none"),
        needs=_ON_ELLIPSOIDS,
    )
    sex: str = parameter(
        "female",
        "Column of Table 1 of Gong et al. 2018.",
        choices=("female", "male"),
        needs=(*_ON_ELLIPSOIDS, needs("segmentation", "table1")),
    )
    paths: str = parameter(
        "unfolded",
        "Geodesic distances that divide the body. unfolded: also straight across pairs of "
        "triangles; edges: along edges only, as in Gong et al. 2018.",
        choices=("unfolded", "edges"),
        needs=(*_ON_ELLIPSOIDS, needs("segmentation", "auto", "rig", "surface", "table1")),
    )
    cover: str = parameter(
        "triangles",
        "What is inside the ellipsoids. triangles: the whole skin; vertices: its vertices, as in "
        "Gong et al. 2018, which leaves skin outside where ellipsoids meet.",
        choices=("triangles", "vertices"),
        needs=_ON_ELLIPSOIDS,
    )
    refit: bool = parameter(
        True, "Fit the ellipsoids at joints again in every pose.", needs=_ON_ELLIPSOIDS
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class _ColliderKind:
    """The first of `ColliderOptions`."""

    method: str = parameter(
        HULLS,
        "Kind of colliders. mesh works with the solver relaxation only.",
        choices=METHODS,
        aliases=METHOD_ALIASES,
    )
    thickness: float = parameter(
        0.002,
        "Distance that cloth keeps from colliders, on top of delta: the larger of this and its "
        "fabric's own thickness.",
        unit="m",
        minimum=0.0,
        maximum=0.1,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class ColliderOptions(SdfSettings, EllipsoidSettings, HullSettings, _ColliderKind):
    """Which colliders a body gets."""
