"""Axes of the grid: any declared parameter, colliders by their text, presets as points."""

from dataclasses import replace

import pytest

from garment_sim_ros.errors import ParameterError
from garment_sim_ros.tradeoff import scenes
from garment_sim_ros.tradeoff.axes import axis, collider_arguments, collider_kinds
from garment_sim_ros.tradeoff.playing import Player
from garment_sim_ros.tradeoff.points import grid, preset_point


def small(**asked):
    """A sheet of 25 vertices."""
    sheet = {"width": 0.4, "height": 0.4, "edge": 0.1, **asked}
    return scenes.staged(scenes.Scene(text="", seconds=0.1, sheet=sheet))


class TestAxes:
    def test_a_parameter_is_an_axis_of_the_solvers_that_have_it(self):
        axes = [axis("cloth_node.search_every=6,3"), axis("cloth_node.contact=union,rays")]
        found = list(grid(["hulls"], ["xpbd", "relaxation", "implicit"], [4], [1], axes=axes))
        assert [p.name for p in found] == [
            *("xpbd 4x1", "xpbd 4x1 search_every=3"),  # 6 is the default
            *("relaxation 4x1", "relaxation 4x1 contact=rays"),
            "implicit 4x1",
        ]
        given = small(pins="top corners")
        simulation = Player(given, found[1].arguments(1 / 60)).simulation
        assert simulation.parameters.settings.search_every == 3
        assert simulation.parameters.settings.sub_step == pytest.approx(1 / 240)

    def test_detail_is_an_axis_of_every_solver(self):
        axes = [axis("cloth_node.detail=1,0.5"), axis("cloth_node.search_every=3")]
        found = list(grid(["hulls"], ["xpbd", "implicit"], [4], [1], axes=axes))
        assert [p.name for p in found] == [
            *("xpbd 4x1 search_every=3", "xpbd 4x1 search_every=3 detail=0.5"),
            *("implicit 4x1", "implicit 4x1 detail=0.5"),
        ]
        given = small(pins="top corners", edge=0.03)
        player = Player(given, found[1].arguments(1 / 60))
        (view,) = player.simulation
        assert len(view.model) == len(view.garment.vertices) // 2 > 60
        # It begins where a snapshot with all vertices is.
        player.put_on(settle=False)
        at = player.snapshot(0)
        player.play(0, 5)
        player.begin(at)
        assert abs(view.positions - at.x[view.name]).max() < 1e-6

    def test_what_does_nothing_is_no_setting_of_its_own(self):
        axes = [axis("cloth_node.contact=union,earliest"), axis("cloth_node.restitution=0,0.5")]
        found = [p.options for p in grid(["a"], ["relaxation"], [1], [1], axes=axes)]
        earliest = ("contact", "earliest")
        assert found == [(), (earliest,), (earliest, ("restitution", 0.5))]

    def test_the_colliders_budget_is_that_of_the_kind(self):
        axes = [axis("collider_node.max_faces=80,20"), axis("collider_node.max_ellipsoids=30")]
        kinds = collider_kinds(axes, ["hulls", "capsules", "ellipsoids"])
        assert kinds == ["hulls", "hulls max_faces=20", "capsules", "ellipsoids max_ellipsoids=30"]
        assert collider_arguments("hulls max_faces=20")["max_faces"] == 20
        assert collider_arguments("capsules")["method"] == "capsules"

    def test_fewer_faces_are_fitted_where_they_are_asked_for(self):
        scene = scenes.Scene(text="", seconds=0.1, body="mannequin", wear="tshirt_short_skirt")

        def faces(kind):
            shapes = scenes.staged(scene, kind).colliders.colliders
            return sum(len(c.geometry["faces"]) for c in shapes if c.kind == "hull")

        assert faces("hulls max_faces=20") < 0.7 * faces("hulls")

    @pytest.mark.parametrize(
        "word",
        [
            *("search_every=3", "cloth_node.search_every", "cloth_node.search_every=3,"),
            *("cloth_node.search_every=0", "cloth_node.contact=maybe", "cloth_node.rate=30"),
            *("cloth_node.sub_step=0.01", "collider_node.method=hulls", "mocap_player.rate=30"),
            "collider_node.mu=left_thigh=0.03 right_thigh=0.03",
        ],
    )
    def test_what_cannot_be_an_axis_is_refused(self, word):
        with pytest.raises(ParameterError):
            axis(word)

    @pytest.mark.parametrize("kind", ["nonesuch", "hulls max_faces=1", "hulls nonesuch=1"])
    def test_colliders_that_there_are_not_are_refused(self, kind):
        with pytest.raises(ParameterError):
            collider_arguments(kind)


class TestPresets:
    @pytest.mark.parametrize(
        ("name", "kind", "solver", "sub_steps", "passes"),
        [
            ("fast", "capsules", "xpbd", 9, 1),
            ("balanced", "hulls", "xpbd", 18, 1),
            ("accurate", "hulls", "xpbd", 54, 1),
            ("sun2007", "sun2007", "relaxation", 1, 3),
            ("gong2018", "gong2018", "relaxation", 1, 3),
        ],
    )
    def test_they_are_points_with_their_own_colliders_and_steps(
        self, name, kind, solver, sub_steps, passes
    ):
        point = preset_point(name, 1 / 60)
        assert (point.kind, point.solver) == (kind, solver)
        assert (point.sub_steps, point.passes) == (sub_steps, passes)
        assert preset_point(name, 1 / 60, "plain").kind == "plain"

    def test_a_node_would_run_the_same(self):
        simulation = Player(small(), preset_point("fast", 1 / 60).arguments(1 / 60)).simulation
        assert simulation.parameters.settings.search_every == 9
        assert simulation.solver_step == pytest.approx(1 / 60)
        balanced = preset_point("balanced", 1 / 60).arguments(1 / 60)
        assert Player(small(), balanced).simulation.solver_step == pytest.approx(1 / 60)

    def test_the_scenes_wind_wins_and_the_presets_stays(self):
        calm = Player(small(), preset_point("gong2018", 0.033, "plain").arguments(0.033))
        assert calm.simulation.parameters.environment.gust == 1.0
        windy = small()
        windy = replace(windy, scene=replace(windy.scene, environment={"gust": 2.0}))
        player = Player(windy, preset_point("gong2018", 0.033, "plain").arguments(0.033))
        assert player.simulation.parameters.environment.gust == 2.0
        assert player.simulation.parameters.environment.wind_drag == 1.2
