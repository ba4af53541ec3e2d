"""Other cloth simulators and ours in the same scenes: cost at equal error.

    make peers [ARGS="--scene drape hung limb --peer ours pypbd --fresh --write"]

Makes an environment of its own for each simulator under ``.peers`` (``--fresh``: anew), plays each
scene of `scenes.py` with each of its settings (`settings.py`) in a process of its own, with one
thread; with ``--write`` it writes ``docs/measurements/peers.csv`` and the tables of ``peers.md``
beside it. A simulator that cannot be installed is left out, and the reason is told. Some 20
minutes; ``--peer --write`` makes the tables of what is in the CSV.

Cost is the median over frames of a frame's processor time over F, three sweeps of plain C over the
springs of the same cloth, timed in turns with the frames.
"""

import argparse
import csv
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from judging import judge
from playing import load
from scenes import SCENES, write
from settings import PACKAGES, SETTINGS
from springs import compiled

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
FOLDER = ROOT / ".peers"
PAGE = ROOT / "docs" / "measurements" / "peers.md"
NAMES = {"pypbd": "pyPBD", "pybullet": "PyBullet", "mujoco": "MuJoCo", "newton": "Newton"}
ERRORS = {"drape": (3.0, 1.0, 0.3), "hung": (3.0, 1.0, 0.5), "limb": (5.0, 1.0, 0.3)}
"""Stretch at which costs are compared in each scene [%]."""
DEEPEST = 10.0
"""A run whose cloth was deeper in the shape than this is no answer [mm]."""


def python_of(peer: str, fresh: bool) -> str:
    """The interpreter that a simulator runs in.

    Raises:
        subprocess.CalledProcessError: It cannot be installed.
    """
    if peer == "ours":
        return sys.executable
    python = FOLDER / peer / "bin" / "python"
    if fresh or not python.exists():
        flags = ["--clear"] if fresh else []
        subprocess.run([sys.executable, "-m", "venv", *flags, str(FOLDER / peer)], check=True)
        words = ["install", "--quiet", "--disable-pip-version-check", PACKAGES[peer], "numpy"]
        subprocess.run([str(python), "-m", "pip", *words], check=True, capture_output=True)
    return str(python)


def environment(peer: str) -> dict[str, str]:
    """One thread; nothing of this project in the environments of others."""
    own = {k: v for k, v in os.environ.items() if peer == "ours" or k != "PYTHONPATH"}
    if peer == "ours":
        own["PYTHONPATH"] = os.pathsep.join([str(ROOT), own.get("PYTHONPATH", "")])
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    return {**own, **dict.fromkeys(threads, "1")}


def run(peer: str, python: str, scene: Path, library: Path, name: str) -> dict[str, Any]:
    """The figures of one setting in one scene."""
    settings = json.dumps(SETTINGS[peer][name])
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.npz"
        script = str(HERE / f"with_{peer}.py")
        command = [python, script, str(scene), settings, str(library), str(result)]
        # Some leave files where they run.
        how = {"env": environment(peer), "cwd": folder, "capture_output": True, "text": True}
        done = subprocess.run(command, check=False, **how)
        if not result.exists():
            last = (done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1]
            return {"fault": f"fails: {last[:80]}"}
        with np.load(result) as file:
            found = {key: file[key] for key in file.files}
    return {"version": str(found.pop("version")), **judge(scene.stem, load(scene), found)}


def measured(peers: Iterable[str], names: Iterable[str], fresh: bool) -> list[dict[str, Any]]:
    """A row for each simulator, scene and setting."""
    rows: list[dict[str, Any]] = []
    pythons: dict[str, str] = {}
    for peer in peers:
        try:
            pythons[peer] = python_of(peer, fresh)
        except subprocess.CalledProcessError as error:
            why = (error.stderr or b"").decode().strip().splitlines() or ["no environment"]
            print(f"{peer}: left out, cannot be installed: {why[-1]}", file=sys.stderr)
            rows.append({"simulator": peer, "fault": f"not installed: {why[-1][:80]}"})
    with tempfile.TemporaryDirectory() as folder:
        compiled(folder)
        library = Path(folder) / "springs.so"
        for name in names:
            scene = write(name, Path(folder))
            for peer, python in pythons.items():
                for setting in SETTINGS[peer]:
                    row = run(peer, python, scene, library, setting)
                    rows.append({"scene": name, "simulator": peer, "setting": setting, **row})
                    print(line(rows[-1]), flush=True)
    return rows


