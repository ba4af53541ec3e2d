"""Signed-distance colliders against hulls: tightness, posed skin outside, cost.

    python bench/signed_distance.py [--data DIR] [--body mannequin] [--parts fits,clips,contact]

fits: time, memory, and how both stand off the skin in the bind pose. clips: how far the
posed skin leaves them over 25 poses of each of three clips. contact: T-shirt and short skirt on
the walking mannequin, what they bring to their collisions in 30 steps collided again, both kinds
by turns; medians of processor time of one thread.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.description import to_json
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.report.fit_report import fit_report
from garment_sim_ros.colliders.report.motion_report import motion_report
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.mocap.clip_poses import clip_poses
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.params import ColliderOptions

sys.path.insert(0, str(Path(__file__).parent))
from hull_contact import again, walked

CLIPS = ("cmu_14_14_jumping_jacks_30fps", "rokoko_jesse_dance", "cmu_131_03_hop_spin")
POSES = 25
ROUNDS = 5


def fits(body: Body, sets: dict[str, ColliderSet], options: dict[str, ColliderOptions]) -> None:
    """Time, size and tightness."""
    for name, colliders in sets.items():
        took = []
        for _ in range(3):
            begin = time.perf_counter()
            fit_colliders(body, options[name])
            took.append(time.perf_counter() - begin)
        report = fit_report(body, colliders)
        print(
            f"{name}: {report['colliders']}; fit {np.median(took):.1f} s, description "
            f"{len(to_json(colliders)) / 1e6:.2f} MB; skin outside "
            f"{100 * report['outside_share']:.2f} %, max {report['outside_mm_max']:.2f} mm; "
            f"collider to skin mean {report['collider_to_skin_mm_mean']:.2f}, "
            f"p95 {report['collider_to_skin_mm_p95']:.1f}, "
            f"max {report['collider_to_skin_mm_max']:.1f} mm; "
            f"volume {100 * report['volume_excess']:+.1f} %"
        )


def clips(body: Body, sets: dict[str, ColliderSet], folder: Path) -> None:
    """Posed skin outside."""
    for clip in CLIPS:
        poses = clip_poses(load_clip(folder / f"{clip}.bvh"), body, POSES)
        for name, colliders in sets.items():
            report = motion_report(body, colliders, poses)
            print(
                f"{clip}, {name}: outside {100 * report['outside_share']:.2f} %, "
                f"p99 {report['outside_mm_p99']:.1f}, max {report['outside_mm_max']:.1f} mm"
            )


def contact(body: Body, sets: dict[str, ColliderSet]) -> None:
    """Milliseconds of collision per step of both garments."""
    garments = load_outfit("tshirt_short_skirt", body).garments
    brought = {name: walked(garments, colliders, body) for name, colliders in sets.items()}
    took: dict[str, list[float]] = {name: [] for name in sets}
    for _ in range(ROUNDS):
        for name, by_garment in brought.items():
            took[name].append(sum(again(steps, 1) for steps in by_garment.values()))
    ratio = np.median(np.array(took["sdf"]) / np.array(took["hulls"]))
    figures = ", ".join(f"{name} {np.median(own):.3f} ms" for name, own in took.items())
    print(f"contact of both garments: {figures}; ratio {ratio:.2f}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    here = Path(__file__).resolve().parents[1]
    default = Path(os.environ.get("GARMENT_SIM_DATA") or here.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=default, help="folder with mocap")
    parser.add_argument("--body", default="mannequin")
    parser.add_argument("--voxel", type=float, default=0.01, help="distance of samples [m]")
    parser.add_argument("--parts", default="fits,clips,contact")
    given = parser.parse_args()
    body = load_body(given.body)
    options = {
        "hulls": ColliderOptions(),
        "sdf": ColliderOptions(method="sdf", voxel=given.voxel),
    }
    sets = {name: fit_colliders(body, own) for name, own in options.items()}
    if "fits" in given.parts:
        fits(body, sets, options)
    if "clips" in given.parts:
        clips(body, sets, given.data / "mocap")
    if "contact" in given.parts:
        contact(body, sets)


if __name__ == "__main__":
    main()
