"""A capsule swings through a curtain that hangs from its upper corners.

python examples/moving_shapes.py
"""

import math

import garment_sim_ros as gs


def main(seconds: float = 1.0, edge: float = 0.03) -> gs.Simulation:
    """Swings it once to and fro."""
    arm = gs.capsule((-0.4, 0.0, 0.0), (0.4, 0.0, 0.0), 0.05, bone="arm")
    colliders = gs.ColliderSet.of(arm)
    curtain = gs.Garment.sheet(0.8, 0.6, edge=edge, upright=True, pins="top corners")
    simulation = gs.Simulation(curtain, colliders, solver="xpbd")
    frames = round(60 * seconds)
    for frame in range(frames + 1):
        y = -0.3 * math.cos(2.0 * math.pi * frame / frames)
        simulation.step(colliders.poses({"arm": (0.0, y, -0.1)}), dt=1 / 60)
    print(f"{simulation['sheet'].health.contacts} vertices touch the arm")
    return simulation


if __name__ == "__main__":
    main()
