import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from naive import naive

from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.contact.sides import OPPOSED, PASSING, UNDER, Sides
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.transforms import matrix_from_quaternion

THICKNESS = 0.003


def random_scene(rng, count):
    """Overlapping spheres and tapered capsules of limb size within a cube of 0.4 m."""
    colliders = []
    for k in range(count):
        r0, r1, length = rng.uniform(0.03, 0.12), rng.uniform(0.03, 0.12), rng.uniform(0.0, 0.4)
        geometry = (
            {"radius": r0} if k % 3 == 0 else {"radius0": r0, "radius1": r1, "length": length}
        )
        kind = "sphere" if k % 3 == 0 else "capsule"
        colliders.append(Collider(name=f"c{k}", kind=kind, bone="b", geometry=geometry))
    orientation = rng.normal(size=(count, 4))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    poses = ColliderPoses(position=rng.uniform(-0.2, 0.2, (count, 3)), orientation=orientation)
    return ColliderSet(colliders=tuple(colliders)), poses


def permuted(colliders, poses, order):
    return (
        ColliderSet(colliders=tuple(colliders.colliders[k] for k in order)),
        ColliderPoses(position=poses.position[order], orientation=poses.orientation[order]),
    )


def naive_shapes(colliders, poses):
    rotation = matrix_from_quaternion(poses.orientation)
    return [(c, p, R) for c, p, R in zip(colliders.colliders, poses.position, rotation)]


def run(
    colliders,
    poses,
    x,
    *,
    start=None,
    x_start=None,
    friction=0.0,
    origin=(0.0, 0.0, 0.0),
    sides=None,
):
    shapes = pack(colliders)
    posed = PosedShapes.room_for(shapes)
    pose(shapes, start or poses, poses, np.array(origin), posed)
    out = np.array(x, dtype=np.float32)
    before = out.copy() if x_start is None else np.ascontiguousarray(x_start, np.float32)
    contacts = Contacts.room_for(len(out), len(shapes.kind))
    sides = sides or Sides.all_under(len(out), len(shapes.kind))
    count = collide(shapes, posed, sides, out, before, THICKNESS, friction, contacts)
    return out, contacts, count


@given(st.integers(0, 10**6), st.integers(1, 8))
@settings(derandomize=True, deadline=None, max_examples=10)
def test_agrees_with_the_naive_twin_and_ends_outside_or_pinched(seed, count):
    rng = np.random.default_rng(seed)
    colliders, poses = random_scene(rng, count)
    x = rng.uniform(-0.3, 0.3, (60, 3)).astype(np.float32)
    # From far away: what was between two shapes before would stay there.
    out, contacts, touching = run(colliders, poses, x, x_start=x + np.float32(1.0))
    shapes = naive_shapes(colliders, poses)
    assert touching == (contacts.shape >= 0).sum()
    for before, after, k in zip(x.astype(np.float64), out, contacts.shape):
        distance, _ = naive.deepest(shapes, before)
        if distance >= THICKNESS + 1e-6:
            assert k == -1
            assert (after == before).all()
        elif distance <= THICKNESS - 1e-6:
            assert k >= 0
            # On the brink between leaving and being pinched, rounding decides.
            twins = [naive.leave_union(shapes, before, THICKNESS, f) for f in (3.996, 4.0, 4.004)]
            assert min(np.linalg.norm(after - twin) for twin in twins) < 1e-4
            left, _ = naive.deepest(shapes, after.astype(np.float64))
            if left < THICKNESS - 2e-6:
                pressing = sum(naive.signed_distance(s, after)[0] < THICKNESS for s in shapes)
                assert pressing >= 2


@given(st.integers(0, 10**6))
@settings(derandomize=True, deadline=None, max_examples=40)
def test_order_of_colliders_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    colliders, poses = random_scene(rng, 6)
    x = rng.uniform(-0.3, 0.3, (200, 3))
    a, _, _ = run(colliders, poses, x)
    b, _, _ = run(*permuted(colliders, poses, rng.permutation(6)), x)
    assert (a == b).all()


@given(st.integers(0, 10**6))
@example(15)
@example(72)
@example(78)
@example(410909)
@settings(derandomize=True, deadline=None, max_examples=40)
def test_block_rejection_changes_nothing(seed):
    """Nothing is missed, neither by a block of one nor by one of many; several at once may round.

    In the examples one is so deep that its way out ends in a shape that does not come near where
    it was.
    """
    rng = np.random.default_rng(seed)
    colliders, poses = random_scene(rng, 6)
    x = rng.uniform(-0.3, 0.3, (100, 3))
    together, _, _ = run(colliders, poses, x)
    alone = np.concatenate([run(colliders, poses, p[None])[0] for p in x])
    np.testing.assert_allclose(together, alone, atol=1e-6, rtol=0)


