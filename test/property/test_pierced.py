"""Body parts that run through garments: cases of known answer, and the plain twin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import pierced as naive

from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.crossings import find_hits, overlaps
from garment_sim_ros.contact.pierced import PiercedMeter, PiercedSoFar
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet

SQUARE = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def box(x, y, z):
    """Corners and faces of a box of half edges x, y, z."""
    corners = np.array([[i, j, k] for i in (-x, x) for j in (-y, y) for k in (-z, z)], float)
    return Collider(
        name="box", kind="hull", bone="limb", geometry={"vertices": corners, "faces": []}
    )


def sheet(z, half=0.5):
    """A level square at a height, single precision as a simulation has it."""
    corners = [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]]
    return np.array(corners, np.float32)


def tube(radius=0.1, low=-0.3, high=0.3, n=24):
    """An upright tube without ends: a trouser leg."""
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    x = np.concatenate([np.c_[ring, np.full(n, z)] for z in (low, high)]).astype(np.float32)
    i = np.arange(n)
    j = (i + 1) % n
    return x, np.concatenate([np.c_[i, j, i + n], np.c_[j, j + n, i + n]]).astype(np.int32)


def poses(*rows):
    """World poses from positions, unturned."""
    found = ColliderPoses.identity(len(rows))
    found.position[:] = rows
    return found


def pierced(colliders, frames, garments):
    meter = PiercedMeter(ColliderSet(colliders=tuple(colliders)))
    for at in frames:
        meter.add(at, garments)
    return meter.result()


@pytest.mark.parametrize(
    ("kind", "geometry", "half"),
    [
        ("capsule", {"radius0": 0.04, "radius1": 0.05, "length": 0.4}, 0.14),
        ("ellipsoid", {"radii": [0.05, 0.06, 0.2]}, 0.14),
        ("hull", dict(box(0.05, 0.06, 0.2).geometry), 0.14),
    ],
)
def test_the_middle_of_the_long_axis_counts(kind, geometry, half):
    limb = Collider(name="limb", kind=kind, bone="limb", geometry=geometry)
    middle = 0.2 if kind == "capsule" else 0.0
    for z, through in [(half - 1e-3, 1), (half + 1e-3, 0), (-half + 1e-3, 1), (-half - 1e-3, 0)]:
        found = pierced([limb], [poses([0.0, 0, 0])], {"sheet": (sheet(middle + z), SQUARE)})
        assert found.pierced == through, (z, found)


def test_a_leg_in_its_tube_is_worn_and_beside_it_too_but_not_in_its_wall():
    limb = Collider(
        name="leg",
        kind="capsule",
        bone="leg",
        geometry={"radius0": 0.04, "radius1": 0.04, "length": 0.4},
    )
    worn = {"trousers": tube()}
    upright = poses([0.0, 0.0, -0.2])
    assert pierced([limb], [upright], worn).pierced == 0
    leaning = upright.copy()
    leaning.orientation[0] = [np.sin(0.3), 0.0, 0.0, np.cos(0.3)]
    leaning.position[0] = [0.0, 0.0, -0.1]
    found = pierced([limb], [upright, leaning, leaning], worn)
    assert (found.frames, found.pierced) == (3, 2)
    assert found.by_bone == {"trousers": {"leg": 2}}
    assert found.share == pytest.approx(2 / 3)


def test_a_leg_out_of_its_tube_is_seen_though_no_cloth_is_inside_of_it():
    # The thigh still begins within the tube and leaves it through its wall.
    limb = Collider(
        name="leg",
        kind="capsule",
        bone="leg",
        geometry={"radius0": 0.04, "radius1": 0.04, "length": 0.8},
    )
    beside = poses([0.0, 0.0, 0.2])
    beside.orientation[0] = [np.sin(1.3), 0.0, 0.0, np.cos(1.3)]
    assert pierced([limb], [beside], {"trousers": tube()}).pierced == 1


def test_a_hand_pressed_into_the_hip_is_excused_but_neighbours_excuse_nothing():
    hip = box(0.2, 0.2, 0.2)
    hand = Collider(
        name="hand",
        kind="capsule",
        bone="hand",
        geometry={"radius0": 0.02, "radius1": 0.02, "length": 0.3},
    )
    garments = {"skirt": (sheet(0.15), SQUARE)}
    away, pressed = poses([3.0, 0, 0], [0.0, 0, 0]), poses([0.0, 0, 0], [0.0, 0, 0])
    far = {"skirt": (sheet(5.0), SQUARE)}
    meter = PiercedMeter(ColliderSet(colliders=(hip, hand)))
    for _ in range(3):
        meter.add(away, far)
    meter.add(pressed, garments)
    assert meter.result().pierced == 0, "pressed in by the motion"
    for _ in range(6):
        meter.add(pressed, garments)
    assert meter.result().pierced == 7, "they overlap most of the time: neighbours"
    # Out of reach of the overlap the same hit counts.
    low = poses([0.0, 0, -0.4], [0.0, 0, -0.0])
    meter = PiercedMeter(ColliderSet(colliders=(hip, hand)))
    for _ in range(3):
        meter.add(away, far)
    low.position[1] = [0.0, 0.0, -0.30]
    meter.add(low, {"skirt": (sheet(-0.15), SQUARE)})
    assert meter.result().pierced == 0, "within 60 mm of the overlap"
    meter.add(low, {"skirt": (sheet(-0.13), SQUARE)})
    assert meter.result().pierced == 1


def test_a_skin_has_cores_in_its_frames():
    from garment_sim_ros.body.loaders.load import load_body
    from garment_sim_ros.colliders.exact_mesh import fit_mesh

    body = load_body("mannequin")
    cores = Cores.of(fit_mesh(body))
    assert len(set(cores.bone)) > 10
    length = np.linalg.norm(cores.ends[:, 1] - cores.ends[:, 0], axis=1)
    assert length.min() > 0.01
    assert length.max() < 0.8


@given(seed=st.integers(0, 10_000), broken=st.booleans())
@settings(max_examples=40, derandomize=True, deadline=None)
def test_hits_are_those_of_the_twin(seed, broken):
    random = np.random.default_rng(seed)
    x = random.uniform(-1, 1, (30, 3)).astype(np.float32)
    triangles = np.array([random.permutation(30)[:3] for _ in range(40)], np.int32)
    if broken:  # a vertex that is not finite hides nothing but its own triangles
        x[random.integers(30)] = random.choice([np.nan, np.inf])
    whole = triangles[np.isfinite(x[triangles]).all(axis=(1, 2))]
    ends = random.uniform(-1, 1, (3, 2, 3))
    core, at = np.empty(256, np.int32), np.empty(256)
    count = find_hits(ends, x, triangles, core, at)
    for k, (start, end) in enumerate(ends):
        found = np.sort(at[:count][core[:count] == k])
        np.testing.assert_allclose(found, naive.hits(start, end, x[whole]), rtol=0, atol=1e-9)
    assert find_hits(ends, x, triangles, core[:1], at[:1]) == count


@given(seed=st.integers(0, 10_000))
@settings(max_examples=25, derandomize=True, deadline=None)
def test_overlaps_are_those_of_the_twin(seed):
    random = np.random.default_rng(seed)
    points = random.uniform(-1, 1, (12, 3))
    solid = Collider(name="a", kind="hull", bone="a", geometry={"vertices": points, "faces": []})
    limb = Collider(
        name="b",
        kind="capsule",
        bone="b",
        geometry={"radius0": 0.1, "radius1": 0.1, "length": 1.0},
    )
    cores = Cores.of(ColliderSet(colliders=(solid, limb)))
    orientation = random.normal(size=4)
    orientation /= np.linalg.norm(orientation)
    at = poses(random.uniform(-0.5, 0.5, 3), random.uniform(-1, 1, 3))
    at.orientation[0] = orientation
    ends = cores.posed(at)
    low, high = np.empty((2, *cores.same_bone.shape))
    from scipy.spatial.transform import Rotation

    overlaps(
        ends,
        at.position[cores.solid_collider],
        Rotation.from_quat(at.orientation[cores.solid_collider]).as_matrix(),
        cores.planes,
        cores.plane_start,
        cores.same_bone,
        low,
        high,
    )
    k = cores.bone.index("b")
    expected = naive.run(*ends[k], points, at.position[0], orientation)
    if expected is None:
        assert high[k, 0] - low[k, 0] < 1e-3
    else:
        np.testing.assert_allclose([low[k, 0], high[k, 0]], expected, rtol=0, atol=2e-4)


def test_frames_as_they_come_are_judged_by_those_before_them():
    hip = box(0.2, 0.2, 0.2)
    hand = Collider(
        name="hand",
        kind="capsule",
        bone="hand",
        geometry={"radius0": 0.02, "radius1": 0.02, "length": 0.3},
    )
    away, pressed = poses([3.0, 0, 0], [0.0, 0, 0]), poses([0.0, 0, 0], [0.0, 0, 0])
    cut, free = (sheet(0.15), SQUARE), (sheet(5.0), SQUARE)
    meter = PiercedSoFar(ColliderSet(colliders=(hip, hand)), ["skirt", "shirt"])
    assert meter.share() == 0.0
    for _ in range(3):
        meter.add(away, {"skirt": free, "shirt": free})
    assert meter.now == {"skirt": (), "shirt": ()}
    for _ in range(3):
        meter.add(pressed, {"skirt": cut, "shirt": free})
        assert meter.now == {"skirt": (), "shirt": ()}, "overlapping in up to half of the frames"
    meter.add(pressed, {"skirt": cut, "shirt": free})
    assert meter.now == {"skirt": ("hand",), "shirt": ()}
    assert [meter.share(n) for n in ("skirt", "shirt", None)] == [1 / 7, 0.0, 1 / 7]
    meter.add(away, {"skirt": free, "shirt": cut})
    assert meter.now == {"skirt": (), "shirt": ("hand",)}
    assert [meter.share(n) for n in ("skirt", "shirt", None)] == [1 / 8, 1 / 8, 1 / 4]
