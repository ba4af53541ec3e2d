"""What a simulation says it models."""

import dataclasses
import json

from garment_sim_ros.cli import main as cli
from garment_sim_ros.contact.shapes import Collider
from garment_sim_ros.params import Environment
from garment_sim_ros.sim.account import account, in_words
from garment_sim_ros.sim.simulation import Simulation

BALL = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": 0.1})


def told(cloth, *shapes, environment=None, layer=0, **material):
    vertices, triangles = cloth.grid(8, 9)
    garments = [
        dataclasses.replace(
            cloth.garment(vertices, triangles, pins=range(9), name=name, **material), layer=number
        )
        for name, number in (("inner", 0), ("outer", layer))
    ]
    return account(Simulation(garments, cloth.colliders(*shapes), environment=environment))


def effects(found, key):
    return {text.partition(" (")[0] for text in found[key]}


def test_what_a_scene_does_not_ask_for_is_left_out_with_a_reason(cloth):
    found = told(cloth, environment=Environment(gravity=(0.0, 0.0, 0.0)))
    assert effects(found, "models") == {
        *("stretch, shear and bending", "all of the body's own motion"),
    }
    assert "friction (no material has any)" in found["leaves_out"]
    assert "contact between layers (all garments are in one layer)" in found["leaves_out"]
    assert all("(" in text for text in found["leaves_out"])


def test_what_a_scene_asks_for_is_modelled(cloth):
    windy = Environment(wind_drag=1.2, gust=2.0, root_linear_inertia=0.5)
    found = told(cloth, BALL, environment=windy, layer=1, friction=0.3, air_drag=0.1)
    assert effects(found, "leaves_out") == {
        *("cloth against itself", "all of the body's own motion"),
        *("a farthest distance from skin", "a farthest distance behind skin"),
        *("tethers to pins", "soft attachments"),
    }
    assert "contact on 1 sphere colliders" in found["models"]


def test_a_garment_that_does_not_pass_through_itself_is_told_of(cloth):
    garment = dataclasses.replace(cloth.garment(*cloth.grid(8, 9)), self_collision=0.002)
    simulation = Simulation((garment,), cloth.colliders())
    assert "cloth against itself" in account(simulation)["models"]
    assert simulation.own_distance("cloth") == 0.002


def test_what_the_implicit_solver_limits_is_told(cloth):
    """Its own weight stretches cloth of 0.16 m and 0.2 kg/m^2 by 1e-5 at 3.14e4 N/m."""
    vertices, triangles = cloth.grid(8, 9)
    stiff = cloth.garment(
        vertices, triangles, areal_density=0.2, stretch_stiffness_warp=1e6, bending_stiffness=1e3
    )
    usual = dataclasses.replace(cloth.garment(vertices, triangles), name="usual")
    found = account(Simulation((stiff, usual), cloth.colliders(), solver="implicit"))
    assert found["garments"]["usual"]["limits"] == []
    limits = found["garments"]["cloth"]["limits"]
    assert limits[0] == "stretch_stiffness_warp counts as 3.14e+04 N/m, not 1e+06"
    assert "hinges" in limits[1]
    assert f"cloth: limited: {limits[0]}" in in_words(found)
    free = account(Simulation((stiff,), cloth.colliders(), solver="xpbd"))
    assert free["garments"]["cloth"]["limits"] == []


def test_garments_are_counted(cloth):
    found = told(cloth, BALL)["garments"]["inner"]
    assert (found["vertices"], found["triangles"], found["pinned"]) == (72, 112, 9)
    # 7 x 9 + 8 x 8 + 7 x 8 edges of the grid, a bending spring over each but the rim's 30, and
    # none between the 9 pins.
    assert found["springs"] == 183 + 183 - 30 - 8
    assert found["shapes_under"] == 1


def test_the_command_tells_the_same(capsys):
    assert cli.main(["info", "--json"]) == 0
    *lines, last = capsys.readouterr().out.splitlines()
    found = json.loads(last)
    assert set(in_words(found)) <= set(lines)
    assert found["garments"]["skirt"]["shapes_passing"] > 0
    # The shirt's.
    assert "a farthest distance from skin" in found["models"]


def test_contact_as_printed_has_no_friction_and_no_layers(cloth):
    vertices, triangles = cloth.grid(8, 9)
    garments = [
        dataclasses.replace(
            cloth.garment(vertices, triangles, pins=range(9), name=name), layer=number
        )
        for number, name in enumerate(("inner", "outer"))
    ]
    how = {"solver": "relaxation", "contact": "rays"}
    kept, printed = (
        account(Simulation(garments, cloth.colliders(BALL), extras=extras, **how))
        for extras in (True, False)
    )
    assert "contact between layers" in kept["models"]
    assert "friction" not in kept["models"]
    assert "contact between layers (extras is false)" in printed["leaves_out"]
