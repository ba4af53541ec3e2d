"""Garments of which fewer vertices are simulated, and all shown."""

from dataclasses import replace

import numpy as np
import pytest
from naive.naive_detail import normals, places

import garment_sim_ros as gs
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.errors import GeometryError, ParameterError
from garment_sim_ros.geometry.topology import boundary_loops, edge_table, vertex_normals
from garment_sim_ros.geometry.transforms import quaternion_from_matrix
from garment_sim_ros.geometry.triangles import triangle_areas
from garment_sim_ros.sim.account import account, in_words
from garment_sim_ros.sim.detail import coarser as coarsening
from garment_sim_ros.sim.detail.coarser import coarser
from garment_sim_ros.sim.detail.surface import Places, Surface
from garment_sim_ros.sim.elastic import ElasticEdges
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.sim.placement import SoftAttachments

TURN = np.array([[0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [-0.8, 0.0, 0.6]])


@pytest.fixture(scope="module")
def outfit():
    """The default outfit on the mannequin."""
    return gs.Avatar.load("mannequin").dress("tshirt_short_skirt")


@pytest.fixture(params=["skirt", "tshirt"])
def made(outfit, request):
    """A garment of it, its coarser one, and the garment's surface over that."""
    garment = next(g for g in outfit.garments if g.name == request.param)
    return garment, *coarser(garment, 0.25)


@pytest.fixture
def strip(cloth):
    """A sheet of 48 x 8 cm, 24 x 4 cells, 125 vertices."""
    return cloth.garment(*cloth.grid(25, 5))


def lengths(x, edges):
    """Of edges [m]."""
    return np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)


def followed(surface, x, origin=(0.0, 0.0, 0.0)):
    """All vertices over the coarser mesh at x."""
    out = np.empty((len(surface), 3), np.float32)
    surface.follow(np.ascontiguousarray(x, np.float32), np.array(origin), out)
    return out


def test_it_has_as_many_vertices_and_the_same_surface(made):
    garment, coarse, _ = made
    assert len(coarse.vertices) == pytest.approx(0.25 * len(garment.vertices), abs=1)
    area, before = (triangle_areas(g.vertices, g.triangles).sum() for g in (coarse, garment))
    assert area == pytest.approx(before, rel=0.01)
    mass, before = (
        build_model(
            g.name,
            g.vertices,
            g.triangles,
            g.material,
            pins=g.pins,
            pin_collider=np.zeros(len(g.pins), np.int32),
            pin_position=np.zeros((len(g.pins), 3)),
        ).mass.sum()
        for g in (coarse, garment)
    )
    assert mass == pytest.approx(before, rel=0.01)
    loops, before = (boundary_loops(g.triangles) for g in (coarse, garment))
    assert len(loops) == len(before)
    length = lengths(coarse.vertices, edge_table(coarse.triangles)[0])
    assert length.min() > 0.4 * np.median(length)
    assert length.max() < 1.7 * np.median(length)


def test_what_holds_it_is_where_it_was(made):
    garment, coarse, _ = made
    length = np.median(lengths(coarse.vertices, edge_table(coarse.triangles)[0]))
    pinned = coarse.vertices[coarse.pins]
    for pin in garment.vertices[garment.pins]:
        assert np.linalg.norm(pinned - pin, axis=1).min() <= length
    # And nothing else is pinned: each is beside a pin of the same frame.
    for x, frame in zip(pinned, coarse.pin_frame, strict=True):
        of_frame = garment.vertices[garment.pins[garment.pin_frame == frame]]
        assert np.linalg.norm(of_frame - x, axis=1).min() < 0.5 * length
    assert coarse.frame_weight.sum(axis=1) == pytest.approx(1.0)
    assert set(coarse.skin_limits) == set(garment.skin_limits)
    for limit in coarse.skin_limits.values():
        assert len(limit) == len(coarse.vertices)


def test_at_rest_every_vertex_is_where_the_garment_has_it(made):
    garment, coarse, surface = made
    shown = followed(surface, coarse.vertices)
    assert np.abs(shown - garment.vertices).max() < 2e-6
    assert surface.share.min() > -1e-6
    assert surface.share.sum(axis=1) == pytest.approx(1.0, abs=1e-6)


