"""The stability map as a table and a picture."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont

from garment_sim_ros.stability.judge import Outcome

_COLORS = {
    "holds": (86, 156, 112),
    "skipped": (205, 205, 200),
    "refused": (150, 170, 190),
    "inaccurate": (228, 178, 84),
    "broken": (196, 78, 72),
}
_BROKEN = (
    *("not finite", "out of bounds", "reset", "mended", "energy grows"),
    *("crushed", "inside", "pierced", "tangled", "layers"),
)
_ROW, _CELL, _LABEL, _MARGIN = 22, 190, 330, 16


@dataclass(frozen=True, kw_only=True)
class Row:
    """One cell with every solver.

    Attributes:
        extreme: What was driven to an extreme.
        value: How far.
        outcomes: What came of it, a solver each.
        seconds: How long that took, a solver each [s].
    """

    extreme: str
    value: str
    outcomes: dict[str, Outcome]
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def skipped(self) -> str:
        """Why no solver was tried; empty where one was."""
        reasons = [outcome.skipped for outcome in self.outcomes.values()]
        return reasons[0] if all(reasons) else ""


def grade(outcome: Outcome) -> str:
    """How bad it is: a key of the colours in the picture."""
    if outcome.refused or outcome.skipped:
        return "refused" if outcome.refused else "skipped"
    if not outcome.faults:
        return "holds"
    return "broken" if any(f in _BROKEN for f in outcome.faults) else "inaccurate"


def words(outcome: Outcome) -> str:
    """What a cell of the table says."""
    if outcome.refused or outcome.skipped:
        return grade(outcome)
    return ", ".join(outcome.faults) or "holds"


def table(rows: Sequence[Row]) -> str:
    """A Markdown table."""
    solvers = list(rows[0].outcomes)
    lines = [f"| Extreme | Value | {' | '.join(solvers)} |", "|---" * (2 + len(solvers)) + "|"]
    last = ""
    for row in rows:
        said = " | ".join(words(row.outcomes[s]) for s in solvers)
        lines.append(f"| {'' if row.extreme == last else row.extreme} | {row.value} | {said} |")
        last = row.extreme
    held = held_by(rows)
    tried = {s: sum(not row.outcomes[s].skipped for row in rows) for s in solvers}
    refused = {s: sum(bool(row.outcomes[s].refused) for row in rows) for s in solvers}
    said = " | ".join(f"{held[s]} of {tried[s]}" for s in solvers)
    lines.append(f"| **held** | | {said} |")
    if any(refused.values()):
        lines.append(f"| **refused** | | {' | '.join(str(refused[s]) for s in solvers)} |")
    return "\n".join(lines) + "\n"


def held_by(rows: Sequence[Row]) -> dict[str, int]:
    """In how many cells each solver holds; what it refuses it does not hold."""
    solvers = list(rows[0].outcomes)
    return {s: sum(grade(row.outcomes[s]) == "holds" for row in rows) for s in solvers}


def picture(rows: Sequence[Row], path: Path) -> None:
    """Draws the map.

    Args:
        rows: The cells.
        path: PNG to write.
    """
    solvers = list(rows[0].outcomes)
    width = _LABEL + _CELL * len(solvers) + 2 * _MARGIN
    height = _ROW * (len(rows) + 2) + 2 * _MARGIN
    image = Image.new("RGB", (width, height), (250, 250, 248))
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(13)
    ink = (40, 44, 48)
    for k, solver in enumerate(solvers):
        draw.text((_MARGIN + _LABEL + k * _CELL + 8, _MARGIN), solver, ink, font)
    last = ""
    for n, row in enumerate(rows):
        y = _MARGIN + _ROW * (n + 1)
        if row.extreme != last:
            draw.line((_MARGIN, y, width - _MARGIN, y), (205, 205, 200))
            draw.text((_MARGIN, y + 3), row.extreme, ink, font)
            last = row.extreme
        room = _LABEL - 140
        draw.text((_MARGIN + 140, y + 3), _cut(row.value, room, draw, font), ink, font)
        for k, solver in enumerate(solvers):
            x = _MARGIN + _LABEL + k * _CELL
            outcome = row.outcomes[solver]
            draw.rectangle((x + 2, y + 2, x + _CELL - 3, y + _ROW - 2), _COLORS[grade(outcome)])
            text = _cut(words(outcome), _CELL - 16, draw, font)
            draw.text((x + 8, y + 3), text, (255, 255, 255), font)
    y = _MARGIN + _ROW * (len(rows) + 1) + 4
    for k, (name, color) in enumerate(_COLORS.items()):
        x = _MARGIN + k * 120
        draw.rectangle((x, y + 2, x + 14, y + 14), color)
        draw.text((x + 20, y), name, ink, font)
    image.save(path)


def _cut(text: str, width: float, draw: ImageDraw.ImageDraw, font: Any) -> str:
    """What of a text has room."""
    while draw.textlength(text, font) > width:
        text = text[:-2] + "…" if text.endswith("…") else text[:-1] + "…"
    return text
