"""Time to build and publish Marker + PointCloud2 of 5,000 triangles, with a subscriber process.

Run: python bench/messages.py
"""

import os
import statistics
import subprocess
import sys
import time

import numpy as np
import rclpy
from rclpy.lifecycle import LifecycleNode

from garment_sim_ros.ros.interfaces import advertise
from garment_sim_ros.ros.serialize import PointCloud, TriangleMarker
from garment_sim_ros.ros.topics import GARMENT_MESH, GARMENT_POINTS

ROWS, COLUMNS = 51, 51  # vertices: 5,000 triangles
REPEATS = 600
RATE = 60.0

SUBSCRIBER = """
import rclpy
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker
rclpy.init()
node = rclpy.create_node("subscriber")
node.create_subscription(PointCloud2, "garments/cloth/points", lambda m: None, 2, raw=True)
node.create_subscription(Marker, "garments/cloth/mesh", lambda m: None, 2, raw=True)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    pass
"""


def grid() -> tuple[np.ndarray, np.ndarray]:
    """A flat cloth: vertices, float32, and triangles."""
    index = np.arange(ROWS * COLUMNS, dtype=np.int32).reshape(ROWS, COLUMNS)
    a, b = index[:-1, :-1].ravel(), index[1:, :-1].ravel()
    c, d = index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    x = np.random.default_rng(0).random((ROWS * COLUMNS, 3), dtype=np.float32)
    return x, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])


def measure(subscribed: bool) -> None:
    """Print the medians of building, of publishing and of both [ms]."""
    x, triangles = grid()
    node = LifecycleNode("bench_messages")
    points_out = advertise(node, GARMENT_POINTS, "cloth")
    mesh_out = advertise(node, GARMENT_MESH, "cloth")
    node.trigger_configure()
    node.trigger_activate()
    points = PointCloud(len(x), "world")
    mesh = TriangleMarker(triangles, "world", "cloth", (0.5, 0.5, 0.5, 1.0))
    mesh.fill(0, x)
    limit = time.monotonic() + 20.0
    while (
        subscribed and not mesh_out.get_subscription_count() * points_out.get_subscription_count()
    ):
        if time.monotonic() > limit:
            raise SystemExit("no subscriber")
        time.sleep(0.05)
    build, both = [], []
    for n in range(REPEATS):
        begin = time.perf_counter()
        first, second = points.fill(n, x), mesh.fill(n, x)
        built = time.perf_counter()
        points_out.publish(first)
        mesh_out.publish(second)
        done = time.perf_counter()
        build.append(1e3 * (built - begin))
        both.append(1e3 * (done - begin))
        time.sleep(1.0 / RATE)
    p = [np.percentile(both, q) for q in (5, 95)]
    who = "one subscriber" if subscribed else "no subscriber"
    print(
        f"{len(triangles)} triangles, {who}: build {statistics.median(build):.3f} ms, build and "
        f"publish {statistics.median(both):.3f} ms (5 to 95 %: {p[0]:.3f} to {p[1]:.3f} ms)"
    )
    node.destroy_node()


def main() -> None:
    """Measure without and with a subscriber in another process."""
    os.environ.setdefault("RMW_FASTRTPS_PUBLICATION_MODE", "ASYNCHRONOUS")  # as the nodes do
    rclpy.init()
    try:
        measure(False)
        other = subprocess.Popen([sys.executable, "-c", SUBSCRIBER])
        try:
            measure(True)
        finally:
            other.terminate()
            other.wait()
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