def test_it_moves_as_a_rigid_body_with_what_is_simulated(made):
    garment, coarse, surface = made
    shown = followed(surface, coarse.vertices @ TURN.T, (900.0, -70.0, 3.0))
    assert np.abs(shown - garment.vertices @ TURN.T - (900.0, -70.0, 3.0)).max() < 1e-4


def test_the_kernel_does_what_its_twin_does(made):
    _, coarse, surface = made
    rng = np.random.default_rng(5)
    x = (coarse.vertices + rng.normal(0.0, 0.006, coarse.vertices.shape)).astype(np.float32)
    expected = places(
        x.astype(float),
        normals(x.astype(float), coarse.triangles),
        surface.corner,
        surface.share.astype(float),
        surface.off.astype(float),
    )
    assert np.abs(followed(surface, x) - expected).max() < 5e-6


def test_a_triangle_without_area_gives_finite_places(strip):
    coarse, surface = coarser(strip, 0.5)
    for x in (np.zeros_like(coarse.vertices), coarse.vertices * (1.0, 0.0, 0.0)):
        shown = followed(surface, x)
        assert np.isfinite(shown).all()
        assert np.abs(shown).max() < 1.0


def test_vertices_follow_their_own_side_of_a_fold(cloth):
    """A strip bent round a rod: the other layer is 8 mm away, edges are 4 cm long."""
    fine, coarse = cloth.grid(41, 9, 0.02), cloth.grid(21, 5, 0.04)
    at = np.arange(41 * 9, dtype=np.int32).reshape(41, 9)[::2, ::2].ravel()
    assert np.abs(fine[0][at] - coarse[0]).max() < 1e-12
    r, s = 0.004, fine[0][:, 0] - 0.01  # vertices of the layers lie side by side
    beyond = np.maximum(np.abs(s) - np.pi / 2 * r, 0.0)
    angle = np.clip(s / r, -np.pi / 2, np.pi / 2)
    bent = np.stack([beyond + r - r * np.cos(angle), fine[0][:, 1], r * np.sin(angle)], axis=1)
    places = Places(corner=at.repeat(3).reshape(-1, 3), share=np.tile([1.0, 0.0, 0.0], (105, 1)))
    surface = Surface(bent, fine[1], places, coarse[1])
    upper = (surface.share * (s[at] > 0.0)[surface.corner]).sum(axis=1)
    assert (upper[s > 0.05] > 0.999).all()
    assert (upper[s < -0.05] < 0.001).all()


@pytest.mark.parametrize("pins", [(0,), (0, 4), (62,), (60, 61, 62, 63, 64)])
def test_pins_are_near_where_they_were(cloth, pins):
    sheet = cloth.garment(*cloth.grid(25, 5), pins=pins)
    coarse, surface = coarser(sheet, 0.5)
    apart = np.linalg.norm(
        coarse.vertices[coarse.pins][:, None] - sheet.vertices[list(pins)], axis=2
    )
    assert apart.min(axis=1).max() < 0.02
    assert apart.min(axis=0).max() < 0.03
    shown = followed(surface, coarse.vertices)
    assert np.abs(shown - sheet.vertices).max() < 1e-6


def test_springs_to_the_body_are_as_stiff_together(strip):
    edge = np.arange(5, dtype=np.int32)
    soft = SoftAttachments(
        vertices=edge,
        frame=np.array([0, 1, 0, 1, 1], np.int32),
        stiffness=np.linspace(10.0, 50.0, 5),
        damping=np.ones(5),
    )
    coarse, _ = coarser(replace(strip, soft=soft), 0.5)
    assert coarse.soft.stiffness.sum() == pytest.approx(150.0)
    assert coarse.soft.damping.sum() == pytest.approx(5.0)
    assert len(coarse.soft.vertices) < 5
    at = coarse.vertices[coarse.soft.vertices]
    near = np.linalg.norm(strip.vertices[edge][:, None] - at, axis=2).argmin(axis=1)
    for n, frame in enumerate(coarse.soft.frame):
        stiffest = max(np.flatnonzero(near == n), key=lambda k: soft.stiffness[k])
        assert frame == soft.frame[stiffest]
    assert np.abs(coarse.vertices[coarse.soft.vertices, 0] - strip.vertices[0, 0]).max() < 0.03


