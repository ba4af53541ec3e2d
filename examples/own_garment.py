"""A garment of your own, as a mesh in its place on the body.

python examples/own_garment.py avatar.glb shirt.obj
"""

import sys

import garment_sim_ros as gs


def main(body: str, mesh: str, seconds: float = 1.0, **options: object) -> gs.Simulation:
    """Dresses the body and lets it stand; options as an outfit file has them."""
    avatar = gs.Avatar.load(body)
    outfit = avatar.dress(mesh, name="mine", material="denim", **options)
    for note in outfit.notes:
        print(f"assumed: {note}")
    simulation = gs.Simulation(outfit, avatar.colliders)
    poses = avatar.poses()
    for _ in range(round(60 * seconds) + 1):
        simulation.step(poses, dt=1 / 60)
    mine = simulation["mine"]
    print(f"{len(mine.positions)} vertices, {len(outfit.garments[0].pins)} of them pinned")
    return simulation


if __name__ == "__main__":
    try:
        main(*sys.argv[1:3])
    except gs.GarmentSimError as error:
        sys.exit(f"error: {error}")
