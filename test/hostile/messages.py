"""Damages messages of every topic that the nodes take and tells what their handlers did.

As a program, from `test/`: ``python -m hostile.messages --count 1000000 --seed 0``. It runs in a
process of its own, whose memory is limited and which a handler that never ends ends. The handlers
are those of `collider_node` and `cloth_node`, without the middleware, which does not look into a
message: they get its bytes.
"""

import argparse
import dataclasses
import faulthandler
import itertools
import json
import random
import resource
import struct
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from std_msgs.msg import String

from garment_sim_ros.colliders.description import MAX_TEXT, from_json, to_json
from garment_sim_ros.errors import MessageError
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.ros.cdr import encode
from garment_sim_ros.ros.conversions import text_from
from garment_sim_ros.ros.offline.inputs import Message
from garment_sim_ros.ros.offline.setup import Setup
from garment_sim_ros.ros.offline.work import Cloth, Colliders
from garment_sim_ros.ros.serialize import Joints
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_POSES,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
)
from hostile.mutants import binary_mutant, mutant
from hostile.run import limit_memory

HANG = 20.0
"""Longest that one message may take [s]: over it the process ends with the handler's stack."""
SLOW = 1.0
"""Over this [s] it counts as a failure."""
_PERIOD = 2_000_000
"""Between the stamps of good messages [ns]."""
_GOOD_EVERY = 50
"""A good message comes after so many: it must be taken, however bad those before were."""
_GROWN = 64 * 2**20
"""What the process may grow by while it does this [bytes]."""
_SHARES = {JOINT_STATES: 0.6, COLLIDER_POSES: 0.38, ROBOT_DESCRIPTION: 0.01}
"""Of all messages; the rest are collider descriptions."""


@dataclasses.dataclass
class Target:
    """A topic's handler.

    Attributes:
        good: The next valid message.
        damaged: One that is not, for a seed.
        take: Handles it, and may raise `MessageError`.
        check: Sees that what is kept is in order.
    """

    good: Callable[[], bytes]
    damaged: Callable[[bytes, int], bytes]
    take: Callable[[bytes], object]
    check: Callable[[], bool]


def targets(folder: Path) -> dict[str, Target]:
    """By the topic's name."""
    outfit = folder / "outfit.yaml"
    outfit.write_text(
        "version: 1\ngarments: [{name: skirt, generator: short_skirt, options: {vertices: 200}}]\n"
    )
    given = {"body": "mannequin", "outfit": str(outfit)}
    setup = Setup.of(
        {
            "collider_node": given,
            # Put on again for each jump, garments would take all of the time.
            "cloth_node": {**given, "on_time_jump": "keep", "on_teleport": "keep"},
        }
    )
    clip = load_clip("walk")
    sampler, joints = ClipSampler(clip, "loop"), Joints(clip.rig.dofs.names, "world")

    def walk() -> Iterator[bytes]:
        for number in itertools.count(1):
            stamp = 10**9 + number * _PERIOD
            yield bytes(joints.fill(stamp, sampler.sample(stamp * 1e-9)))

    urdf = urdf_from_clip(clip)
    colliders, poser, described_to = (Colliders(setup, _Silent()) for _ in range(3))
    ((_, described),) = colliders.describe(encode(String(data=urdf)))
    list(poser.describe(encode(String(data=urdf))))
    cloth = Cloth(setup)
    list(cloth.describe(described))

    def posed(taken: Colliders, data: bytes) -> dict[str, bytes]:
        return dict(taken.pose(Message(JOINT_STATES, 0, data)))

    joint_states = walk()
    poses = (posed(poser, data)[COLLIDER_POSES.name] for data in walk())

    def is_finite() -> bool:
        state = cloth.stepper.simulation.state("skirt")
        return bool(np.isfinite(state.x).all() and np.isfinite(state.v).all())

    whole = from_json(text_from(described))
    text = to_json(dataclasses.replace(whole, colliders=whole.colliders[:4]))
    return {
        JOINT_STATES.name: Target(
            lambda: next(joint_states),
            binary_mutant,
            lambda data: posed(colliders, data),
            lambda: True,
        ),
        COLLIDER_POSES.name: Target(
            lambda: next(poses), binary_mutant, lambda data: list(cloth.step(data)), is_finite
        ),
        ROBOT_DESCRIPTION.name: Target(
            lambda: encode(String(data=urdf)),
            text_mutant,
            lambda data: list(described_to.describe(data)),
            lambda: True,
        ),
        COLLIDER_DESCRIPTION.name: Target(
            lambda: encode(String(data=text)),
            text_mutant,
            lambda data: from_json(text_from(data, MAX_TEXT)),
            lambda: True,
        ),
    }


