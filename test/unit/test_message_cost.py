"""What messages cost grows with their size and no faster, and texts do not hold the node up."""

import json
import time

import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import Pose, PoseArray, Quaternion
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from garment_sim_ros import plain_data
from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.colliders.description import from_json
from garment_sim_ros.errors import MessageError
from garment_sim_ros.mocap.source_urdf import reference_from_urdf
from garment_sim_ros.ros.conversions import JointStates, poses_from
from garment_sim_ros.ros.joint_channels import JointChannels


def chain(count):
    """A robot of hinges each of which mimics the next."""
    hinges = "".join(
        f"<link name='l{i + 1}'/><joint name='joint_{i}' type='revolute'><parent link='l{i}'/>"
        f"<child link='l{i + 1}'/><limit lower='-1' upper='1' effort='1' velocity='1'/>"
        + (f"<mimic joint='joint_{i + 1}'/>" if i + 1 < count else "")
        + "</joint>"
        for i in range(count)
    )
    return f"<robot name='r'><link name='l0'/>{hinges}</robot>"


HINGES = parse_urdf(chain(64)).dofs


def joints_with_a_duplicate(count):
    names = [f"joint_{i}" for i in range(count - 1)] + [f"joint_{count - 2}"]
    data = serialize_message(JointState(name=names, position=[0.0] * count))

    def use():
        with pytest.raises(MessageError, match="twice"):
            JointChannels(HINGES).check(JointStates().read(data))

    return use


def poses(count):
    poses = [Pose(orientation=Quaternion(w=1.0))] * count
    data = serialize_message(PoseArray(header=Header(frame_id="world"), poses=poses))
    return lambda: poses_from(data)


def mimics(count):
    text = chain(count // 4)
    return lambda: (parse_urdf(text), reference_from_urdf(text))


def far_hull(count):
    corners = [[-(2**63)] * 3] * (4 * count)
    entry = {"name": "a", "kind": "hull", "bone": "b"}
    entry["pose_in_bone"] = {"position": [0, 0, 0], "orientation": [0, 0, 0, 1]}
    entry["geometry"] = {"vertices": corners, "faces": [[0, 1, 2]] * 4}
    document = {"version": 1, "revision": "", "frame_id": "world", "thickness": 0.0}
    text = json.dumps({**document, "colliders": [entry]})

    def use():
        with pytest.raises(MessageError):
            from_json(text)

    return use


@pytest.mark.parametrize("kind", [joints_with_a_duplicate, poses, mimics, far_hull])
def test_the_work_for_a_message_is_linear(kind):
    """Processor time of eight times as much: 8 times as long, and not 64 times."""

    def least(use):
        took = []
        for _ in range(4):
            began = time.thread_time_ns()
            use()
            took.append(time.thread_time_ns() - began)
        return min(took)

    small, large = kind(512), kind(4096)
    assert least(large) < 24 * least(small) + 100_000


def test_a_long_text_of_numbers_lets_other_threads_run(monkeypatch):
    """Its reader gives way at each number; without, none would run until all are read."""
    calls = []
    finite = plain_data._finite
    monkeypatch.setattr(plain_data, "_finite", lambda text: calls.append(1) or finite(text))
    numbers = [0.5] * 300_000
    assert plain_data.parse_json(json.dumps(numbers[:1000])) == numbers[:1000]
    assert not calls
    assert plain_data.parse_json(json.dumps(numbers)) == numbers
    assert len(calls) == len(numbers)


def test_a_long_description_is_read_in_pieces():
    robot = "<robot name='r'><link name='\N{GREEK SMALL LETTER ALPHA}'/>{}</robot>"
    rig = parse_urdf(robot.format("<!--" + "\N{EURO SIGN}" * 3_000_000 + "-->"))
    assert rig.joint_names == parse_urdf(robot.format("")).joint_names
