"""Your body dances to your motion capture.

python examples/own_body_and_motion.py avatar.glb dance.bvh
"""

import sys

import garment_sim_ros as gs


def main(
    body: str, motion: str, outfit: str = "tshirt_short_skirt", seconds: float | None = None
) -> gs.Simulation:
    """Plays the clip once, or so many seconds of it."""
    avatar = gs.Avatar.load(body)
    clip = gs.load_clip(motion)
    for note in (*avatar.body.notes, *clip.notes):
        print(f"assumed: {note}")
    simulation = gs.Simulation(avatar.dress(outfit), avatar.colliders)
    for poses in avatar.play(clip, rate=60, seconds=seconds):
        simulation.step(poses, dt=1 / 60)
    print(f"{simulation.time:.1f} s of {clip.name} on {avatar.body.name}")
    return simulation


if __name__ == "__main__":
    try:
        main(*sys.argv[1:3])
    except gs.GarmentSimError as error:
        sys.exit(f"error: {error}")
