"""A flag that hangs by its upper side in a gusty wind.

python examples/flag_in_the_wind.py
"""

import garment_sim_ros as gs


def main(seconds: float = 2.0, edge: float = 0.03, wind: float = 6.0) -> gs.Simulation:
    """Lets it blow along y."""
    flag = gs.Garment.sheet(0.6, 0.4, edge=edge, upright=True, pins="top", material="polyester")
    simulation = gs.Simulation(
        flag,
        gs.ColliderSet.of(),
        solver="xpbd",
        wind=(0.0, wind, 0.0),
        wind_drag=1.2,
        wind_lift=0.4,
        gust=0.2 * wind,
    )
    for _ in range(round(60 * seconds) + 1):
        simulation.step(dt=1 / 60)
    y = simulation["sheet"].positions[:, 1]
    print(f"the hem is blown {y.max():.2f} m to leeward")
    return simulation


if __name__ == "__main__":
    main()
