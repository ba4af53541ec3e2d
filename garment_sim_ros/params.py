"""Every parameter of nodes, solvers, fabrics and fits, declared once; how is in `declaration`."""

import dataclasses

from garment_sim_ros.collider_params import ColliderOptions as ColliderOptions
from garment_sim_ros.constants import USUAL_STEP
from garment_sim_ros.declaration import Needs, needs
from garment_sim_ros.declaration import checked as checked
from garment_sim_ros.declaration import declarations as declarations
from garment_sim_ros.declaration import idle as idle
from garment_sim_ros.declaration import markdown_table as markdown_table
from garment_sim_ros.declaration import parameter as parameter
from garment_sim_ros.declaration import validated as validated
from garment_sim_ros.outer_force_params import Environment as Environment
from garment_sim_ros.solver_params import ImplicitSettings as ImplicitSettings
from garment_sim_ros.solver_params import RelaxationSettings as RelaxationSettings
from garment_sim_ros.solver_params import XpbdSettings as XpbdSettings

PRESETS = ("fast", "balanced", "accurate", "auto", "sun2007", "gong2018")
"""Names of sets of parameters; each has a file in ``config/presets``, see `presets`."""


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
    poisson_ratio: float = parameter(0.2, "Poisson's ratio of threads.", minimum=0.0, maximum=0.9)
    bending_stiffness: float = parameter(
        1e-5, "Bending rigidity per width.", unit="N m", minimum=0.0, maximum=1e3
    )
    damping: float = parameter(
        0.5,
        "Rate at which internal losses damp the velocity.",
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
        "Distance that cloth keeps from colliders: the larger of this and their own thickness. "
        "Two garments keep the mean of theirs.",
        unit="m",
        minimum=0.0,
        maximum=0.1,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class LifecycleParameters:
    """Parameters of every node."""

    preset: str = parameter(
        "balanced",
        "Set of parameters in place of the defaults; single parameters given beside it win.",
        choices=PRESETS,
    )
    autostart: bool = parameter(
        True, "Configure and activate at the start, without a lifecycle manager."
    )


def _realtime_priority() -> int:
    """Declares it for a node that keeps a time."""
    return parameter(
        1,
        "Real-time priority (round robin) of the node's thread, where the system grants one; "
        "0: none. A thread that uses most of a core loses it for a while.",
        minimum=0,
        maximum=99,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class MocapPlayerParameters:
    """Parameters of the node `mocap_player`."""

    clip: str = parameter(
        "walk",
        "BVH or glTF file, rosbag2, or 'walk' for the built-in clip; 'avatar.glb:animation=Run' "
        "is one of several animations of a glTF file.",
    )
    bone_names: str = parameter(
        "",
        "YAML file that maps humanoid bones to joints of the clip; empty: recognised by name.",
    )
    rate: float = parameter(
        0.0, "Messages per second; 0: as the clip.", unit="Hz", minimum=0.0, maximum=1000.0
    )
    speed: float = parameter(
        1.0,
        "Playback speed, as a multiple of real time; can be set while playing.",
        minimum=0.0,
        maximum=100.0,
    )
    loop: bool = parameter(True, "Start the clip again at its end; false: stop at the last frame.")
    travel: bool = parameter(
        True,
        "Start each loop at the place where the last one ended; false: at the start of the clip.",
        needs=(needs("loop", True),),
    )
    publish_clock: bool = parameter(False, "Publish /clock, a simulated time that begins at 0.")
    wait_for_subscribers: int = parameter(
        0,
        "Subscribers of joint_states that are waited for before the clip begins.",
        minimum=0,
        maximum=1000,
    )
    frame_id: str = parameter("world", "Frame of the skeleton's root, z up.")


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Avatar:
    """The first of `ColliderNodeParameters`."""

    body: str = parameter(
        "mannequin",
        "Body file of the avatar, or 'mannequin'; empty: robot_description is the body.",
    )
    bone_names: str = parameter(
        "",
        "YAML file that maps humanoid bones to joints of robot_description; empty: recognised by "
        "name.",
        needs=(Needs(("body",), (), "a body"),),
    )
    body_bone_names: str = parameter(
        "", "YAML file that maps humanoid bones to joints of the body; empty: recognised by name."
    )
    ground_feet: bool = parameter(
        True,
        "Keep on the ground what is on it in the source: feet that stand, without sliding, and "
        "parts of a body that lies, sits or kneels.",
    )
    clear_arms: bool = parameter(
        True, "Turn arms about the shoulder out of hips, trunk and thighs that they are in."
    )
    clear_thighs: bool = parameter(
        True,
        "Bend the body back where a thigh is deep in its belly or hips, and open knees where a "
        "calf is deep in its thigh.",
    )
    colliders: str = parameter(
        "", "Collider file, as written by `garment-sim fit`; empty: fitted at the start."
    )
    cache: bool = parameter(
        True,
        "Keep fitted colliders on disk, beside the body or in the user's cache folder, and reuse "
        "them.",
    )
    outfit: str = parameter(
        "",
        "Outfit file; its settings of colliders win over the parameters of this node, but not "
        "over a collider file.",
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class ColliderNodeParameters(ColliderOptions, _Avatar):
    """Parameters of the node `collider_node`."""

    marker_rate: float = parameter(
        10.0, "Largest rate of collider_markers; 0: none.", unit="Hz", minimum=0.0, maximum=120.0
    )
    lossless: bool = parameter(
        False,
        "Pose every message of joint_states, so that runs are reproducible. Messages that come "
        "before the skeleton is read and collider_poses has its subscribers are kept until then. "
        "joint_states have to be published reliably.",
    )
    wait_for_subscribers: int = parameter(
        1,
        "Subscribers of collider_poses that are waited for before the first is published.",
        minimum=0,
        maximum=1000,
        needs=(needs("lossless", True),),
    )
    time_jump: float = parameter(
        1.0,
        "Difference between the stamps of two messages above which time starts anew, as where a "
        "clip or a bag begins again.",
        unit="s",
        minimum=0.05,
        maximum=1e6,
    )
    stale_after: float = parameter(
        1.0,
        "Time without usable joint_states after which /diagnostics shows the node as STALE, and "
        "another publisher may take over.",
        unit="s",
        minimum=0.05,
        maximum=1e6,
    )
    frame_id: str = parameter("world", "Frame of everything published, z up.")
    root_frame: str = parameter(
        "hips",
        "Name of the hips' frame on /tf, behind the namespace; empty: none. Needs tf2_msgs.",
    )
    realtime_priority: int = _realtime_priority()


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClothNodeParameters:
    """Parameters of the node `cloth_node`."""

    body: str = parameter(
        "mannequin", "Body that the garments are made for: a file, or 'mannequin'."
    )
    body_bone_names: str = parameter(
        "", "YAML file that maps humanoid bones to joints of the body; empty: recognised by name."
    )
    outfit: str = parameter("", "Outfit file; empty: a T-shirt and a short skirt.")
    attachments: str = parameter(
        "auto",
        "What holds garments for which the outfit says auto or nothing. auto: a few points on the "
        "shoulders and a distance limit; arms: points on shoulders and upper arms and no distance "
        "limit, as in Sun et al. 2007. With both, a garment that does not reach the shoulders is "
        "held at the waist.",
        choices=("auto", "arms"),
    )
    skinning: str = parameter(
        "linear",
        "How the skin that garments are measured against follows the bones. linear: mean of the "
        "matrices; dual_quaternion; bone_blend: rotations are blended about the joint, as in Sun "
        "et al. 2007.",
        choices=("linear", "dual_quaternion", "bone_blend"),
    )
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
        "Delay of the cloth behind the newest poses; below 0: one input period.",
        unit="s",
        minimum=-1.0,
        maximum=10.0,
        needs=(needs("step_on", "timer"),),
    )
    step_on: str = parameter(
        "timer",
        "What advances the cloth. timer: time; poses: every message of collider_poses, which is "
        "reproducible.",
        choices=("timer", "poses"),
    )
    solver: str = parameter(
        "xpbd", "Name of the solver.", choices=("xpbd", "relaxation", "implicit")
    )
    solver_step: float = parameter(
        USUAL_STEP,
        "Fixed step of the cloth. A frame shows a whole number of steps, so long steps make the "
        "motion uneven. With xpbd as many steps as fit into 1/60 s are simulated as one.",
        unit="s",
        minimum=1e-4,
        maximum=0.5,
    )
    detail: float = parameter(
        1.0,
        "Share of each garment's vertices that are simulated. The others keep their places beside "
        "them. Fewer take less time and have fewer folds.",
        minimum=0.05,
        maximum=1.0,
    )
    normals: bool = parameter(False, "Add vertex normals to the points.")
    catch_up: float = parameter(
        0.1,
        "Longest time that is simulated within one frame; what is due beyond it comes later.",
        unit="s",
        minimum=0.01,
        maximum=10.0,
        needs=(needs("step_on", "timer"),),
    )
    longest_lag: float = parameter(
        0.4,
        "Longest time that the cloth lags behind as it catches up; poses beyond it are skipped.",
        unit="s",
        minimum=0.0,
        maximum=10.0,
        needs=(needs("step_on", "timer"),),
    )
    frame_budget_ms: float = parameter(
        0.0,
        "Longest time that a frame may take, its wait for a free core included; preset auto keeps "
        "to it by changing the solver's settings and, at last, the share of vertices. 0: 70 % of "
        "the period.",
        unit="ms",
        minimum=0.0,
        maximum=1e4,
        needs=(needs("preset", "auto"), needs("step_on", "timer")),
    )
    teleport_speed: float = parameter(
        30.0,
        "Collider speed above which the motion counts as a teleport.",
        unit="m/s",
        minimum=1.0,
        maximum=1e6,
        needs=(needs("on_teleport", "reset", "keep"),),
    )
    teleport_turn_rate: float = parameter(
        105.0,
        "Turn rate of the root above which the motion counts as a teleport.",
        unit="rad/s",
        minimum=1.0,
        maximum=1e6,
        needs=(needs("on_teleport", "reset", "keep"),),
    )
    on_teleport: str = parameter(
        "reset",
        "Cloth at a teleport. reset: put on again; keep: moved along with its folds; ignore: "
        "simulated through the jump.",
        choices=("reset", "keep", "ignore"),
    )
    time_jump: float = parameter(
        1.0,
        "Difference between the stamps of two messages above which time starts anew, as where a "
        "clip or a bag begins again.",
        unit="s",
        minimum=0.05,
        maximum=1e6,
    )
    on_time_jump: str = parameter(
        "reset",
        "Cloth where time starts anew. reset: put on again; keep: moved along with its folds.",
        choices=("reset", "keep"),
    )
    stale_after: float = parameter(
        1.0,
        "Time without usable collider_poses after which /diagnostics shows the node as STALE, the "
        "node stops publishing garments, and another publisher may take over.",
        unit="s",
        minimum=0.05,
        maximum=1e6,
    )
    frame_id: str = parameter("world", "Frame of poses and garments, z up.")
    realtime_priority: int = _realtime_priority()
