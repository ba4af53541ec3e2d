"""A dressed walk as numpy arrays in one file: positions of every frame, and the triangles.

python examples/collect.py walk.npz
"""

import sys

import numpy as np

import garment_sim_ros as gs


def main(out: str, seconds: float = 1.0, outfit: str = "short_skirt", **fit: object) -> None:
    """Writes `NAME_x` [frames, v, 3] in metres, and `NAME_triangles` [t, 3]."""
    avatar = gs.Avatar.load(**fit)
    simulation = gs.Simulation(avatar.dress(outfit), avatar.colliders)
    frames: dict[str, list[np.ndarray]] = {name: [] for name in simulation.names}
    for poses in avatar.play("walk", rate=60, seconds=seconds):
        simulation.step(poses, dt=1 / 60)
        for name, positions in frames.items():
            positions.append(simulation[name].positions)
    arrays = {f"{name}_x": np.stack(x) for name, x in frames.items()}
    arrays |= {f"{name}_triangles": simulation[name].triangles for name in frames}
    np.savez_compressed(out, **arrays)
    print(f"{out}: " + ", ".join(f"{name} {a.shape}" for name, a in arrays.items()))


if __name__ == "__main__":
    main(*sys.argv[1:2] or ["walk.npz"])
