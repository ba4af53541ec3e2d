"""A cloth node that runs, for the tests of a file."""

from importlib.util import find_spec

import numpy as np
import pytest

if find_spec("rclpy"):
    from ros_input.cloth import (
        GARMENTS,
        NAMESPACE,
        OUTFIT,
        RATE,
        SECOND,
        Avatar,
        Feeder,
        points_of,
        stamp_of,
    )

    from garment_sim_ros.ros.topics import (
        COLLIDER_DESCRIPTION,
        COLLIDER_POSES,
        GARMENT_MESH,
        GARMENT_POINTS,
        QUALITY,
    )
else:
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(scope="module")
def outfit(tmp_path_factory):
    path = tmp_path_factory.mktemp("outfit") / "outfit.yaml"
    path.write_text(OUTFIT)
    return str(path)


@pytest.fixture(scope="module")
def avatar():
    return Avatar()


@pytest.fixture(scope="module")
def node(start_node, outfit):
    return start_node("cloth_node", NAMESPACE, outfit=outfit, rate=RATE)


@pytest.fixture(scope="module")
def probe(node, make_probe, avatar, until):
    probe = make_probe(NAMESPACE)
    until(
        lambda: (
            probe.diagnostics(node) and "waits for collider_d" in probe.diagnostics(node).message
        ),
        "the node waits for colliders",
    )
    for name in GARMENTS:
        # Serialized: thousands of points as objects, at 60 Hz, would take all of a core.
        probe.listen(GARMENT_POINTS, name, raw=True)
        probe.listen(GARMENT_MESH, name, raw=True)
    probe.listen(QUALITY)
    probe.publish(COLLIDER_DESCRIPTION, avatar.description)
    # The publisher is made here: it waits for its reader, which the feeder's timer must not.
    probe.publish(COLLIDER_POSES, avatar.message(999 * SECOND, avatar.at(999.0)))
    return probe


@pytest.fixture(scope="module")
def feeder(probe, avatar):
    feeder = Feeder(probe, avatar)
    yield feeder
    feeder.stop()


@pytest.fixture
def running(feeder, reach):
    """Input that runs, and cloth that follows it; both rest while other nodes are tested."""
    feeder.start()
    reach()
    yield feeder
    feeder.stop()


@pytest.fixture
def reach(feeder, probe, until):
    """Waits until the cloth is where the input is now; the shirt's points there."""

    def reach():
        now = feeder.stamp
        found = probe.received("garments/shirt/points")

        def recent():
            return found and now < stamp_of(found[-1]) <= feeder.stamp

        until(recent, "the cloth follows the input")
        points = points_of(found[-1])
        assert np.isfinite(points).all()
        sway = 0.2 * np.sin(np.pi * 1e-9 * stamp_of(found[-1]))
        middle = feeder.origin[0] + sway, feeder.origin[1]
        assert np.abs(points[:, :2].mean(axis=0) - middle).max() < 0.2
        assert 0.8 < points[:, 2].mean() < 1.6
        return points

    return reach
