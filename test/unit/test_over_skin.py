"""Cloth is shown over skin that leaves the shapes."""

import numpy as np
import pytest
from naive import naive_over_skin
from particles import simulated

import garment_sim_ros as gs
from garment_sim_ros.colliders.description import from_json, to_json
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.papers.allowed import check_contact
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError, MessageError
from garment_sim_ros.geometry.topology import (
    mesh_topology,
    triangles_across,
    vertex_normals,
)
from garment_sim_ros.sim import over_skin
from garment_sim_ros.sim.bare_skin import BareSkin, Patch
from garment_sim_ros.sim.over_skin import (
    even_out,
    go_on,
    keep_short,
    lift_over_skin,
    spread,
    stay_out,
)

CLEAR = 0.002
HEIGHT = 0.02
"""How far the skin is over the ball."""
RADIUS = 0.15


def dome(cloth, radius, rows=9, spacing=0.02):
    """A patch that is bent like a ball around the origin, its middle on top, facing outwards."""
    vertices, triangles = cloth.grid(rows, rows, spacing)
    vertices[:, 2] = radius
    vertices *= radius / np.linalg.norm(vertices, axis=1, keepdims=True)
    return vertices, triangles


def bare(vertices, triangles, /, **changes):
    """The collider of a patch that goes with the one frame."""
    geometry = {
        "vertices": vertices,
        "triangles": triangles,
        "frame": np.zeros((len(vertices), 1), np.int32),
        "weight": np.ones((len(vertices), 1)),
        "bind": np.eye(4)[None, :3],
    }
    return Collider(name="skin", kind="bare_skin", bone="bone", geometry={**geometry, **changes})


@pytest.fixture
def on_a_ball(cloth):
    """A sheet that has come to lie on a ball, with skin over its top or not; and its poses."""

    def on_a_ball(*more, **options):
        vertices, triangles = cloth.grid(21, 21, 0.015)
        vertices[:, 2] = RADIUS + 0.004
        garment = cloth.garment(vertices, triangles, friction=1.0, damping=3.0)
        ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": RADIUS})
        simulation = gs.Simulation((garment,), cloth.colliders(ball, *more), **options)
        poses = ColliderPoses.identity(2 + len(more))
        simulation.reset(poses)
        for _ in range(30):
            simulation.step(poses, dt=1 / 60)
        return simulation, poses

    return on_a_ball


def test_cloth_is_seen_over_the_skin_and_simulated_as_without_it(cloth, on_a_ball):
    skin = bare(*dome(cloth, RADIUS + HEIGHT))
    bald, _ = on_a_ball(skin)
    plain, _ = on_a_ball()
    np.testing.assert_array_equal(simulated(bald), simulated(plain))
    shown = bald.positions("cloth")
    under = np.linalg.norm(simulated(bald), axis=1) < RADIUS + 0.01
    # The patch ends in its border, where nothing is lifted: look at what is well within.
    within = under & (np.linalg.norm(simulated(bald)[:, :2], axis=1) < 0.05)
    assert within.sum() > 20
    assert np.linalg.norm(plain.positions("cloth")[within], axis=1).max() < RADIUS + 0.5 * HEIGHT
    assert np.linalg.norm(shown[within], axis=1).min() > RADIUS + HEIGHT
    lift = np.linalg.norm(shown - plain.positions("cloth"), axis=1)
    assert lift.max() < HEIGHT + 0.004
    far = np.linalg.norm(simulated(bald)[:, :2], axis=1) > 0.13
    assert far.sum() > 50
    assert lift[far].max() == 0.0
    edges = mesh_topology(bald["cloth"].triangles).edges
    long = [
        np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1).max()
        for x in (shown, plain.positions("cloth"))
    ]
    assert long[0] < 1.3 * long[1]


def test_nothing_is_lifted_over_skin_of_which_nobody_knows_where_it_is_at_rest(cloth, on_a_ball):
    vertices, triangles = dome(cloth, RADIUS + HEIGHT)
    skin = bare(
        vertices,
        triangles,
        frame=np.ones((len(vertices), 1), np.int32),
        bind=np.tile(np.eye(4)[None, :3], (2, 1, 1)),
    )
    lost, _ = on_a_ball(Collider(name="frame_other", kind="frame", bone="other"), skin)
    plain, _ = on_a_ball()
    np.testing.assert_array_equal(lost.positions("cloth"), plain.positions("cloth"))


def test_it_is_lifted_in_some_frames_not_in_one(cloth, on_a_ball):
    simulation, poses = on_a_ball(bare(*dome(cloth, RADIUS + 2.0 * HEIGHT)))
    aside = simulation["cloth"].worn.aside
    over = aside.off.copy()
    assert np.linalg.norm(over, axis=1).max() > 1.8 * HEIGHT
    aside.forget()
    assert not aside.off.any()
    seen = []
    for _ in range(4):
        simulation.step(poses, dt=1 / 60)
        seen.append(np.linalg.norm(aside.off, axis=1).max())
    assert seen[0] < 0.036 < seen[1]  # at 2 m/s
    np.testing.assert_allclose(aside.off, over, atol=3e-3)


