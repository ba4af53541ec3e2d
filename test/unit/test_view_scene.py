"""What the page shows, without a page: colours of known answers, both sides, frames of a bag."""

import dataclasses

import numpy as np
import pytest
import trimesh
from unit.test_recording import FRAMES, REST, avatar, write  # noqa: F401

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Skin
from garment_sim_ros.colliders.capsules.capsules import fit_capsules
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.recording.metrics import GarmentMesh
from garment_sim_ros.view.collider_surface import ColliderSurface
from garment_sim_ros.view.frame import Cloth, Frame
from garment_sim_ros.view.history import History
from garment_sim_ros.view.levels import (
    LEVELS,
    STRAIN,
    colour,
    edges_of_triangles,
    part,
    strain_of_triangles,
)
from garment_sim_ros.view.playback import Playback
from garment_sim_ros.view.scene import COLOURS, Scene
from garment_sim_ros.view.wearer import Wearer

# Two squares of two triangles side by side, in the plane.
SHEET = np.array([[x, y, 0.0] for y in (0.0, 1.0) for x in (0.0, 1.0, 2.0)])
TRIANGLES = np.array([[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4]], np.int32)
ASIDE = np.array([2.0, 0.0, 0.0])
"""Where the body stands in `posed`."""


def cloth():
    return Cloth(vertices=SHEET, triangles=TRIANGLES)


def frame(x, **more):
    return Frame(stamp=1, positions={"sheet": x.astype(np.float32)}, **more)


def scene(colours="garment"):
    made = Scene()
    made.dress({"sheet": cloth()})
    made.shows.colours = colours
    return made


def test_strain_of_a_sheet_that_is_pulled_is_the_pull():
    mesh = GarmentMesh.from_rest(SHEET, TRIANGLES)
    edges = edges_of_triangles(mesh)
    x = SHEET.copy()
    x[[2, 5], 0] += 0.11  # the right square is 11 % longer
    strain = strain_of_triangles(mesh, edges, x.astype(np.float32))
    assert strain[:2] == pytest.approx(0.0, abs=1e-6)
    assert strain[2:] == pytest.approx(0.11, abs=1e-6)
    # An edge is of its triangle: the corners of each are the triangle's own.
    for triangle, own in zip(TRIANGLES, edges):
        assert set(mesh.edges[own].ravel()) == set(triangle)


@pytest.mark.parametrize(
    ("value", "level"), [(-0.5, 0), (0.0, 0), (0.019, 0), (0.021, 1), (0.1, 5), (0.239, 11)]
)
def test_levels_divide_the_scale_evenly(value, level):
    assert STRAIN.levels(np.array([value]))[0] == level


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_what_is_no_number_is_in_the_last_level(value):
    assert STRAIN.levels(np.array([value]))[0] == LEVELS - 1


def test_levels_have_different_colours_from_blue_to_red():
    colours = [colour(level) for level in range(LEVELS)]
    assert len(set(colours)) == LEVELS
    assert colours[0][2] > colours[0][0]
    assert colours[-1][0] > colours[-1][2]


def test_a_part_has_the_same_triangles_in_space():
    vertices, faces = part(TRIANGLES[[1, 3]], SHEET.astype(np.float32))
    assert (vertices[faces] == SHEET[TRIANGLES[[1, 3]]]).all()
    assert len(vertices) == 5


def test_strain_colours_the_triangles_that_are_strained_and_no_others():
    x = SHEET.copy()
    x[[2, 5], 0] += 0.11
    drawn = {d.name: d for d in scene("strain").draw(frame(x))}
    assert set(drawn) == {"sheet/inside", "sheet/level_0", "sheet/level_5"}
    left, right = drawn["sheet/level_0"], drawn["sheet/level_5"]
    assert (left.vertices[left.triangles] == x.astype(np.float32)[TRIANGLES[:2]]).all()
    assert (right.vertices[right.triangles] == x.astype(np.float32)[TRIANGLES[2:]]).all()
    assert right.colour == colour(5)


