"""All presets on one walk, side by side: the picture ``docs/presets.png``.

    python bench/presets_side_by_side.py [--seconds 1.6] [--out docs/presets.png]

Each in its own colliders, contact, solver and step, as `bench/presets.py` plays them.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from garment_sim_ros.params import PRESETS
from garment_sim_ros.presets import chosen
from garment_sim_ros.recording.render import SKIN_COLOR, Camera, Surface, color, render

sys.path.insert(0, str(Path(__file__).parent))
from presets import Clip, Wearer

WIDTH, HEIGHT, LABEL = 250, 460, 26
COLORS = {"skirt": color("#3a5a8c"), "tshirt": color("#c8553d")}
EYE = np.array([3.6, -2.6, 0.35])


def picture(name: str, seconds: float) -> Image.Image:
    """One preset after so many seconds of the walk, with its name above."""
    wearer = Wearer(chosen(name), Clip("walk", "walk"), seconds, "mannequin")
    wearer.until(seconds)
    skin = wearer.avatar.skin(wearer.joints[wearer.next - 1])
    middle = skin.mean(axis=0) * [1.0, 1.0, 0.0] + [0.0, 0.0, 0.84]
    surfaces = [
        Surface(vertices=skin, triangles=wearer.avatar.body.skin.triangles, color=SKIN_COLOR)
    ]
    surfaces += [
        Surface(
            vertices=wearer.simulation.positions(g.name).copy(),
            triangles=g.triangles,
            color=COLORS[g.name],
        )
        for g in wearer.garments
    ]
    drawn = render(surfaces, Camera(position=middle + EYE, target=middle), WIDTH, HEIGHT)
    whole = Image.new("RGB", (WIDTH, HEIGHT + LABEL), "white")
    whole.paste(Image.fromarray(drawn), (0, LABEL))
    font = ImageFont.load_default(16)
    ImageDraw.Draw(whole).text((WIDTH / 2, LABEL / 2), name, "black", font, anchor="mm")
    return whole


def main() -> None:
    """Plays and draws."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=1.6)
    parser.add_argument("--out", type=Path, default=Path("docs/presets.png"))
    options = parser.parse_args()
    whole = Image.new("RGB", (WIDTH * len(PRESETS), HEIGHT + LABEL), "white")
    for place, name in enumerate(PRESETS):
        whole.paste(picture(name, options.seconds), (place * WIDTH, 0))
    whole.quantize(200).save(options.out, optimize=True)
    print(f"{options.out}: {options.out.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
