"""What more descent steps of `implicit` cost and gain in a walk.

    python bench/descent.py

T-shirt and short skirt on the walking mannequin, in steps of 1/60 s: processor time of the median
frame, and the mean distance of vertices from the same walk with 200 to 600 steps.
"""

import time

import numpy as np

import garment_sim_ros as gs

STEP, SECONDS = 1 / 60, 2.0
REFERENCE = (200, 600)
SETTINGS = ((8, 8), (8, 16), (8, 24))


def walk(avatar: gs.Avatar, frames: list, least: int, most: int) -> tuple[np.ndarray, float]:
    """Vertices in each frame [m], shape [f, n, 3], and the median frame [ms]."""
    simulation = gs.Simulation(
        avatar.dress("tshirt_short_skirt"),
        avatar.colliders,
        solver="implicit",
        iterations=least,
        most_iterations=most,
    )
    x, times = [], []
    for poses in frames:
        began = time.thread_time()
        simulation.step(poses, dt=STEP)
        times.append(time.thread_time() - began)
        x.append(np.concatenate([view.simulated for view in simulation]))
    return np.array(x), 1e3 * float(np.median(times[20:]))


def main() -> None:
    """Print the table."""
    avatar = gs.Avatar.load("mannequin")
    frames = list(avatar.play("walk", rate=1 / STEP, seconds=SECONDS))
    exact, _ = walk(avatar, frames, *REFERENCE)
    print("| `iterations`, `most_iterations` | frame | off after 0.5 s | 1 s |\n|---|---|---|---|")
    for least, most in SETTINGS:
        x, frame = walk(avatar, frames, least, most)
        half, one = 1e3 * np.linalg.norm(x - exact, axis=2).mean(axis=1)[[29, 59]]
        print(f"| {least}, {most} | {frame:.1f} ms | {half:.1f} mm | {one:.1f} mm |")


if __name__ == "__main__":
    main()
