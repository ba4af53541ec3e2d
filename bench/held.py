"""How far cloth is from rest on a body that rests: a clip is stopped at a frame.

    python bench/held.py [--body F] [--outfit F] [--held CLIP:FRAME ...]

The clip is played up to the frame (60 a second), then held for 3 s; figures are of the second
after them: root mean square speed over all vertices, the farthest that a vertex goes in a frame in
the mean, and how many shake: go on average more than 0.5 mm in a frame, and less far in two.

A body is what `garment-sim` takes, or a file of the shared data; an outfit likewise.
"""

import argparse
import os
from pathlib import Path

import numpy as np

import garment_sim_ros as gs

FRAME = 1 / 60
DATA = Path(os.environ.get("GARMENT_SIM_DATA") or Path(__file__).parents[2] / "shared" / "data")
HELD = ("deepmimic_run:20", "deepmimic_cartwheel:70", "deepmimic_spinkick:45")
HELD += ("rokoko_jesse_dance:300",)


def found(name: str, folder: str) -> str:
    """A file of the shared data, or what was asked for."""
    file = DATA / folder / name
    return str(file) if file.is_file() else name


def held(avatar: gs.Avatar, outfit: gs.Outfit, clip: str, frame: int) -> dict[str, np.ndarray]:
    """Places of each garment's vertices in the second after 3 s [m], shape [60, v, 3]."""
    simulation = gs.Simulation(outfit, avatar.colliders)
    for n, poses in enumerate(avatar.play(gs.load_clip(clip), rate=60)):
        simulation.step(poses, dt=FRAME)
        if n == frame:
            break
    places: dict[str, list] = {garment.name: [] for garment in outfit.garments}
    for n in range(240):
        simulation.step(poses, dt=FRAME)
        for name, x in places.items():
            if n >= 180:
                x.append(simulation.positions(name).astype(np.float64))
    return {name: np.array(x) for name, x in places.items()}


def main() -> None:
    """Prints a line for each clip and garment."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--body", default="mannequin")
    parser.add_argument("--outfit", default="tshirt_long_skirt")
    parser.add_argument("--held", nargs="+", default=HELD, metavar="CLIP:FRAME")
    args = parser.parse_args()
    avatar = gs.Avatar.load(found(args.body, "bodies"))
    outfit = avatar.dress(found(args.outfit, "garments"))
    for asked in args.held:
        clip, frame = asked.rsplit(":", 1)
        for name, x in held(avatar, outfit, found(f"{clip}.bvh", "mocap"), int(frame)).items():
            way = np.linalg.norm(np.diff(x, axis=0), axis=2)
            net = np.linalg.norm(x[2:] - x[:-2], axis=2).mean(axis=0)
            mean = way.mean(axis=0)
            print(
                f"{asked} {name}: {1e3 * np.sqrt((way**2).mean()) / FRAME:.1f} mm/s, "
                f"{1e3 * mean.max():.1f} mm, {((mean > 5e-4) & (net < mean)).sum()} shake",
                flush=True,
            )


if __name__ == "__main__":
    main()
