"""Every parameter of nodes, solvers, fabrics and fits, declared once; how is in `declaration`."""

import dataclasses

from garment_sim_ros.declaration import Declaration as Declaration
from garment_sim_ros.declaration import Needs, needs, needs_any
from garment_sim_ros.declaration import checked as checked
from garment_sim_ros.declaration import declarations as declarations
from garment_sim_ros.declaration import idle as idle
from garment_sim_ros.declaration import markdown_table as markdown_table
from garment_sim_ros.declaration import parameter as parameter
from garment_sim_ros.declaration import validated as validated


@dataclasses.dataclass(frozen=True, kw_only=True)
class Material:
    """Physical parameters of a fabric; they mean the same in every solver.

    `relaxation` ignores the stiffnesses: its springs are corrected geometrically, so that how
    stiff it looks depends on its step and sweeps.
    """

    areal_density: float = parameter(
        0.15, "Mass per area.", unit="kg/m^2", minimum=1e-3, maximum=10.0
    )
    stretch_stiffness_warp: float = parameter(
        2000.0, "Tensile stiffness along the warp.", unit="N/m", minimum=0.0, maximum=1e9
    )
    stretch_stiffness_weft: float = parameter(
        1500.0, "Tensile stiffness along the weft.", unit="N/m", minimum=0.0, maximum=1e9
    )
    shear_stiffness: float = parameter(
        60.0, "In-plane shear stiffness.", unit="N/m", minimum=0.0, maximum=1e9
    )
    bending_stiffness: float = parameter(
        1e-5, "Bending rigidity per width.", unit="N m", minimum=0.0, maximum=1e3
    )
    damping: float = parameter(
        0.5,
        "Rate at which velocity dies out by internal losses.",
        unit="1/s",
        minimum=0.0,
        maximum=1e4,
    )
    air_drag: float = parameter(
        0.05, "Viscous drag per area.", unit="kg/(m^2 s)", minimum=0.0, maximum=1e3
    )
    friction: float = parameter(
        0.3, "Coulomb friction coefficient against colliders.", minimum=0.0, maximum=10.0
    )
    thickness: float = parameter(
        0.002,
        "Distance kept between cloth and collider surfaces.",
        unit="m",
        minimum=0.0,
        maximum=0.1,
    )


