"""A sheet of cotton falls on a ball and comes to rest.

python examples/sheet_on_a_ball.py
"""

import garment_sim_ros as gs


def main(seconds: float = 2.0, edge: float = 0.025) -> gs.Simulation:
    """Lets it fall."""
    ball = gs.ColliderSet.of(gs.sphere(0.15))
    sheet = gs.Garment.sheet(0.6, 0.6, edge=edge, at=(0.0, 0.0, 0.2), material="cotton_jersey")
    simulation = gs.Simulation(sheet, ball, solver="xpbd")
    simulation.step()  # the first call puts the sheet where it was made
    for _ in range(round(60 * seconds)):
        simulation.step(dt=1 / 60)
    x = simulation["sheet"].positions
    print(f"top at {x[:, 2].max():.3f} m, hem at {x[:, 2].min():.3f} m")
    return simulation


if __name__ == "__main__":
    main()
