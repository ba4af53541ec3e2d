"""What is through the openings of a tube."""

import numpy as np
import pytest

from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.sim.joint_links import limbs_of
from garment_sim_ros.sim.openings import Openings


def tube(rows=5, n=24, radius=0.1, half=0.2):
    """An upright tube without ends, single precision."""
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    heights = np.linspace(-half, half, rows)
    x = np.concatenate([np.c_[ring, np.full(n, z)] for z in heights]).astype(np.float32)
    i = np.arange(n)
    j = (i + 1) % n
    rings = [
        k * n + np.concatenate([np.c_[i, j, i + n], np.c_[j, j + n, i + n]]) for k in range(4)
    ]
    return x, np.concatenate(rings).astype(np.int32)


def limb(name, length):
    return Collider(
        name=name,
        kind="capsule",
        bone=name,
        geometry={"radius0": 0.04, "radius1": 0.04, "length": length},
    )


def set_of(*colliders):
    return ColliderSet(colliders=colliders)


def at(*positions):
    poses = ColliderPoses.identity(len(positions))
    poses.position[:] = positions
    return poses


@pytest.fixture
def worn():
    """A tube on a limb of two parts; the openings know it."""
    x, triangles = tube()
    colliders = set_of(limb("upper", 0.6), limb("lower", 0.6))
    poses = at([0, 0, 0.0], [0, 0, -0.7])
    T = np.tile(np.eye(4), (2, 1, 1))
    T[:, :3, 3] = poses.position
    openings = Openings(colliders, T, triangles)
    openings.begin(x, poses)
    return openings, x, poses


def test_cloth_beside_the_limb_has_lost_it(worn):
    openings, x, poses = worn
    assert not openings.lost(x, poses)
    assert not openings.lost(x + np.float32([0.03, 0.02, 0.1]), poses)
    assert openings.lost(x + np.float32([0.3, 0.0, 0.0]), poses)


def test_no_limb_has_to_run_through_the_cloth_for_that(worn):
    """The tube is beside the limb but a row, that is still around it: below it, none is."""
    openings, x, poses = worn
    bent = x.copy()
    bent[: 3 * 24, 0] += 0.3
    assert openings.lost(bent, poses)


def test_a_tip_that_is_drawn_in_is_still_there(worn):
    openings, x, poses = worn
    drawn = poses.copy()
    drawn.position[:, 2] += 0.55
    assert not openings.lost(x, drawn)


def test_only_what_sticks_out_is_a_limb():
    """A trunk of two parts side by side, two legs and a stump."""
    ends = np.array(
        [
            [[-0.1, 0, 1.0], [0.1, 0, 1.0]],
            [[-0.1, 0.02, 1.1], [0.1, 0.02, 1.1]],
            [[-0.1, 0, 0.9], [-0.1, 0, 0.3]],
            [[0.1, 0, 0.9], [0.1, 0, 0.3]],
            [[0.0, 0, 1.2], [0.0, 0, 1.3]],
        ]
    )
    assert limbs_of(ends)[1] == [5, 7]


def test_where_nothing_is_known_nothing_is_lost():
    x, triangles = tube()
    colliders = set_of(limb("upper", 0.6))
    openings = Openings(colliders, np.full((1, 4, 4), np.nan), triangles)
    openings.begin(x, at([0, 0, 0]))
    assert not openings.lost(x + np.float32([0.3, 0.0, 0.0]), at([0, 0, 0]))


def test_a_limb_that_ends_inside_is_drawn_in_wherever_it_points(worn):
    """As feet in a long skirt when the body crouches: they point through its front."""
    openings, x, poses = worn
    long = x * np.float32([10.0, 10.0, 4.0])
    drawn = poses.copy()
    drawn.position[:] = [0, 0, 0.15], [0, 0, -1.7]
    drawn.orientation[0] = [0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]
    assert not openings.lost(long, drawn)
    assert openings.lost(long + np.float32([2.5, 0.0, 0.0]), drawn)
