"""A collider node that runs, for the tests of a file."""

from importlib.util import find_spec

import numpy as np
import pytest

if find_spec("rclpy"):
    from ros_input.collider import NAMESPACE, Feeder
    from std_msgs.msg import String

    from garment_sim_ros.body.loaders.load import load_body
    from garment_sim_ros.body.loaders.urdf import parse_urdf
    from garment_sim_ros.body.retargeting import Retargeter
    from garment_sim_ros.colliders.description import from_json
    from garment_sim_ros.colliders.posing import ColliderPoser
    from garment_sim_ros.mocap.source_urdf import reference_from_urdf
    from garment_sim_ros.ros.topics import COLLIDER_DESCRIPTION, ROBOT_DESCRIPTION
else:
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(scope="module")
def node(start_node):
    return start_node("collider_node", NAMESPACE, ground_feet=False)


@pytest.fixture(scope="module")
def feeder(node, make_probe, until):
    probe = make_probe(NAMESPACE)
    feeder = Feeder(probe, until)
    description = probe.listen(COLLIDER_DESCRIPTION)
    probe.publish(ROBOT_DESCRIPTION, String(data=feeder.urdf))
    until(lambda: probe.received(description), "a description")
    until(
        lambda: (
            probe.diagnostics(node) and "waits for robot" not in probe.diagnostics(node).message
        ),
        "the skeleton is taken",
    )
    feeder.until_answered()
    return feeder


@pytest.fixture(scope="module")
def expected_poses(feeder):
    """Poses [n, 7] of the node's colliders for channel values, computed here."""
    colliders = from_json(feeder.probe.received("collider_description")[0].data)
    body = load_body("mannequin")
    rig = parse_urdf(feeder.urdf)
    move = Retargeter(rig, body, reference=reference_from_urdf(feeder.urdf))
    poser = ColliderPoser(colliders, body)
    order = [feeder.names.index(name) for name in rig.dofs.names]

    def poses(values):
        found = poser.poses(move.world_joints(np.array(values)[order]))
        return np.concatenate([found.position, found.orientation], axis=1)

    return poses
