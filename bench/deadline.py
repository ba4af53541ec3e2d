"""Whether real nodes keep their rate, alone and with a core taken away.

    python bench/deadline.py [--preset balanced auto] [--seconds 20] [--repeats 3] [--free]
        [--busy 1] [--json]

The three nodes of `garment-sim demo` run and are recorded, each preset in turn, several times.
With ``--busy N`` a loop that does nothing else keeps each of N cores busy meanwhile; with
``--free`` there is a run without, too. Late frames are those of the node's own count
(`garment_sim_ros/lateness.py`) after the first second, over those that were due. Prints, for each
preset, the median and the range over the repeats; for `auto` also which share of the frames ran at
which level, and how often that changed.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.cli import demo
from garment_sim_ros.cli.avatar_options import RATE, node_parameters
from garment_sim_ros.cli.main import parser
from garment_sim_ros.lateness import SETTLING, late_of
from garment_sim_ros.params import PRESETS
from garment_sim_ros.recording.bags import read_recording

_SETTLING = round(SETTLING * RATE)  # frames


@contextmanager
def cores_taken(count: int) -> Iterator[None]:
    """The last `count` cores are busy meanwhile."""
    cores = sorted(os.sched_getaffinity(0))[-count:] if count else []
    loop = "while True: pass"
    busy = [subprocess.Popen([sys.executable, "-c", loop]) for _ in cores]
    try:
        for process, core in zip(busy, cores):
            os.sched_setaffinity(process.pid, {core})
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def run(preset: str, seconds: float, busy: int) -> dict[str, Any]:
    """The figures of one run."""
    words = ["demo", "--preset", preset]
    parameters = node_parameters(parser("demo").parse_args(words))
    with tempfile.TemporaryDirectory() as folder:
        with cores_taken(busy):
            demo._record(parameters, seconds, Path(folder), time.monotonic())
        quality = read_recording(Path(folder) / "bag").quality
    one = next(iter(quality.values()))
    late = late_of(one["late_frames"], RATE)
    whole = np.concatenate([of["strain_p95"][_SETTLING:] for of in quality.values()])
    level = one.get("auto_level", np.zeros(0))[_SETTLING:].astype(int).tolist()
    return {
        "frames": len(one["late_frames"]) - _SETTLING,
        "late_percent": 100.0 * late / (RATE * seconds - _SETTLING),
        "step_ms": float(np.median(one["step_ms"][_SETTLING:])),
        "step_ms_p95": float(np.percentile(one["step_ms"][_SETTLING:], 95.0)),
        "strain_p95": float(np.median(whole)),
        "skipped_s": float(one["skipped_s"][-1]),
        "pierced": float(max(of["pierced"][-1] for of in quality.values())),
        "levels": {str(k): n / len(level) for k, n in sorted(Counter(level).items())},
        "changes": int(np.count_nonzero(np.diff(level))),
    }


def in_words(name: str, runs: list[dict[str, Any]]) -> str:
    """One line of figures."""

    def spread(key: str, digits: int = 2) -> str:
        values = [r[key] for r in runs]
        low, middle, high = min(values), float(np.median(values)), max(values)
        return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"

    text = (
        f"{name}: late {spread('late_percent')} %, {runs[0]['frames']} frames came; step "
        f"{spread('step_ms')} ms, p95 {spread('step_ms_p95')} ms; stretch p95 of a frame "
        f"{spread('strain_p95', 3)}; skipped {spread('skipped_s')} s; "
        f"pierced {spread('pierced', 3)}"
    )
    if runs[-1]["levels"]:
        levels = ", ".join(
            f"{k}: {100.0 * share:.0f} %" for k, share in runs[-1]["levels"].items()
        )
        text += f"; changes {spread('changes', 0)}; quality of the last run {levels}"
    return text


def main() -> None:
    """Runs and prints."""
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--preset", nargs="+", default=["balanced", "auto"], choices=PRESETS)
    options.add_argument("--seconds", type=float, default=20.0)
    options.add_argument("--repeats", type=int, default=3)
    options.add_argument("--busy", type=int, default=1, help="cores taken away")
    options.add_argument("--free", action="store_true", help="without a busy core, too")
    options.add_argument("--json", action="store_true")
    args = options.parse_args()
    conditions = ([0] if args.free else []) + ([args.busy] if args.busy else [])
    found: dict[str, list[dict[str, Any]]] = {}
    for _ in range(args.repeats):
        for busy in conditions:
            for preset in args.preset:
                name = f"{preset}, {busy} core{'s' * (busy != 1)} taken"
                found.setdefault(name, []).append(run(preset, args.seconds, busy))
                print(in_words(name, found[name][-1:]), file=sys.stderr, flush=True)
    for name, runs in found.items():
        print(in_words(name, runs))
    if args.json:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