def test_elastic_bands_run_where_they_ran(cloth):
    """Round the border of a sheet, whose corners edges cut off, and across it."""
    rows, columns = 13, 9
    x, triangles = cloth.grid(rows, columns)
    at = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    border = (at[0], at[-1], at[:, 0], at[:, -1])
    edges = np.concatenate([np.c_[v[:-1], v[1:]] for v in (*border, at[6])])
    tension = np.repeat([2.0, 7.0], [len(edges) - columns + 1, columns - 1])
    bands = ElasticEdges(edges, tension, np.full(len(edges), 0.5))
    coarse, _ = coarser(replace(cloth.garment(x, triangles), elastic=bands), 0.55)
    length = lengths(coarse.vertices, coarse.elastic.edges)
    for pull, whole in ((2.0, 0.8), (7.0, 0.16)):
        assert length[coarse.elastic.tension == pull].sum() == pytest.approx(whole, rel=1e-6)
    assert (coarse.elastic.slack == 0.5).all()


@pytest.mark.parametrize("gap", [0.002, 0.005, 0.01])
def test_a_lining_is_not_mixed_up_with_its_cloth(cloth, gap):
    """Two tubes in one garment, nearer to each other than edges are long, the inner one pinned."""
    made = [cloth.tube(0.1 + r, 1.0, 0.4, 21, 40) for r in (0.0, gap)]
    x = np.concatenate([m[0] for m in made])
    triangles = np.concatenate([made[0][1], made[1][1] + 840])
    pins = np.arange(40, dtype=np.int32)
    coarse, surface = coarser(cloth.garment(x, triangles, pins=pins), 0.25)
    inner = surface.under.nearest < 840
    assert (surface.under.corner < 840).all(axis=1).tolist() == inner.tolist()
    assert inner[coarse.pins].all()
    assert inner[surface.corner[:840]].all()
    assert not inner[surface.corner[840:]].any()
    assert np.hypot(*coarse.vertices[~inner, :2].T).min() > 0.1 * np.cos(0.3) + 0.9 * gap


def test_bands_that_share_an_edge_all_stay(strip):
    border = np.arange(0, 125, 5, dtype=np.int32)
    edges = np.tile(np.c_[border[:-1], border[1:]], (2, 1))
    tension = np.repeat([2.0, 5.0], 24)
    coarse, _ = coarser(replace(strip, elastic=ElasticEdges(edges, tension, 0.1 * tension)), 0.5)
    length = lengths(coarse.vertices, coarse.elastic.edges)
    for pull in (2.0, 5.0):
        of_one = coarse.elastic.tension == pull
        assert length[of_one].sum() == pytest.approx(0.48, rel=1e-6)
        assert coarse.elastic.slack[of_one] == pytest.approx(0.1 * pull)


def test_no_bands_are_none(strip):
    coarse, _ = coarser(replace(strip, elastic=ElasticEdges.none()), 0.5)
    assert not len(coarse.elastic.edges)


def test_what_is_no_cloth_is_left_to_those_who_say_so(cloth, strip):
    line = replace(strip, vertices=strip.vertices * (1.0, 0.0, 0.0))
    loose = replace(strip, triangles=strip.triangles[(strip.triangles != 0).all(axis=1)])
    for garment in (line, loose):
        assert coarser(garment, 0.5) is None
        with pytest.raises(GeometryError):
            worn(cloth, garment, detail=0.5)


def test_cloth_that_was_cut_flat_has_its_rest_lengths(strip):
    """A panel that is as wide, and 0.9 times as long, turned by a quarter."""
    panel = np.stack([strip.vertices[:, 1], -0.9 * strip.vertices[:, 0]], axis=1)
    flat = panel[strip.triangles]
    bent = strip.vertices.copy()
    angle = strip.vertices[:, 0] / 0.1
    bent[:, 0], bent[:, 2] = 0.1 * np.sin(angle), 0.1 * np.cos(angle)
    coarse, _ = coarser(replace(strip, vertices=bent, flat=flat), 0.5)
    # Chords of an arc of 0.1 m radius; way along the arc is what the panel has.
    at = np.arctan2(coarse.vertices[:, 0], coarse.vertices[:, 2]) * 0.1
    expected = np.stack([coarse.vertices[:, 1], -0.9 * at], axis=1)[coarse.triangles]
    sides, wanted = (f[:, 1:] - f[:, :1] for f in (coarse.flat, expected))
    assert np.abs(sides - wanted).max() < 0.05 * np.abs(wanted).max()


def test_another_rest_shape_goes_along(strip):
    coarse, _ = coarser(replace(strip, rest=strip.vertices * (1.1, 1.0, 1.0)), 0.5)
    assert coarse.rest == pytest.approx(coarse.vertices * (1.1, 1.0, 1.0))


