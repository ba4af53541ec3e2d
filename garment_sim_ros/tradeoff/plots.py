"""Error against cost as PNG and SVG: told apart by shape, so that it can be read in grey print."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol
from xml.sax.saxutils import escape

from PIL import Image, ImageDraw, ImageFont

from garment_sim_ros.tradeoff.front import front

_WIDE, _HIGH, _LEFT, _TOP, _RIGHT, _BOTTOM = 720, 480, 70, 50, 20, 60
_INK, _GRID = "#202428", "#d8d8d4"
_COLOUR = {"relaxation": "#7a4fa0", "xpbd": "#1f77b4", "implicit": "#c7600a"}
_CORNERS = {"relaxation": 3, "xpbd": 24, "implicit": 4}
_SIZE = 6.0
_SCALE = 3
"""Pixels of the PNG per unit of the drawing: 300 per inch at 18 cm."""

Points = Sequence[tuple[float, float]]


class _Canvas(Protocol):
    def line(self, points: Points, colour: str, width: float) -> None: ...
    def area(self, points: Points, colour: str, filled: bool) -> None: ...
    def text(self, x: float, y: float, words: str, colour: str, anchor: str) -> None: ...


class _Svg:
    """Draws into the text of an SVG file."""

    def __init__(self) -> None:
        size = f'viewBox="0 0 {_WIDE} {_HIGH}" width="{_WIDE}" height="{_HIGH}"'
        self.rows = [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" '
            'font-size="13">',
            f'<rect width="{_WIDE}" height="{_HIGH}" fill="white"/>',
        ]

    def line(self, points: Points, colour: str, width: float) -> None:
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self.rows.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}"/>'
        )

    def area(self, points: Points, colour: str, filled: bool) -> None:
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        inside = colour if filled else "white"
        self.rows.append(
            f'<polygon points="{path}" fill="{inside}" stroke="{colour}" stroke-width="1.5"/>'
        )

    def text(self, x: float, y: float, words: str, colour: str, anchor: str) -> None:
        at = {"l": "start", "m": "middle", "r": "end"}[anchor]
        self.rows.append(
            f'<text x="{x:.1f}" y="{y + 4.5:.1f}" fill="{colour}" text-anchor="{at}">'
            f"{escape(words)}</text>"
        )


class _Png:
    """Draws into a picture."""

    def __init__(self) -> None:
        self.image = Image.new("RGB", (_WIDE * _SCALE, _HIGH * _SCALE), "white")
        self._pen = ImageDraw.Draw(self.image)
        self._font = ImageFont.load_default(13 * _SCALE)

    def line(self, points: Points, colour: str, width: float) -> None:
        scaled = [(x * _SCALE, y * _SCALE) for x, y in points]
        self._pen.line(scaled, colour, round(width * _SCALE), joint="curve")

    def area(self, points: Points, colour: str, filled: bool) -> None:
        scaled = [(x * _SCALE, y * _SCALE) for x, y in points]
        self._pen.polygon(scaled, colour if filled else "white", colour, round(1.5 * _SCALE))

    def text(self, x: float, y: float, words: str, colour: str, anchor: str) -> None:
        self._pen.text((x * _SCALE, y * _SCALE), words, colour, self._font, anchor=f"{anchor}m")


def draw(
    rows: Sequence[dict[str, Any]], title: str, folder: Path, *, cost: str, error: str
) -> None:
    """Write ``<title>.png`` and ``<title>.svg``; nothing where fewer than two rows have figures.

    Filled: valid; hollow with a cross: a failure, whatever it costs. The line is the front.

    Args:
        rows: Of one scene, on one kind of colliders, or on several, which are then named.
        title: Of picture and files.
        folder: Where they go.
        cost: Key of the cost [ms].
        error: Key of the error [mm].
    """
    shown = [row for row in rows if (row.get(cost) or 0) > 0 and (row.get(error) or 0) > 0]
    if len(shown) < 2:
        return
    svg, png = _Svg(), _Png()
    for canvas in (svg, png):
        _chart(canvas, shown, title, (cost, error))
    (folder / f"{title}.svg").write_text("\n".join([*svg.rows, "</svg>", ""]))
    png.image.save(folder / f"{title}.png", dpi=(300, 300))


def _chart(
    canvas: _Canvas, rows: Sequence[dict[str, Any]], title: str, keys: tuple[str, str]
) -> None:
    spans = [_span([row[key] for row in rows]) for key in keys]
    width, height = _WIDE - _LEFT - _RIGHT, _HIGH - _TOP - _BOTTOM

    def place(row: dict[str, Any]) -> tuple[float, float]:
        u, v = (
            (math.log10(row[key]) - low) / (high - low) for key, (low, high) in zip(keys, spans)
        )
        return _LEFT + width * u, _TOP + height * (1.0 - v)

    bottom, right = _TOP + height, _LEFT + width
    for value, u in _ticks(spans[0]):
        x = _LEFT + width * u
        canvas.line([(x, _TOP), (x, bottom)], _GRID, 1.0)
        canvas.text(x, bottom + 12, f"{value:g}", _INK, "m")
    for value, v in _ticks(spans[1]):
        y = bottom - height * v
        canvas.line([(_LEFT, y), (right, y)], _GRID, 1.0)
        canvas.text(_LEFT - 6, y, f"{value:g}", _INK, "r")
    frame = [(_LEFT, _TOP), (right, _TOP), (right, bottom), (_LEFT, bottom), (_LEFT, _TOP)]
    canvas.line(frame, _INK, 1.0)
    canvas.text(_LEFT, 14, title, _INK, "l")
    canvas.text(_LEFT + width / 2, bottom + 36, _axis(keys[0], "ms a frame"), _INK, "m")
    canvas.text(_LEFT, _TOP - 12, _axis(keys[1], "mm"), _INK, "l")
    several = len({row["colliders"] for row in rows}) > 1
    doubt = 0.0 if several else rows[0].get("doubt_mm") or 0.0
    if spans[1][0] < math.log10(max(doubt, 1e-12)) < spans[1][1]:
        y = place(rows[0] | {keys[1]: doubt})[1]
        canvas.line([(_LEFT, y), (right, y)], "#808080", 1.5)
        canvas.text(right - 6, y - 9, "below: the reference itself is in doubt", "#606060", "r")
    valid = [row for row in rows if not row["faults"]]
    best = [valid[k] for k in front([r[keys[0]] for r in valid], [r[keys[1]] for r in valid])]
    canvas.line([place(row) for row in best], _INK, 1.5)
    for row in rows:
        x, y = place(row)
        colour = _COLOUR.get(row["solver"], _INK)
        _mark(canvas, (x, y), row["solver"], not row["faults"])
        if row in best or several:
            side = (-1) ** (best if row in best else rows).index(row)  # neighbours may be close
            words = row.get("preset") or f"{row['sub_steps']}x{row['passes']}"
            if several:
                words = f"{words}, {row['colliders']}"
            canvas.text(x + 9 * side, y - 9 * side, words, colour, "l" if side > 0 else "r")
    for n, solver in enumerate(s for s in _COLOUR if any(r["solver"] == s for r in rows)):
        _mark(canvas, (right - 310 + 110 * n, 14), solver, True)
        canvas.text(right - 298 + 110 * n, 14, solver, _COLOUR[solver], "l")


def _mark(canvas: _Canvas, at: tuple[float, float], solver: str, valid: bool) -> None:
    count = _CORNERS.get(solver, 5)
    turn = math.pi / 4 if count == 4 else -math.pi / 2
    angles = [turn + 2.0 * math.pi * k / count for k in range(count)]
    corners = [(at[0] + _SIZE * math.cos(a), at[1] + _SIZE * math.sin(a)) for a in angles]
    colour = _COLOUR.get(solver, _INK)
    canvas.area(corners, colour, valid)
    if not valid:
        for sign in (-1, 1):
            across = [(at[0] + s * _SIZE, at[1] + s * sign * _SIZE) for s in (-1, 1)]
            canvas.line(across, colour, 1.5)


def _axis(key: str, unit: str) -> str:
    return f"{key.removesuffix('_ms').removesuffix('_mm')}, {unit}"


def _span(values: Sequence[float]) -> tuple[float, float]:
    low, high = math.log10(min(values)), math.log10(max(values))
    room = 0.08 * (high - low) + 0.05
    return low - room, high + room


def _ticks(span: tuple[float, float]) -> list[tuple[float, float]]:
    """Values 1, 2, 5 and their powers within a span, and where on it each is, 0 to 1."""
    low, high = span
    powers = range(math.floor(low), math.ceil(high) + 1)
    values = [digit * 10.0**power for power in powers for digit in (1, 2, 5)]
    at = [(value, (math.log10(value) - low) / (high - low)) for value in values]
    return [(value, u) for value, u in at if 0.0 < u < 1.0]
