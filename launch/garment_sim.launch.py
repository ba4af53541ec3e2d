"""The three nodes of one avatar, and robot_state_publisher where it is installed.

Example:
    ros2 launch garment_sim_ros garment_sim.launch.py namespace:=avatar clip:=dance.bvh
"""

from pathlib import Path

import yaml
from ament_index_python.packages import (
    PackageNotFoundError,
    get_package_prefix,
    get_package_share_directory,
)
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, NotEqualsSubstitution, OrSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchContext, LaunchDescription

ROOT = "world"

ARGUMENTS = {
    "namespace": ("", "Namespace of the avatar: one each."),
    "body": ("mannequin", "Body file of the avatar, or 'mannequin'."),
    "clip": (
        "walk",
        "BVH or glTF file, rosbag2, 'walk'; empty: no player, joint_states come from elsewhere.",
    ),
    "outfit": ("", "Outfit file; empty: a T-shirt and a short skirt."),
    "preset": ("balanced", "fast, balanced, accurate, auto, sun2007 or gong2018."),
    "set": ("", "NODE.PARAM=VALUE, several with ; between: these win over the preset."),
    "use_sim_time": ("false", "Follow /clock."),
    "publish_clock": ("false", "The player is the clock that the other nodes follow."),
    "robot_state_publisher": ("true", "Start robot_state_publisher where it is installed."),
    "rviz": ("false", "Show the avatar in RViz, where it is installed."),
}


def text(name: str) -> ParameterValue:
    """A launch argument as text, whatever it looks like."""
    return ParameterValue(LaunchConfiguration(name), value_type=str)


def flag(*names: str) -> ParameterValue:
    """Whether any of some launch arguments is true."""
    either = LaunchConfiguration(names[0])
    for name in names[1:]:
        either = OrSubstitution(either, LaunchConfiguration(name))
    return ParameterValue(either, value_type=bool)


def given_in(context: LaunchContext) -> dict[str, dict[str, object]]:
    """By node: what the launch arguments `preset` and `set` say."""
    from garment_sim_ros.presets import chosen

    words = LaunchConfiguration("set").perform(context).split(";")
    choice = chosen(
        LaunchConfiguration("preset").perform(context),
        [word for word in words if word.strip()],
        option="set",
    )

    def typed(value: object) -> object:
        # Text is not to be taken for a number.
        return ParameterValue(value, value_type=str) if isinstance(value, str) else value

    return {
        name: {key: typed(value) for key, value in choice.given(name).items()}
        for name in ("mocap_player", "collider_node", "cloth_node")
    }


def node(
    executable: str,
    given: dict[str, object],
    condition: IfCondition | None = None,
    **parameters: ParameterValue,
) -> Node:
    """One of this package's nodes, with its parameters and those given beside, which win."""
    return Node(
        package="garment_sim_ros",
        executable=executable,
        name=executable,
        namespace=LaunchConfiguration("namespace"),
        output="screen",
        condition=condition,
        parameters=[parameters, given],
    )


def frame_prefix(namespace: str) -> str:
    """What goes before the names of an avatar's joint frames: all avatars share one tree."""
    name = namespace.strip("/")
    return f"{name}/" if name else ""


def joint_frames(context: LaunchContext) -> list[Node]:
    """robot_state_publisher with the URDF that the player publishes, where it is installed."""
    clip = LaunchConfiguration("clip").perform(context)
    if not clip:
        return []
    try:
        get_package_prefix("robot_state_publisher")
    except PackageNotFoundError:
        return []
    from garment_sim_ros.mocap.clips import load_clip
    from garment_sim_ros.mocap.source_urdf import urdf_from_clip

    urdf = urdf_from_clip(load_clip(clip))
    prefix = frame_prefix(LaunchConfiguration("namespace").perform(context))
    # The prefix goes before the root's name, too.
    joined = [
        Node(
            package="tf2_ros",
            executable="static_transform_publisher",
            name="world_frame",
            namespace=LaunchConfiguration("namespace"),
            arguments=["--frame-id", ROOT, "--child-frame-id", f"{prefix}{ROOT}"],
        )
    ]
    return (joined if prefix else []) + [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            namespace=LaunchConfiguration("namespace"),
            parameters=[
                {
                    "robot_description": ParameterValue(urdf, value_type=str),
                    "frame_prefix": prefix,
                    "use_sim_time": flag("use_sim_time", "publish_clock"),
                }
            ],
            # The player has the latched topic.
            remappings=[("robot_description", "~/robot_description")],
        )
    ]


def shown_topics(config: str) -> list[tuple[str, str]]:
    """Topics that RViz's configuration names, each as it is and in the namespace of the node."""
    displays = yaml.safe_load(config)["Visualization Manager"]["Displays"]
    names = [display["Topic"]["Value"] for display in displays if "Topic" in display]
    return [(name, name.lstrip("/")) for name in names]


def rviz(context: LaunchContext) -> list[Node | LogInfo]:
    """RViz with the avatar, where it is installed."""
    try:
        get_package_prefix("rviz2")
    except PackageNotFoundError:
        return [LogInfo(msg="rviz: rviz2 is not installed; allowed: rviz:=false")]
    config = Path(get_package_share_directory("garment_sim_ros")) / "config" / "garment_sim.rviz"
    return [
        Node(
            package="rviz2",
            executable="rviz2",
            name="rviz",
            namespace=LaunchConfiguration("namespace"),
            arguments=["-d", str(config)],
            parameters=[{"use_sim_time": flag("use_sim_time", "publish_clock")}],
            remappings=shown_topics(config.read_text()),
        )
    ]


def nodes(context: LaunchContext) -> list[Node]:
    """The nodes of one avatar."""
    given = given_in(context)
    return [
        node(
            "mocap_player",
            given["mocap_player"],
            IfCondition(NotEqualsSubstitution(LaunchConfiguration("clip"), "")),
            clip=text("clip"),
            use_sim_time=flag("use_sim_time"),
            publish_clock=flag("publish_clock"),
        ),
        node(
            "collider_node",
            given["collider_node"],
            body=text("body"),
            outfit=text("outfit"),
            use_sim_time=flag("use_sim_time", "publish_clock"),
        ),
        node(
            "cloth_node",
            given["cloth_node"],
            body=text("body"),
            outfit=text("outfit"),
            use_sim_time=flag("use_sim_time", "publish_clock"),
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """What `ros2 launch` runs."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=about)
                for name, (default, about) in ARGUMENTS.items()
            ),
            OpaqueFunction(function=nodes),
            OpaqueFunction(
                function=joint_frames,
                condition=IfCondition(LaunchConfiguration("robot_state_publisher")),
            ),
            OpaqueFunction(function=rviz, condition=IfCondition(LaunchConfiguration("rviz"))),
        ]
    )
