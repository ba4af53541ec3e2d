"""Faces of hulls inside other hulls: which they are, and that no way out leads through them."""

import dataclasses

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.spatial.transform import Rotation

from garment_sim_ros.colliders.hulls.hull import convex_hull
from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.kinds.buried_faces import buried_planes
from garment_sim_ros.contact.kinds.hull import hull_distance
from garment_sim_ros.contact.kinds.packed_hulls import hull_planes, pack_hulls
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.contact.sides import OPPOSED, UNDER, Sides
from garment_sim_ros.geometry.transforms import transform_from, transform_points
from garment_sim_ros.sim.placement import rest_transforms
from garment_sim_ros.sim.sides import shape_sides

CHECKED = settings(derandomize=True, deadline=None, max_examples=20)
WAY = 0.02
THICKNESS = 0.003


def box(middle, size=(0.2, 0.2, 0.2)):
    """Corners and faces of a box."""
    mesh = trimesh.creation.box(size)
    return np.array(mesh.vertices) + middle, np.array(mesh.faces)


def collider(name, vertices, faces, **where):
    return Collider(
        name=name,
        kind="hull",
        geometry={"vertices": vertices, "faces": faces},
        **{"bone": "bone", **where},
    )


def buried_normals(meshes, R=None, unknown=()):
    """Normals of the buried faces of hulls that are turned by R, turned back: a set for each."""
    R = np.eye(3) if R is None else R
    turned = [vertices @ R.T for vertices, _ in meshes]
    planes = [hull_planes(x, faces) for x, (_, faces) in zip(turned, meshes)]
    planes = [np.zeros((0, 4)) if h in unknown else p for h, p in enumerate(planes)]
    buried = buried_planes(planes, turned, WAY)
    assert [len(b) for b in buried] == [len(p) for p in planes]
    return [
        {tuple(map(float, n)) for n in np.round(p[b, :3] @ R) + 0.0}
        for p, b in zip(planes, buried)
    ]


UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)


@pytest.mark.parametrize("seed", [None, 1, 2, 3, 4])
def test_of_stacked_boxes_the_faces_inside_each_other_are_buried(seed):
    R = None if seed is None else Rotation.random(random_state=seed).as_matrix()
    stacked = [box((0.0, 0.0, 0.0)), box((0.0, 0.0, 0.17))]
    assert buried_normals(stacked, R) == [{UP}, {DOWN}]
    assert buried_normals([*stacked, box((0.0, 0.0, 0.34))], R) == [{UP}, {UP, DOWN}, {DOWN}]


@pytest.mark.parametrize(
    ("meshes", "expected"),
    [
        # Nothing fits between faces that touch, or nearly; through a wider gap there is a way.
        ([box((0.0, 0.0, 0.0)), box((0.0, 0.0, 0.2))], [{UP}, {DOWN}]),
        ([box((0.0, 0.0, 0.0)), box((0.0, 0.0, 0.201))], [{UP}, {DOWN}]),
        ([box((0.0, 0.0, 0.0)), box((0.0, 0.0, 0.203))], [set(), set()]),
        # It touches along an edge, and beside.
        ([box((0.0, 0.0, 0.0)), box((0.2, 0.0, 0.2))], [set(), set()]),
        ([box((0.0, 0.0, 0.0)), box((0.19, 0.0, 0.19))], [set(), set()]),
        # A plate does not go on for long enough; from its own face the box does.
        ([box((0.0, 0.0, 0.0)), box((0.0, 0.0, 0.105), (0.2, 0.2, 0.02))], [set(), {DOWN}]),
        ([box((0.0, 0.0, 0.0)), box((0.0, 0.0, 0.12), (0.2, 0.2, 0.05))], [{UP}, {DOWN}]),
        # Two plates together do.
        (
            [
                box((0.0, 0.0, 0.0)),
                box((0.0, 0.0, 0.105), (0.2, 0.2, 0.02)),
                box((0.0, 0.0, 0.118), (0.2, 0.2, 0.02)),
            ],
            [{UP}, {DOWN}, {DOWN}],
        ),
        # Most of a large face is free around a thin neck; the neck's end is inside.
        (
            [box((0.0, 0.0, 0.0)), box((0.0, 0.0, 0.17), (0.05, 0.05, 0.2))],
            [set(), {DOWN}],
        ),
        # A hull without any way out would hold for ever what is in it.
        ([box((0.0, 0.0, 0.0)), box((0.0, 0.0, 0.0), (0.05, 0.05, 0.05))], [set(), set()]),
    ],
)
def test_what_is_buried_and_what_is_not(meshes, expected):
    assert buried_normals(meshes) == expected


