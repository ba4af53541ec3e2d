"""A picture of how garments are made, as Fig. 9 a to c of Sun et al. 2007: flat, placed, sewn."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.garment.colours import Colour
from garment_sim_ros.garment.patterns.making import Made
from garment_sim_ros.recording.dress_pictures import draw_pieces, view_of
from garment_sim_ros.recording.render import SKIN_COLOR, Surface, linear

_WIDTH = 620
"""Width of the flat pieces [pixel]."""
_SIDEWAYS = 30.0
"""Direction from which the body is seen [degree]."""
_PAPER, _INK = "#ffffff", "#222222"


def draw_steps(
    made: Sequence[Made],
    colours: Sequence[Colour],
    skin: FloatArray,
    skin_triangles: IntArray,
    path: Path,
) -> None:
    """Draws garments as flat pieces, as they are placed around a body, and sewn on it.

    Args:
        made: The garments, inner ones first.
        colours: A colour for each.
        skin: The body's skin [m], shape [v, 3].
        skin_triangles: Shape [t, 3].
        path: A .png file.

    Raises:
        RenderingUnavailableError: The ray caster is not installed.
    """
    body = Surface(vertices=skin, triangles=skin_triangles, color=SKIN_COLOR, gloss=0.15)
    looks = [linear(colour) for colour in colours]
    stages = (
        [(m.sewn.placed, m.pieces.triangles) for m in made],
        [(m.sewn.vertices, m.sewn.triangles) for m in made],
    )
    extent = np.concatenate([x for stage in stages for x, _ in stage])
    views = [
        Image.fromarray(
            view_of(
                [
                    body,
                    *(
                        Surface(vertices=x, triangles=t, color=look)
                        for (x, t), look in zip(stage, looks, strict=True)
                    ),
                ],
                extent,
                _SIDEWAYS,
            )
        )
        for stage in stages
    ]
    flat = [draw_pieces(m.pieces, _WIDTH) for m in made]
    heights = sum(f.height for f in flat), views[0].height
    sheet = Image.new("RGB", (_WIDTH + sum(v.width for v in views), max(heights) + 24), _PAPER)
    y = 24
    for pieces in flat:
        sheet.paste(pieces, (0, y))
        y += pieces.height
    draw = ImageDraw.Draw(sheet)
    for k, (view, name) in enumerate(zip(views, ("b: placed", "c: sewn"), strict=True)):
        x = _WIDTH + k * view.width
        sheet.paste(view, (x, 24))
        draw.text((x + 10, 4), name, fill=_INK, font=ImageFont.load_default(13))
    draw.text((10, 4), "a: flat", fill=_INK, font=ImageFont.load_default(13))
    sheet.save(path)
