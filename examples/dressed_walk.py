"""The built-in body walks in a T-shirt and a short skirt.

python examples/dressed_walk.py
"""

import garment_sim_ros as gs


def main(seconds: float = 2.0, outfit: str = "tshirt_short_skirt", **fit: object) -> gs.Simulation:
    """Walks."""
    avatar = gs.Avatar.load("mannequin:height=1.7", **fit)
    simulation = gs.Simulation(avatar.dress(outfit), avatar.colliders)
    for poses in avatar.play("walk", rate=60, seconds=seconds):
        simulation.step(poses, dt=1 / 60)
    for garment in simulation:
        speed, contacts = garment.health.max_speed, garment.health.contacts
        print(f"{garment.name}: fastest {speed:.2f} m/s, {contacts} vertices touch the body")
    return simulation


if __name__ == "__main__":
    main()
