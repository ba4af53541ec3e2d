"""Pictures of a garment that was sewn: its flat pieces, the body in it, and how it is strained."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.garment.colours import Colour
from garment_sim_ros.garment.patterns.gates import strains
from garment_sim_ros.garment.patterns.making import Made
from garment_sim_ros.garment.patterns.pieces import Pieces
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.recording.render import SKIN_COLOR, Camera, Surface, color, linear, render

SIZE = (360, 620)
VIEWS = (("front", 0.0), ("side", 90.0), ("back", 180.0))
_FIELD = math.radians(24.0)
_MARGIN = 1.15
_BANDS = (
    (-0.03, "#4a6fb5", "shorter by 3 % and more"),
    (0.03, "#e6e6e2", "within 3 %"),
    (0.10, "#f2b45c", "3 to 10 %"),
    (math.inf, "#c8423a", "longer by 10 % and more"),
)
"""Strains up to which each colour stands, the colours, and what they mean."""
PAPER, INK, _PIECE = "#ffffff", "#222222", "#dfe8f5"
_GAP = 14
"""Between flat pieces [pixel]."""
_LARGEST = 420.0
"""Height of the tallest piece [pixel]."""


def dressed_picture(
    made: Sequence[Made],
    colours: Sequence[Colour],
    skin: FloatArray,
    skin_triangles: IntArray,
) -> Image.Image:
    """Garments on their body: front, side, back, strain; below, their flat pieces.

    Args:
        made: The garments.
        colours: A colour for each.
        skin: The body's skin [m], shape [v, 3].
        skin_triangles: Shape [t, 3].

    Raises:
        RenderingUnavailableError: The ray caster is not installed.
    """
    worn = [(m.sewn.shown, m.sewn.triangles) for m in made]
    surfaces = clothed(skin, skin_triangles, worn, colours)
    cloth = np.concatenate([x for x, _ in worn])
    views = [view_of(surfaces, cloth, angle) for _, angle in VIEWS]
    strained = [surfaces[0], *(s for m in made for s in _strain_surfaces(m))]
    views.append(view_of(strained, cloth, 0.0))
    row = Image.fromarray(np.concatenate(views, axis=1))
    draw = ImageDraw.Draw(row)
    for k, name in enumerate([*(name for name, _ in VIEWS), "strain"]):
        draw.text((k * SIZE[0] + 10, 8), name, fill=INK, font=text_font())
    for n, (_, code, text) in enumerate(_BANDS):
        y = SIZE[1] - 20 * (len(_BANDS) - n) - 6
        x = 3 * SIZE[0] + 10
        draw.rectangle((x, y, x + 14, y + 14), fill=code, outline=INK)
        draw.text((x + 20, y), text, fill=INK, font=text_font())
    return stacked([row, *(draw_pieces(m.pieces, row.width) for m in made)])


def stacked(pictures: Sequence[Image.Image]) -> Image.Image:
    """Pictures below each other."""
    size = max(p.width for p in pictures), sum(p.height for p in pictures)
    sheet = Image.new("RGB", size, PAPER)
    y = 0
    for picture in pictures:
        sheet.paste(picture, (0, y))
        y += picture.height
    return sheet


def clothed(
    skin: FloatArray,
    skin_triangles: IntArray,
    cloth: Sequence[tuple[FloatArray, IntArray]],
    colours: Sequence[Colour],
) -> list[Surface]:
    """A body, then what it wears or what is placed around it, in these colours."""
    return [
        Surface(vertices=skin, triangles=skin_triangles, color=SKIN_COLOR, gloss=0.15),
        *(
            Surface(vertices=x, triangles=t, color=linear(c))
            for (x, t), c in zip(cloth, colours, strict=True)
        ),
    ]


def draw_pieces(pieces: Pieces, width: int) -> Image.Image:
    """The flat pieces of a pattern in rows, with their triangles and names."""
    panels = list(pieces.pattern.panels.items())
    room = width - _GAP
    words = np.array([min(text_font().getlength(n) + _GAP, room) for n, _ in panels])
    extents = np.array([np.ptp(panel.outline, axis=0) for _, panel in panels])
    rows: list[list[int]] = [[]]
    for k in range(len(panels)):
        if words[[*rows[-1], k]].sum() > room:
            rows.append([])
        rows[-1].append(k)
    scale = _LARGEST / extents[:, 1].max()
    while any(_cells(words[r], scale * extents[r, 0]).sum() > room + 1e-6 for r in rows):
        scale *= 0.98
    heights = [int(scale * extents[r, 1].max()) + 2 * _GAP + 18 for r in rows]
    picture = Image.new("RGB", (width, sum(heights)), PAPER)
    draw = ImageDraw.Draw(picture)
    for row, height, bottom in zip(rows, heights, np.cumsum(heights), strict=True):
        lefts = _GAP + np.cumsum([0.0, *_cells(words[row], scale * extents[row, 0])])
        for k, left in zip(row, lefts, strict=False):
            name, panel = panels[k]
            origin = scale * panel.outline.min(axis=0) * [1.0, -1.0]
            corner = np.array([left, bottom - _GAP]) - origin
            own = pieces.triangles[pieces.panel[pieces.triangles[:, 0]] == k]
            at = corner + scale * pieces.flat * [1.0, -1.0]
            for corners in at[own]:
                draw.polygon([tuple(c) for c in corners], outline="#9fb2cc", fill=_PIECE)
            outline = [tuple(p) for p in corner + scale * panel.outline * [1.0, -1.0]]
            draw.line([*outline, outline[0]], fill=INK, width=2)
            draw.text((left, bottom - height + 2), name, fill=INK, font=text_font())
    return picture


def _cells(words: FloatArray, widths: FloatArray) -> FloatArray:
    """Width of the place of each piece, its name and its gap [pixel]."""
    cells: FloatArray = np.maximum(words, widths + _GAP)
    return cells


def text_font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """The font of all words in these pictures."""
    return ImageFont.load_default(13)


def view_of(surfaces: Sequence[Surface], cloth: FloatArray, degrees: float) -> NDArray[np.uint8]:
    """A picture of what is worn from a direction about the vertical.

    The floor is at the lowest point where that is below 0, as of a robot whose root is its hips.
    """
    low, high = cloth.min(axis=0), cloth.max(axis=0)
    middle = 0.5 * (low + high)
    half = 0.5 * _MARGIN * (high - low)
    across = max(float(half[0]), float(half[1])) * SIZE[1] / SIZE[0]
    away = max(float(half[2]), across) / math.tan(0.5 * _FIELD) + float(half.max())
    a = math.radians(degrees)
    eye = middle + away * np.array([math.cos(a), math.sin(a), 0.1])
    floor = min(0.0, *(float(s.vertices[:, 2].min()) for s in surfaces if len(s.vertices)))
    camera = Camera(position=eye, target=middle, field_of_view=_FIELD)
    return render(surfaces, camera, *SIZE, floor=floor)


def _strain_surfaces(made: Made) -> list[Surface]:
    """The garment in bands of the strain of its triangles' most strained edges."""
    triangles = made.sewn.triangles
    edges, of_triangle, _ = edge_table(triangles)
    strain = strains(made.sewn, edges)[of_triangle].reshape(-1, 3)
    worst = np.take_along_axis(strain, np.abs(strain).argmax(axis=1)[:, None], axis=1)[:, 0]
    band = np.searchsorted([limit for limit, _, _ in _BANDS], worst)
    return [
        Surface(
            vertices=made.sewn.shown,
            triangles=np.ascontiguousarray(triangles[band == k]),
            color=color(code),
        )
        for k, (_, code, _) in enumerate(_BANDS)
        if (band == k).any()
    ]
