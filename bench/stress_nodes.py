"""The motion of `bench/stress.py` for real nodes, and what they made of it.

    python bench/stress_nodes.py write CLIP.bvh OUT.bvh [--seconds S] [--speed X]
    taskset -c 1 python -c "while True: pass" &
    taskset -c 0 garment-sim demo --clip OUT.bvh --body F --outfit F --seconds S --out DIR
    python bench/stress_nodes.py judge DIR/bag

`write` makes a clip of 60 frames a second in which the body moves for a second and stands for
0.9 s in turns. `judge` looks at each recorded frame: stops; `late`, those after which a limb runs
through a garment (`pierced`) in a frame from 0.5 s after the body stood (by stamps); `back`, the
longest time until none did; `pierced`, share of all frames; frames per second that arrived; the
longest time without one; `jump` (see `bench/jumps.py`) from frame to frame.
"""

import argparse
from pathlib import Path

import numpy as np
from jumps import JumpMeter
from stress import CALM, STANDS, clip_time
from worn import FRAME, found

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.contact.pierced import PiercedSoFar
from garment_sim_ros.recording.bags import read_recording
from garment_sim_ros.stamps import SECOND

_STILL = 0.05
"""Colliders that are all slower stand [m/s]."""


def write(source: Path, out: Path, seconds: float, speed: float) -> None:
    """Writes the clip: the nearest frames of another."""
    head, _, rest = source.read_text().partition("Frames:")
    lines = [line for line in rest.splitlines() if line.strip()]
    step, frames = float(lines[1].split(":")[1]), lines[2:]
    length = (len(frames) - 1) * step
    times = [clip_time(n * FRAME, length, speed) for n in range(int(seconds / FRAME))]
    chosen = [frames[min(round(t / step), len(frames) - 1)] for t in times]
    head += f"Frames: {len(chosen)}\nFrame Time: {FRAME:.8f}\n"
    out.write_text(head + "\n".join(chosen) + "\n")


def judge(bag: Path, body: str) -> dict:
    """What is in a bag."""
    recording = read_recording(bag, most_frames=10**6)
    track, garments = recording.colliders, recording.garments
    assert track is not None
    moved = np.abs(np.diff(track.position, axis=0)).max(axis=(1, 2))
    speed = moved / np.maximum(np.diff(track.stamp) / SECOND, 1e-3)
    moves = track.stamp[1:][speed > _STILL]
    pierced = PiercedSoFar(track.colliders, list(garments))
    loaded = load_body(found(body, "bodies"))
    skin, jumps = SkinFromPoses(track.colliders, loaded), JumpMeter(loaded.skin.vertices)
    back: dict[int, float] = {}
    through = frames = 0
    for k, stamp in enumerate(recording.stamp.tolist()):
        poses = track.at(stamp)
        if poses is None:
            continue
        x = {name: g.positions[k] for name, g in garments.items()}
        pierced.add(poses, {name: (x[name], g.triangles) for name, g in garments.items()})
        jumps.add(skin.vertices(poses), x)
        is_through = any(pierced.now.values())
        frames, through = frames + 1, through + is_through
        last = int(np.searchsorted(moves, stamp, side="right")) - 1
        since = (stamp - moves[last]) / SECOND if last >= 0 else 0.0
        if FRAME < since < STANDS and last >= 0:
            stop = int(moves[last])
            back[stop] = since if is_through else back.get(stop, 0.0)
    stops = {s: b for s, b in back.items() if s + CALM * SECOND < recording.stamp[-1]}
    arrival = next(iter(garments.values())).arrival
    return {
        "stops": len(stops),
        "late": sum(b > CALM for b in stops.values()),
        "back_s": round(max(stops.values(), default=0.0), 2),
        "pierced": round(through / max(frames, 1), 4),
        "frames": frames,
        "rate_hz": round((len(arrival) - 1) / max((arrival[-1] - arrival[0]) / SECOND, 1e-9), 1),
        "longest_gap_s": round(float(np.diff(arrival).max()) / SECOND, 2),
        "jump_cm": round(100 * jumps.largest, 1),
        "jump_frames": jumps.frames,
    }


def main() -> None:
    """Writes or judges."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    does = parser.add_subparsers(required=True, dest="what")
    writes = does.add_parser("write")
    writes.add_argument("source", type=lambda name: Path(found(name, "mocap")))
    writes.add_argument("out", type=Path)
    writes.add_argument("--seconds", type=float, default=19.0)
    writes.add_argument("--speed", type=float, default=1.0)
    judges = does.add_parser("judge")
    judges.add_argument("bag", type=Path)
    judges.add_argument("--body", default="mannequin")
    options = parser.parse_args()
    if options.what == "write":
        write(options.source, options.out, options.seconds, options.speed)
    else:
        print(", ".join(f"{k} {v}" for k, v in judge(options.bag, options.body).items()))


if __name__ == "__main__":
    main()
