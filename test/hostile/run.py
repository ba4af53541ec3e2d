"""Damages a file of every format many times and tells what its reader did.

As a program, from `test/`: ``python -m hostile.run --mutants 1000 --seed 0 --keep FOLDER``. It
runs in a process of its own, because its memory is limited and a reader that never ends ends it.
"""

import argparse
import faulthandler
import json
import resource
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from pathlib import Path

from garment_sim_ros.errors import InputFileError
from hostile.mutants import mutant
from hostile.samples import Sample, samples

HANG = 20.0
"""Longest that one file may take [s]: over it the process ends with the reader's stack."""
MEMORY = 1536 * 2**20
"""What may be taken beyond what the process has when it begins [bytes of addresses]."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mutants", type=int, default=1000, help="of each format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="formats whose names begin so")
    parser.add_argument("--keep", type=Path, help="folder for files that a reader fell over")
    args = parser.parse_args()
    warnings.simplefilter("ignore")  # a reader may say that a number overflows, and then refuse
    result = {}
    with tempfile.TemporaryDirectory() as folder:
        made = samples(Path(folder))
        for sample in made.values():
            sample.read()  # what is valid is read; imports and kernels are then there, too
        limit_memory()
        for name, sample in made.items():
            if name.startswith(args.only):
                result[name] = _tried(name, sample, args.mutants, args.seed, args.keep)
                print(f"{name:32} {_words(result[name])}", file=sys.stderr, flush=True)
    tried = sum(
        found["read"] + found["refused"] + len(found["failures"]) for found in result.values()
    )
    failures = sum(len(found["failures"]) for found in result.values())
    print(f"{tried} damaged files, {failures} failures", file=sys.stderr)
    print(json.dumps(result))
    return any(found["failures"] for found in result.values())


def _tried(name: str, sample: Sample, count: int, seed: int, keep: Path | None) -> dict:
    valid = sample.file.read_bytes()
    found = {"read": 0, "refused": 0, "slowest": 0.0, "failures": []}
    for number in range(count):
        damaged = mutant(valid, zlib.crc32(f"{name} {seed} {number}".encode()))
        sample.file.write_bytes(damaged)
        faulthandler.dump_traceback_later(HANG, exit=True)
        started, problem = time.process_time(), ""
        outcome = "read"
        try:
            sample.read()
        except InputFileError as error:
            outcome = "refused"
            if not str(error).isprintable() or len(str(error)) > 5000:
                problem = f"message {str(error)[:200]!r}"
        except BaseException as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            problem = (
                f"{type(error).__name__}: {str(error)[:200]!r} at {place.filename}:{place.lineno}"
            )
        finally:
            faulthandler.cancel_dump_traceback_later()
        found["slowest"] = max(found["slowest"], round(time.process_time() - started, 3))
        if not problem:
            found[outcome] += 1
        else:
            found["failures"].append(f"{number}: {problem}")
            if keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / f"{name.replace(' ', '_')}_{number}{sample.file.suffix}").write_bytes(
                    damaged
                )
    sample.file.write_bytes(valid)
    return found


def limit_memory() -> None:
    """Let this process take little more than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def _words(found: dict) -> str:
    return (
        f"{found['read']:6} read, {found['refused']:6} refused, slowest {found['slowest']:.3f} s, "
        f"{len(found['failures'])} failures {' '.join(found['failures'][:3])}"
    )


if __name__ == "__main__":
    sys.exit(main())
