"""Fewer vertices are the same cloth: it hangs, swings and lies as all of them do."""

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.contact.pierced import PiercedMeter

FRAME = 1 / 60


def curtain(cloth, detail, solver):
    """A curtain of 0.6 x 0.48 m that hangs from its upper border, ready to swing."""
    x, triangles = cloth.grid(31, 25)
    upright = np.stack([0.0 * x[:, 0], x[:, 1], x[:, 0]], axis=1)
    pins = np.flatnonzero(upright[:, 2] > 0.299)
    material = {"damping": 0.3, "air_drag": 0.05}
    garment = cloth.garment(upright, triangles, pins=pins, **material)
    return gs.Simulation(garment, cloth.colliders(), solver=solver, detail=detail)


@pytest.mark.parametrize("solver", ["xpbd", "implicit"])
def test_a_curtain_swings_as_long_and_as_far(cloth, solver):
    """Let go from the side, as a plate: the ways of the lower border differ by less than 8 %."""
    ways = []
    for detail in (1.0, 0.25):
        simulation = curtain(cloth, detail, solver)
        simulation.step()
        view = simulation["cloth"]
        angle = 0.5
        local = view.state.x[:, 2] - 0.3  # below the pins
        free = view.model.free_count
        view.state.x[:free, 0] = -np.sin(angle) * local[:free]
        view.state.x[:free, 2] = 0.3 + np.cos(angle) * local[:free]
        lowest = view.garment.vertices[:, 2] < -0.299
        way = []
        for _ in range(120):
            simulation.step(dt=FRAME)
            way.append(view.positions[lowest].mean(axis=0))
        ways.append(np.array(way))
    whole, fewer = ways
    swing = np.ptp(whole[:, 0])
    assert swing > 0.3
    assert np.abs(fewer - whole).max() < 0.08 * swing


def test_a_sheet_lies_as_high_on_a_ball(cloth):
    """What is shown of fewer vertices does not sink in, nor does it hover."""
    ball = gs.Collider(
        name="ball",
        kind="sphere",
        bone="bone",
        position=[0.0, 0.0, 0.0],
        orientation=[0.0, 0.0, 0.0, 1.0],
        geometry={"radius": 0.2},
    )
    x, triangles = cloth.grid(41, 41)
    x[:, 2] = 0.21
    sheet = cloth.garment(x, triangles, damping=4.0, friction=0.6)
    low = []
    for detail in (1.0, 0.25):
        simulation = gs.Simulation(sheet, cloth.colliders(ball), detail=detail)
        for _ in range(120):
            simulation.step(dt=FRAME)
        away = np.linalg.norm(simulation.positions("cloth"), axis=1)
        low.append((away.min() - 0.2, np.median(np.sort(away)[:400]) - 0.2))
    (lowest, height), (lowest_of_fewer, height_of_fewer) = low
    assert abs(lowest) < 0.003
    assert lowest_of_fewer > -0.004
    assert height_of_fewer == pytest.approx(height, abs=0.003)


def test_the_preset_that_has_it_is_worn_right_in_a_walk():
    """All vertices of both garments, on the built-in walk: no limb through, little stretch."""
    avatar = gs.Avatar.load("mannequin", preset="fast")
    outfit = avatar.dress("tshirt_short_skirt")
    simulation = gs.Simulation(outfit, avatar.colliders, preset="fast")
    meter, stretch = PiercedMeter(avatar.colliders), []
    poses = avatar.play("walk", rate=60, seconds=2.0)
    for pose in poses:
        simulation.step(pose, dt=FRAME)
        shown = {view.name: (view.positions, view.triangles) for view in simulation}
        meter.add(pose, shown)
        for view in simulation:
            rest = view.garment.vertices
            a, b = view.triangles[:, 0], view.triangles[:, 1]
            before = np.linalg.norm(rest[a] - rest[b], axis=1)
            stretch.append(np.linalg.norm(view.positions[a] - view.positions[b], axis=1) / before)
    assert sum(len(view.model) for view in simulation) < 0.26 * sum(
        len(view.garment.vertices) for view in simulation
    )
    assert meter.result().share == 0.0
    assert np.percentile(np.concatenate(stretch), 95.0) < 1.05


def test_the_same_input_gives_the_same_bits():
    found = []
    for _ in range(2):
        avatar = gs.Avatar.load("mannequin", preset="fast")
        simulation = gs.Simulation(
            avatar.dress("tshirt_short_skirt"), avatar.colliders, preset="fast"
        )
        for pose in avatar.play("walk", rate=60, seconds=0.5):
            simulation.step(pose, dt=FRAME)
        found.append([view.positions.tobytes() for view in simulation])
    assert found[0] == found[1]
