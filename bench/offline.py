"""Processor time that `garment-sim simulate` takes for a second of the walk.

    python bench/offline.py [--seconds 10] [--rounds 3] [--settings balanced:60 fast:30 ...]

A setting is PRESET:RATE, and may have :NODE.PARAM=VALUE,... after it. Each round runs the command
for 2 s and for so many more, in turns; the difference of their processor times is that of a second
in the long run, and what is left of the short one is the start: kernels loaded, colliders read,
garments put on. `c_us` is how fast the machine was, as `bench/springs.py` has it; `times` is how
many times faster than real time one core is, and the same where `c_us` is 140. Medians and ranges
of the rounds.
"""

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from springs import machine_us

COMMAND = [sys.executable, "-m", "garment_sim_ros.cli.main", "simulate", "--clip", "walk"]
SHORT = 2.0
"""The command's shorter run [s]."""
USUAL_US = 140.0
"""`c_us` of a machine that does nothing else."""


def processor_time(setting: str, seconds: float) -> float:
    """Of the command [s]."""
    preset, rate, *single = setting.split(":")
    with tempfile.TemporaryDirectory() as folder:
        words = ["--preset", preset, "--rate", rate, "--seconds", f"{seconds:g}"]
        for value in ",".join(single).split(",") if single else ():
            words += ["--set", value]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [*COMMAND, *words, "--out", str(Path(folder) / "bag")], check=True, capture_output=True
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def in_words(values: list[float]) -> str:
    """Median and range."""
    return f"{statistics.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def main() -> None:
    """Runs and prints."""
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--seconds", type=float, default=10.0)
    options.add_argument("--rounds", type=int, default=3)
    options.add_argument(
        "--settings", nargs="+", default=["balanced:60", "balanced:30", "fast:30"]
    )
    args = options.parse_args()
    for setting in args.settings:
        starts, spent, times, usual = [], [], [], []
        for _ in range(args.rounds):
            speed = machine_us()
            short = processor_time(setting, SHORT)
            long = processor_time(setting, SHORT + args.seconds)
            speed = 0.5 * (speed + machine_us())
            spent.append((long - short) / args.seconds)
            starts.append(short - SHORT * spent[-1])
            times.append(1.0 / spent[-1])
            usual.append(speed / USUAL_US / spent[-1])
        print(
            f"{setting}: a second takes {in_words(spent)} s, the start {in_words(starts)} s; "
            f"{in_words(times)} times, {in_words(usual)} at 140 us",
            flush=True,
        )


if __name__ == "__main__":
    main()