@pytest.mark.parametrize(
    "collider",
    [
        Collider(name="s", kind="sphere", bone="b", geometry={"radius": 0.2}),
        Collider(
            name="c",
            kind="capsule",
            bone="b",
            geometry={"radius0": 0.2, "radius1": 0.08, "length": 0.3},
        ),
    ],
    ids=["sphere", "capsule"],
)
def test_one_shape_leaves_points_at_exactly_the_thickness(collider):
    rng = np.random.default_rng(3)
    scene = ColliderSet(colliders=(collider,))
    poses = ColliderPoses.identity(1)
    x = rng.uniform([-0.2, -0.2, -0.2], [0.2, 0.2, 0.5], (500, 3))
    out, contacts, count = run(scene, poses, x)
    shape = naive_shapes(scene, poses)[0]
    inside = contacts.shape >= 0
    assert 50 < count < 500
    distance = [naive.signed_distance(shape, p.astype(np.float64))[0] for p in out[inside]]
    assert distance == pytest.approx([THICKNESS] * count, abs=2e-7)
    before = np.array([naive.signed_distance(shape, p.astype(np.float32))[0] for p in x[inside]])
    assert contacts.depth[inside] == pytest.approx(THICKNESS - before, abs=1e-6)
    assert np.linalg.norm(contacts.normal[inside], axis=1) == pytest.approx(1.0, abs=1e-6)


def test_crease_between_two_spheres_is_reached_continuously():
    """Points along a line through the lens of two spheres: no jump but at its mid-plane."""
    ball = {"radius": 0.1}
    scene = ColliderSet(
        colliders=tuple(Collider(name=n, kind="sphere", bone="b", geometry=ball) for n in "ab")
    )
    poses = ColliderPoses.identity(2)
    poses.position[:, 0] = -0.06, 0.06
    z = np.linspace(0.0, 0.12, 400)
    x = np.stack([np.full_like(z, 0.004), np.zeros_like(z), z], axis=1)
    out, _, _ = run(scene, poses, x, x_start=x + 1.0)
    distances = np.linalg.norm(out[:, None] - poses.position[None], axis=2)
    # The first lies on the line between the centres, where there is no way to the crease.
    assert distances[1:].min() >= 0.1 + THICKNESS - 1e-6
    reached = out[z > 0.03]
    assert np.linalg.norm(np.diff(reached, axis=0), axis=1).max() < 0.004


@pytest.mark.parametrize("gap", [-0.03, 0.0, 0.004])
def test_points_between_closing_legs_are_held_halfway(gap):
    """Cloth that two legs close on stays between them: it is not squeezed out of the crease."""
    leg = {"radius0": 0.08, "radius1": 0.05, "length": 0.4}
    scene = ColliderSet(
        colliders=tuple(Collider(name=n, kind="capsule", bone="b", geometry=leg) for n in "lr")
    )
    poses = ColliderPoses.identity(2)
    poses.position[:, 1] = -0.08 - gap / 2, 0.08 + gap / 2
    rng = np.random.default_rng(0)
    x = rng.uniform([-0.01, -0.003, 0.0], [0.01, 0.003, 0.02], (300, 3))
    out, _, _ = run(scene, poses, x)
    shapes = naive_shapes(scene, poses)
    squeeze = 2.0 * THICKNESS - gap
    assert np.linalg.norm(out - x, axis=1).max() <= 4.0 * (0.003 + 0.5 * squeeze)
    # No deeper in either leg than half of what they overlap.
    left = min(naive.deepest(shapes, p.astype(np.float64))[0] for p in out)
    assert left >= THICKNESS - 0.55 * squeeze