_AIR = needs_any("wind_drag", "wind_lift")
_GUSTS = (needs_any("gust"), _AIR)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Environment:
    """Outer forces on all garments."""

    gravity: tuple[float, ...] = parameter(
        (0.0, 0.0, -9.81), "Gravity in the world frame.", unit="m/s^2", minimum=-1e4, maximum=1e4
    )
    wind: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        "Wind velocity in the world frame.",
        unit="m/s",
        minimum=-200.0,
        maximum=200.0,
    )
    wind_drag: float = parameter(
        0.0,
        "Drag coefficient of a triangle across the wind; cloth has about 1.2. 0: none.",
        minimum=0.0,
        maximum=10.0,
    )
    wind_lift: float = parameter(
        0.0,
        "Lift coefficient of a triangle; cloth has about 0.4. 0: none.",
        minimum=0.0,
        maximum=10.0,
    )
    gust: float = parameter(
        0.0,
        "Root mean square speed of noise on the wind.",
        unit="m/s",
        minimum=0.0,
        maximum=200.0,
        needs=(_AIR,),
    )
    gust_shortest: float = parameter(
        0.3, "Shortest wavelength of the noise.", unit="m", minimum=0.01, maximum=1e3, needs=_GUSTS
    )
    gust_longest: float = parameter(
        3.0, "Longest wavelength of the noise.", unit="m", minimum=0.01, maximum=1e3, needs=_GUSTS
    )
    gust_change: float = parameter(
        0.5,
        "Rate at which the noise changes by itself.",
        unit="1/s",
        minimum=0.0,
        maximum=100.0,
        needs=_GUSTS,
    )
    gust_waves: int = parameter(
        24, "Plane waves that make up the noise.", minimum=1, maximum=512, needs=_GUSTS
    )
    gust_divergence_free: bool = parameter(
        True, "Noise in which no air appears or vanishes.", needs=_GUSTS
    )
    gust_seed: int = parameter(
        1, "The same seed gives the same noise.", minimum=0, maximum=2**31 - 1, needs=_GUSTS
    )
    root_linear_inertia: float = parameter(
        1.0,
        "Fraction of the body's own translation that cloth feels: 1 is the world as it is, 0 the "
        "first paper's simulation relative to the body.",
        minimum=0.0,
        maximum=1.0,
    )
    root_angular_inertia: float = parameter(
        1.0, "Fraction of the body's own rotation that cloth feels.", minimum=0.0, maximum=1.0
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class RelaxationSettings:
    """Numerical parameters of the `relaxation` solver."""

    sweeps: int = parameter(3, "Sweeps of spring correction per step.", minimum=1, maximum=1000)
    contact: str = parameter(
        "union",
        "Out of the union of all shapes, or by the earliest hit (ellipsoids and spheres only).",
        choices=("union", "earliest"),
    )
    response: str = parameter(
        "surface",
        "To an earliest hit: by the surface's normal with friction and restitution, without "
        "either, or reflected along the ray from the centre.",
        choices=("surface", "inelastic", "reflection"),
        needs=(needs("contact", "earliest"),),
    )
    restitution: float = parameter(
        0.0,
        "Share of normal velocity that an earliest hit gives back.",
        minimum=0.0,
        maximum=1.0,
        needs=(needs("contact", "earliest"), needs("response", "surface")),
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class LifecycleParameters:
    """Parameters of every node."""

    autostart: bool = parameter(
        True, "Configure and activate at the start, without a lifecycle manager."
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class MocapPlayerParameters:
    """Parameters of the node `mocap_player`."""

    clip: str = parameter("walk", "BVH file, rosbag2 or the built-in 'walk'.")
    bone_names: str = parameter(
        "", "YAML file: humanoid bone to joint of a BVH file, where names do not tell."
    )
    rate: float = parameter(
        0.0, "Messages per second; 0: as the clip.", unit="Hz", minimum=0.0, maximum=1000.0
    )
    speed: float = parameter(
        1.0, "Clip time per time; can be set while playing.", minimum=0.0, maximum=100.0
    )
    loop: bool = parameter(True, "Begin again after the end, or stand still there.")
    travel: bool = parameter(
        True,
        "A loop goes on from where it ended, so that a walk walks on; else it goes back.",
        needs=(needs("loop", True),),
    )
    publish_clock: bool = parameter(
        False, "Be the clock of a simulated time that begins at 0: publish /clock."
    )
    frame_id: str = parameter("world", "Frame of the skeleton's root, z up.")


_ON_HULLS = (needs("method", "hulls"),)
_ON_HULLS_AND_GRIDS = (needs("method", "hulls", "sdf"),)
_ON_GRIDS = (needs("method", "sdf"),)
_ON_ELLIPSOIDS = (needs("method", "ellipsoids"),)


@dataclasses.dataclass(frozen=True, kw_only=True)
class HullSettings:
    """How to fit hulls; all other methods but the mesh take `delta` of these."""

    delta: float = parameter(
        0.003,
        "Inflation of all shapes.",
        unit="m",
        minimum=0.0,
        maximum=0.05,
        needs=(needs("method", "hulls", "capsules", "ellipsoids", "spheres", "sdf"),),
    )
    max_faces: int = parameter(
        80,
        "Triangles that a hull is simplified to, where that fits.",
        minimum=4,
        maximum=100000,
        needs=_ON_HULLS,
    )
    reach: float = parameter(
        3.0,
        "Farthest that a simplified hull reaches out, in deltas.",
        minimum=1.0,
        maximum=100.0,
        needs=_ON_HULLS,
    )
    placement: str = parameter(
        "quadric",
        "Where simplified corners go: near the inflated hull, or as tight as allowed.",
        choices=("quadric", "volume"),
        needs=_ON_HULLS,
    )
    inflation: str = parameter(
        "vertices",
        "What moves out by delta: corners, as in the paper, or faces, which then get all of it.",
        choices=("vertices", "planes"),
        needs=_ON_HULLS,
    )
    merge: float = parameter(
        0.0,
        "A region with a smaller share of the skin joins the next.",
        minimum=0.0,
        maximum=1.0,
        needs=_ON_HULLS_AND_GRIDS,
    )
    split: float = parameter(
        0.005,
        "A region is cut in two where that saves this share of all hulls' volume; 1 for never.",
        minimum=1e-4,
        maximum=1.0,
        needs=_ON_HULLS,
    )
    joints: str = parameter(
        "auto",
        "Colliders at joints: half-turning spheres in the skin, or hulls where these leave much "
        "open; spheres that contain all that bends (the paper's); or none.",
        choices=("auto", "spheres", "none"),
        needs=_ON_HULLS_AND_GRIDS,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class SdfSettings:
    """How to sample signed distances."""

    voxel: float = parameter(
        0.01,
        "Distance of an sdf's samples.",
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
        "Fit error that splits one of the torso.",
        unit="m",
        minimum=1e-6,
        maximum=1.0,
        needs=_ON_ELLIPSOIDS,
    )
    mu_limb: float = parameter(
        0.012,
        "The same of head, arms and legs.",
        unit="m",
        minimum=1e-6,
        maximum=1.0,
        needs=_ON_ELLIPSOIDS,
    )
    mu: str = parameter(
        "",
        "The same of single regions: REGION=M, several apart by spaces, as left_thigh=0.03.",
        needs=_ON_ELLIPSOIDS,
    )
    sigma: float = parameter(
        1e-3,
        "K-means stops where centres move by no more.",
        unit="m",
        minimum=0.0,
        maximum=1.0,
        needs=_ON_ELLIPSOIDS,
    )
    max_ellipsoids: int = parameter(
        90,
        "Most ellipsoids; those that fit worst are split first.",
        minimum=15,
        maximum=1000,
        needs=_ON_ELLIPSOIDS,
    )
    segmentation: str = parameter(
        "auto",
        "Regions by the rig's joints where it has them, by the rig, by the surface alone, by the "
        "paper's constants, or the body as a whole.",
        choices=("auto", "rig", "surface", "table1", "none"),
        needs=_ON_ELLIPSOIDS,
    )
    refit: bool = parameter(
        True, "Ellipsoids at joints are fitted again in every pose.", needs=_ON_ELLIPSOIDS
    )


METHODS = ("hulls", "capsules", "ellipsoids", "spheres", "sdf", "mesh")
"""Kinds of colliders."""
METHOD_ALIASES = {name.removesuffix("s"): name for name in METHODS if name.endswith("s")}
"""Other spellings of them."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class _ColliderKind:
    """The first of `ColliderOptions`."""

    method: str = parameter("hulls", "Kind of colliders.", choices=METHODS, aliases=METHOD_ALIASES)
    thickness: float = parameter(
        0.002, "Distance that cloth keeps on top.", unit="m", minimum=0.0, maximum=0.1
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class ColliderOptions(SdfSettings, EllipsoidSettings, HullSettings, _ColliderKind):
    """Which colliders a body gets."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Avatar:
    """The first of `ColliderNodeParameters`."""

    body: str = parameter(
        "mannequin", "The avatar's body file, or 'mannequin'; empty: robot_description is it."
    )
    bone_names: str = parameter(
        "",
        "YAML file: humanoid bone to joint of robot_description, where names do not tell.",
        needs=(Needs(("body",), (), "a body"),),
    )
    body_bone_names: str = parameter(
        "", "YAML file: humanoid bone to joint of the body, where names do not tell."
    )
    ground_feet: bool = parameter(
        True, "Feet that stand in the source stand on the ground, without sliding."
    )
    colliders: str = parameter("", "File that `fit` wrote; empty: fitted at the start.")
    cache: bool = parameter(
        True, "Keep fits beside the body, or in the user's cache folder, and use them again."
    )
    outfit: str = parameter(
        "", "Outfit file whose collider options hold; empty: those that follow."
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class ColliderNodeParameters(ColliderOptions, _Avatar):
    """Parameters of the node `collider_node`."""

    marker_rate: float = parameter(
        10.0, "Most collider_markers per second; 0: none.", unit="Hz", minimum=0.0, maximum=120.0
    )
    time_jump: float = parameter(
        1.0, "Stamps farther apart begin a new time.", unit="s", minimum=0.05, maximum=1e6
    )
    stale_after: float = parameter(
        1.0,
        "After so long without input the node is STALE; another publisher may then take over.",
        unit="s",
        minimum=0.05,
        maximum=1e6,
    )
    frame_id: str = parameter("world", "Frame of everything published, z up.")


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClothNodeParameters:
    """Parameters of the node `cloth_node`."""

    body: str = parameter("mannequin", "The body that the garments are made for.")
    body_bone_names: str = parameter(
        "", "YAML file: humanoid bone to joint of the body, where names do not tell."
    )
    outfit: str = parameter("", "Outfit file; empty: a T-shirt and a short skirt.")
    rate: float = parameter(
        60.0,
        "Frames per second.",
        unit="Hz",
        minimum=1.0,
        maximum=1000.0,
        needs=(needs("step_on", "timer"),),
    )
    delay: float = parameter(
        -1.0,
        "How far the cloth stays behind the newest poses; below 0: one input period.",
        unit="s",
        minimum=-1.0,
        maximum=10.0,
        needs=(needs("step_on", "timer"),),
    )
    step_on: str = parameter(
        "timer",
        "What advances the cloth: time, or every message of collider_poses, reproducibly.",
        choices=("timer", "poses"),
    )
    solver: str = parameter(
        "xpbd", "Name of the solver.", choices=("xpbd", "relaxation", "implicit")
    )
    solver_step: float = parameter(
        1 / 180,
        "Fixed step of the solver. Frames show whole steps: a longer one makes them uneven.",
        unit="s",
        minimum=1e-4,
        maximum=0.5,
    )
    normals: bool = parameter(False, "Add vertex normals to the points.")
    catch_up: float = parameter(
        0.1,
        "Most time that is simulated within one frame; poses of the rest are passed over.",
        unit="s",
        minimum=0.01,
        maximum=10.0,
        needs=(needs("step_on", "timer"),),
    )
    teleport_speed: float = parameter(
        30.0,
        "Colliders that move faster are taken to have jumped.",
        unit="m/s",
        minimum=1.0,
        maximum=1e6,
        needs=(needs("on_teleport", "reset", "keep"),),
    )
    teleport_turn_rate: float = parameter(
        105.0,
        "A root that turns faster is taken to have jumped.",
        unit="rad/s",
        minimum=1.0,
        maximum=1e6,
        needs=(needs("on_teleport", "reset", "keep"),),
    )
    on_teleport: str = parameter(
        "reset",
        "Where the body has jumped the cloth is put on again, keeps its folds, or takes part.",
        choices=("reset", "keep", "ignore"),
    )
    time_jump: float = parameter(
        1.0, "Stamps farther apart begin a new time.", unit="s", minimum=0.05, maximum=1e6
    )
    stale_after: float = parameter(
        1.0,
        "After so long without poses the node is STALE and does not publish garments again.",
        unit="s",
        minimum=0.05,
        maximum=1e6,
    )
    frame_id: str = parameter("world", "Frame of poses and garments, z up.")


@dataclasses.dataclass(frozen=True, kw_only=True)
class XpbdSettings:
    """Numerical parameters of the `xpbd` solver."""

    sub_step: float = parameter(
        1 / 1080,
        "Longest sub-step: shorter is stiffer cloth and slower.",
        unit="s",
        minimum=1e-5,
        maximum=0.1,
    )
    iterations: int = parameter(1, "Passes over the edges in a sub-step.", minimum=1, maximum=1000)
    search_every: int = parameter(
        6,
        "Sub-steps for each search for contacts and each pass over hinges, unless stiff.",
        minimum=1,
        maximum=64,
    )
    coarse: bool = parameter(
        False, "Less stretch with few sub-steps.", needs=(needs("iterations", 1),)
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class ImplicitSettings:
    """Numerical parameters of the `implicit` solver."""

    sub_step: float = parameter(
        1 / 60,
        "Longest sub-step: shorter is more accurate motion and slower.",
        unit="s",
        minimum=1e-4,
        maximum=0.5,
    )
    iterations: int = parameter(
        8, "Steps towards the solution in each sub-step.", minimum=1, maximum=200
    )
