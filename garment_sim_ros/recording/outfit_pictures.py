"""A picture of an outfit on its body: front, side, back, and what holds it, by name.

Dots are drawn twice: on the garments, and below without these, as outer ones hide inner ones.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from PIL import Image, ImageDraw

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.recording.dress_pictures import (
    INK,
    PAPER,
    SIZE,
    VIEWS,
    clothed,
    stacked,
    text_font,
    view_of,
)
from garment_sim_ros.recording.render import Surface, color

MARKS = ("#e4572e", "#2e86ab", "#f3a712", "#6a4c93", "#3a9d5d", "#d63384", "#555555", "#17becf")
"""Colours of what holds garments, one after the other."""
_DOT = 0.006
"""Half the size of a dot [m]."""
_LINE = 18
"""Height of a line of the legend [pixel]."""
_OCTAHEDRON = np.array(
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
)


def outfit_picture(
    garments: Sequence[Garment], skin: FloatArray, skin_triangles: IntArray
) -> Image.Image:
    """Garments as they are put on, with dots at their attachments and elastic bands.

    Args:
        garments: The garments.
        skin: The body's skin in that pose [m], shape [v, 3].
        skin_triangles: Shape [t, 3].

    Raises:
        RenderingUnavailableError: The ray caster is not installed.
    """
    cloth = [(g.vertices, g.triangles) for g in garments]
    colours = [garment_colour(k) for k in range(len(garments))]
    marks = {
        f"{g.name}: {title}": g.vertices[vertices]
        for g in garments
        for title, vertices in g.marks.items()
    }
    surfaces = clothed(skin, skin_triangles, cloth, colours)
    extent = np.concatenate([x for x, _ in cloth])
    rows = [
        np.concatenate(
            [view_of([*seen, *dots(marks)], extent, angle) for _, angle in VIEWS], axis=1
        )
        for seen in (surfaces, surfaces[:1])
    ]
    views = Image.fromarray(np.concatenate(rows))
    draw = ImageDraw.Draw(views)
    for k, (name, _) in enumerate(VIEWS):
        draw.text((k * SIZE[0] + 10, 8), name, fill=INK, font=text_font())
    legend = legend_of(marks, views.width)
    return stacked([views, legend])


def dots(marks: Mapping[str, FloatArray]) -> list[Surface]:
    """A small octahedron at each point, one colour for each name."""
    corners = _DOT * np.concatenate([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]]
    made = []
    for k, points in enumerate(marks.values()):
        vertices = (points[:, None] + corners).reshape(-1, 3)
        triangles = (6 * np.arange(len(points))[:, None, None] + _OCTAHEDRON).reshape(-1, 3)
        look = color(MARKS[k % len(MARKS)])
        made.append(Surface(vertices=vertices, triangles=triangles.astype(np.int32), color=look))
    return made


def legend_of(marks: Mapping[str, FloatArray], width: int) -> Image.Image:
    """What the dots are, one line for each."""
    lines = [f"{name} ({len(points)} vertices)" for name, points in marks.items()]
    lines = lines or ["nothing is attached"]
    picture = Image.new("RGB", (width, _LINE * len(lines) + 12), PAPER)
    draw = ImageDraw.Draw(picture)
    for k, line in enumerate(lines):
        y = 6 + k * _LINE
        if marks:
            draw.ellipse((12, y + 3, 22, y + 13), fill=MARKS[k % len(MARKS)])
        draw.text((30, y), line, fill=INK, font=text_font())
    return picture
