"""DeepMimic's motions as BVH clips: motions that the shared data has not.

    python bench/deepmimic.py MOTION.txt ... --out DIR

A motion is a file such as `humanoid3d_backflip.txt`, of DeepMimic (Peng et al. 2018) or of the
package `pybullet`, in `pybullet_data/data/motions`. The skeleton is that of the shared
`deepmimic_walk.bvh`; that clip comes out as it is there, number for number.
"""

import argparse
import json
import os
import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

DATA = Path(os.environ.get("GARMENT_SIM_DATA") or Path(__file__).parents[2] / "shared" / "data")
SKELETON = DATA / "mocap" / "deepmimic_walk.bvh"
LIMBS = ("hip", "knee", "ankle", "shoulder", "elbow")
HINGES = ("knee", "elbow")  # one angle about z; the others have a quaternion, w first


def joint_rotations(frames: np.ndarray) -> dict[str, Rotation]:
    """Rotations of all joints in all frames, shape [n, 44]: time, root position, joints."""
    limbs = [f"{side}_{limb}" for side in ("right", "left") for limb in LIMBS]
    found, at = {}, 4
    for joint in ("root", "chest", "neck", *limbs):
        if joint.endswith(HINGES):
            found[joint] = Rotation.from_rotvec(frames[:, at, None] * [0.0, 0.0, 1.0])
            at += 1
        else:
            found[joint] = Rotation.from_quat(frames[:, at : at + 4], scalar_first=True)
            at += 4
    return found


def clip(motion: Path, skeleton: str) -> str:
    """The text of a clip."""
    frames = np.array(json.loads(motion.read_text())["Frames"], dtype=float)
    rotations = joint_rotations(frames)
    columns = [frames[:, 1:4] - frames[0, 1:4] * [1.0, 0.0, 1.0]]
    for joint in re.findall(r"(?:ROOT|JOINT) (\w+)", skeleton):
        angles = np.unwrap(rotations[joint].as_euler("ZXY"), axis=0)
        columns.append(np.degrees(angles))
    rows = [" ".join(f"{v:.5f}" for v in row) for row in np.concatenate(columns, axis=1)]
    head = f"MOTION\nFrames: {len(rows)}\nFrame Time: {frames[0, 0]:.6f}\n"
    return skeleton + head + "\n".join(rows) + "\n"


def main() -> None:
    """Write one clip for each motion."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("motions", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    text = SKELETON.read_text()
    skeleton = text[: text.index("MOTION")]
    for motion in args.motions:
        name = motion.stem.removeprefix("humanoid3d_")
        (args.out / f"{name}.bvh").write_text(clip(motion, skeleton))


if __name__ == "__main__":
    main()
