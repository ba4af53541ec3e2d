"""Time to load, sample and retarget motion capture: medians and 95th percentiles.

Run: python bench/mocap.py [BODY] [CLIP...]
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.loaders.urdf import parse_urdf
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.mocap.source_urdf import reference_from_urdf, urdf_from_clip

REPEATS = 3000


def microseconds(work: Callable[[int], object]) -> str:
    """Median and 95th percentile of one call [us]."""
    for k in range(10):
        work(k)
    spent = np.empty(REPEATS)
    for k in range(REPEATS):
        start = time.perf_counter()
        work(k)
        spent[k] = time.perf_counter() - start
    median, high = 1e6 * np.percentile(spent, (50, 95))
    return f"{median:7.1f} {high:7.1f}"


def main(body_name: str, clips: list[str]) -> None:
    """Print one line per clip."""
    body = load_body(body_name)
    print(
        f"{body.name}: {len(body.rig)} joints\n{'clip':>32}  load ms  sample us      retarget us"
    )
    for name in clips:
        load_clip(name)
        start = time.perf_counter()
        clip = load_clip(name)
        loading = 1e3 * (time.perf_counter() - start)
        text = urdf_from_clip(clip)
        retargeter = Retargeter(parse_urdf(text), body, reference=reference_from_urdf(text))
        sampler = ClipSampler(clip, "carry")
        values = clip.values
        sampling = microseconds(lambda k, s=sampler: s.sample(k * 0.0123))
        posing = microseconds(lambda k, r=retargeter, v=values: r.world_joints(v[k % len(v)]))
        print(f"{clip.name:>32} {loading:8.1f}  {sampling}  {posing}")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "mannequin", sys.argv[2:] or ["walk"])
