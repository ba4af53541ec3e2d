"""Garments that stay through each other on a body at rest are worn as they were put on."""

from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.sim.entangled import Entangled
from garment_sim_ros.sim.layers.pair import LayerPair
from garment_sim_ros.sim.rewinding import Rewinding, overstretched
from garment_sim_ros.sim.simulation import Simulation

FRAME = 1 / 60
RINGS, AROUND = 12, 32
NAMES = ("skirt", "shirt")


def tube(cloth, name, layer, *shape):
    """Hangs on its uppermost ring."""
    x, triangles = cloth.tube(*shape, RINGS, AROUND)
    worn = cloth.garment(x, triangles, pins=np.arange(AROUND), name=name, damping=1.0)
    return replace(worn, layer=layer)


@pytest.fixture(params=["xpbd", "relaxation", "implicit"])
def dressed(request, cloth, monkeypatch):
    """A rod in a skirt and, over its upper half, a shirt."""
    skirt = tube(cloth, "skirt", 0, 0.13, 1.0, 0.4)
    shirt = tube(cloth, "shirt", 1, 0.134, 1.1, 0.3)
    simulation = Simulation([skirt, shirt], cloth.colliders(cloth.rod()), solver=request.param)
    simulation.reset(ColliderPoses.identity(len(simulation.collider_set)))
    assert crossings(simulation) == 0
    look = Entangled.look

    def finds_it_entangled(looks, *what):
        if counts(simulation) == [0, 0]:  # it would free itself in two frames
            entangle(simulation)
        look(looks, *what)

    monkeypatch.setattr(Entangled, "look", finds_it_entangled)
    return simulation


def pair_of(simulation):
    (pair,) = simulation.over("shirt")
    return pair


def crossings(simulation):
    """Edges that run through the other garment, as they are shown."""
    return pair_of(simulation).crossings_at(*map(simulation.positions, NAMES))


def entangle(simulation):
    """What is under the shirt waves through it, at rest, in eight waves around the body."""
    worn = simulation["skirt"].worn
    x = worn.garment.vertices.copy()
    under = (x[:, 2] > 0.82) & (x[:, 2] < 0.98)
    angle = np.arctan2(x[under, 1], x[under, 0])
    x[under, :2] *= 1.0 + 0.1 * np.sin(8.0 * angle)[:, None]
    # Where the body is: the waist is held there.
    x += (simulation.positions("skirt") - worn.garment.vertices)[:AROUND].mean(axis=0)
    worn.state.x[:] = (x - simulation.origin)[worn.model.vertex]
    worn.state.v[:] = 0.0
    pair_of(simulation)._untangled.crossings = crossings(simulation)


def counts(simulation):
    return [simulation[name].health.entangled for name in NAMES]


def test_what_stays_through_is_wound_back_on_a_body_at_rest(dressed):
    through = []
    for _ in range(90):
        dressed.step()
        through.append((counts(dressed)[0], crossings(dressed)))
    wound_back = [count for count, _ in through].index(1)
    # Four looks, 1/15 s from one to the next; then they are seen on their way.
    assert 15 <= wound_back <= 22
    assert through[wound_back][1] > 100
    assert [edges for _, edges in through[wound_back + 15 :]] == [0] * (75 - wound_back)
    assert counts(dressed) == [1, 1]
    health = dressed["skirt"].health
    assert (health.caught, health.came_off, health.rode_up, health.rewound) == (0, 0, 0, 0)


def test_nothing_is_wound_back_while_the_body_moves(dressed):
    here = ColliderPoses.identity(len(dressed.collider_set))
    for _ in range(60):
        there = here.copy()
        there.position[:, 0] += 1.0 * FRAME
        dressed.advance(here, there, FRAME)
        here = there
    assert counts(dressed) == [0, 0]


@pytest.mark.parametrize("hinders", ["not well", "no better"])
def test_what_would_be_no_better_is_left_and_tried_seldom(dressed, hinders, monkeypatch):
    """Fifteen looks in a second: after 4, 8 and 16 more of them."""
    tried = []
    monkeypatch.setattr(
        "garment_sim_ros.sim.entangled.carried",
        lambda worn, kept, poses: (tried.append(worn.garment.name), kept.x)[1],
    )
    if hinders == "not well":
        monkeypatch.setattr(Rewinding, "is_well", lambda *_: False)
    else:
        at = LayerPair.crossings_at
        monkeypatch.setattr(LayerPair, "crossings_at", lambda *what: max(at(*what), 250))
    for _ in range(150):
        dressed.step()
    assert tried == 3 * list(NAMES)
    assert counts(dressed) == [0, 0]


@pytest.mark.parametrize(("out", "wound_back"), [(1, 1), (3, 0)])
def test_few_edges_may_be_overstretched(dressed, out, wound_back, monkeypatch):
    """Six at each vertex, of 1,100: as skin on a bent body they are too long here and there."""

    def stretched(worn, kept, poses):
        x = kept.x.copy()
        at = (RINGS - 2) * AROUND + 8 * np.arange(out)
        x[at, :2] *= 1.5 if worn.garment.name == "skirt" else 1.0
        assert overstretched(worn, x) == pytest.approx(
            0.0054 * out if worn.garment.name == "skirt" else 0.0, abs=0.0006 * out
        )
        return x

    monkeypatch.setattr("garment_sim_ros.sim.entangled.carried", stretched)
    for _ in range(30):
        dressed.step()
    assert counts(dressed) == [wound_back, wound_back]


def test_what_gets_through_again_is_wound_back_less_and_less_often(dressed, monkeypatch):
    """As in wind: after 4, 8, 16, 32 looks, 15 in a second, however often it helps."""
    monkeypatch.setitem(globals(), "counts", lambda simulation: [0, 0])
    for _ in range(4 * (4 + 8 + 16 + 32 + 10)):
        dressed.step()
    assert [dressed[name].health.entangled for name in NAMES] == [4, 4]


def test_after_a_reset_it_looks_no_sooner_than_the_garments_are_looked_at(dressed, monkeypatch):
    for _ in range(30):
        dressed.step()
    dressed.reset(ColliderPoses.identity(len(dressed.collider_set)))
    asked = []
    monkeypatch.setattr(Rewinding, "is_calm", lambda _, name: bool(asked.append(name)))
    for _ in range(3):  # of the four from one look to the next
        dressed.step()
    assert asked == []
