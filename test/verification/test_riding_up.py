"""A skirt that stays rolled up is pulled down; what falls by itself is left alone."""

from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.sim.openings import Openings
from garment_sim_ros.sim.rewinding import Rewinding
from garment_sim_ros.sim.riding_up import RidingUp
from garment_sim_ros.sim.simulation import Simulation

FRAME = 1 / 60
RINGS, AROUND = 15, 32
LENGTH, RADIUS = 0.42, 0.125
DOWN = np.array([0.0, 0.0, -9.81])
BONE = np.eye(4)[None]


def skirt(cloth, length=LENGTH, **more):
    """Held by its waist ring."""
    x, triangles = cloth.tube(RADIUS, 1.0, length, RINGS, AROUND)
    return cloth.garment(x, triangles, pins=np.arange(AROUND), damping=1.0, **more)


def rolled_up(x, share):
    """Each ring so much nearer to the waist."""
    return np.column_stack([x[:, :2], 1.0 + (1.0 - share) * (x[:, 2] - 1.0)])


@pytest.mark.parametrize(("share", "rode_up"), [(0.0, False), (0.45, False), (0.55, True)])
def test_a_hem_nearer_than_half_way_rode_up(cloth, share, rode_up):
    garment = skirt(cloth)
    x = rolled_up(garment.vertices, share)
    assert RidingUp(garment).look(x, BONE, DOWN).rode_up is rode_up


@pytest.mark.parametrize("gravity", [-DOWN, DOWN[[2, 0, 1]], 0.0 * DOWN])
def test_what_would_not_hang_there_did_not(cloth, gravity):
    """Upside down, lying, or without gravity."""
    garment = skirt(cloth)
    x = rolled_up(garment.vertices, 0.8)
    assert not RidingUp(garment).look(x, BONE, gravity).rode_up


def test_it_follows_the_body(cloth):
    """What hangs upside down on a body upside down did not ride up; what lies on its hips did."""
    garment = skirt(cloth)
    over = np.diag([1.0, -1.0, -1.0, 1.0])[None]
    x = garment.vertices * [1.0, -1.0, -1.0]
    assert not RidingUp(garment).look(x, over, -DOWN).rode_up
    rolled = rolled_up(garment.vertices, 0.8) * [1.0, -1.0, -1.0]
    assert RidingUp(garment).look(rolled, over, -DOWN).rode_up


def test_what_gravity_turns_over_is_told(cloth):
    garment = skirt(cloth)
    over = np.diag([1.0, -1.0, -1.0, 1.0])[None]
    x = garment.vertices
    for T, gravity, told in [(BONE, DOWN, False), (BONE, -DOWN, True), (over, DOWN, True)]:
        assert RidingUp(garment).look(x, T, gravity).upside_down is told
    assert not RidingUp(garment).look(x, over, -DOWN).upside_down
    assert not RidingUp(garment).look(x, BONE, 0.0 * DOWN).upside_down


def test_a_body_upside_down_has_its_skirt_turned_over_not_off(cloth, monkeypatch):
    """Legs are through no hem then. Upright again, the skirt has 0.27 s to fall."""
    simulation = put_on(cloth, "xpbd")
    lost = []
    monkeypatch.setattr(Openings, "lost", lambda *_: bool(lost))
    here = ColliderPoses.identity(len(simulation.collider_set))
    came_off = []
    for n in range(120):
        turn = np.pi * np.clip([n / 30, (90 - n) / 30], 0.0, 1.0).min()
        there = here.copy()
        there.orientation[:] = [np.sin(turn / 2), 0.0, 0.0, np.cos(turn / 2)]
        there.position[:, 2] = 1.0 - np.cos(turn)
        there.position[:, 1] = np.sin(turn)
        lost += [True] * (n == 30)
        simulation.advance(here, there, FRAME)
        came_off.append(simulation["cloth"].health.came_off)
        here = there
    # Upright from the 76th frame on, when it is turned back by more than half.
    assert came_off[75 + 16] == 0
    assert came_off[75 + 16 + 16] == 1


