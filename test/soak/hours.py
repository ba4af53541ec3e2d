"""Hours of clips in simulated time, as fast as they go: memory is flat, garments stay worn."""

import time

import psutil
from ros_input.processes import wait_until
from std_msgs.msg import String

from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.ros.serialize import Joints
from garment_sim_ros.ros.topics import JOINT_STATES, ROBOT_DESCRIPTION
from soak.avatar import Avatar
from soak.report import Row, at_least, at_most

SECOND = 10**9
_CLIPS = ("walk", "walk:speed=0.8,path=straight", "walk:path=in_place", "walk:speed=1.7")
"""Of one skeleton; from one to the next the body jumps, and its clothes are put on again."""
_CLIP = 20.0
"""Each is played for so long [s], over its seam."""
_AHEAD = SECOND // 2
"""The cloth is waited for where the input is farther on [ns]."""
_GROWTH = 16.0
"""Allowed from the end of the first hour on [MiB]."""


def run(lengths):
    period = SECOND // lengths.rate
    names, told = ("collider_node", "cloth_node"), []
    with Avatar("/soak_hours") as avatar:
        avatar.start("collider_node", lossless=True)
        avatar.start("cloth_node", step_on="poses", preset=lengths.preset)
        clips = [load_clip(name) for name in _CLIPS]
        message = Joints(clips[0].rig.dofs.names, "world")
        avatar.probe.publish(ROBOT_DESCRIPTION, String(data=urdf_from_clip(clips[0])))
        samplers = [ClipSampler(clip, "carry") for clip in clips]
        used = {name: psutil.Process(avatar.nodes[name].pid) for name in names}
        before = {name: sum(process.cpu_times()[:2]) for name, process in used.items()}
        begun, stamp, began = 1000 * SECOND, 1000 * SECOND, time.monotonic()
        for hour in range(lengths.hours):
            end = begun + round((hour + 1) * lengths.hour * SECOND)
            while stamp < end and time.monotonic() - began < lengths.longest:
                stamp += period
                at = (stamp - begun) / SECOND
                values = samplers[int(at / _CLIP) % len(samplers)].sample(at % _CLIP)
                avatar.probe.publish(JOINT_STATES, message.fill(stamp, values))
                if stamp - avatar.stamp > _AHEAD:
                    limit = stamp - _AHEAD // 2
                    if stamp - begun > _AHEAD:
                        wait_until(lambda to=limit: avatar.stamp >= to, "the cloth keeps up")
            told.append((avatar.fresh()["pierced"], *map(avatar.memory, names)))
            if stamp < end:
                break
        played = (stamp - begun) / SECOND
        times = {n: sum(process.cpu_times()[:2]) - before[n] for n, process in used.items()}
        rows = [
            Row("simulated time", f"{played / 3600.0:.3f} h"),
            Row("times real time", f"{played / (time.monotonic() - began):.2f}"),
            *(
                Row(f"processor time of {n}", f"{spent / played:.2f} s a second")
                for n, spent in times.items()
            ),
            at_most("pierced, worst hour's end", 100.0 * max(row[0] for row in told), 0.0, "%"),
        ]
        # Nothing can be seen to grow where nothing came before.
        rows.append(at_least("ends of hours, the last one cut short", len(told), 2))
        for k, name in enumerate(names, 1):
            grown = max(row[k] for row in told) - told[0][k]
            rows.append(at_most(f"memory that {name} grew by", grown, _GROWTH, "MiB"))
        return [*rows, *avatar.ends()]
