"""Every parameter, declared once: type, default, unit, range and text.

A group of parameters is a frozen dataclass whose fields are made by `parameter`. Nodes, commands,
outfit files and documents derive names, ranges and texts from it (`declarations`), and every value
from outside passes through `validated`.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, TypeVar

from garment_sim_ros.errors import ParameterError

Group = TypeVar("Group")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Declaration:
    """What is declared about one parameter.

    Attributes:
        name: Field name, also the ROS parameter and the YAML key.
        type: `bool`, `int`, `float`, `str` or `tuple` (of floats, fixed length).
        default: Default value.
        unit: SI unit as text, empty where there is none.
        minimum: Smallest value allowed, None for no limit.
        maximum: Largest value allowed, None for no limit.
        choices: Allowed values of a string, empty for any.
        text: One sentence for people.
    """

    name: str
    type: type
    default: Any
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    text: str

    @property
    def allowed(self) -> str:
        """The allowed values as text for error messages."""
        if self.choices:
            return "allowed: " + ", ".join(self.choices)
        kind = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}.get(
            self.type, f"{len(self.default)} numbers" if self.type is tuple else "a value"
        )
        low = "" if self.minimum is None else f" from {self.minimum:g}"
        high = "" if self.maximum is None else f" to {self.maximum:g}"
        return f"allowed: {kind}{low}{high}{' ' + self.unit if self.unit else ''}"


def parameter(
    default: Any,
    text: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
) -> Any:
    """A dataclass field with its declaration; see `Declaration` for the arguments."""
    return dataclasses.field(
        default=default,
        metadata={
            "declaration": {
                "type": type(default),
                "unit": unit,
                "minimum": minimum,
                "maximum": maximum,
                "choices": choices,
                "text": text,
            }
        },
    )


def declarations(group: type) -> dict[str, Declaration]:
    """The declarations of a parameter group, in field order."""
    return {
        f.name: Declaration(name=f.name, default=f.default, **f.metadata["declaration"])
        for f in dataclasses.fields(group)
        if "declaration" in f.metadata
    }


def checked(declaration: Declaration, value: Any) -> Any:
    """`value` converted to the declared type and checked against the declared range.

    Raises:
        ParameterError: Wrong type, not finite, or out of range.
    """

    def refuse() -> ParameterError:
        return ParameterError(declaration.name, f"found {value!r}", declaration.allowed)

    def number(v: Any) -> float:
        if isinstance(v, bool) or not isinstance(v, int | float) or not math.isfinite(v):
            raise refuse()
        if declaration.minimum is not None and v < declaration.minimum:
            raise refuse()
        if declaration.maximum is not None and v > declaration.maximum:
            raise refuse()
        return float(v)

    if declaration.type is bool or declaration.type is str:
        if not isinstance(value, declaration.type):
            raise refuse()
        if declaration.choices and value not in declaration.choices:
            raise refuse()
        return value
    if declaration.type is int:
        v = number(value)
        if v != int(v):
            raise refuse()
        return int(v)
    if declaration.type is tuple:
        if isinstance(value, str | bytes | Mapping) or not hasattr(value, "__iter__"):
            raise refuse()
        values = tuple(number(v) for v in value)
        if len(values) != len(declaration.default):
            raise refuse()
        return values
    return number(value)


def validated(group: type[Group], values: Mapping[str, Any]) -> Group:
    """An instance of `group` from untrusted values.

    Args:
        group: A parameter group.
        values: Values by name; absent ones keep their default.

    Raises:
        ParameterError: An unknown name or a value that is not allowed.
    """
    known = declarations(group)
    for name in values:
        if name not in known:
            raise ParameterError(str(name), "unknown", "allowed: " + ", ".join(known))
    return group(**{name: checked(known[name], value) for name, value in values.items()})


def markdown_table(group: type) -> str:
    """The declarations of a group as a Markdown table: name, default, what is allowed, text."""
    rows = ["| parameter | default | allowed | |", "|---|---|---|---|"]
    for d in declarations(group).values():
        default = f"{d.default:.6g}" if isinstance(d.default, float) else f"{d.default}"
        allowed = d.allowed.removeprefix("allowed: ")
        rows.append(
            f"| `{d.name}` | {f'`{default}`' if default else '-'} | {allowed} | {d.text} |"
        )
    return "\n".join(rows)


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
        "Root mean square speed of noise on the wind; acts through wind_drag and wind_lift.",
        unit="m/s",
        minimum=0.0,
        maximum=200.0,
    )
    gust_shortest: float = parameter(
        0.3, "Shortest wavelength of the noise.", unit="m", minimum=0.01, maximum=1e3
    )
    gust_longest: float = parameter(
        3.0, "Longest wavelength of the noise.", unit="m", minimum=0.01, maximum=1e3
    )
    gust_change: float = parameter(
        0.5, "Rate at which the noise changes by itself.", unit="1/s", minimum=0.0, maximum=100.0
    )
    gust_waves: int = parameter(
        24, "Plane waves that the noise is made of.", minimum=1, maximum=512
    )
    gust_divergence_free: bool = parameter(
        True, "Noise in which air neither appears nor vanishes."
    )
    gust_seed: int = parameter(
        1, "The same seed gives the same noise.", minimum=0, maximum=2**31 - 1
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
    )
    restitution: float = parameter(
        0.0, "Share of normal velocity that an earliest hit gives back.", minimum=0.0, maximum=1.0
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
    rate: float = parameter(
        0.0, "Messages per second; 0: as the clip.", unit="Hz", minimum=0.0, maximum=1000.0
    )
    speed: float = parameter(
        1.0, "Clip time per time; can be set while playing.", minimum=0.0, maximum=100.0
    )
    loop: bool = parameter(True, "Begin again after the end, or stand still there.")
    travel: bool = parameter(
        True, "A loop goes on from where it ended, so that a walk walks on; else it goes back."
    )
    publish_clock: bool = parameter(
        False, "Be the clock of a simulated time that begins at 0: publish /clock."
    )
    frame_id: str = parameter("world", "Frame of the skeleton's root, z up.")


@dataclasses.dataclass(frozen=True, kw_only=True)
class HullSettings:
    """How to fit hulls; other methods take `delta` only."""

    delta: float = parameter(
        0.003, "Inflation of all shapes.", unit="m", minimum=0.0, maximum=0.05
    )
    max_faces: int = parameter(
        80, "Triangles that a hull is simplified to, where that fits.", minimum=4, maximum=100000
    )
    reach: float = parameter(
        3.0, "Farthest that a simplified hull reaches out, in deltas.", minimum=1.0, maximum=100.0
    )
    placement: str = parameter(
        "quadric",
        "Where simplified corners go: near the inflated hull, or as tight as allowed.",
        choices=("quadric", "volume"),
    )
    inflation: str = parameter(
        "vertices",
        "What moves out by delta: corners, as in the paper, or faces, which then get all of it.",
        choices=("vertices", "planes"),
    )
    merge: float = parameter(
        0.0,
        "A region with a smaller share of the skin joins the next one.",
        minimum=0.0,
        maximum=1.0,
    )
    split: float = parameter(
        0.005,
        "A region is cut in two where that saves this share of all hulls' volume; 1 for never.",
        minimum=1e-4,
        maximum=1.0,
    )
    joints: str = parameter(
        "auto",
        "Colliders at joints: half-turning spheres in the skin, or hulls where these leave much "
        "open; spheres that contain all that bends (the paper's); or none.",
        choices=("auto", "spheres", "none"),
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class _ColliderKind:
    """The first of `ColliderOptions`."""

    method: str = parameter(
        "hulls",
        "Kind of colliders.",
        choices=("hulls", "capsules", "ellipsoids", "spheres"),
    )
    thickness: float = parameter(
        0.002, "Distance that cloth keeps on top.", unit="m", minimum=0.0, maximum=0.1
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class ColliderOptions(HullSettings, _ColliderKind):
    """Which colliders a body gets."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Avatar:
    """The first of `ColliderNodeParameters`."""

    body: str = parameter(
        "mannequin", "The avatar's body file, or 'mannequin'; empty: robot_description is it."
    )
    bone_names: str = parameter(
        "", "YAML file: humanoid bone to joint of robot_description, where names do not tell."
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
    frame_id: str = parameter("world", "Frame of everything published, z up.")


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClothNodeParameters:
    """Parameters of the node `cloth_node`."""

    body: str = parameter("mannequin", "The body that the garments are made for.")
    outfit: str = parameter("", "Outfit file; empty: a T-shirt and a short skirt.")
    rate: float = parameter(60.0, "Frames per second.", unit="Hz", minimum=1.0, maximum=1000.0)
    delay: float = parameter(
        -1.0,
        "How far the cloth stays behind the newest poses; below 0: one input period.",
        unit="s",
        minimum=-1.0,
        maximum=10.0,
    )
    step_on: str = parameter(
        "timer",
        "What advances the cloth: time, or every message of collider_poses, reproducibly.",
        choices=("timer", "poses"),
    )
    solver: str = parameter("relaxation", "Name of the solver.")
    solver_step: float = parameter(
        1 / 180, "Fixed step of the solver.", unit="s", minimum=1e-4, maximum=0.5
    )
    normals: bool = parameter(False, "Add vertex normals to the points.")
    catch_up: float = parameter(
        0.1,
        "Most time that is simulated within one frame; poses of the rest are passed over.",
        unit="s",
        minimum=0.01,
        maximum=10.0,
    )
    teleport_speed: float = parameter(
        30.0,
        "Colliders that move faster are taken to have jumped: the cloth is put on again.",
        unit="m/s",
        minimum=1.0,
        maximum=1e6,
    )
    time_jump: float = parameter(
        1.0, "Stamps farther apart begin a new time.", unit="s", minimum=0.05, maximum=1e6
    )
    frame_id: str = parameter("world", "Frame of poses and garments, z up.")


@dataclasses.dataclass(frozen=True, kw_only=True)
class XpbdSettings:
    """Numerical parameters of the `xpbd` solver."""

    sub_step: float = parameter(
        1 / 1200,
        "Longest sub-step: shorter is stiffer cloth and slower.",
        unit="s",
        minimum=1e-5,
        maximum=0.1,
    )
    iterations: int = parameter(
        1, "Passes over the edges in each sub-step.", minimum=1, maximum=1000
    )
    bending_every: int = parameter(
        4,
        "Sub-steps for each pass over the hinges and each search for contacts.",
        minimum=1,
        maximum=64,
    )
