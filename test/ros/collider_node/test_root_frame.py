"""The hips' frame on /tf, with the message type that ROS 2's own generators make."""

import os
import shutil
import sys
from importlib.util import find_spec

import numpy as np
import pytest

pytest.importorskip("rclpy")

from ros_input import tf2_messages
from ros_input.collider import NAMESPACE, nanoseconds

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.geometry.transforms import quaternion_from_matrix
from garment_sim_ros.mocap.source_urdf import reference_from_urdf
from garment_sim_ros.ros.topics import ROOT_POSE

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module", autouse=True)
def _tf2_messages(tmp_path_factory):
    """They can be imported here and in the node."""
    if find_spec("tf2_msgs"):
        yield
        return
    if not (shutil.which("gcc") and shutil.which("g++")):
        pytest.skip("tf2_msgs is not installed, and there is no compiler to make it")
    folder = tmp_path_factory.mktemp("tf2")
    with pytest.MonkeyPatch.context() as change:
        change.setenv("AMENT_PREFIX_PATH", sys.prefix)
        try:
            tf2_messages.build(folder)
        except ImportError as error:
            pytest.skip(f"tf2_msgs is not installed, and cannot be made: {error}")
        for name in ("PYTHONPATH", "LD_LIBRARY_PATH"):
            change.setenv(name, str(folder), prepend=os.pathsep)
        change.syspath_prepend(str(folder))
        yield
        for name in [name for name in sys.modules if name.split(".")[0] == "tf2_msgs"]:
            del sys.modules[name]


@pytest.fixture
def hips(feeder):
    """World transform of the body's hips for a sample of the clip, computed here."""
    body, rig = load_body("mannequin"), parse_urdf(feeder.urdf)
    move = Retargeter(rig, body, reference=reference_from_urdf(feeder.urdf))
    order = [feeder.names.index(name) for name in rig.dofs.names]
    index = body.rig.index(body.humanoid["hips"])
    return lambda sample: move.world_joints(feeder.clip.values[sample][order])[index]


def test_root_frame_is_the_hips_of_the_clip(feeder, hips, until):
    from rosbags.typesys import Stores, get_typestore
    from tf2_msgs.msg import TFMessage

    root, frames = feeder.probe.listen(ROOT_POSE), []
    feeder.probe.node.create_subscription(TFMessage, "/tf", frames.append, 100)
    samples = {}

    def both():
        stamp = feeder.send()
        samples[stamp] = feeder.sample
        stamps = {nanoseconds(t) for message in frames for t in message.transforms}
        return len(stamps & {nanoseconds(m) for m in feeder.probe.received(root)}) > 10

    until(both, "the root's pose and frame")
    poses = {nanoseconds(m): m.pose for m in feeder.probe.received(root)}
    found = [transform for message in frames for transform in message.transforms]
    for frame in found:
        assert (frame.header.frame_id, frame.child_frame_id) == ("world", f"{NAMESPACE[1:]}/hips")
        t, q = frame.transform.translation, frame.transform.rotation
        expected = hips(samples[nanoseconds(frame)])
        np.testing.assert_allclose([t.x, t.y, t.z], expected[:3, 3], atol=1e-9)
        turned = quaternion_from_matrix(expected[:3, :3])
        np.testing.assert_allclose([q.x, q.y, q.z, q.w], turned, atol=1e-9)
        pose = poses.get(nanoseconds(frame))
        if pose is not None:
            assert (t.x, t.y, t.z) == (pose.position.x, pose.position.y, pose.position.z)
            assert (q.w, q.z) == (pose.orientation.w, pose.orientation.z)
    assert len(poses.keys() & {nanoseconds(frame) for frame in found}) > 10
    # Others take the frame: the type is the one that ROS 2 has under this name.
    (publisher,) = feeder.probe.publishers_of("/tf")
    known = get_typestore(Stores.ROS2_JAZZY).hash_rihs01(publisher.topic_type)
    assert publisher.topic_type == "tf2_msgs/msg/TFMessage"
    assert str(publisher.topic_type_hash) == known
