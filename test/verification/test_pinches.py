"""Cloth that shapes press from two sides comes to rest, and stays between them."""

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.sim.simulation import Simulation


def limbs(cloth, order):
    """An arm that lies in the side of a chest, overlapping it by 1.5 cm, both along y."""
    sizes = {"chest": (0.12, 0.10), "arm": (0.05, 0.04)}
    shapes = []
    for name in order:
        r0, r1 = sizes[name]
        geometry = {"radius0": r0, "radius1": r1, "length": 0.6}
        shapes.append(Collider(name=name, kind="capsule", bone="bone", geometry=geometry))
    return cloth.colliders(*shapes)


def poses(order, apart):
    result = ColliderPoses.identity(3)
    for n, name in enumerate(order):
        result.position[1 + n] = [0.0 if name == "chest" else apart, -0.3, 0.0]
        result.orientation[1 + n] = [-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    return result


def pinched(cloth, solver, order):
    """A sheet that hangs between the two over the chest while the arm closes, after 3 s."""
    vertices, triangles = cloth.grid(16, 12)
    sheet = np.stack([0.0 * vertices[:, 0] + 0.125, vertices[:, 1], 0.05 - vertices[:, 0]], axis=1)
    simulation = Simulation(
        (cloth.garment(sheet, triangles, pins=range(12), friction=0.3, damping=5.0),),
        limbs(cloth, order),
        solver=solver,
    )
    start = poses(order, 0.20)
    speeds = []
    for frame in range(180):
        end = poses(order, 0.20 - 0.06 * min((frame + 1) / 30, 1.0))
        simulation.advance(start, end, 1 / 60)
        speeds.append(simulation.health("cloth").rms_speed)
        start = end
    assert simulation.health("cloth").resets == 0
    return simulation.positions("cloth").copy(), max(speeds[-10:])


@pytest.mark.parametrize("solver", ["relaxation", "xpbd"])
def test_pinched_cloth_comes_to_rest_between_what_pinches_it(cloth, solver):
    x, speed = pinched(cloth, solver, ("chest", "arm"))
    assert speed < 1e-3
    beside = np.abs(x[:, 2]) < 0.02
    assert beside.sum() > 10
    # The overlap goes from x = 0.095 to 0.11 in the middle: nothing was pushed through a side.
    assert x[beside, 0].min() > 0.085
    assert x[beside, 0].max() < 0.12
    assert np.abs(x - pinched(cloth, solver, ("arm", "chest"))[0]).max() == 0.0