def test_beside_a_hull_in_an_unknown_place_nothing_is_buried():
    stacked = [box((0.0, 0.0, 0.0)), box((0.0, 0.0, 0.17))]
    assert buried_normals(stacked, unknown=[1]) == [set(), set()]
    assert buried_normals(stacked, unknown=[0, 1]) == [set(), set()]


def marched(points, direction, others):
    """Steps along a direction, shape [s], and which of them are inside of hulls, [n, s]."""
    steps = np.arange(0.0, 1.5 * WAY, WAY / 100)
    at = points[:, None] + steps[:, None] * direction
    inside = [(at @ planes[:, :3].T <= planes[:, 3]).all(axis=2) for planes in others]
    return steps, np.any(inside, axis=0)


def reached(steps, inside, gap):
    """How far steps lead that are inside, gaps up to a length being none."""
    passed = np.concatenate([[0.0], steps[inside]])
    wide = np.flatnonzero(np.diff(passed) > gap)
    return passed[wide[0]] if len(wide) else passed[-1]


@settings(CHECKED, max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_buried_faces_are_those_from_which_a_march_stays_inside(seed):
    rng = np.random.default_rng(seed)
    hulls = [
        convex_hull(0.1 * rng.normal(size=(9, 3)) + rng.uniform(-0.1, 0.1, 3)) for _ in range(4)
    ]
    planes = [hull_planes(hull.vertices, hull.faces) for hull in hulls]
    found = buried_planes(planes, [hull.vertices for hull in hulls], WAY)
    count = told = 0
    for h, hull in enumerate(hulls):
        others = planes[:h] + planes[h + 1 :]
        least, most = np.zeros(len(planes[h]), bool), np.ones(len(planes[h]), bool)
        for f, plane in enumerate(planes[h]):
            # Faces that are nearly in one plane may count as one.
            corners = hull.vertices[np.abs(hull.vertices @ plane[:3] - plane[3]) < 1e-4]
            if len(corners) != 3:
                continue
            middle = corners.mean(axis=0)
            points = np.vstack([(2.0 * corners + middle) / 3.0, middle])
            steps, inside = marched(points, plane[:3], others)
            # From the middle and two corners, of three; half of them may count or not.
            far = np.array([reached(steps, row, 0.08 * WAY) for row in inside])
            least[f] = (far > 1.1 * WAY).sum() > 2
            far = np.array([reached(steps, row, 0.12 * WAY) for row in inside])
            most[f] = (far > 0.9 * WAY).sum() >= 2
        if most.all():
            assert not (least.all() and found[h].any())
            continue
        assert found[h][least].all()
        assert not found[h][~most].any()
        count += len(least)
        told += (least == most).sum()
    assert told > 0.6 * count


def packed_planes(shapes, h):
    """Planes [f, 4] of a hull's whole list, and which of them are buried."""
    first, end = 20 * shapes.hulls.first[h], 20 * shapes.hulls.first[h + 1]
    fours = shapes.hulls.plane[first:end].reshape(-1, 5, 4).transpose(0, 2, 1).reshape(-1, 5)
    fours = fours[np.abs(fours[:, 3]) < 1e20]
    return fours[:, :4], fours[:, 4] > 0.0


def stacked_colliders(seed):
    """Two stacked boxes, each in a frame of its own, and where these are at rest."""
    rng = np.random.default_rng(seed)
    T_world_stack = transform_from(
        rng.normal(size=3), Rotation.random(random_state=seed).as_quat()
    )
    colliders, T_world_rest = [], []
    for h, z in enumerate([-0.09, 0.09]):
        own = Rotation.random(random_state=seed + 10 * h).as_matrix()
        vertices, faces = box((0.0, 0.0, z))
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = own, rng.normal(size=3)
        colliders.append(collider(f"box{h}", transform_points(np.linalg.inv(T), vertices), faces))
        T_world_rest.append(T_world_stack @ T)
    return ColliderSet(colliders=tuple(colliders)), np.array(T_world_rest), T_world_stack


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_packing_finds_buried_faces_in_the_rest_pose(seed):
    colliders, T_world_rest, T_world_stack = stacked_colliders(seed)
    shapes = pack(colliders, T_world_rest)
    for h, expected in enumerate([UP, DOWN]):
        planes, buried = packed_planes(shapes, h)
        assert buried.sum() == 1
        normal = T_world_stack[:3, :3].T @ T_world_rest[h, :3, :3] @ planes[buried][0, :3]
        np.testing.assert_allclose(normal, expected, atol=1e-6)
    apart, unknown = T_world_rest.copy(), T_world_rest.copy()
    apart[1, :3, 3] += 1.0
    unknown[1] = np.nan
    for T in (None, apart, unknown):
        assert not any(packed_planes(pack(colliders, T), h)[1].any() for h in range(2))


@njit
def distances(shapes, posed, points, reach, distance, normal):
    for i in range(len(points)):
        d, nx, ny, nz = hull_distance(
            shapes, posed, 0, points[i, 0], points[i, 1], points[i, 2], reach
        )
        distance[i] = d
        normal[i, 0], normal[i, 1], normal[i, 2] = nx, ny, nz


def random_scene(seed):
    """A hull with some buried planes, packed and posed; points in its frame and in the world."""
    rng = np.random.default_rng(seed)
    hull = convex_hull(rng.normal(size=(30, 3)) * [0.1, 0.07, 0.2])
    planes = hull_planes(hull.vertices, hull.faces)
    buried = rng.random(len(planes)) < rng.choice([0.1, 0.5, 0.9])
    buried[rng.integers(len(planes))] = False
    colliders = ColliderSet(colliders=(collider("hull", hull.vertices, hull.faces),))
    shapes = pack(colliders)
    hulls = pack_hulls({"hull": (hull.vertices, hull.faces)}, lambda _: [buried])
    shapes = shapes._replace(hulls=hulls)
    R = Rotation.random(random_state=seed % 1000)
    posed = PosedShapes.room_for(shapes)
    poses = ColliderPoses(position=np.zeros((1, 3)), orientation=R.as_quat()[None])
    pose(shapes, poses, poses, np.zeros(3), posed)
    low, high = hull.vertices.min(axis=0), hull.vertices.max(axis=0)
    anywhere = rng.uniform(low - 0.1, high + 0.1, (1000, 3))
    inside = rng.dirichlet(np.full(len(hull.vertices), 0.3), 1000) @ hull.vertices
    weight = rng.dirichlet([1.0, 1.0, 1.0], 1000)
    face = hull.faces[rng.integers(len(hull.faces), size=1000)]
    near = np.einsum("nc,nck->nk", weight, hull.vertices[face])
    near = near * (1.0 + rng.normal(size=(1000, 1)) * rng.choice([1e-4, 1e-2], (1000, 1)))
    local = np.vstack([anywhere, inside, near])
    return shapes, posed, planes, buried, R, local, (low, high)


def naive_distance(local, planes, buried):
    """Distance, normal, whether that is clear, and whether sides of buried planes are."""
    height = local @ planes[:, :3].T - planes[:, 3]
    counted = np.where((height > 0.0) | ~buried, height, -np.inf)
    second, best = np.partition(counted, -2, axis=1)[:, -2:].T
    clear = np.abs(np.where(buried, height, np.inf)).min(axis=1) > 1e-6
    return best, planes[counted.argmax(axis=1), :3], best - second > 1e-6, clear


@CHECKED
@given(seed=st.integers(0, 10**6), reach=st.sampled_from([0.0, 0.003, 0.05, 1.0]))
def test_buried_planes_count_for_points_above_them_only(seed, reach):
    shapes, posed, planes, buried, R, local, (low, high) = random_scene(seed)
    assert 0.003 < shapes.hulls.around < 0.05  # cells' lists, and whole ones
    expected, direction, sharp, clear = naive_distance(local, planes, buried)
    # As elsewhere: off a sharp corner a plane may be near, but not the hull.
    clear &= ((local > low - reach + 1e-5) & (local < high + reach - 1e-5)).all(axis=1)
    clear &= np.abs(expected - reach) > 1e-5
    x = np.ascontiguousarray(R.apply(local), np.float32)
    distance, normal = np.empty(len(x), np.float32), np.empty((len(x), 3), np.float32)
    distances(shapes, posed, x, np.float32(reach), distance, normal)
    within = np.isfinite(distance)
    np.testing.assert_array_equal(within[clear], (expected <= reach)[clear])
    told = within & clear
    # Single precision of coordinates below half a metre.
    np.testing.assert_allclose(distance[told], expected[told], atol=1e-6)
    told &= sharp
    np.testing.assert_allclose(normal[told], R.apply(direction[told]), atol=1e-6)
    hidden = planes[buried, :3] @ local.T - planes[buried, 3:4]
    assert told.sum() > 1000
    if buried.any():
        # The nearest of all planes was buried for some.
        assert (expected[told] < hidden.max(axis=0)[told] - 1e-3).any()


@CHECKED
@given(seed=st.integers(0, 10**6), thickness=st.sampled_from([0.0005, 0.003, 0.05]))
def test_blocks_count_buried_planes_for_points_above_them_only(seed, thickness):
    shapes, posed, planes, buried, R, local, (low, high) = random_scene(seed)
    expected, direction, sharp, clear = naive_distance(local, planes, buried)
    clear &= ((local > low - thickness + 1e-5) & (local < high + thickness - 1e-5)).all(axis=1)
    clear &= np.abs(expected - thickness) > 1e-5
    x = np.ascontiguousarray(R.apply(local), np.float32)
    before, contacts = x.copy(), Contacts.room_for(len(x), 1)
    collide(shapes, posed, Sides.all_under(len(x), 1), x, before, thickness, 0.0, contacts)
    touching = contacts.shape == 0
    np.testing.assert_array_equal(touching[clear], (expected < thickness)[clear])
    told = touching & clear
    np.testing.assert_allclose(contacts.depth[told], thickness - expected[told], atol=1e-6)
    told &= sharp
    np.testing.assert_allclose(contacts.normal[told], R.apply(direction[told]), atol=1e-6)
    assert told.sum() > 1000


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_particle_in_the_slab_of_two_boxes_leaves_by_the_side(seed):
    colliders, T_world_rest, T_world_stack = stacked_colliders(seed)
    poses = ColliderPoses(
        position=T_world_rest[:, :3, 3],
        orientation=Rotation.from_matrix(T_world_rest[:, :3, :3]).as_quat(),
    )
    # 1 cm from the buried faces of both boxes, 3 cm from the nearest side.
    local = np.array([[0.07, 0.0, 0.0], [0.0, -0.07, 0.004], [-0.07, 0.02, -0.004]])
    way = np.array([[0.03, 0.0, 0.0], [0.0, -0.03, 0.0], [-0.03, 0.0, 0.0]])
    ends = []
    for T in (None, T_world_rest):
        shapes = pack(colliders, T)
        posed = PosedShapes.room_for(shapes)
        pose(shapes, poses, poses, T_world_stack[:3, 3], posed)
        x = np.ascontiguousarray(local @ T_world_stack[:3, :3].T, np.float32)
        collide(
            *(shapes, posed, Sides.all_under(3, 2), x, x.copy(), THICKNESS, 0.0),
            Contacts.room_for(3, 2),
        )
        ends.append(x @ T_world_stack[:3, :3])
    held, free = ends
    np.testing.assert_allclose(free, local + way * (1.0 + THICKNESS / 0.03), atol=2e-6)
    assert (np.abs(held[:, 2]) < 0.02).all()
    assert (np.abs(held[:, :2]) < 0.08).all()


def rigid(seed):
    rng = np.random.default_rng(seed)
    return transform_from(rng.normal(size=3), Rotation.random(random_state=seed).as_quat())


def test_a_name_of_both_a_bone_and_a_collider_is_the_bones_at_rest(cloth):
    turn = Rotation.from_euler("x", 40.0, degrees=True).as_quat()
    where = {"position": np.array([0.1, 0.2, 0.3]), "orientation": turn}
    hull = box((0.0, 0.0, 0.0))
    colliders = ColliderSet(
        colliders=(
            collider("spine", *hull, bone="spine", **where),
            collider("chest_hull", *hull, bone="spine", **where),
            collider("plate", *hull, bone="arm", **where),
            collider("foot", *hull, bone="foot", **where),
        )
    )
    T_spine, T_plate, T_foot = rigid(1), rigid(2), rigid(3)
    plain = cloth.garment(*cloth.grid(2, 2))
    shirt = dataclasses.replace(
        plain, frames=("spine", "plate"), T_world_frame_rest=np.array([T_spine, T_plate])
    )
    own = transform_from(where["position"], where["orientation"])
    T = rest_transforms([shirt], colliders)
    np.testing.assert_allclose(T[:3], [T_spine @ own, T_spine @ own, T_plate], atol=1e-12)
    assert np.isnan(T[3]).all()
    sock = dataclasses.replace(plain, frames=("foot",), T_world_frame_rest=T_foot[None])
    T = rest_transforms([shirt, sock], colliders)
    np.testing.assert_allclose(
        T, [T_spine @ own, T_spine @ own, T_plate, T_foot @ own], atol=1e-12
    )
    assert np.isnan(rest_transforms([], colliders)).all()


def test_sides_do_not_depend_on_colliders_being_named_like_bones(cloth):
    # Two tubes side by side along z, each on its bone; the bones' origins are off the hulls.
    angle = np.linspace(0.0, 2.0 * np.pi, 13)[:-1]
    ring = 0.07 * np.column_stack([np.cos(angle), np.sin(angle)])
    tube = trimesh.creation.cylinder(0.07, 0.4, sections=12, cap=False)
    rings = np.vstack([np.column_stack([ring, np.full(12, z)]) for z in np.linspace(-0.2, 0.2, 5)])
    i = np.arange(48).reshape(4, 12)
    j = np.roll(i, -1, axis=1)
    quads = [np.stack([i, j, j + 12], -1), np.stack([i, j + 12, i + 12], -1)]
    faces = np.concatenate([q.reshape(-1, 3) for q in quads])
    aside = np.array([0.1, 0.0, 0.0])
    vertices = np.vstack([rings - aside, rings + aside])
    T = np.array([rigid(1), rigid(2)])
    frame = np.repeat([0, 1], 60)[:, None].astype(np.int32)
    garment = dataclasses.replace(
        cloth.garment(vertices, np.vstack([faces, faces + 60])),
        frames=("trunk", "arm"),
        T_world_frame_rest=T,
        frame_index=frame,
        frame_weight=np.ones((120, 1)),
    )
    hull = convex_hull(np.array(tube.vertices) * [0.8, 0.8, 1.0])

    def sides(names, offset=True):
        colliders = []
        for name, bone, T_bone, x in zip(names, ("trunk", "arm"), T, (-0.1, 0.1)):
            own = np.linalg.inv(T_bone) @ transform_from(np.array([x, 0.0, 0.0]), [0, 0, 0, 1])
            quaternion = Rotation.from_matrix(own[:3, :3]).as_quat()
            where = {"position": own[:3, 3], "orientation": quaternion} if offset else {}
            colliders.append(collider(name, hull.vertices, hull.faces, bone=bone, **where))
        colliders = ColliderSet(colliders=tuple(colliders))
        row, side = shape_sides(garment, colliders, pack(colliders))
        return side[row]

    expected = sides(["trunk_hull", "arm_hull"])
    np.testing.assert_array_equal(sides(["trunk", "arm"]), expected)
    # Where a tube faces the other one, that is outside of it; all else is under the cloth.
    facing = np.vstack([np.repeat([False, True], 60), np.repeat([True, False], 60)]).T
    towards = np.where(frame[:, 0] == 0, 1.0, -1.0) * np.tile(np.cos(angle), 10) > 0.3
    assert (expected[facing & towards[:, None]] == OPPOSED).all()
    assert (expected[~facing] == UNDER).all()
    assert (sides(["trunk", "arm"], offset=False) != expected).any()
