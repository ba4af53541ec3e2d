"""Faults, one after the other, and a table of what became of the cloth; 1 where a limit is missed.

From `test/`: ``python -m soak.run [--full] [--only NAME ...] [--minutes M] [--rounds N] ...``.
"""

import argparse
import dataclasses
import importlib
import os
import time

from garment_sim_ros.cli.node_processes import own_network
from soak.report import FULL, SHORT, Lengths, Row, line, row_line

FAULTS = (*("killed", "full_disk", "flooded", "two_publishers", "clock_back", "rounds", "hours"),)


def main() -> int:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--full", action="store_true", help="hours instead of minutes")
    parser.add_argument("--only", nargs="+", choices=FAULTS, default=FAULTS, metavar="NAME")
    for field in dataclasses.fields(Lengths):
        parser.add_argument(f"--{field.name}", type=type(getattr(SHORT, field.name)))
    args = parser.parse_args()
    usual = FULL if args.full else SHORT
    given = {
        f.name: getattr(args, f.name)
        for f in dataclasses.fields(Lengths)
        if getattr(args, f.name) is not None
    }
    lengths = dataclasses.replace(usual, **given)
    os.environ.update(own_network())
    print(line("fault", "figure", "found", "allowed"), flush=True)
    failed = 0
    for name in args.only:
        began = time.monotonic()
        try:
            rows = importlib.import_module(f"soak.{name}").run(lengths)
        except AssertionError as error:  # what was waited for did not come
            rows = [Row("it goes on", " ".join(str(error).split())[:200], "", False)]
        rows.append(Row("took", f"{time.monotonic() - began:.0f} s"))
        for row in rows:
            print(row_line(name, row), flush=True)
        failed += sum(not row.holds for row in rows)
    print(f"{failed} limits missed")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
