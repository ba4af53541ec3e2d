"""A change of the level of `auto` is not seen: cloth does not jump, and hangs as before."""

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.sim.auto.levels import LEVELS, START
from garment_sim_ros.sim.auto.pacer import Pacer

EVERY = 12
"""Frames between two changes; fewer than `auto` ever leaves between a fall and a climb."""
AT_FIRST = [level.name for level in LEVELS].index(START)
TOP = len(LEVELS) - 1
CLIMBS = [*range(AT_FIRST + 1, TOP + 1), 0, *range(1, AT_FIRST + 1)]
"""To the top, the deepest fall that there is, and back."""
SEEN = 6.0
"""Change of motion from frame to frame that a walk's own is as large as [mm]."""


@pytest.fixture(scope="module")
def worn():
    avatar = gs.Avatar.load("mannequin")
    outfit = avatar.dress("tshirt_short_skirt")
    return gs.Simulation(outfit, avatar.colliders), avatar.colliders, avatar


def played(worn, schedule, frames):
    """Positions after each frame of a body that stands still [m], shape [f, v, 3]."""
    simulation, _, avatar = worn
    poses = next(iter(avatar.play(gs.load_clip("walk"), rate=60))).copy()
    simulation.reset(poses)
    pacer = Pacer(simulation, 1e9, levels=LEVELS)
    shown = []
    for n in range(frames):
        if n in schedule:
            pacer._controller.level = schedule[n]
            pacer.apply()
        simulation.step(poses)
        shown.append(np.concatenate([view.positions for view in simulation]))
    return np.array(shown)


def changes_of_motion(shown):
    """99th percentile over vertices of the change of the way of a frame [mm], shape [f - 2]."""
    ways = np.diff(shown, axis=0)
    return 1e3 * np.percentile(np.linalg.norm(np.diff(ways, axis=0), axis=2), 99, axis=1)


@pytest.mark.parametrize(("lowest", "off"), [(0, 8.0), (1, 6.0)])
def test_standing_cloth_does_not_jump_and_comes_back_to_its_shape(worn, lowest, off):
    """Off by so many millimetres: folds that fewer vertices lost come back elsewhere."""
    begin = 30
    climbs = [max(level, lowest) for level in CLIMBS]
    schedule = {begin + EVERY * k: level for k, level in enumerate(climbs)}
    end = begin + EVERY * len(climbs)
    shown = played(worn, schedule, end + 90)
    assert changes_of_motion(shown[begin - 5 :]).max() < SEEN
    moved = 1e3 * np.linalg.norm(shown[-1] - shown[begin - 1], axis=1)
    # Friction holds what lies on a body in many places; balanced itself is off by 6.6 mm there.
    assert np.sqrt((moved**2).mean()) < off


def test_hung_cloth_comes_back_to_its_shape():
    material = {"damping": 8.0, "air_drag": 1.0}  # soon at rest
    sheet = gs.Garment.sheet(
        0.6, 0.6, edge=0.05, upright=True, pins="top corners", material=material
    )
    simulation = gs.Simulation(sheet, gs.ColliderSet.of())
    pacer = Pacer(simulation, 1e9, levels=LEVELS)
    (view,) = simulation
    shapes = []
    for level in (AT_FIRST, AT_FIRST, 0, TOP, AT_FIRST):
        pacer._controller.level = level
        pacer.apply()
        for _ in range(300):
            simulation.step()
        shapes.append(view.positions)
    way = [1e3 * np.abs(x - shapes[1]).max() for x in shapes]
    assert way[0] < 0.01
    assert way[2] > 1.0  # it does stretch more meanwhile
    assert way[4] < 0.01


def test_what_is_never_done_would_be_seen(worn):
    """From the lowest level to the highest at once: the check above can fail."""
    shown = played(worn, {10: 0, 50: TOP}, 60)
    assert changes_of_motion(shown[45:]).max() > SEEN


def test_each_step_after_a_change_is_the_only_one_that_prepares(worn):
    """What a level needs is made once; its other steps find it."""
    simulation, _, avatar = worn
    poses = next(iter(avatar.play(gs.load_clip("walk"), rate=60))).copy()
    simulation.reset(poses)
    pacer = Pacer(simulation, 1e9, levels=LEVELS)
    for level in (0, AT_FIRST, TOP):
        pacer._controller.level = level
        pacer.apply()
        simulation.step(poses)
        given = [view.worn.workspace.given for view in simulation]
        for _ in range(3):
            simulation.step(poses)
        assert all(a is view.worn.workspace.given for a, view in zip(given, simulation))
