"""Whether garments stay on robots: URDFs that somebody has, dressed and moved by clips.

    python bench/robots.py --body F.urdf [F.urdf ...] --clip F [F ...] [--outfit O] [--seconds S]

For each robot and clip, offline at 60 frames a second: in how many frames a limb runs through a
garment, the 95th percentile and the largest excess length of edges (mean and largest over the
frames), how often garments were wound back and put back, and the median time of a step.
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np

import garment_sim_ros as gs
from garment_sim_ros.contact.pierced import PiercedMeter
from garment_sim_ros.recording.metrics import GarmentMesh


def measure(avatar: gs.Avatar, outfit: gs.Outfit, clip: str, seconds: float) -> str:
    """A row of the table, after the robot's name."""
    simulation = gs.Simulation(outfit, avatar.colliders)
    meshes = {garment.name: GarmentMesh.of(garment) for garment in outfit.garments}
    meter, steps, high, longest = PiercedMeter(avatar.colliders), [], [], []
    for n, pose in enumerate(avatar.play(gs.load_clip(clip), rate=60)):
        if n >= 60.0 * seconds:
            break
        start = time.perf_counter()
        simulation.step(pose, dt=1 / 60)
        steps.append(time.perf_counter() - start)
        shown = {g.name: (simulation.positions(g.name), g.triangles) for g in outfit.garments}
        meter.add(pose, shown)
        excess = np.concatenate([mesh.strain(shown[name][0]) for name, mesh in meshes.items()])
        high.append(np.percentile(excess, 95.0))
        longest.append(excess.max())
    health = [simulation.health(garment.name) for garment in outfit.garments]
    wound, put = (sum(getattr(h, key) for h in health) for key in ("rewound", "resets"))
    return (
        f"{Path(clip).stem} | {meter.result().pierced} of {len(steps)} | {np.mean(high):.1%}, "
        f"{np.max(longest):.0%} | {wound}, {put} | {1e3 * np.median(steps):.1f} ms |"
    )


def main() -> None:
    """Print a table."""
    data = Path(os.environ.get("GARMENT_SIM_DATA", Path(__file__).parents[2] / "shared/data"))
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--body", nargs="+", required=True)
    parser.add_argument("--clip", nargs="+", required=True)
    parser.add_argument("--outfit", default="tshirt_short_skirt")
    parser.add_argument("--seconds", type=float, default=np.inf)
    given = parser.parse_args()
    for body in given.body:
        avatar = gs.Avatar.load(body)
        outfit = avatar.dress(given.outfit)
        for clip in given.clip:
            path = clip if Path(clip).exists() else str(data / "mocap" / clip)
            print(
                f"| {avatar.body.name} | {measure(avatar, outfit, path, given.seconds)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