def test_both_sides_are_drawn_and_the_inside_is_darker():
    drawn = {d.side: d for d in scene().draw(frame(SHEET))}
    assert set(drawn) == {"front", "back"}
    assert drawn["front"].colour == tuple(round(255 * c) for c in garment_colour(0))
    assert all(b < f for b, f in zip(drawn["back"].colour, drawn["front"].colour))
    for d in drawn.values():
        assert (d.triangles == TRIANGLES).all()


@pytest.mark.parametrize("colours", COLOURS)
def test_every_triangle_is_drawn_once_on_each_side(colours):
    rng = np.random.default_rng(3)
    x = SHEET + 0.2 * rng.standard_normal(SHEET.shape)
    drawn = scene(colours).draw(frame(x))
    for side in ("front", "back"):
        corners = np.concatenate([d.vertices[d.triangles] for d in drawn if d.side == side])
        assert {c.tobytes() for c in corners} == {
            c.tobytes() for c in x.astype(np.float32)[TRIANGLES]
        }
        assert len(corners) == len(TRIANGLES)


def test_layers_have_colours_of_their_own_and_grey_where_not_known():
    made = scene("layer")
    told = made.draw(frame(SHEET, quality={"sheet": {"layer": 1.0}}))
    assert told[-1].colour == tuple(round(255 * c) for c in garment_colour(1))
    assert made.draw(frame(SHEET))[-1].colour == (128, 128, 128)


