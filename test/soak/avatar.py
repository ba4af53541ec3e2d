"""Real nodes that a fault is tried on, and what is known of them."""

import contextlib
import signal
import time

import psutil
from ros_input.cloth import stamp_of
from ros_input.processes import NodeProcess, Probe, wait_until

from garment_sim_ros.ros.topics import GARMENT_POINTS
from soak.report import Row, at_most

NODES = ("mocap_player", "collider_node", "cloth_node")


class Avatar:
    """Nodes in one namespace, that end with the `with` block.

    Args:
        namespace: Theirs.
        garment: Whose frames are counted.

    Attributes:
        nodes: By name, those that run.
        probe: Sends and listens beside them.
        frames: Frames of cloth so far.
        moved: Those that were of another time than the one before.
        stamp: Time of the last frame [ns].
    """

    def __init__(self, namespace, garment="skirt"):
        self.namespace, self.garment = namespace, garment
        self.nodes, self.ended = {}, []
        self.frames = self.moved = 0
        self.stamp = -1

    def __enter__(self):
        self.probe = Probe(self.namespace)
        from rclpy.qos import QoSProfile

        # Counted, not kept: a soak run is long.
        self.probe.node.create_subscription(
            GARMENT_POINTS.type,
            GARMENT_POINTS.name.format(self.garment),
            self._take,
            QoSProfile(depth=100),
            raw=True,
        )
        return self

    def __exit__(self, *_):
        for node in self.nodes.values():
            node.send(signal.SIGTERM)
        for node in self.nodes.values():
            with contextlib.suppress(Exception):
                node.wait()
            node.end()
        self.probe.close()

    def _take(self, data):
        stamp = stamp_of(data)
        self.frames += 1
        self.moved += stamp != self.stamp
        self.stamp = stamp

    def start(self, name, **parameters):
        """Start a node, or start it again."""
        self.nodes[name] = NodeProcess(name, self.namespace, **parameters)
        return self.nodes[name]

    def kill(self, name):
        """End a node at once, as the kernel does that is out of memory."""
        node = self.nodes.pop(name)
        node.send(signal.SIGKILL)
        node.wait()
        self.ended.append(node.output)
        node.end()

    def follow(self, *, since=None):
        """Wait for a frame of a time that was not yet when this was called [ns]; how long [s]."""
        began = time.monotonic()
        now = self.probe.node.get_clock().now().nanoseconds if since is None else since
        wait_until(lambda: self.stamp >= now, f"cloth of after {now}, it is of {self.stamp}")
        return time.monotonic() - began

    def fresh(self, name="cloth_node"):
        """The numbers of a node's next diagnostics, by name."""
        node = self.nodes[name]
        before = self.probe.diagnostics(node)
        wait_until(lambda: self.probe.diagnostics(node) is not before, f"diagnostics of {name}")
        values = {}
        for item in self.probe.diagnostics(node).values:
            with contextlib.suppress(ValueError):
                values[item.key] = float(item.value)
        return values

    def memory(self, name):
        """What a node's process takes [MiB]."""
        return psutil.Process(self.nodes[name].pid).memory_info().rss / 2**20

    def ends(self):
        """Rows that every fault ends with: still worn, no node has fallen over."""
        pierced = 100.0 * self.fresh()["pierced"]
        outputs = [*self.ended, *(node.output for node in self.nodes.values())]
        traces = sum(output.count("Traceback") for output in outputs)
        running = all(node.is_running for node in self.nodes.values())
        return [
            at_most("frames in which a limb pierces cloth", pierced, 0.0, "%"),
            Row(
                "nodes that fell over",
                f"{traces} traces" if running else "a node ended",
                "none",
                running and not traces,
            ),
        ]
