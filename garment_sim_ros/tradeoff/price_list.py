"""The price list as a person reads it, and as a table."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from garment_sim_ros.tradeoff.features import FEATURES
from garment_sim_ros.tradeoff.table import Row

_UNITS: Mapping[str, str] = {
    "crossed_own": "%",
    "crossed": "%",
    "pierced": "%",
    "inside": "%",
    "penetration_mm": "mm",
    "gap_mm": "mm",
    "strain_p95": "%",
    "strain_max": "%",
}
"""Figures that features are there for, and how they are told."""
_COST = ("off_ms", "on_ms", "cost_ms", "cost_ms_p10", "cost_ms_p90", "cost_share", "turns")
_BOTH = (*_UNITS, "dropped", "mended", "finite")
COLUMNS = (
    *("scene", "preset", "feature", "in_preset", *_COST),
    *(f"{name}_{side}" for name in _BOTH for side in ("off", "on")),
    *("moved_mm", "refused"),
)
"""Of the CSV."""


def line(row: Row) -> str:
    """A feature in one line: what it costs and what it removes."""
    if "refused" in row:
        return f"{row['feature']}: {row['refused']}"
    effects = "".join(f", {effect}" for effect in _effects(row))
    return f"{row['feature']}: {row['cost_ms']:+.2f} ms ({_share(row)}){effects}"


def markdown(rows: Sequence[Row]) -> str:
    """Those that there is a price of, as a table."""
    lines = [
        "| scene | preset | feature | in the preset | cost, ms | most turns | share | off -> on | "
        "elsewhere by, mm |",
        "|---" * 9 + "|",
    ]
    for row in rows:
        if "refused" in row:
            continue
        moved = row.get("moved_mm")
        cells = [
            *(row["scene"], row["preset"], f"`{row['feature']}`", row["in_preset"]),
            f"{row['cost_ms']:+.2f}",
            f"{row['cost_ms_p10']:+.2f} to {row['cost_ms_p90']:+.2f}",
            _share(row),
            "; ".join(_effects(row)),
            "-" if moved is None else f"{moved:.1f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def write_csv(rows: Sequence[Row], file: Path) -> None:
    """All rows."""
    with file.open("w", newline="") as out:
        writer = csv.DictWriter(out, COLUMNS)
        writer.writeheader()
        for row in rows:
            writer.writerow({name: row.get(name) for name in COLUMNS})


def _share(row: Row) -> str:
    return f"{100.0 * row['cost_share']:+.0f} %"


def _effects(row: Row) -> list[str]:
    """What the feature is there for, without it and with it; first of all faults."""
    faults = [
        f"{fault} {word} it"
        for side, word in (("off", "without"), ("on", "with"))
        for fault, there in (
            ("not finite", not row[f"finite_{side}"]),
            ("contacts dropped", row.get(f"dropped_{side}")),
        )
        if there
    ]
    told = []
    for name in FEATURES[row["feature"]].figures:
        off, on = row.get(f"{name}_off"), row.get(f"{name}_on")
        if off is not None and on is not None:
            unit = _UNITS[name]
            scale = 100.0 if unit == "%" else 1.0
            told.append(f"{name} {scale * off:.3g} -> {scale * on:.3g} {unit}")
    return faults + told