def worn(cloth, garment, **more):
    return gs.Simulation(garment, cloth.colliders(), gravity=(0.0, 0.0, 0.0), **more)


def test_all_that_is_told_is_of_all_vertices(cloth, strip):
    simulation = worn(cloth, strip, detail=0.5)
    view = simulation["cloth"]
    assert view.garment is strip
    for array in (view.positions, view.velocities, view.normals, simulation.positions("cloth")):
        assert array.shape == (125, 3)
    assert len(view.model) == len(view.state.x) == 62
    assert (view.triangles == strip.triangles).all()
    told = account(simulation)
    assert told["garments"]["cloth"]["vertices"] == 125
    assert told["garments"]["cloth"]["simulated"] == 62
    assert "125 vertices, 62 of them simulated" in "\n".join(in_words(told))
    poses = ColliderPoses.identity(1)
    moved = ColliderPoses(
        position=np.array([[3.0, 0.0, 1.0]]), orientation=quaternion_from_matrix(TURN)[None]
    )
    simulation.reset(poses)
    simulation.transport(poses, moved)
    assert np.abs(view.positions - (strip.vertices @ TURN.T + (3.0, 0.0, 1.0))).max() < 1e-5
    normal = np.zeros((125, 3), np.float32)
    vertex_normals(view.positions, view.triangles, normal)
    assert np.abs(view.normals - normal).max() == 0.0


def test_velocities_are_those_of_the_places(cloth, strip):
    """A flat sheet that turns: all vertices lie on the triangles."""
    view = worn(cloth, strip, detail=0.5)["cloth"]
    spin = np.array([0.3, -2.0, 1.0])
    particles = view.worn.garment.vertices[view.model.vertex]
    view.state.v[:] = np.cross(spin, particles)
    assert np.abs(view.velocities - np.cross(spin, strip.vertices)).max() < 1e-6


def test_all_are_simulated_where_that_is_asked_for_or_fewer_cannot_be(cloth, strip):
    assert worn(cloth, strip)["cloth"].worn.surface is None
    small = cloth.garment(*cloth.grid(5, 5))
    assert len(worn(cloth, small, detail=0.1)["cloth"].model) == 25
    sewn = worn(cloth, replace(strip, stitches=np.full(125, -1, np.int32)), detail=0.5)["cloth"]
    assert len(sewn.model) == 125
    assert sewn.limits == ("detail: all vertices are simulated: it is being sewn",)
    three = np.concatenate([strip.triangles, [[0, 1, 124]], [[0, 1, 62]]]).astype(np.int32)
    simulation = worn(cloth, replace(strip, triangles=three), detail=0.5)
    assert len(simulation["cloth"].model) == 125
    limits = simulation["cloth"].limits
    assert any(s.startswith("detail: all vertices are simulated") for s in limits)


@pytest.mark.parametrize("detail", [0.0, 0.04, 1.5, float("nan")])
def test_a_share_that_cannot_be_is_refused(cloth, strip, detail):
    with pytest.raises(ParameterError, match="detail"):
        worn(cloth, strip, detail=detail)


def test_a_preset_has_its_own_and_what_is_asked_for_wins(cloth, strip):
    assert len(worn(cloth, strip, preset="fast")["cloth"].model) == 60
    assert len(worn(cloth, strip, preset="fast", detail=1.0)["cloth"].model) == 125
    assert len(worn(cloth, strip, preset="fast", solver="implicit")["cloth"].model) == 60


@pytest.mark.parametrize(("farthest", "fewest"), [(0.14, 564), (0.1, 1269), (0.0, 1503)])
def test_where_so_few_cannot_tell_its_shape_it_has_more(outfit, monkeypatch, farthest, fewest):
    """One in a hundred is 0.148, 0.118 and 0.083 of an edge off 376, 564 and 1,269 vertices."""
    monkeypatch.setattr(coarsening, "_FARTHEST", farthest)
    simulation = gs.Simulation(outfit, gs.Avatar.load("mannequin").colliders, detail=0.25)
    view = simulation["tshirt"]
    assert len(view.model) == fewest
    assert len(view.positions) == 1503
    assert len(view.limits) == 1
    assert ("all" if fewest == 1503 else f"{fewest} instead of 376") in view.limits[0]