@pytest.mark.parametrize(("gap", "is_caught"), [(-0.02, False), (-0.07, True)])
def test_cloth_deep_between_closing_legs_does_not_slip(gap, is_caught):
    """It is pulled along the crease by 8 mm in a step, as a hem that is stretched over a thigh."""
    leg = {"radius0": 0.08, "radius1": 0.08, "length": 0.4}
    scene = ColliderSet(
        colliders=tuple(Collider(name=n, kind="capsule", bone="b", geometry=leg) for n in "lr")
    )
    poses = ColliderPoses.identity(2)
    poses.position[:, 1] = -0.08 - gap / 2, 0.08 + gap / 2
    start = np.array([[0.0, 0.0, z] for z in np.linspace(0.1, 0.3, 20)])
    pulled = start + np.array([0.0, 0.0, 0.008])
    out, contacts, _ = run(scene, poses, pulled, x_start=start)
    assert np.isinf(contacts.depth).all()
    assert (contacts.caught == is_caught).all()
    slip = np.linalg.norm(out - start, axis=1)
    assert slip == pytest.approx(0.0 if is_caught else 0.008 - 0.003 * 0.56, abs=2e-4)


def met_by_chest_and_arm(x, arm, apart):
    """Points after contact with a chest under the cloth and an arm against it; the contacts."""
    scene = ColliderSet(
        colliders=(
            Collider(name="chest", kind="sphere", bone="b", geometry={"radius": 0.1}),
            Collider(name="arm", kind="sphere", bone="b", geometry={"radius": arm}),
        )
    )
    poses = ColliderPoses.identity(2)
    poses.position[1, 0] = apart
    sides = Sides.of(np.zeros(len(x), np.int32), np.array([[UNDER, OPPOSED]]))
    out, contacts, _ = run(scene, poses, x, sides=sides)
    return out, contacts


def test_cloth_pressed_by_what_it_is_worn_on_elsewhere_is_marked_as_held():
    """An arm in the side of a shirt: the point goes halfway, and must not fly off the chest."""
    x = [[0.097, 0.0, 0.0], [0.0, 0.098, 0.0]]
    out, contacts = met_by_chest_and_arm(x, 0.05, 0.14)  # 1 cm inside each other
    assert np.isinf(contacts.depth[0])
    assert np.isfinite(contacts.depth[1])
    # Between the chest's surface and the arm's.
    assert 0.09 - THICKNESS < out[0, 0] < 0.1 + THICKNESS


def test_cloth_between_chest_and_arm_is_held_halfway_wherever_it_was_asked_to_be():
    """In one of them or in both: what is pushed out of the arm alone must not end in the chest."""
    along = np.linspace(0.086 - THICKNESS, 0.104 + THICKNESS, 60)
    x = np.stack([along, np.zeros(60), np.zeros(60)], axis=1)
    out, contacts = met_by_chest_and_arm(x, 0.05, 0.14)
    assert np.isinf(contacts.depth).all()
    np.testing.assert_allclose(out, np.tile([0.095, 0.0, 0.0], (60, 1)), atol=1e-5)


def test_cloth_goes_all_the_way_out_of_what_presses_it_along_the_body():
    """Whether the body is touched there, too, hangs on micrometres; where it goes does not."""
    above = THICKNESS + np.linspace(-1e-5, 1e-5, 20)
    x = (0.1 + above)[:, None] * np.array([np.cos(0.84), np.sin(0.84), 0.0])
    # The ways out of the two are a little less than perpendicular.
    arm = np.array([0.13, 0.0, 0.0])
    out, contacts = met_by_chest_and_arm(x, 0.1, arm[0])
    assert (0.1 + THICKNESS - np.linalg.norm(x - arm, axis=1)).min() > 0.003
    np.testing.assert_allclose(out, np.tile(out[0], (20, 1)), atol=5e-5)
    np.testing.assert_allclose(np.linalg.norm(out - arm, axis=1), 0.1 + THICKNESS, atol=1e-6)
    np.testing.assert_array_equal(contacts.shape, np.where(above < THICKNESS, 0, 1))


def test_hand_brushes_cloth_but_never_drives_it_into_the_body():
    """A ball on the cloth's outer side pushes a little; the body under the cloth always wins."""
    scene = ColliderSet(
        colliders=(
            Collider(name="body", kind="sphere", bone="b", geometry={"radius": 0.2}),
            Collider(name="hand", kind="sphere", bone="b", geometry={"radius": 0.05}),
        )
    )
    depth = np.linspace(-0.01, 0.06, 71)
    pushed = []
    for d in depth:
        poses = ColliderPoses.identity(2)
        poses.position[1, 0] = 0.4 + 0.05 + THICKNESS - d  # d deep in the hand, free of the body
        x = np.array([[0.4, 0.0, 0.0]])
        out, _, _ = run(scene, poses, x, sides=Sides.of(np.zeros(1), np.array([[UNDER, PASSING]])))
        pushed.append(0.4 - out[0, 0])
    expected = np.clip(np.minimum(depth, 0.04 - depth), 0.0, None)
    assert pushed == pytest.approx(expected, abs=1e-6)

    poses.position[1, 0] = 0.21  # a hand that lies on the body, its palm in it
    ring = np.linspace(0.0, 2.0 * np.pi, 50)
    x = np.stack([np.full(50, 0.21), 0.03 * np.cos(ring), 0.03 * np.sin(ring)], axis=1)
    out, _, _ = run(scene, poses, x, sides=Sides.of(np.zeros(50), np.array([[UNDER, PASSING]])))
    assert np.linalg.norm(out, axis=1).min() >= 0.2 + THICKNESS - 1e-6