def line(row: Mapping[str, Any]) -> str:
    """A row of a table."""
    who = NAMES.get(row["simulator"], "ours")
    if "cost_F" not in row:
        return f"| {who} | {row.get('setting', '')} | | | | | | {row['fault']} |"
    speed = f"{row['speed_mm_s']:.0f}"
    return (
        f"| {who} | {row['setting']} | {row['cost_F']:.4g} | {row['stretch_p95_percent']:.2f} % | "
        f"{row['stretch_max_percent']:.0f} % | {row['penetration_mm']:.1f} mm | {speed} mm/s | "
        f"{row['fault']} |"
    )


def cheapest(rows: Iterable[Mapping[str, Any]], error: float) -> Mapping[str, Any] | None:
    """The cheapest whole run whose stretch is no more than an error [%]; None: there is none."""
    good = [
        r
        for r in rows
        if not r["fault"] and r["stretch_p95_percent"] <= error and r["penetration_mm"] <= DEEPEST
    ]
    return min(good, key=lambda r: r["cost_F"], default=None)


def tables(rows: list[dict[str, Any]]) -> dict[str, str]:
    """The tables of the page, by name."""
    head = ["simulator", "setting", "F", "stretch p95", "largest", "penetration", "moves", ""]
    found = {}
    for name in SCENES:
        of_scene = [r for r in rows if r.get("scene") == name]
        lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|", *map(line, of_scene)]
        found[name] = "\n".join(lines)
    peers = list(dict.fromkeys(r["simulator"] for r in rows if "scene" in r))
    lines = ["| scene, stretch | " + " | ".join(NAMES.get(p, "ours") for p in peers) + " |"]
    lines.append("|---" * (len(peers) + 1) + "|")
    for name in SCENES:
        for error in ERRORS[name]:
            best = [
                cheapest((r for r in rows if (r.get("scene"), r["simulator"]) == (name, p)), error)
                for p in peers
            ]
            cells = ["-" if b is None else f"{b['cost_F']:.3g} F ({b['setting']})" for b in best]
            lines.append(f"| {name}, {error:g} % | " + " | ".join(cells) + " |")
    found["equal"] = "\n".join(lines)
    return found


def fill(page: str, made: Mapping[str, str]) -> str:
    """The page with its tables anew: what is between a table's two comments."""
    for name, table in made.items():
        pattern = rf"(<!-- {name} -->\n).*?(\n<!-- end -->)"
        page, count = re.subn(
            pattern, lambda m, t=table: m[1] + t + m[2], page, count=1, flags=re.S
        )
        assert count == 1, f"{PAGE} has no place for the table {name}"
    return page


def main() -> None:
    """Measures, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--peer", nargs="*", choices=list(SETTINGS), default=list(SETTINGS))
    parser.add_argument("--scene", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--fresh", action="store_true", help="make the environments anew")
    parser.add_argument("--write", action="store_true", help="the page and the CSV of docs")
    options = parser.parse_args()
    new = measured(options.peer, options.scene, options.fresh)
    sheet = PAGE.with_suffix(".csv")
    rows: list[dict[str, Any]] = []
    if sheet.exists():  # what is not measured now stays
        with sheet.open(newline="") as file:
            rows = [numbers(r) for r in csv.DictReader(file)]
    done = {(r.get("scene"), r["simulator"]) for r in new}
    kept = [r for r in rows if r.get("setting") in SETTINGS[r["simulator"]]]
    rows = [r for r in kept if (r.get("scene"), r["simulator"]) not in done] + new
    order = list(SETTINGS)
    rows.sort(
        key=lambda r: (
            list(SCENES).index(r["scene"]) if "scene" in r else -1,
            order.index(r["simulator"]),
        )
    )
    if options.write:
        keys = list(dict.fromkeys(key for r in rows for key in r))
        with sheet.open("w", newline="") as file:
            writer = csv.DictWriter(file, keys, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        PAGE.write_text(fill(PAGE.read_text(), tables(rows)))


def numbers(row: Mapping[str, str]) -> dict[str, Any]:
    """A row of the CSV as it was before it was written."""
    texts = ("scene", "simulator", "setting", "version", "fault")
    return {k: v if k in texts else float(v) for k, v in row.items() if v or k == "fault"}


if __name__ == "__main__":
    main()
