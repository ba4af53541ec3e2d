"""Sends hostile messages for ever: ``python -m soak.send_hostile NAMESPACE STAMP``.

The stamp [ns] is that of the good messages now; how many were sent is printed each second.
"""

import sys
import time

from rclpy.serialization import serialize_message
from ros_input.hostile import Sender, hostile_messages
from ros_input.processes import Probe

from garment_sim_ros.mocap.clips import load_clip


def main():
    probe, begin, began = Probe(sys.argv[1]), int(sys.argv[2]), time.monotonic_ns()
    clip, kinds = load_clip("walk"), []

    def send(number):
        if number % 100 == 0:
            stamp = begin + time.monotonic_ns() - began
            kinds[:] = [
                (topic, message if isinstance(message, bytes) else serialize_message(message))
                for topic, message in hostile_messages(stamp, clip)
            ]
        probe.publish(*kinds[number % len(kinds)])

    sender = Sender(send)
    sender.start()
    while True:
        time.sleep(1.0)
        print(sender.sent, flush=True)


if __name__ == "__main__":
    main()
