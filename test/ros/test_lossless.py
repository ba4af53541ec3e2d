"""Live and offline are one: the same joint states give the same cloth, bit for bit."""

import signal

import pytest

pytest.importorskip("rclpy")

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from ros_input.cloth import SECOND, stamp_of

from garment_sim_ros.cli.main import main
from garment_sim_ros.mocap.bag_file import opened_bag
from garment_sim_ros.ros.recorder import Recorder
from garment_sim_ros.ros.stamp_order import JUMP
from garment_sim_ros.ros.topics import GARMENT_POINTS, JOINT_STATES

pytestmark = pytest.mark.ros
OUTFIT = """
version: 1
garments:
  - {name: skirt, generator: short_skirt, options: {vertices: 500}}
  - {name: shirt, generator: tshirt, options: {vertices: 500}}
"""
MESSAGES = 240
NODES = {
    # The recorder is the other subscriber: what it hears of is what the nodes hear of.
    "collider_node": {"lossless": True, "wait_for_subscribers": 2},
    "cloth_node": {"step_on": "poses"},
    "mocap_player": {"wait_for_subscribers": 2, "rate": 60.0},
}
ORDERS = {
    "the cloth first": ("cloth_node", "collider_node", "mocap_player"),
    "the player first": ("mocap_player", "collider_node", "cloth_node"),
}


def on(bag, ending):
    """Stamp, topic and bytes of all messages on topics with an ending.

    The middleware fills messages up to four bytes.
    """
    with opened_bag(bag) as opened:
        chosen = [c for c in opened.connections if c.topic.endswith(ending)]
        return [
            (stamp_of(data), connection.topic, data + bytes(-len(data) % 4))
            for connection, _, data in opened.messages(chosen)
        ]


@pytest.mark.parametrize(
    "order", [pytest.param("the cloth first", marks=pytest.mark.slow), "the player first"]
)
def test_the_cloth_of_the_nodes_is_that_of_simulate(
    start_node, make_probe, until, tmp_path, order
):
    """Poses wait for the cloth, and joint states for the colliders, whoever starts last."""
    namespace = f"/lossless_{order.split()[1]}"
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(OUTFIT)
    worn = {"collider_node": {"outfit": str(outfit)}, "cloth_node": {"outfit": str(outfit)}}
    joints, clouds = f"{namespace}/joint_states", f"{namespace}/garments/shirt/points"
    nodes = {}
    with Recorder(tmp_path / "live") as recorder:

        def count(topic):
            return recorder.counts.get(topic, 0)

        for name in ORDERS[order]:
            if name == "mocap_player":
                # Clouds from the first on, where there is cloth before there are joint states.
                until(lambda: len(nodes) < 2 or clouds in recorder.counts, "the cloth's topics")
            elif name == "cloth_node" and "mocap_player" in nodes:
                until(lambda: count(joints) > MESSAGES // 2, "joint states before the cloth")
            nodes[name] = start_node(name, namespace, **NODES[name], **worn.get(name, {}))
        until(lambda: count(joints) > MESSAGES, "joint states")
        # Not before they flow: the player waits for no more readers than the two.
        probe = make_probe(namespace)
        heard = [probe.listen(JOINT_STATES, raw=True)]
        heard += [probe.listen(GARMENT_POINTS, name, raw=True) for name in ("skirt", "shirt")]
        until(lambda: all(map(probe.received, heard)), "the probe hears all of it")
        # Not ended before its readers have all of it: what is under way then is lost.
        halt = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE))
        assert probe.call(ChangeState, "mocap_player/change_state", halt).success

        def apart():
            last = [stamp_of(probe.received(name)[-1]) for name in heard]
            return max(last) - min(last)

        # Clouds are of whole steps, joint states of the player's clock.
        until(lambda: apart() < SECOND // 1000, "the cloth of the last joint state")
        # What its nodes tell after it comes after it: the recorder has it, too.
        told = count("/diagnostics")
        until(lambda: count("/diagnostics") > told + len(nodes), "diagnostics")
    for name in NODES:
        nodes[name].send(signal.SIGTERM)
        assert nodes[name].wait() == 0
        # On a busy machine the player may stand still for longer than a jump is.
        refused = [line for line in nodes[name].output.splitlines() if "rejected" in line]
        assert not [line for line in refused if JUMP not in line]

    out = tmp_path / "offline"
    words = ["--bag", str(tmp_path / "live"), "--outfit", str(outfit), "--out", str(out)]
    assert main(["simulate", *words]) == 0
    assert on(out, "/joint_states") == on(tmp_path / "live", "/joint_states")
    for ending in ("/collider_poses", "/skirt/points", "/shirt/points"):
        live, offline = on(tmp_path / "live", ending), on(out, ending)
        if order == "the player first":
            # Whoever hears of a topic late misses its beginning; the recorder does here.
            assert len(live) > MESSAGES // 2
            offline = offline[-len(live) :]
        assert [stamp for stamp, _, _ in live] == [stamp for stamp, _, _ in offline]
        different = [live[0] for live, then in zip(live, offline) if live != then]
        assert not different, f"{len(different)} of {len(live)} on {ending}"