def text_mutant(data: bytes, seed: int) -> bytes:
    """A damaged String: mostly its text, and then whole otherwise."""
    if random.Random(seed).random() < 0.2:
        return binary_mutant(data, seed)
    text = mutant(data[8:-1], seed)
    return data[:4] + struct.pack("<I", len(text) + 1) + text + b"\0"


class _Silent:
    def info(self, message: str) -> None:
        """Nothing."""

    def warning(self, message: str) -> None:
        """Nothing."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000, help="messages of all topics")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    result = {}
    with tempfile.TemporaryDirectory() as folder:
        made = targets(Path(folder))
        for target in made.values():
            target.take(target.good())  # kernels are there
    limit_memory()
    shares = {topic.name: share for topic, share in _SHARES.items()}
    shares[COLLIDER_DESCRIPTION.name] = 1.0 - sum(shares.values())
    for name, target in made.items():
        result[name] = _tried(target, round(args.count * shares[name]), args.seed)
        print(f"{name:22} {_words(result[name])}", file=sys.stderr, flush=True)
    tried = sum(found["taken"] + sum(found["refused"].values()) for found in result.values())
    failures = sum(len(found["failures"]) for found in result.values())
    print(f"{tried} damaged messages, {failures} failures", file=sys.stderr)
    print(json.dumps(result))
    return int(failures > 0)


def _tried(target: Target, count: int, seed: int) -> dict:
    refused: Counter[str] = Counter()
    failures: list[str] = []
    taken, slowest = 0, 0.0
    before = _resident()
    for number in range(count):
        good = target.good()
        data = target.damaged(good, seed + number)
        faulthandler.dump_traceback_later(HANG, exit=True)
        began = time.process_time()
        try:
            target.take(data)
            taken += 1
        except MessageError as error:
            refused[error.reason] += 1
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            failures.append(
                f"{number}: {type(error).__name__}: {str(error)[:200]!r} "
                f"at {place.filename}:{place.lineno}"
            )
        took = time.process_time() - began
        faulthandler.cancel_dump_traceback_later()
        slowest = max(slowest, took)
        if took > SLOW:
            failures.append(f"{number}: took {took:.1f} s")
        if number % _GOOD_EVERY == 0:
            failures += [f"{number}: {problem}" for problem in _recovers(target)]
    if (grown := _resident() - before) > _GROWN:
        failures.append(f"grew by {grown / 2**20:.0f} MiB")
    return {
        "taken": taken,
        "refused": dict(refused.most_common()),
        "slowest": round(slowest, 3),
        "grown_mib": round(grown / 2**20, 1),
        "failures": failures,
    }


def _recovers(target: Target) -> Iterator[str]:
    """That good messages are taken again, a few at the latest: a new time has to be seen twice."""
    reason = ""
    for _ in range(300):
        try:
            target.take(target.good())
            break
        except MessageError as error:
            reason = str(error)
    else:
        yield f"good ones are no longer taken: {reason}"
    if not target.check():
        yield "what is kept is not finite"


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def _words(found: dict) -> str:
    reasons = ", ".join(f"{k} {n}" for k, n in found["refused"].items())
    return (
        f"{found['taken']:7} taken, {sum(found['refused'].values()):7} refused ({reasons}), "
        f"slowest {found['slowest']:.3f} s, {found['grown_mib']} MiB, "
        f"{len(found['failures'])} failures {' '.join(found['failures'][:3])}"
    )


if __name__ == "__main__":
    sys.exit(main())