def test_the_papers_do_without(cloth, on_a_ball):
    simulation, _ = on_a_ball(
        bare(*dome(cloth, RADIUS + HEIGHT)), solver="relaxation", extras=False
    )
    np.testing.assert_array_equal(simulation.positions("cloth"), simulated(simulation))


def test_no_contact_is_asked_for(cloth):
    ball = Collider(name="ball", kind="sphere", bone="bone", geometry={"radius": RADIUS})
    colliders = cloth.colliders(ball, bare(*dome(cloth, RADIUS)))
    check_contact("rays", colliders)
    assert [c.is_met for c in colliders.colliders] == [False, True, False]
    assert [c.is_frame for c in colliders.colliders] == [True, False, False]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bind": np.zeros((2, 3, 4))}, "bind has shape"),
        ({"frame": np.full((81, 1), 3)}, "frame must be indices"),
        ({"triangles": [[0, 1, 81]]}, "triangles must be indices"),
        ({"triangles": np.zeros((0, 3))}, "triangles has shape"),
        ({"weight": np.full((81, 1), 0.5)}, "sum to 1"),
    ],
)
def test_what_cannot_be_posed_is_refused_by_name(cloth, changes, message):
    colliders = cloth.colliders(bare(*dome(cloth, RADIUS), **changes))
    with pytest.raises(MessageError, match=message):
        from_json(to_json(colliders))
    with pytest.raises(GeometryError, match=message):
        BareSkin(colliders)


def test_triangles_without_area_harm_nothing(cloth, on_a_ball):
    vertices, triangles = dome(cloth, RADIUS + HEIGHT)
    flat = np.array([[0, 0, 1], [2, 3, 4], [5, 5, 5]])
    simulation, _ = on_a_ball(bare(vertices, np.concatenate([triangles, flat])))
    assert np.isfinite(simulation.positions("cloth")).all()
    lift = np.linalg.norm(simulation["cloth"].worn.aside.off, axis=1)
    assert 0.9 * HEIGHT < lift.max() < HEIGHT + 0.004


def patch_of(vertices, triangles):
    """As kernels see it, all of it shown over."""
    x = vertices.astype(np.float32)
    normal = np.zeros_like(x)
    vertex_normals(x, triangles, normal)
    share = np.random.default_rng(2).uniform(0.2, 1.0, len(x)).astype(np.float32)
    return Patch(x, normal, triangles, triangles_across(triangles), share)


def test_vertices_are_lifted_as_the_twin_lifts_them(cloth):
    patch = patch_of(*dome(cloth, RADIUS))
    rng = np.random.default_rng(5)
    x = rng.uniform([-0.06, -0.06, 0.12], [0.06, 0.06, 0.17], (300, 3)).astype(np.float32)
    normal = x + 0.03 * rng.normal(size=x.shape).astype(np.float32)
    normal[:20] *= -1.0  # cloth that faces the other way
    near = np.full(len(x), 60, np.int32)
    asked = np.full_like(x, np.nan)
    places = np.arange(len(x), dtype=np.int32), near, near.copy()
    for _ in range(3):  # those that are far off go on from there
        lift_over_skin(x, normal, patch, *places, np.float32(CLEAR), asked)
    expected = naive_over_skin.lift(
        *(x.astype(float), normal.astype(float), patch.x.astype(float)),
        *(patch.normal.astype(float), patch.triangles, patch.share.astype(float), CLEAR),
        *(float(over_skin._DEEP), float(over_skin._STEEP)),
    )
    assert 50 < (np.linalg.norm(expected, axis=1) > 1e-3).sum() < 250
    assert not expected[:20].any()
    # Over an edge two triangles are as near, or nearly: their normals differ by some degrees.
    np.testing.assert_allclose(asked, expected, atol=3e-3)
    off = np.abs(asked - expected).max(axis=1)
    assert (off < 1e-5).mean() > 0.95


def test_lifts_go_on_as_the_twin_lets_them():
    rng = np.random.default_rng(1)
    asked, lifted = (rng.normal(size=(50, 3)).astype(np.float32) for _ in "ab")
    asked[:10] *= 0.1
    asked[10:15] = lifted[15:20] = 0.0
    expected = naive_over_skin.go_on(asked.astype(float), 0.8, 0.5, lifted.astype(float))
    go_on(asked, np.float32(0.8), np.float32(0.5), lifted)
    np.testing.assert_allclose(lifted, expected, rtol=1e-5, atol=1e-6)


