"""Avatars of one host in one process: one launch on each host.

Example, 8 avatars on each of two hosts:
    ros2 launch garment_sim_ros many_avatars.launch.py host:=1 avatars:=8 preset:=fast
    ros2 launch garment_sim_ros many_avatars.launch.py host:=2 avatars:=8 preset:=fast
"""

from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.substitutions import ExecutableInPackage

from launch import LaunchContext, LaunchDescription

ARGUMENTS = {
    "host": ("1", "Number of this host: its avatars are host_<number>/avatar_1 and so on."),
    "avatars": ("8", "How many this host runs."),
    "domain": (
        "40",
        "DDS domain of host 1, the next ones have the next; empty: that of the shell.",
    ),
    "body": ("mannequin", "Body file of the avatars, or 'mannequin'."),
    "clip": ("walk", "BVH or glTF file, or rosbag2; empty: joint_states come from elsewhere."),
    "outfit": ("tshirt_short_skirt", "Outfit file or name."),
    "preset": ("fast", "fast, balanced, accurate, auto, sun2007 or gong2018."),
    "set": ("cloth_node.rate=30", "NODE.PARAM=VALUE, several with ; between."),
}


def words(given: dict[str, str]) -> list[str]:
    """Command line of `garment-sim`."""
    line = ["run", "--namespace", f"host_{given['host']}", "--avatars", given["avatars"]]
    for name in ("body", "clip", "outfit", "preset"):
        line += [f"--{name}", given[name]]
    for word in filter(str.strip, given["set"].split(";")):
        line += ["--set", word.strip()]
    return line


def environment(given: dict[str, str]) -> dict[str, str]:
    """Each host has a domain of its own: others do not hear of what stays on it."""
    if not given["domain"]:
        return {}
    return {"ROS_DOMAIN_ID": str(int(given["domain"]) + int(given["host"]) - 1)}


def process(context: LaunchContext) -> list[ExecuteProcess]:
    """The process of this host."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    command = ExecutableInPackage(package="garment_sim_ros", executable="garment-sim")
    return [
        ExecuteProcess(
            cmd=[command, *words(given)],
            additional_env=environment(given),
            output="screen",
        )
    ]


def generate_launch_description() -> LaunchDescription:
    """What `ros2 launch` runs."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=about)
                for name, (default, about) in ARGUMENTS.items()
            ),
            OpaqueFunction(function=process),
        ]
    )
