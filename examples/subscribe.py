"""A garment of a running avatar (`garment-sim demo`, `ros2 launch`) as numpy arrays.

python examples/subscribe.py tshirt 60 --ros-args -r __ns:=/
"""

import sys

import numpy as np
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import PointCloud2
from shape_msgs.msg import Mesh


def main(garment: str = "tshirt", count: str = "60") -> None:
    """Prints so many frames, their stamps and where the garment is."""
    rclpy.init(args=sys.argv)
    node = rclpy.create_node("listener")
    frames: list[tuple[int, np.ndarray]] = []  # [ns]; [v, 3] m, world
    meshes: list[Mesh] = []

    def take(message: PointCloud2) -> None:
        rows = np.frombuffer(message.data, np.float32).reshape(message.width, -1)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        frames.append((stamp, rows[:, :3]))
        print(f"{stamp} ns: {len(rows)} vertices about {rows[:, :3].mean(axis=0).round(3)} m")

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(Mesh, f"garments/{garment}/topology", meshes.append, latched)
    node.create_subscription(PointCloud2, f"garments/{garment}/points", take, 2)
    while len(frames) < int(count) or not meshes:
        rclpy.spin_once(node)
    triangles = np.array([t.vertex_indices for t in meshes[0].triangles])
    print("triangles:", triangles.shape)


if __name__ == "__main__":
    main(*remove_ros_args(sys.argv)[1:3])