def test_short_sleeves_and_cloth_that_nothing_holds_have_no_such_hem(cloth):
    short = skirt(cloth, length=0.2)
    assert not RidingUp(short).look(rolled_up(short.vertices, 0.9), BONE, DOWN).rode_up
    loose = replace(skirt(cloth), pins=np.zeros(0, np.int32), pin_frame=np.zeros(0, np.int32))
    assert not RidingUp(loose).look(rolled_up(loose.vertices, 0.9), BONE, DOWN).rode_up


def put_on(cloth, solver, **more):
    """The skirt on an upright rod, which it is wider than."""
    simulation = Simulation(skirt(cloth, **more), cloth.colliders(cloth.rod()), solver=solver)
    for _ in range(30):
        simulation.step()
    return simulation


def length_of(x):
    """From waist to hem, straight."""
    rings = x.reshape(RINGS, AROUND, 3)
    return float(np.linalg.norm(rings[-1] - rings[0], axis=1).mean())


def roll_up_to(simulation, length):
    """Lets the cloth be so long, and at rest."""
    worn = simulation["cloth"].worn
    x = worn.seen(simulation.origin)
    x = rolled_up(x, 1.0 - length / length_of(x)) - simulation.origin
    worn.state.x[:] = x[worn.model.vertex]
    worn.state.v[:] = 0.0


@pytest.mark.parametrize("solver", ["xpbd", "relaxation", "implicit"])
def test_a_roll_that_stays_is_pulled_down(cloth, solver):
    """Cloth that is held where it is rolled up hangs again, within a second, and is counted."""
    simulation = put_on(cloth, solver)
    whole = length_of(simulation["cloth"].positions)
    assert whole > 0.9 * LENGTH
    lengths = []
    for _ in range(60):
        if simulation["cloth"].health.rode_up == 0:
            roll_up_to(simulation, 0.3 * LENGTH)
        simulation.step()
        lengths.append(length_of(simulation["cloth"].positions))
    health = simulation["cloth"].health
    assert (health.rode_up, health.rewound, health.not_rewound) == (1, 1, 0)
    assert (health.caught, health.came_off) == (0, 0)
    assert lengths[20] < 0.5 * LENGTH
    assert lengths[-1] > 0.9 * whole
    assert np.abs(np.diff(lengths)).max() < 0.05


@pytest.mark.parametrize(("speed", "replays"), [(0.0, 3), (1.0, 0)])
def test_what_cannot_be_pulled_down_is_tried_seldom_and_at_rest_alone(
    cloth, speed, replays, monkeypatch
):
    """The body is not moved with the garment on while it moves itself; else less and less often.

    In 2.5 s it is tried after 0.53 s and then every 0.2 s: by a replay at first, 0.4 s later, and
    0.8 s after that.
    """
    simulation = put_on(cloth, "xpbd")
    may_replay, answers = Rewinding.may_replay, []
    monkeypatch.setattr(Rewinding, "is_well", lambda *_: False)
    monkeypatch.setattr(
        Rewinding,
        "may_replay",
        lambda *asked: (answers.append(may_replay(*asked)), answers[-1])[1],
    )
    here = ColliderPoses.identity(len(simulation.collider_set))
    for _ in range(150):
        roll_up_to(simulation, 0.3 * LENGTH)
        there = here.copy()
        there.position[:, 0] += speed * FRAME
        simulation.advance(here, there, FRAME)
        here = there
    assert sum(answers) == replays
    health = simulation["cloth"].health
    assert health.rode_up == health.not_rewound >= 9
    assert (health.caught, health.came_off, health.rewound) == (0, 0, 0)


def test_what_falls_by_itself_is_left_alone(cloth):
    simulation = put_on(cloth, "xpbd", friction=0.0)
    roll_up_to(simulation, 0.3 * LENGTH)
    for _ in range(60):
        simulation.step()
    health = simulation["cloth"].health
    assert (health.rode_up, health.rewound, health.rewound_parts) == (0, 0, 0)
    # Nothing rolls it out but its weight: it comes to rest on folds, at 0.54 to 0.77 by chance.
    assert length_of(simulation["cloth"].positions) > 0.5 * LENGTH