def test_point_at_the_very_centre_or_axis_gets_out():
    scene = ColliderSet(
        colliders=(
            Collider(name="s", kind="sphere", bone="b", geometry={"radius": 0.1}),
            Collider(
                name="c",
                kind="capsule",
                bone="b",
                geometry={"radius0": 0.1, "radius1": 0.1, "length": 0.3},
            ),
        )
    )
    poses = ColliderPoses.identity(2)
    poses.position[1, 0] = 1.0
    out, _, count = run(scene, poses, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.15]])
    assert count == 2
    assert np.linalg.norm(out[0]) == pytest.approx(0.1 + THICKNESS, abs=1e-7)
    assert np.hypot(out[1, 0] - 1.0, out[1, 1]) == pytest.approx(0.1 + THICKNESS, abs=1e-6)


@pytest.mark.parametrize(("r0", "r1"), [(0.2, 0.05), (0.05, 0.2)])
def test_capsule_with_one_end_inside_the_other_is_the_larger_sphere(r0, r1):
    geometry = {"radius0": r0, "radius1": r1, "length": 0.1}
    scene = ColliderSet(
        colliders=(Collider(name="c", kind="capsule", bone="b", geometry=geometry),)
    )
    rng = np.random.default_rng(1)
    out, contacts, _ = run(scene, ColliderPoses.identity(1), rng.uniform(-0.2, 0.3, (300, 3)))
    centre = np.array([0.0, 0.0, 0.0 if r0 > r1 else 0.1])
    touched = np.linalg.norm(out[contacts.shape >= 0] - centre, axis=1)
    assert touched == pytest.approx(0.2 + THICKNESS, abs=1e-5)


def test_friction_holds_what_coulomb_allows_relative_to_the_moving_shape():
    scene = ColliderSet(
        colliders=(Collider(name="s", kind="sphere", bone="b", geometry={"radius": 1.0}),)
    )
    start, end = ColliderPoses.identity(1), ColliderPoses.identity(1)
    end.position[0, 0] = 0.01
    top = 1.0 + THICKNESS
    x_start = np.array([[0.0, 0.0, top], [0.0, 0.0, top]])
    depth = 0.002
    x = np.array([[0.0095, 0.0, top - depth], [0.0, 0.0, top - depth]])
    out, _, _ = run(scene, end, x, start=start, x_start=x_start, friction=0.5)
    assert out[0, 0] == pytest.approx(0.01, abs=1e-5)
    # The ball's top has moved on: the surface here has come down by 5 % of the depth.
    assert out[1, 0] == pytest.approx(0.5 * depth, rel=0.08)
    free, _, _ = run(scene, end, x, start=start, x_start=x_start, friction=0.0)
    assert free[1, 0] == pytest.approx(0.0, abs=3e-5)


@pytest.mark.parametrize(
    ("kind", "geometry", "message"),
    [
        ("sphere", {"radius": float("nan")}, "finite"),
        ("sphere", {"radius": -1.0}, "not negative"),
        ("sphere", {"radius": "big"}, "could not convert"),
        ("capsule", {"radius0": 0.1, "radius1": 0.1, "length": float("inf")}, "finite"),
    ],
)
def test_unusable_shapes_are_refused_by_name(kind, geometry, message):
    scene = ColliderSet(colliders=(Collider(name="odd", kind=kind, bone="b", geometry=geometry),))
    with pytest.raises(GeometryError, match=f"'odd'.*{message}"):
        pack(scene)


def test_no_shapes_no_contacts():
    out, _, count = run(ColliderSet(colliders=()), ColliderPoses.identity(0), np.zeros((5, 3)))
    assert count == 0
    assert (out == 0.0).all()
