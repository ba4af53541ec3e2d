"""How far the lowest skin of a body is from the ground, over whole clips.

    python bench/ground.py [--body F]... --clip F [F ...] [--rate HZ]

For each body and clip: the height of the lowest vertex of the posed skin in each frame, with feet,
hands and what lies left where the angles put them (`ground_feet` off) and with all of it on the
ground; and how far the line between the hip joints goes up or down from frame to frame at most
more than the source's, to scale.
"""

import argparse
import os
from pathlib import Path

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler

BODIES = ("mannequin", "mh_female_young.glb", "CesiumMan.glb")


def measure(clip: Clip, body: Body, rate: float, ground: bool) -> tuple[FloatArray, FloatArray]:
    """Heights of the lowest skin [m], and steps of the hips against the source's [m]."""
    retargeter = Retargeter(
        clip.rig, body, T_world_source=clip.T_world_file, reference=clip.source_reference
    )
    kinematics, skinner = ForwardKinematics(clip.rig), Skinner(body.skin)
    sampler = ClipSampler(clip)
    lowest, off = [], []
    for t in np.arange(clip.times[0], clip.times[-1], 1.0 / rate):
        q = sampler.sample(float(t))
        T = retargeter.world_joints(q, float(t), ground_feet=ground)
        lowest.append(skinner.vertices(T)[:, 2].min())
        hips = T[retargeter.feet.legs.joints[:, 0], 2, 3].mean()
        source = kinematics.from_dofs(q, clip.T_world_file)[retargeter._travel_joints, 2, 3]
        off.append(hips - retargeter.scale * source.mean())
    return np.array(lowest), np.abs(np.diff(off))


def main() -> None:
    """Print a table."""
    data = Path(os.environ.get("GARMENT_SIM_DATA", Path(__file__).parents[2] / "shared/data"))
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--body", action="append")
    parser.add_argument("--clip", nargs="+", required=True)
    parser.add_argument("--rate", type=float, default=60.0)
    given = parser.parse_args()
    bodies = given.body or [
        name if name == "mannequin" else str(data / "bodies" / name) for name in BODIES
    ]
    heights = "lowest, p5, p95, highest"
    print(f"| body | clip | as the angles have it: {heights} | {heights} | step of the hips |")
    for source in bodies:
        body = load_body(source)
        for path in given.clip:
            clip = load_clip(path)
            cells = []
            for ground in (False, True):
                lowest, steps = measure(clip, body, given.rate, ground)
                numbers = 1e2 * np.percentile(lowest, (0, 5, 95, 100))
                cells.append(", ".join(f"{x:.1f}" for x in numbers) + " cm")
            cells.append(f"{1e2 * steps.max():.1f} cm")
            print(f"| {body.name} | {clip.name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
