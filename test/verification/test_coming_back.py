"""A garment that is broken for good is worn right again within half a second of calm."""

from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.contact.shapes import Collider
from garment_sim_ros.sim.simulation import Simulation

FRAME = 1 / 60
RINGS, AROUND = 13, 24
ROD = np.array([[[0.0, -0.42, 0.0], [0.0, 0.42, 0.0]]])
"""The core of a rod along y: the middle 70 %."""


def limb(parts):
    """A level rod, of one part or of two that meet in its middle."""
    length = 1.2 / parts
    return [
        Collider(
            name=f"rod {k}",
            kind="capsule",
            bone="bone" if k == 0 else "beyond",
            position=[0.0, -0.6 + k * length, 0.0],
            orientation=[-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)],
            geometry={"radius0": 0.04, "radius1": 0.04, "length": length},
        )
        for k in range(parts)
    ]


def worn(cloth, solver):
    """A tube on a level rod, which it hangs from."""
    angle = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    ring = 0.08 * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=-1)
    x = np.concatenate([ring + np.array([0, y, -0.02]) for y in np.linspace(-0.15, 0.15, RINGS)])
    i = np.arange(AROUND)
    j = (i + 1) % AROUND
    two = np.concatenate([np.c_[i, i + AROUND, j], np.c_[j, i + AROUND, j + AROUND]])
    triangles = np.concatenate([two + k * AROUND for k in range(RINGS - 1)]).astype(np.int32)
    garment = cloth.garment(x, triangles, damping=1.0, friction=0.3)
    simulation = Simulation(garment, cloth.colliders(*limb(1)), solver=solver)
    simulation.step()
    return simulation


def rings_around(simulation):
    """How many rings of the tube go around the rod."""
    x = simulation["cloth"].positions.astype(float).reshape(RINGS, AROUND, 3)
    turn = np.diff(np.arctan2(x[..., 2], x[..., 0]), axis=1, append=np.nan)
    turn[:, -1] = np.arctan2(x[:, 0, 2], x[:, 0, 0]) - np.arctan2(x[:, -1, 2], x[:, -1, 0])
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    return int((np.abs(turn.sum(axis=1)) > 6.0).sum())


def hits(simulation):
    view = simulation["cloth"]
    return find_hits(ROD, view.positions, view.triangles, np.empty(9, np.int32), np.empty(9))


def calm(simulation, frames):
    """Steps on; how far any point is seen to move in a frame."""
    largest, before = 0.0, simulation["cloth"].positions
    for _ in range(frames):
        simulation.step()
        x = simulation["cloth"].positions
        largest = max(largest, float(np.linalg.norm(x - before, axis=1).max()))
        before = x
    return largest


@pytest.mark.parametrize("solver", ["xpbd", "relaxation", "implicit"])
def test_cloth_beside_the_body_is_put_back(cloth, solver):
    simulation = worn(cloth, solver)
    calm(simulation, 30)
    assert rings_around(simulation) == RINGS
    good = simulation["cloth"].positions
    simulation["cloth"].state.x[:, 0] += 0.3
    assert calm(simulation, 30) < 0.05
    assert rings_around(simulation) == RINGS
    assert hits(simulation) == 0
    health = simulation["cloth"].health
    assert (health.rewound, health.came_off, health.caught, health.not_rewound) == (1, 1, 0, 0)
    assert calm(simulation, 30) < 0.02
    assert np.abs(simulation["cloth"].positions - good).max() < 0.03


@pytest.mark.parametrize("parts", [1, 2])
def test_a_limb_that_stays_in_the_cloth_is_out_of_it_again(cloth, parts):
    """A sheet in the air beyond the end of the rod, which then runs through it in its middle.

    Of two parts, it is the joint alone that is in the cloth: no core of a part is.
    """
    plane, triangles = cloth.grid(13, 13, 0.025)
    x = plane[:, [0, 2, 1]] + np.array([0.0, 0.65, 0.0])
    garment = replace(
        cloth.garment(x, triangles, damping=1.0),
        T_world_bone_rest={"bone": np.eye(4), "beyond": np.eye(4)},
    )
    rod = cloth.colliders(*limb(parts))
    simulation = Simulation(garment, rod, solver="relaxation", gravity=(0.0, 0.0, 0.0))
    simulation.step()
    calm(simulation, 30)
    view = simulation["cloth"]
    good, health = view.positions, view.health
    view.state.x[:, 1] -= 0.62
    calm(simulation, 6)
    assert hits(simulation) > 0
    assert health.rewound == 0
    assert calm(simulation, 24) < 0.05
    assert hits(simulation) == 0
    assert (health.rewound, health.rewound_parts) in ((1, 0), (0, 1))
    assert (health.caught, health.came_off, health.not_rewound) == (1, 0, 0)
    assert np.abs(view.positions - good).max() < 0.05


@pytest.mark.parametrize("solver", ["xpbd", "relaxation"])
def test_what_is_worn_right_is_left_alone(cloth, solver):
    simulation = worn(cloth, solver)
    simulation["cloth"].state.v[:, 1] += 0.5
    calm(simulation, 60)
    assert rings_around(simulation) == RINGS
    health = simulation["cloth"].health
    assert (health.rewound, health.rewound_parts) == (0, 0)
    assert (health.caught, health.came_off) == (0, 0)
