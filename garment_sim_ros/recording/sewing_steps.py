"""A picture of how garments are made, as Fig. 9 a to c of Sun et al. 2007: flat, placed, sewn."""

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.garment.colours import Colour
from garment_sim_ros.garment.patterns.making import Made
from garment_sim_ros.recording.dress_pictures import (
    INK,
    PAPER,
    clothed,
    draw_pieces,
    stacked,
    text_font,
    view_of,
)

_WIDTH = 620
"""Width of the flat pieces [pixel]."""
_SIDEWAYS = 30.0
"""Direction from which the body is seen [degree]."""


def steps_picture(
    made: Sequence[Made],
    colours: Sequence[Colour],
    skin: FloatArray,
    skin_triangles: IntArray,
) -> Image.Image:
    """Garments as flat pieces, as they are placed around a body, and sewn on it.

    Args:
        made: The garments.
        colours: A colour for each.
        skin: The body's skin [m], shape [v, 3].
        skin_triangles: Shape [t, 3].

    Raises:
        RenderingUnavailableError: The ray caster is not installed.
    """
    stages = (
        [(m.sewn.placed, m.pieces.triangles) for m in made],
        [(m.sewn.shown, m.sewn.triangles) for m in made],
    )
    extent = np.concatenate([x for stage in stages for x, _ in stage])
    views = [
        Image.fromarray(view_of(clothed(skin, skin_triangles, stage, colours), extent, _SIDEWAYS))
        for stage in stages
    ]
    flat = stacked([draw_pieces(m.pieces, _WIDTH) for m in made])
    height = max(flat.height, views[0].height) + 24
    sheet = Image.new("RGB", (_WIDTH + sum(v.width for v in views), height), PAPER)
    sheet.paste(flat, (0, 24))
    draw = ImageDraw.Draw(sheet)
    for k, (view, name) in enumerate(zip(views, ("b: placed", "c: sewn"), strict=True)):
        x = _WIDTH + k * view.width
        sheet.paste(view, (x, 24))
        draw.text((x + 10, 4), name, fill=INK, font=text_font())
    draw.text((10, 4), "a: flat", fill=INK, font=text_font())
    return sheet
