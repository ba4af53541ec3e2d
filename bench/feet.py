"""How feet stand: height of the soles over the ground, and how fast they slide.

A foot stands, by the source alone: ankle or ball is as low as in a foot that stands, to 3 cm, and
slower than 0.1 m/s, both against the samples before and after, and stays within 4 cm and slower
than 0.15 m/s. The sole's height is that of the
lowest vertex of the posed skin of a foot that stands, and it slides as fast along the ground as
the slowest of its vertices within 2 cm of the lowest: a foot that rolls off does not slide.

Run: python bench/feet.py [--body F]... [--clip F]... [--rate HZ]
"""

import argparse
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.leg_reach import FOOT
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler

BODIES = ("mannequin", "mh_female_young.glb", "CesiumMan.glb")
LOW, SLOW = (0.03, 0.04), (0.1, 0.15)  # to begin and to go on [m], [m/s]
NEAR = 0.02


def stands(points: FloatArray, height: FloatArray, dt: float) -> NDArray[np.bool_]:
    """Whether each foot stands in each sample, from ankle and ball [k, f, 2, 3]."""
    speed = np.full(points.shape[:3], np.inf)
    speed[1:-1] = np.linalg.norm(points[2:] - points[:-2], axis=-1) / (2.0 * dt)
    away = np.abs(points[..., 2] - height)
    standing = (away < LOW[0]) & (speed < SLOW[0])
    staying = (away < LOW[1]) & (speed < SLOW[1])
    for k in range(1, len(standing)):
        standing[k] |= standing[k - 1] & staying[k]
    return standing.any(axis=2)


def measure(clip: Clip, body: Body, rate: float) -> dict[str, FloatArray]:
    """Heights [m] and speeds [m/s] of standing feet, as the angles put them and grounded."""
    retargeter = Retargeter(
        clip.rig, body, T_world_source=clip.T_world_file, reference=clip.source_reference
    )
    feet = retargeter.feet
    times = np.arange(clip.times[0], clip.times[-1], 1.0 / rate)
    kinematics, skinner = ForwardKinematics(clip.rig), Skinner(body.skin)
    sampler = ClipSampler(clip)
    main = body.skin.bone[np.arange(len(body.skin.bone)), body.skin.weight.argmax(axis=1)]
    soles = [np.flatnonzero(part[main] == FOOT) for part in feet.legs.part]
    points = []
    skins: dict[str, list[list[FloatArray]]] = {"before": [], "after": []}
    for t in times:
        q = sampler.sample(float(t))
        T = kinematics.from_dofs(q, clip.T_world_file)[feet._joint]
        points.append((T[..., :3, :3] @ feet._offset[..., None])[..., 0] + T[..., :3, 3])
        for name, time in (("before", None), ("after", float(t))):
            x = skinner.vertices(retargeter.world_joints(q, time))
            skins[name].append([x[sole].copy() for sole in soles])
    places = np.array(points)
    standing = stands(places, feet._standing, 1.0 / rate)
    slow = np.linalg.norm(np.diff(places[..., :2], axis=0), axis=-1).min(axis=2)
    both = standing[1:] & standing[:-1]
    figures = {"source slide": retargeter.scale * rate * slow[both]}
    for name, frames in skins.items():
        heights, slides = [], []
        for k, i in np.argwhere(standing):
            x = frames[k][i]
            heights.append(x[:, 2].min())
            if k and standing[k - 1, i]:
                near = x[:, 2] < x[:, 2].min() + NEAR
                way = np.linalg.norm((x - frames[k - 1][i])[near, :2], axis=1)
                slides.append(way.min() * rate)
        figures[f"{name} height"] = np.array(heights)
        figures[f"{name} slide"] = np.array(slides)
    return figures


def line(figures: dict[str, FloatArray]) -> str:
    """Median, 5th and 95th percentile of heights; median and 95th of speeds."""
    own = figures["source slide"]
    cells = ["-, -"]
    if len(own):
        cells = ["{:5.1f}, {:5.1f}".format(*1e2 * np.percentile(own, (50, 95)))]
    for name in ("before", "after"):
        height, slide = figures[f"{name} height"], figures[f"{name} slide"]
        if not len(height) or not len(slide):
            cells.append("no foot stands")
            continue
        low, middle, high = 1e3 * np.percentile(height, (5, 50, 95))
        away = 1e3 * np.percentile(np.abs(height), 95)
        slow, fast = 1e2 * np.percentile(slide, (50, 95))
        cells.append(
            f"{middle:6.1f} | {low:6.1f} to {high:6.1f} | {away:6.1f} | {slow:5.1f}, {fast:5.1f}"
        )
    return " | ".join(cells)


def main() -> None:
    """Print a table: for each body and clip, and for each body."""
    data = Path(os.environ.get("GARMENT_SIM_DATA", Path(__file__).parents[2] / "shared/data"))
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--body", action="append")
    parser.add_argument("--clip", action="append")
    parser.add_argument("--rate", type=float, default=60.0)
    given = parser.parse_args()
    bodies = given.body or [
        name if name == "mannequin" else str(data / "bodies" / name) for name in BODIES
    ]
    clips = given.clip or ["walk", *map(str, sorted((data / "mocap").glob("*.bvh")))]
    one = "median | p5 to p95 | p95 of either | slide, p95"
    print(f"| body | clip | source: slide, p95 | before: {one} | grounded: {one} |")
    for source in bodies:
        body = load_body(source)
        whole: dict[str, list[FloatArray]] = {}
        for name in clips:
            clip = load_clip(name)
            figures = measure(clip, body, given.rate)
            for key, values in figures.items():
                whole.setdefault(key, []).append(values)
            print(f"| {body.name} | {clip.name} | {line(figures)} |", flush=True)
        total = {key: np.concatenate(values) for key, values in whole.items()}
        print(f"| {body.name} | all | {line(total)} |", flush=True)


if __name__ == "__main__":
    main()
