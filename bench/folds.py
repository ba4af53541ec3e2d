"""How finely cloth folds, and what it costs, by number of vertices.

    python bench/folds.py [--outfit tshirt_short_skirt] [--vertices 0 5000 10000] [--pictures DIR]

The mannequin walks for 3 s in the outfit with so many vertices in each garment (0: those of the
outfit), all of them in turns: processor time of a frame over that of the first, median. Folds:
root mean square curvature of each garment over all frames after the first half second [1/m],
and the 99th percentile of the fastest vertex [m/s]. The skin's own curvature counts, too.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import yaml

import garment_sim_ros as gs
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.outfit_file import builtin_outfits
from garment_sim_ros.geometry.topology import hinge_vertices
from garment_sim_ros.recording.previews import Figure, Look, moments

FRAME = 1 / 60
SKIPPED = 30
SHOWN = (60, 90, 120, 150)


def squared_curvature(x: np.ndarray, hinges: np.ndarray) -> float:
    """Mean over the surface of the squared curvature across edges [1/m^2]."""
    a, b, c, d = (x[hinges[:, k]] for k in range(4))
    n, m = np.cross(b - a, c - a), np.cross(d - a, b - a)
    angle = np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), (n * m).sum(axis=1))
    area = 0.5 * (np.linalg.norm(n, axis=1) + np.linalg.norm(m, axis=1))
    curvature = angle * np.linalg.norm(b - a, axis=1) / np.maximum(area, 1e-12)
    return float(np.average(curvature**2, weights=area))


class Dressed:
    """The walker in one outfit, with what is measured on it."""

    def __init__(self, avatar: gs.Avatar, outfit: str, vertices: int) -> None:
        asked = yaml.safe_load(builtin_outfits()[outfit])
        for garment in asked["garments"] if vertices else ():
            garment["options"]["vertices"] = vertices
        self.outfit = avatar.dress(asked)
        self.simulation = gs.Simulation(self.outfit, avatar.colliders)
        self.hinges = {g.name: hinge_vertices(g.triangles) for g in self.outfit.garments}
        self.times: list[float] = []
        self.speeds: dict[str, list[float]] = {name: [] for name in self.hinges}
        self.folds: dict[str, list[float]] = {name: [] for name in self.hinges}
        self.figures: list[Figure] = []

    def step(self, frame: int, poses: object, joints: np.ndarray, skin: np.ndarray) -> None:
        """One frame, measured."""
        began = time.thread_time()
        self.simulation.step(poses, dt=FRAME)
        if frame >= SKIPPED:
            self.times.append(time.thread_time() - began)
            for name, hinges in self.hinges.items():
                x = self.simulation[name].positions.astype(np.float64)
                self.folds[name].append(squared_curvature(x, hinges))
                self.speeds[name].append(self.simulation[name].health.max_speed)
        if frame in SHOWN:
            worn = tuple(self.simulation[name].positions for name in self.hinges)
            self.figures.append(Figure(skin=skin, garments=worn, root=joints[0, :3, 3]))

    def picture(self, avatar: gs.Avatar, path: Path) -> None:
        """Four moments side by side."""
        garments = self.outfit.garments
        look = Look(
            skin_triangles=avatar.body.skin.triangles,
            garment_triangles=tuple(g.triangles for g in garments),
            garment_colours=tuple(garment_colour(i) for i in range(len(garments))),
        )
        moments(self.figures, look, path)


def main() -> None:
    """Prints a line for each number of vertices and garment."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--outfit", default="tshirt_short_skirt", choices=builtin_outfits())
    parser.add_argument("--vertices", nargs="+", type=int, default=[0, 5000, 10_000])
    parser.add_argument("--pictures", type=Path)
    options = parser.parse_args()
    avatar = gs.Avatar.load("mannequin")
    runs = {n: Dressed(avatar, options.outfit, n) for n in options.vertices}
    clip = gs.load_clip("walk")
    ways = (avatar.play(clip, rate=60, seconds=3.0), avatar.joints(clip, rate=60, seconds=3.0))
    for frame, (poses, joints) in enumerate(zip(*ways)):
        skin = avatar.skin(joints)
        for run in runs.values():
            run.step(frame, poses, joints, skin)
    first = next(iter(runs.values()))
    print("| vertices | work | curvature | fastest vertex |\n|---|---|---|---|")
    for n, run in runs.items():
        ratio = float(np.median(np.array(run.times) / first.times))
        sizes = ", ".join(f"{g.name} {len(g.vertices)}" for g in run.outfit.garments)
        folds = ", ".join(f"{np.sqrt(np.mean(f)):.0f}" for f in run.folds.values())
        speeds = ", ".join(f"{np.percentile(s, 99):.1f}" for s in run.speeds.values())
        print(f"| {sizes} | {ratio:.1f} | {folds} /m | {speeds} m/s |")
        if options.pictures:
            options.pictures.mkdir(parents=True, exist_ok=True)
            run.picture(avatar, options.pictures / f"{options.outfit}_{n}.png")


if __name__ == "__main__":
    main()
