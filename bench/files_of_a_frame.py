"""How many files of the package one frame passes, by folder.

    python bench/files_of_a_frame.py [--outfit F] [--json]

A frame: joint angles of the built-in walk to the body's joints, colliders and one frame of cloth,
with the default settings. Kernels run as plain Python (``NUMBA_DISABLE_JIT``), so that every
function that runs is seen; the garments are therefore small ones.
"""

import argparse
import json
import os
import sys
import tempfile
from collections import Counter
from pathlib import Path

os.environ["NUMBA_DISABLE_JIT"] = "1"

import garment_sim_ros as gs
from garment_sim_ros.sim import simulation as owner

PACKAGE = Path(gs.__file__).parent
OUTFIT = """
version: 1
garments:
  - {name: tshirt, generator: tshirt, options: {vertices: 300}}
  - {name: skirt, generator: short_skirt, options: {vertices: 200}}
"""
FRAME = 1 / 60


def files_of(outfit: str) -> set[str]:
    """Files whose functions run within one frame, relative to the package."""
    owner.settle = lambda *_: 0  # to come to rest would take hours in plain Python
    avatar = gs.Avatar.load("mannequin")
    simulation = gs.Simulation(avatar.dress(outfit), avatar.colliders)
    walk = avatar.play(gs.load_clip("walk"), rate=1 / FRAME)
    simulation.reset(avatar.poses())
    found: set[str] = set()

    def note(frame, event, _) -> None:
        if event == "call":
            found.add(frame.f_code.co_filename)

    sys.setprofile(note)
    try:
        simulation.step(next(walk), FRAME)
    finally:
        sys.setprofile(None)
    paths = (Path(name) for name in found)
    return {p.relative_to(PACKAGE).as_posix() for p in paths if p.is_relative_to(PACKAGE)}


def main() -> None:
    """Counts and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--outfit", default="", help="default: a small T-shirt and skirt")
    parser.add_argument("--json", action="store_true", help="print one JSON object only")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        small = Path(folder) / "outfit.yaml"
        small.write_text(OUTFIT)
        files = files_of(options.outfit or str(small))
    if options.json:
        print(json.dumps(sorted(files)))
        return
    for name, count in sorted(Counter(str(Path(f).parent) for f in files).items()):
        print(f"{count:3}  {name}")
    print(f"{len(files):3}  files")


if __name__ == "__main__":
    main()