@pytest.fixture
def sheet(cloth):
    """Places of a sheet's vertices, edges, what they may differ by, and some lifts."""
    vertices, triangles = cloth.grid(8, 9, 0.02)
    edges = mesh_topology(triangles).edges
    ways = vertices[edges[:, 0]] - vertices[edges[:, 1]]
    step = (0.5 * np.linalg.norm(ways, axis=1)).astype(np.float32)
    lifts = np.zeros((len(vertices), 3), np.float32)
    lifts[[10, 11, 40]] = [[0.0, 0.0, 0.04], [0.0, 0.01, 0.03], [0.02, 0.0, -0.02]]
    return vertices.astype(np.float32), edges, step, lifts


def test_lifts_spread_as_the_twin_spreads_them(sheet):
    _, edges, step, lifts = sheet
    expected = naive_over_skin.spread(edges, step, lifts.astype(float), over_skin._PASSES)
    spread(edges, step, np.zeros(len(lifts), np.float32), lifts)
    np.testing.assert_allclose(lifts, expected, rtol=1e-4, atol=1e-7)
    size = np.linalg.norm(lifts, axis=1)
    assert (size > 0.0).sum() > 20
    assert (np.abs(size[edges[:, 0]] - size[edges[:, 1]]) <= step + 1e-6).all()


def test_lifts_are_evened_out_as_the_twin_does_it(sheet):
    x, edges, step, lifts = sheet
    x[30] += np.float32(0.06)  # edges that are long already
    spread(edges, step, np.zeros(len(lifts), np.float32), lifts)
    lifts[12] = 0.0
    before = lifts.copy()
    expected = naive_over_skin.even_out(
        *(x.astype(float), edges, step.astype(float), float(over_skin._LONG)),
        *(lifts.astype(float), over_skin._EVEN),
    )
    size = np.linalg.norm(lifts, axis=1).astype(np.float32)
    even_out(x, edges, step, size, lifts)
    np.testing.assert_allclose(lifts, expected, rtol=1e-4, atol=1e-7)

    def over(lifts):
        apart = np.linalg.norm(lifts[edges[:, 0]] - lifts[edges[:, 1]], axis=1)
        return np.maximum(apart - step, 0.0).sum()

    assert over(lifts) < 0.3 * over(before)


@pytest.mark.parametrize("size", [0.0, 1e-45, 1e-38, 1e-30, 1e-22, 1e-19, 1e-10, 1e-6, 1e-3])
def test_lifts_of_any_size_stay_numbers(sheet, size):
    x, edges, step, lifts = sheet
    x[:, 0] *= 5.0  # edges that are long already
    step[::3] = 0.0
    rng = np.random.default_rng(3)
    lifts[:] = np.float32(size) * rng.normal(size=lifts.shape).astype(np.float32)
    for reach in (lifts, lifts + np.float32(0.01)):
        reach = reach.copy()
        lifted = np.zeros_like(reach)
        go_on(reach, np.float32(0.5), np.float32(size), lifted)
        sizes = np.zeros(len(reach), np.float32)
        spread(edges, step, sizes, reach)
        even_out(x, edges, step, sizes, reach)
        keep_short(x, edges, step, reach)
        assert np.isfinite(reach).all()
        assert np.isfinite(lifted).all()
        assert np.abs(reach).max() <= 0.01 + 6.0 * size


def test_lifts_are_kept_short_as_the_twin_does_it(sheet):
    x, edges, step, lifts = sheet
    x[30] += np.float32(0.06)
    spread(edges, step, np.zeros(len(lifts), np.float32), lifts)
    lifts[25] = [0.0, 0.0, -0.03]

    def longest(lifts):
        ways = (x + lifts)[edges[:, 0]] - (x + lifts)[edges[:, 1]]
        before = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)
        return (np.linalg.norm(ways, axis=1) / np.maximum(before, over_skin._LONG * step)).max()

    assert longest(lifts) > 1.1
    expected = naive_over_skin.keep_short(
        *(x.astype(float), edges, step.astype(float), float(over_skin._LONG)),
        *(lifts.astype(float), over_skin._SHORT),
    )
    keep_short(x, edges, step, lifts)
    np.testing.assert_allclose(lifts, expected, rtol=1e-4, atol=1e-7)
    assert longest(lifts) < 1.001
    assert (np.linalg.norm(lifts, axis=1) > 0.0).any()


def test_nothing_is_lifted_into_what_it_touches():
    contacts = Contacts.room_for(3, 1)
    contacts.shape[:] = 0, 0, -1
    contacts.normal[:] = [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]
    lift = np.array([[1.0, 0.0, -2.0], [1.0, 0.0, 2.0], [1.0, 0.0, -2.0], [0.0, 3.0, -1.0]])
    lift = lift.astype(np.float32)
    stay_out(lift, np.array([0, 1, 2, 3], np.int32), contacts)
    np.testing.assert_array_equal(
        lift, [[1.0, 0.0, 0.0], [1.0, 0.0, 2.0], [1.0, 0.0, -2.0], [0.0, 3.0, -1.0]]
    )


def test_a_set_tells_whether_it_has_bare_skin(cloth):
    assert cloth.colliders(bare(*dome(cloth, RADIUS))).has_bare_skin
    assert not ColliderSet(colliders=()).has_bare_skin
