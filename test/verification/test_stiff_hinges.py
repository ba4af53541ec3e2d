"""Cloth that is stiffer in bending than `xpbd` can follow from sub-step to sub-step."""

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers.xpbd.workspace import XpbdWorkspace

AROUND, ALONG, RADIUS, LENGTH = 34, 17, 0.11, 0.3


def tube(cloth, **material):
    """A sheet that is flat at rest, closed to a tube that hangs by its upper rim."""
    turn = np.linspace(0.0, 2 * np.pi, AROUND, endpoint=False)
    rows = [
        np.stack([RADIUS * np.cos(turn), RADIUS * np.sin(turn), np.full(AROUND, -z)], axis=1)
        for z in np.linspace(0.0, LENGTH, ALONG)
    ]
    index = np.arange(AROUND * ALONG, dtype=np.int32).reshape(ALONG, AROUND)
    a, b = index[:-1].ravel(), index[1:].ravel()
    d, c = np.roll(index, -1, axis=1)[:-1].ravel(), np.roll(index, -1, axis=1)[1:].ravel()
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return cloth.garment(np.concatenate(rows), triangles, pins=range(AROUND), **material)


@pytest.mark.parametrize("bending_stiffness", [1e-2, 1e-1, 1e3])
def test_a_stiff_tube_rests(cloth, bending_stiffness):
    """With a pass over the hinges for every four sub-steps it got ever faster, up to 0.2 m/s."""
    garment = tube(cloth, bending_stiffness=bending_stiffness, damping=4.0)
    simulation = Simulation([garment], cloth.colliders(), solver="xpbd")
    still = ColliderPoses.identity(1)
    simulation.reset(still)
    fastest = []
    for _ in range(90):
        simulation.advance(still, still, 1 / 60)
        fastest.append(simulation.health("cloth").max_speed)
    assert max(fastest[-10:]) < 1e-3


@pytest.mark.parametrize(
    ("bending_stiffness", "expected"),
    [(0.0, 6), (5e-6, 6), (2e-5, 3), (5e-5, 2), (1e-3, 1), (1.0, 1)],
)
def test_stiffer_hinges_have_more_passes(cloth, bending_stiffness, expected):
    """As seldom as contact is searched for, but often enough, and a whole number of times."""
    garment = tube(cloth, bending_stiffness=bending_stiffness)
    model = build_model(garment.name, garment.vertices, garment.triangles, garment.material)
    workspace = XpbdWorkspace.room_for(model, 0)
    workspace.prepare(model, 1 / 1080, 0.0, 6)
    assert workspace.bend_every == expected