def box():
    """A cube of 1 m with a frame at its middle, as a body, and the colliders of such a body."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    hull = trimesh.convex.convex_hull(corners)
    body = load_body("mannequin:vertices=1200")
    skin = Skin(
        vertices=np.asarray(hull.vertices),
        triangles=np.asarray(hull.faces, np.int32),
        bone=np.zeros((8, 1), np.int32),
        weight=np.ones((8, 1)),
        T_bone_bind=np.linalg.inv(_rest(body)),
    )
    bone = body.rig.joint_names[0]
    colliders = ColliderSet(colliders=(Collider(name="a", kind="frame", bone=bone),))
    poses = ColliderPoses.identity(1)
    poses.position[0] = _rest(body)[0, :3, 3]
    return dataclasses.replace(body, skin=skin), colliders, poses


def test_depth_in_a_box_is_the_distance_from_its_face():
    body, colliders, poses = box()
    wearer = Wearer(colliders, body, measures=True)
    x = np.array([[0.5, 0.5, 0.98], [0.5, 0.4, 1.02], [0.4, 0.5, 1.01]], np.float32)
    wearer.pose(poses)
    assert wearer.depth(x) == pytest.approx([0.02, -0.02, -0.01], abs=1e-6)
    poses.position[0, 2] += 0.5
    wearer.pose(poses)
    assert wearer.depth(x) == pytest.approx([0.48, 0.4, 0.4], abs=1e-6)
    assert wearer.vertices(poses).max() == pytest.approx(1.5)


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin:vertices=1200")


@pytest.fixture(scope="module")
def posed(body):
    """Colliders of a body, and their poses when its whole is moved by 2 m."""
    colliders = fit_capsules(body)
    poser = ColliderPoser(colliders, body)
    T = _rest(body)
    T[:, :3, 3] += ASIDE
    return colliders, poser.poses(T).copy()


def _rest(body):
    from garment_sim_ros.body.kinematics import rest_transforms

    return rest_transforms(body.rig)


def test_the_skin_follows_the_colliders(body, posed):
    colliders, poses = posed
    made = scene()
    made.set_colliders(colliders)
    made.set_wearer(Wearer(colliders, body, measures=False))
    assert not made.skinless
    drawn = {d.name: d for d in made.draw(frame(SHEET, poses=poses))}
    expected = body.skin.vertices + ASIDE
    assert drawn["body"].vertices == pytest.approx(expected, abs=1e-5)
    assert made.centre(frame(SHEET, poses=poses))[0] == pytest.approx(2.0, abs=0.1)


def test_penetration_is_measured_against_the_posed_skin(body, posed):
    colliders, poses = posed
    made = scene("penetration")
    made.set_colliders(colliders)
    made.set_wearer(Wearer(colliders, body, measures=True))
    # In the middle of the trunk every vertex is deep; 5 m off none is.
    middle = body.skin.vertices.mean(axis=0) + ASIDE
    names = {d.name for d in made.draw(frame(middle + 1e-3 * SHEET, poses=poses))}
    assert names >= {f"sheet/level_{LEVELS - 1}"}
    made._not_before = 0.0
    names = {d.name for d in made.draw(frame(middle + 3 * ASIDE + SHEET, poses=poses))}
    assert "sheet/level_0" in names
    assert f"sheet/level_{LEVELS - 1}" not in names


def test_another_bodys_colliders_are_refused(body):
    others = ColliderSet(colliders=(Collider(name="a", kind="frame", bone="tail"),))
    with pytest.raises(GeometryError, match="no collider is fixed to a bone"):
        Wearer(others, body, measures=False)


def test_a_wearer_of_other_colliders_is_not_drawn(body, posed):
    colliders, poses = posed
    made = scene()
    made.set_colliders(colliders)
    wearer = Wearer(colliders, body, measures=False)
    made.set_wearer(wearer)
    assert "body" in {d.name for d in made.draw(frame(SHEET, poses=poses))}
    made.set_colliders(ColliderSet(colliders=colliders.colliders[:]))
    assert "body" not in {d.name for d in made.draw(frame(SHEET, poses=poses))}
    made.set_wearer(wearer)
    assert "body" not in {d.name for d in made.draw(frame(SHEET, poses=poses))}


def test_poses_and_points_that_do_not_fit_are_not_drawn(body, posed):
    colliders, _ = posed
    made = scene()
    made.set_colliders(colliders)
    made.set_wearer(Wearer(colliders, body, measures=True))
    drawn = made.draw(frame(SHEET[:4], poses=ColliderPoses.identity(3)))
    assert drawn == []


def test_colliders_are_where_their_poses_are(body, posed):
    colliders, poses = posed
    surface = ColliderSurface(colliders)
    x = surface.vertices(poses)
    assert x[:, 0].mean() == pytest.approx(2.0, abs=0.1)
    assert np.isfinite(x).all()
    assert surface.triangles.max() < len(x)


def knee(points, share):
    """Two bones, and the ellipsoid around skin that both share."""
    geometry = {
        "radii": [0.1, 0.06, 0.05],
        "frames": [0, 1],
        "points": [points.tolist(), points.tolist()],
        "weights": [share.tolist(), (1.0 - share).tolist()],
        "inflation": 0.003,
    }
    return ColliderSet(
        colliders=(
            Collider(name="thigh", kind="frame", bone="thigh"),
            Collider(name="shin", kind="frame", bone="shin"),
            Collider(name="knee", kind="ellipsoid", bone="thigh", geometry=geometry),
        )
    )


@pytest.mark.parametrize("bend", [0.0, 0.7, 2.0])
def test_ellipsoids_that_change_with_the_pose_are_drawn_as_they_are(bend):
    random = np.random.default_rng(5)
    points = random.normal(size=(18, 3)) * [0.06, 0.03, 0.03]
    share = random.uniform(0.1, 0.9, 18)
    surface = ColliderSurface(knee(points, share))
    poses = ColliderPoses.identity(3)
    poses.position[:] = [0.3, -0.2, 1.0]
    poses.orientation[1] = [0.0, np.sin(bend / 2), 0.0, np.cos(bend / 2)]
    x = surface.vertices(poses).astype(np.float64)
    turned = points @ matrix_from_quaternion(poses.orientation[1]).T
    skin = poses.position[0] + share[:, None] * points + (1.0 - share)[:, None] * turned
    # The drawn surface is round the skin that it is fitted to, and close to some of it.
    drawn = trimesh.convex.convex_hull(x)
    above = (skin[:, None] - drawn.triangles[:, 0]) * drawn.face_normals
    outside = above.sum(axis=2).max(axis=1)
    assert outside.max() < 0.004  # flat triangles cut off this much of the ellipsoid
    assert outside.max() > -0.01


@pytest.mark.parametrize("held", [2**28, 3 * REST.size * 4, 0])
def test_frames_of_a_bag(write, monkeypatch, held):  # noqa: F811
    """Read in one pass, or in two where positions are too many to be held."""
    monkeypatch.setattr("garment_sim_ros.recording.tracks._MOST_HELD", held)
    playback = Playback(write(avatar()))
    assert list(playback.cloths) == ["skirt"]
    assert playback.duration == pytest.approx((FRAMES - 1) / 60, abs=1e-6)
    first = playback.frame()
    assert first is not None
    assert first.positions["skirt"] == pytest.approx(REST)
    assert first.quality["skirt"]["step_ms"] == 0.0
    assert playback.frame() is None  # the same as before
    playback.advance(3.5 / 60)
    assert playback.frame().positions["skirt"] == pytest.approx(REST + 3)
    playback.playing = False
    playback.advance(1.0)
    assert playback.frame() is None
    playback.seek(7.2 / 60)
    found = playback.frame()
    assert found.positions["skirt"] == pytest.approx(REST + 7)
    assert found.quality["skirt"]["step_ms"] == 3.5
    playback.seek(1e9)
    assert playback.frame().positions["skirt"] == pytest.approx(REST + FRAMES - 1)
    playback.playing, playback.speed = True, 2.0
    playback.advance(2.7 / 60)  # beyond the end it begins again: 9 + 5.4 - 9
    assert playback.frame().positions["skirt"] == pytest.approx(REST + 5)


@pytest.mark.parametrize("time", [np.nan, np.inf, -np.inf])
def test_a_time_that_is_none_changes_nothing(write, time):  # noqa: F811
    playback = Playback(write(avatar()))
    playback.seek(0.05)
    playback.seek(time)
    assert playback.time == 0.05
    playback.advance(time)
    assert playback.time == 0.05


def test_a_bag_without_joints_is_shown(write):  # noqa: F811
    messages = [m for m in avatar() if m[0].split("/")[-1] in ("points", "topology")]
    playback = Playback(write(messages))
    assert playback.frame().positions["skirt"] == pytest.approx(REST)
    times, strain = playback.errors("strain_p95")
    assert len(times) == FRAMES
    assert strain == pytest.approx(0.0, abs=1e-6)  # what is moved is not strained
    assert len(playback.errors("inside")[0]) == 0


def test_memory_is_limited(write, monkeypatch):  # noqa: F811
    monkeypatch.setattr("garment_sim_ros.view.playback._MOST_BYTES", 5 * REST.size * 4)
    playback = Playback(write(avatar()))
    assert len(playback.shown.stamp) == 5
    assert playback.duration == pytest.approx(8 / 60, abs=1e-6)


@pytest.mark.parametrize("spoil", [0, 5])
def test_a_bag_that_is_not_finite_is_refused(write, spoil):  # noqa: F811
    with pytest.raises(InputFileError, match="skirt is not finite"):
        Playback(write(avatar(spoil=spoil)))


def test_rate_and_errors_of_the_last_minute():
    history = History()
    for k in range(1, 181):  # 3 s at 60 Hz
        history.arrive(100.0 + k / 60, 1)
        quality = {"a": {"strain_p95": 0.01}, "b": {"strain_p95": 0.02, "inside": np.nan}}
        history.add(100.0 + k / 60, Frame(stamp=k, positions={}, quality=quality))
    assert history.rate(103.0) == pytest.approx(60, abs=1)
    seconds, rates = history.rates(103.0)
    assert rates == pytest.approx(60, abs=1)
    assert (seconds < 0).all()
    times, strain, inside = history.errors(103.0)
    assert len(times) == 180
    assert strain == pytest.approx(0.02)
    assert inside == pytest.approx(0.0)
    assert len(history.errors(170.0)[0]) == 0
    assert len(History().rates(0.0)[0]) == 0
