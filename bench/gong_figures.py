"""Figures 8 to 12 of the second paper (Gong et al. 2018), redrawn with the preset ``gong2018``.

    python bench/gong_figures.py docs/gong2018.png [--seconds 2] [--rounds 5]

Fig. 8: a man and a woman with one ellipsoid to a region, with one threshold and with two. Fig. 9:
a sewn wide dress in gravity and gusts on both, and with ``balanced``; Fig. 10: a tight T-shirt
likewise. Figs. 11 and 12: the time of a step's contact with a finer body and with a finer garment,
beside asking the mesh (`ellipsoids.py`). The bodies are mannequins.
"""

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.params import ColliderOptions
from garment_sim_ros.presets import chosen, collider_options
from garment_sim_ros.recording.previews import Figure, Look
from garment_sim_ros.recording.render import SKIN_COLOR, Camera, Surface, render

sys.path.insert(0, str(Path(__file__).parent))
import ellipsoids
from papers import DRESS, TIGHT
from presets import Wearer

BODIES = {"woman": "mannequin:vertices=1425,sex=0", "man": "mannequin:vertices=1425,sex=1"}
SEXES = {"woman": "female", "man": "male"}
WIDTH, HEIGHT, TITLE = 260, 420, 44
INK, PAPER, OURS, MESH = (40, 44, 48), (255, 255, 255), (44, 110, 160), (196, 78, 72)


def shown(surfaces: Sequence[Surface], turned: float = 0.6) -> Image.Image:
    """A picture of somebody who stands."""
    target, far = np.array([0.0, 0.0, 0.86]), 4.9
    eye = target + far * np.array([np.cos(turned), np.sin(turned), 0.12])
    camera = Camera(position=eye, target=target)
    return Image.fromarray(render(list(surfaces), camera, WIDTH, HEIGHT))


def fits(body: str, sex: str) -> list[tuple[str, Image.Image]]:
    """Fig. 8: the skin, and its ellipsoids by three rules."""
    made = load_body(body)
    skin = Surface(vertices=made.skin.vertices, triangles=made.skin.triangles, color=SKIN_COLOR)
    pictures = []
    for name, asked in (
        ("one to a region", {"mu_torso": 1.0, "mu_limb": 1.0}),
        ("one threshold", {"mu_torso": 0.012, "mu_limb": 0.012}),
        ("two thresholds", {}),
    ):
        options = ColliderOptions(**{**collider_options("gong2018"), "sex": sex, **asked})
        colliders = fit_colliders(made, options)
        poses = ColliderPoser(colliders, made).poses(rest_transforms(made.rig))
        surfaces = [skin]
        for n, collider in enumerate(colliders.colliders):
            if collider.kind != "ellipsoid":
                continue
            vertices, triangles = surface(collider)
            vertices = vertices @ matrix_from_quaternion(poses.orientation[n]).T
            colour = tuple(0.35 + 0.5 * np.abs(np.sin([n, 2.1 * n + 1.0, 3.7 * n + 2.0])))
            surfaces.append(
                Surface(vertices=vertices + poses.position[n], triangles=triangles, color=colour)
            )
        pictures.append((f"{name}: {len(surfaces) - 1}", shown(surfaces)))
    return pictures


def worn(
    who: str, outfit: str | Mapping[str, Any], seconds: float, preset: str
) -> tuple[str, Image.Image]:
    """Figs. 9 and 10: somebody who stands, after some seconds of wind."""
    wind = [f"cloth_node.{k}" for k in ("wind_drag=1.2", "wind_lift=0.4", "gust=1.0")]
    sex = [f"collider_node.sex={SEXES[who]}"] if preset == "gong2018" else []
    wearer = Wearer(chosen(preset, [*wind, *sex]), None, seconds, BODIES[who], outfit)
    wearer.until(seconds)
    look = Look(
        skin_triangles=wearer.avatar.body.skin.triangles,
        garment_triangles=tuple(g.triangles for g in wearer.garments),
        garment_colours=tuple(garment_colour(n) for n in range(len(wearer.garments))),
    )
    figure = Figure(
        skin=wearer.avatar.skin(wearer.joints[-1]),
        garments=tuple(wearer.simulation.positions(g.name) for g in wearer.garments),
        root=np.zeros(3),
    )
    inside = 100 * wearer.figures()["inside_p99"]
    return f"inside p99 {inside:.1f} %", shown(look.surfaces(figure))


