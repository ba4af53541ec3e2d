"""Contact along rays from inside against its naive twin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive.naive_rays import Posed
from naive.naive_rays import meet_rays as naive_rays

import garment_sim_ros as gs
from garment_sim_ros.colliders.hulls.hull import convex_hull
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.papers.outer_map import outer_map
from garment_sim_ros.contact.papers.rays.contact import meet_rays
from garment_sim_ros.contact.papers.rays.tables import ray_tables
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.geometry.obb import oriented_box
from garment_sim_ros.geometry.transforms import matrix_from_quaternion

CHECKED = settings(derandomize=True, deadline=None, max_examples=15)
DT = 0.03


def hull(rng, name):
    """A hull that is round or long, in a frame that is not its box's."""
    size = [(0.1, 0.1, 0.12), (0.05, 0.06, 0.3)][rng.integers(2)]
    made = convex_hull(rng.normal(size=(rng.integers(8, 60), 3)) * size + rng.normal(size=3) * 0.1)
    geometry = {"vertices": made.vertices, "faces": made.faces}
    return Collider(name=name, kind="hull", bone=name, geometry=geometry)


def scene(seed):
    """Hulls, spheres and ellipsoids over each other, in some poses."""
    rng = np.random.default_rng(seed)
    shapes = [hull(rng, f"hull{i}") for i in range(rng.integers(0, 4))]
    for i in range(rng.integers(1, 3)):
        radius = {"radius": float(rng.uniform(0.05, 0.2))}
        shapes.append(Collider(name=f"ball{i}", kind="sphere", bone="b", geometry=radius))
        radii = {"radii": rng.uniform(0.03, 0.25, 3)}
        shapes.append(Collider(name=f"egg{i}", kind="ellipsoid", bone="b", geometry=radii))
    colliders = ColliderSet(colliders=tuple(shapes[i] for i in rng.permutation(len(shapes))))
    poses = ColliderPoses.identity(len(colliders))
    poses.position[:] = rng.normal(size=(len(colliders), 3)) * 0.15
    poses.orientation[:] = rng.normal(size=(len(colliders), 4))
    poses.orientation /= np.linalg.norm(poses.orientation, axis=1, keepdims=True)
    return rng, colliders, poses


def posed_naively(colliders, poses):
    found = []
    for c, centre, q in zip(colliders.colliders, poses.position, poses.orientation):
        R = matrix_from_quaternion(q)
        if c.kind == "hull":
            vertices, faces = c.geometry["vertices"], c.geometry["faces"]
            box = oriented_box(vertices, faces)
            table = outer_map(box.local(vertices), faces)
            frame = (box.centre, box.axes)
            found.append(Posed(centre, R, None, table.plane, frame, bool(table.is_sphere)))
        else:
            radii = c.geometry.get("radii", np.full(3, c.geometry.get("radius")))
            found.append(Posed(centre, R, radii))
    return found


def met(colliders, poses, x, v, x_predicted):
    shapes = pack(colliders)
    posed = PosedShapes.room_for(shapes)
    pose(shapes, poses, poses, np.zeros(3), posed)
    hit = np.zeros(len(x), np.int32)
    count = meet_rays(shapes, posed, ray_tables(colliders), x, v, x_predicted, np.float32(DT), hit)
    return count, hit


@CHECKED
@given(seed=st.integers(0, 10**6))
def test_particles_go_where_one_shape_after_the_other_sends_them(seed):
    rng, colliders, poses = scene(seed)
    x = (rng.normal(size=(400, 3)) * 0.25).astype(np.float32)
    expected, shapes = naive_rays(posed_naively(colliders, poses), x)
    v = rng.normal(size=x.shape).astype(np.float32)
    started, before, places = x.copy(), v.copy(), x.copy()
    count, hit = met(colliders, poses, places, v, started)
    # Single precision decides on which side of a surface, an edge or a cell a point is.
    same = hit == shapes
    assert same.mean() > 0.98
    assert count == (hit >= 0).sum()
    near = np.linalg.norm(places - expected, axis=1) < 1e-4
    assert near[same].mean() > 0.98
    np.testing.assert_array_equal(places[hit < 0], started[hit < 0])
    # What contact moved is velocity, as Verlet's positions have it.
    np.testing.assert_allclose(v, before + (places - started) / DT, rtol=1e-4, atol=1e-3)


def test_a_hull_turned_in_its_frame_gives_the_same_places():
    rng = np.random.default_rng(4)
    points = rng.normal(size=(40, 3)) * [0.05, 0.06, 0.3]
    R = matrix_from_quaternion(np.array([0.5, 0.5, 0.5, 0.5]))
    x = (rng.normal(size=(300, 3)) * [0.04, 0.05, 0.25]).astype(np.float32)
    places = []
    for turned in (False, True):
        made = convex_hull(points @ R.T if turned else points)
        geometry = {"vertices": made.vertices, "faces": made.faces}
        one = ColliderSet(
            colliders=(Collider(name="h", kind="hull", bone="h", geometry=geometry),)
        )
        moved = (x @ R.T if turned else x).astype(np.float32)
        met(one, ColliderPoses.identity(1), moved, np.zeros_like(moved), moved.copy())
        places.append(moved @ R if turned else moved)
    apart = np.linalg.norm(places[0] - places[1], axis=1)
    assert np.median(apart) < 1e-6
    assert np.percentile(apart, 95) < 1e-4


def test_kinds_without_rays_are_refused_by_name():
    colliders = gs.ColliderSet.of(gs.capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.3), 0.1))
    garment = gs.Garment.sheet(0.4, 5)
    message = r"contact.*found 'rays' with capsule colliders.*allowed: with hulls, ellipsoids and"
    with pytest.raises(gs.ParameterError, match=message):
        gs.Simulation(garment, colliders, solver="relaxation", contact="rays")
    with pytest.raises(gs.ParameterError, match=r"found 'earliest' with capsule"):
        gs.Simulation(garment, colliders, solver="relaxation", contact="earliest")
