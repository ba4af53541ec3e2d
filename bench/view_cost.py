"""Late frames of the demo's cloth with and without a page that shows it, in turns.

    python bench/view_cost.py [BAG]

The three nodes and the recorder run as `garment-sim demo` has them. A viewer is the command with a
client that takes all that a browser would, without drawing it: where the browser is matters for
its own processor alone. Also told, of a recorded avatar (BAG; alone, where it is given): how long
after the start of the command the first picture is sent, and the processor time that one takes;
`c_us` is how fast the machine was, as `bench/springs.py` has it.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import msgspec
import psutil
import viser
from springs import machine_us
from websockets.sync.client import connect

from garment_sim_ros.cli.node_processes import NodeProcesses, own_network

COMMAND = [sys.executable, "-m", "garment_sim_ros.cli.main", "view", "--port", "0", "--json"]
LONGEST = 300.0
"""For what is waited for: kernels are compiled before the first frame [s]."""
CAMERA = {
    "type": "ViewerCameraMessage",
    **{"wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, -2.0, 1.0]},
    **{"look_at": [0.0, 0.0, 1.0], "up_direction": [0.0, 0.0, 1.0]},
    **{"fov": 1.0, "near": 0.1, "far": 100.0, "image_height": 100, "image_width": 100},
}


class Viewer:
    """The command, and a client that reads."""

    def __init__(self, *words):
        self.began = time.monotonic()
        self.process = subprocess.Popen([*COMMAND, *words], stdout=subprocess.PIPE, text=True)
        self.url = json.loads(self.process.stdout.readline())["url"]
        self.windows = self.bytes = 0
        self.first = 0.0
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self):
        protocol = [f"viser-v{viser.__version__}"]
        with connect(self.url.replace("http", "ws"), subprotocols=protocol, max_size=None) as c:
            c.send(msgspec.msgpack.encode(CAMERA))
            for data in c:
                self.bytes += len(data)
                # A window with a body or garments is large; one with the panel alone is not.
                if len(data) > 30_000:
                    self.windows += 1
                    self.first = self.first or time.monotonic() - self.began

    def has_shown(self):
        """Whether there was a picture; the command may not end before."""
        if self.process.poll() is not None:
            raise SystemExit("error: view: it ended before its first picture")
        return self.first > 0.0

    def close(self):
        """End it."""
        self.process.terminate()
        self.process.wait()


def late(folder, seconds, rounds):
    """Share of late frames without and with a viewer, round by round."""
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray

    from garment_sim_ros.ros.recorder import Recorder

    told = {}

    def take(message):
        for status in message.status:
            if status.name.endswith("cloth_node"):
                told.update({v.key: v.value for v in status.values})

    with NodeProcesses(folder / "logs") as nodes:
        nodes.start("cloth_node", {"rate": 60.0})
        nodes.start("collider_node", {})
        nodes.start("mocap_player", {})
        with Recorder(folder / "bag"):
            rclpy.init()
            node = rclpy.create_node("view_cost")
            node.create_subscription(DiagnosticArray, "/diagnostics", take, 10)

            def counts():
                """Frames and late frames as last told."""
                rclpy.spin_once(node, timeout_sec=0.0)
                return int(told.get("frames", 0)), int(told.get("late_frames", 0))

            def is_dressed():
                nodes.check()
                return counts()[0]

            wait_until(is_dressed, "the first frame of cloth")
            wait(2.0, counts)
            found = {False: [], True: []}
            for _ in range(rounds):
                for viewed in (False, True):
                    viewer = Viewer("--body", "mannequin") if viewed else None
                    wait(2.0, counts)
                    before, windows = counts(), viewer.windows if viewer else 0
                    wait(seconds, counts)
                    after = counts()
                    frames = after[0] - before[0]
                    share = (after[1] - before[1]) / max(frames, 1)
                    found[viewed].append(share)
                    line = f"{'viewed' if viewed else 'alone':7} {frames} frames, late {share:.2%}"
                    if viewer:
                        rate = (viewer.windows - windows) / seconds
                        line += f", page at {rate:.1f} Hz, {viewer.bytes / 1e6:.0f} MB in all"
                        viewer.close()
                    print(line, flush=True)
            rclpy.shutdown()
            return found


def recorded(bag, seconds, rounds):
    """First picture, and processor time of one, of a recording that plays."""
    firsts, worked, costs, speeds = [], [], [], []
    for _ in range(rounds):
        speeds.append(machine_us())
        viewer = Viewer(str(bag))
        wait_until(viewer.has_shown, "the first picture")
        firsts.append(viewer.first)
        worked.append(sum(psutil.Process(viewer.process.pid).cpu_times()[:2]))
        time.sleep(seconds)  # the body is made ready in this time
        process = psutil.Process(viewer.process.pid)
        before, windows = sum(process.cpu_times()[:2]), viewer.windows
        time.sleep(seconds)
        spent, windows = sum(process.cpu_times()[:2]) - before, viewer.windows - windows
        costs.append(1e3 * spent / max(windows, 1))
        print(
            f"first after {firsts[-1]:.2f} s, {worked[-1]:.2f} of them at work; "
            f"{windows / seconds:.1f} Hz, {costs[-1]:.1f} ms each; c_us {speeds[-1]:.0f}"
        )
        viewer.close()
    print(
        f"recorded, medians: first picture sent after {statistics.median(firsts):.2f} s, "
        f"{statistics.median(worked):.2f} of them at work, "
        f"{statistics.median(costs):.1f} ms of a processor for each; "
        f"c_us {statistics.median(speeds):.0f}"
    )


def wait_until(condition, what):
    """Wait for something, not for ever."""
    end = time.monotonic() + LONGEST
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f"error: {what}: did not come in {LONGEST:g} s")
        time.sleep(0.01)


def wait(seconds, counts):
    """Let time pass, with diagnostics taken."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        counts()
        time.sleep(0.1)


def main():
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=6.0, help="of a round (default: 6)")
    parser.add_argument("--rounds", type=int, default=3, help="default: 3")
    parser.add_argument("bag", nargs="?", help="of demo or simulate")
    args = parser.parse_args()
    # A polite end takes the nodes along.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if args.bag:
        recorded(args.bag, args.seconds, args.rounds)
        return
    os.environ.update(own_network())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = late(folder, args.seconds, args.rounds)
        alone, viewed = (statistics.median(found[k]) for k in (False, True))
        print(f"late frames, medians: alone {alone:.2%}, viewed {viewed:.2%}")
        recorded(folder / "bag", args.seconds, args.rounds)


if __name__ == "__main__":
    main()