def plot(title: str, unit: str, rows: Sequence[Sequence[float]]) -> Image.Image:
    """Time over a number, both axes logarithmic: ours and the mesh."""
    image = Image.new("RGB", (3 * WIDTH - 10, 320), PAPER)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(13)
    left, right, top, bottom = 60, image.width - 40, 40, image.height - 40
    x = np.log10([row[0] for row in rows])
    times = np.log10([[row[1], row[2]] for row in rows])
    low, high = np.floor(times.min()), np.ceil(times.max())

    def at(u: float, v: float) -> tuple[float, float]:
        across = (u - x[0]) / (x[-1] - x[0])
        return left + across * (right - left), bottom - (v - low) / (high - low) * (bottom - top)

    draw.text((left, 10), title, INK, font)
    for power in np.arange(low, high + 1):
        y = at(x[0], power)[1]
        draw.line((left, y, right, y), (220, 220, 216))
        draw.text((8, y - 8), f"{10.0**power:g} ms", INK, font)
    for row, u in zip(rows, x):
        draw.text((at(u, low)[0] - 18, bottom + 6), f"{row[0]:,.0f}", INK, font)
    draw.text((left, bottom + 22), unit, INK, font)
    for column, (name, colour) in enumerate((("ellipsoids", OURS), ("the mesh", MESH))):
        points = [at(u, t) for u, t in zip(x, times[:, column])]
        draw.line(points, colour, 3)
        for a, b in points:
            draw.ellipse((a - 4, b - 4, a + 4, b + 4), colour)
        draw.text((points[1][0] - 60, points[1][1] - 26), name, colour, font)
    return image


def sheet(rows: Sequence[tuple[str, Sequence[tuple[str, Image.Image]]]], path: Path) -> None:
    """Rows of pictures, each with a title, a picture with what is said of it."""
    font, large = ImageFont.load_default(13), ImageFont.load_default(17)
    width = max(sum(p.width for _, p in row) for _, row in rows) + 20
    height = sum(TITLE + max(p.height for _, p in row) for _, row in rows) + 20
    image = Image.new("RGB", (width, height), PAPER)
    draw, y = ImageDraw.Draw(image), 10
    for title, row in rows:
        draw.text((12, y), title, INK, large)
        x = 10
        for text, picture in row:
            draw.text((x + 6, y + 24), text, INK, font)
            image.paste(picture, (x, y + TITLE))
            x += picture.width
        y += TITLE + max(p.height for _, p in row)
    image.quantize(255).save(path, optimize=True)


def main() -> None:
    """Draws."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=Path, nargs="?", default=Path("out/gong2018.png"))
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    eight = [
        (f"{who}, {text}", picture)
        for who, body in BODIES.items()
        for text, picture in fits(body, SEXES[who])
    ]
    rows = [("Fig. 8: ellipsoids", eight)]
    clothes = []
    for name, outfit in (("Fig. 9", DRESS), ("Fig. 10", TIGHT)):
        for who, preset in (("woman", "gong2018"), ("man", "gong2018"), ("woman", "balanced")):
            text, picture = worn(who, outfit, options.seconds, preset)
            by = "" if preset == "gong2018" else f" {preset},"
            clothes.append((f"{name}, {who},{by} {text}", picture))
    rows.append(("Figs. 9 and 10: a wide dress and tight clothes, in gravity and wind", clothes))
    figures = ellipsoids.figures(options.rounds)
    finer = figures["fig_11_body_vertices_ellipsoids_ms_mesh_ms_contacts"]
    more = figures["fig_12_particles_ellipsoids_ms_mesh_ms_ratio"]
    plots = [
        ("Fig. 11", plot("a finer body", "vertices of the body", finer)),
        ("Fig. 12", plot("a finer garment", "particles", more)),
    ]
    rows.append(("Figs. 11 and 12: time of a step's contact", plots))
    sheet(rows, options.out)
    print(f"{options.out}: {os.path.getsize(options.out) / 1e3:.0f} kB; {finer}; {more}")


if __name__ == "__main__":
    main()
