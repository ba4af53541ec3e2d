"""The moving picture of the README: two strides of a simulated walk, small, as a loop.

    python bench/film.py docs/walk.gif

A stride takes 1.08 s, 18 pictures of 60 ms: the loop begins where it ends, but for the floor.
"""

import argparse
import tempfile
from pathlib import Path

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.cli.main import main as command
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT
from garment_sim_ros.recording.bags import read_recording
from garment_sim_ros.recording.previews import Look, animation
from garment_sim_ros.recording.summary import figures

CLIP = ("--clip", "walk:path=straight", "--seconds", "5.9", "--rate", "50")
RATE = 50.0 / 3.0
STRIDES, PICTURES = 2, 18


def main():
    """Draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, nargs="?", default=Path("out/walk.gif"), help="GIF file")
    parser.add_argument("--size", type=int, nargs=2, default=(270, 380), help="[pixel]")
    args = parser.parse_args()
    body = load_body("mannequin")
    garments = load_outfit(DEFAULT_OUTFIT, body).garments
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        if command(["simulate", *CLIP, "--out", str(bag)]):
            raise SystemExit(1)
        shown = figures(read_recording(bag), body)[-3 * STRIDES * PICTURES :: 3]
    args.out.parent.mkdir(parents=True, exist_ok=True)
    look = Look(
        skin_triangles=body.skin.triangles,
        garment_triangles=tuple(g.triangles for g in garments),
        garment_colours=tuple(garment_colour(i) for i in range(len(garments))),
    )
    animation(shown, look, args.out, rate=RATE, size=tuple(args.size))
    print(f"{args.out}: {len(shown)} pictures, {args.out.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
