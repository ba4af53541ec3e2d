"""Rows of measurements: kept as they come, told as CSV and JSON with what they were taken on."""

import csv
import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numba
import numpy as np

from garment_sim_ros.sim.auto.own_front import processor
from garment_sim_ros.tradeoff.front import front
from garment_sim_ros.version import VERSION

FIRST = (
    *("scene", "colliders", "solver", "sub_steps", "passes", "membrane"),
    *("options", "preset", "setting", "faults"),
)
FIGURES = (
    *("trajectory_mm", "doubt_mm", "static_mm", "pierced", "inside", "penetration_mm", "gap_mm"),
    *("crossed", "strain_p95", "strain_max", "rest_speed_mm_s", "energy_drift"),
    *("dropped", "mended"),
    *("hot_ms", "hot_ms_p95", "hot_spread", "paced_ms", "paced_ms_p95", "paced_wall_ms"),
    *("compile_s", "refused"),
)
Row = dict[str, Any]
INSIDE = 0.005
"""Share of the cloth that may be in the skin where its distance to it is compared."""


def machine(jobs: int) -> dict[str, Any]:
    """What the figures were taken with and on."""
    return {
        "garment_sim_ros": VERSION,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "processor": processor(),
        "cores": os.cpu_count(),
        "threads": numba.get_num_threads(),
        "jobs": jobs,
        "system": f"{platform.system()} {platform.release()}",
    }


class Kept:
    """Rows in a file, one line each, so that a run that was stopped goes on where it was.

    Args:
        file: The file; a last line that was not finished counts for nothing.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._rows: dict[str, Row] = {}
        text = file.read_text() if file.exists() else ""
        for line in text.splitlines():
            try:
                kept = json.loads(line)
                self._rows[kept["key"]] = kept["row"]
            except (ValueError, KeyError, TypeError):
                continue
        if text and not text.endswith("\n"):
            with file.open("a") as out:
                out.write("\n")

    def get(self, key: str) -> Row | None:
        """The row of a key; None where it is not known."""
        return self._rows.get(key)

    def put(self, key: str, row: Row) -> None:
        """Keep a row."""
        self._rows[key] = row
        with self._file.open("a") as out:
            out.write(json.dumps({"key": key, "row": row}) + "\n")


def on_fronts(rows: Sequence[Row], cost: str, error: str) -> list[Row]:
    """The rows on the front of their scene and colliders; failures are on none.

    Errors are against a reference on the same colliders.
    """
    return _on_fronts(rows, (cost, error), ("scene", "colliders"))


def across_colliders(rows: Sequence[Row], cost: str, error: str) -> list[Row]:
    """The rows on the front of their scene, on whatever colliders, of an error against the skin.

    Scenes with one kind of colliders have none. Cloth that is in the skin is near to it, too: rows
    with more than `INSIDE` of it there are on no front.
    """
    kinds: dict[str, set[str]] = {}
    for row in rows:
        kinds.setdefault(row["scene"], set()).add(row["colliders"])
    several = [row for row in rows if len(kinds[row["scene"]]) > 1 and is_outside(row, error)]
    return _on_fronts(several, (cost, error), ("scene",))


def is_outside(row: Row, error: str) -> bool:
    """Whether cloth is on the skin's outside, so that its distance says how close it lies."""
    return (row.get("inside") or 0.0) <= INSIDE and (row.get(error) or 0.0) > 0.0


def _on_fronts(rows: Sequence[Row], keys: tuple[str, str], groups: tuple[str, ...]) -> list[Row]:
    found: list[Row] = []
    for of in dict.fromkeys(tuple(row[name] for name in groups) for row in rows):
        valid = [r for r in rows if tuple(r[n] for n in groups) == of and not r["faults"]]
        found += [valid[k] for k in front(*(_numbers(valid, key) for key in keys))]
    return found


def _numbers(rows: Sequence[Row], key: str) -> list[float]:
    return [np.inf if row.get(key) is None else row[key] for row in rows]


def write_csv(rows: Sequence[Row], file: Path) -> None:
    """All rows; faults are separated by semicolons."""
    with file.open("w", newline="") as out:
        writer = csv.DictWriter(out, (*FIRST, *FIGURES))
        writer.writeheader()
        for row in rows:
            told = {name: row.get(name) for name in (*FIRST, *FIGURES)}
            writer.writerow(told | {"faults": "; ".join(row["faults"])})


def markdown(rows: Sequence[Row], best: Sequence[Row]) -> str:
    """The main figures as a table; settings on a front are bold."""
    shown = {
        "trajectory_mm": "trajectory, mm",
        "doubt_mm": "reference, mm",
        "static_mm": "static, mm",
        "strain_p95": "strain p95",
        "pierced": "pierced",
        "inside": "inside",
        "gap_mm": "gap, mm",
        "rest_speed_mm_s": "rest, mm/s",
        "energy_drift": "energy drift",
        "hot_ms": "hot, ms",
        "paced_ms": "paced, ms",
    }
    lines = [
        "| scene | colliders | setting | " + " | ".join(shown.values()) + " | faults |",
        "|---" * (len(shown) + 4) + "|",
    ]
    for row in rows:
        name = f"**{row['setting']}**" if row in best else row["setting"]
        cells = ["-" if row.get(key) is None else f"{row[key]:.3g}" for key in shown]
        first = [row["scene"], row["colliders"], name]
        lines.append("| " + " | ".join([*first, *cells, ", ".join(row["faults"])]) + " |")
    return "\n".join(lines) + "\n"
