"""Joints of limbs that stick out of cloth."""

import numpy as np
import pytest

from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.crossings import find_hits
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import transform_from
from garment_sim_ros.sim.joint_links import JointLinks


def rod(name):
    return Collider(
        name=name,
        kind="capsule",
        bone=name,
        geometry={"radius0": 0.05, "radius1": 0.05, "length": 0.5},
    )


COLLIDERS = ColliderSet(colliders=(rod("upper"), rod("lower")))
"""A leg: an upper part that reaches from its hip to its knee, a lower part from there on."""


def leg(bend=0.0):
    """Both parts along x, the lower one turned about y by an angle [rad]; the knee at x = 0.5."""
    poses = ColliderPoses.identity(2)
    poses.position[1] = [0.5, 0.0, 0.0]
    for k, angle in enumerate((np.pi / 2, np.pi / 2 + bend)):
        poses.orientation[k] = [0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2)]
    return poses


@pytest.fixture
def links():
    rest = leg()
    return JointLinks(COLLIDERS, transform_from(rest.position, rest.orientation))


def sheet(at, over):
    """Two triangles at an x that reach over a square about the x axis."""
    y, z = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]).T * over
    x = np.stack([np.full(4, at), y, z], axis=1).astype(np.float32)
    return x, np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def test_cloth_across_a_joint_is_seen_where_no_core_is(links):
    x, triangles = sheet(0.52, 0.2)
    ends = Cores.of(COLLIDERS).posed(leg())
    assert find_hits(ends, x, triangles, np.empty(9, np.int32), np.empty(9)) == 0
    assert links.through(x, triangles, leg()).tolist() == [0]
    assert sorted(links.cores[0].tolist()) == [0, 1]


def test_cloth_across_a_limb_is_for_its_core(links):
    x, triangles = sheet(0.25, 0.2)
    assert not len(links.through(x, triangles, leg()))


@pytest.mark.parametrize("bend", [0.0, 1.0, 2.4])
def test_cloth_around_the_joint_is_none(links, bend):
    """A tube that goes around upper part and knee, however it is bent."""
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    ring = 0.06 * np.stack([0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    x = np.concatenate([ring + np.array([along, 0, 0]) for along in (0.2, 0.5)]).astype(np.float32)
    i = np.arange(24)
    j = (i + 1) % 24
    triangles = np.concatenate([np.c_[i, j, i + 24], np.c_[j, j + 24, i + 24]]).astype(np.int32)
    assert not len(links.through(x, triangles, leg(bend)))


def test_cloth_in_the_bend_of_a_joint_is_none(links):
    """A fold between thigh and calf of a leg that is bent by 140 degrees, up to 1.5 cm from it."""
    bend = np.radians(140.0)
    ways = np.array([[-1.0, 0.0, 0.0], [np.cos(bend), 0.0, -np.sin(bend)]])
    inward = ways.sum(axis=0) / np.linalg.norm(ways.sum(axis=0))
    sides = ((0.015, -0.2), (0.2, -0.2), (0.2, 0.2), (0.015, 0.2))
    corners = [np.array([0.5, y, 0.0]) + away * inward for away, y in sides]
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    assert not len(links.through(np.array(corners, np.float32), triangles, leg(bend)))


def test_without_a_rest_pose_there_are_none():
    links = JointLinks(COLLIDERS, np.full((2, 4, 4), np.nan))
    assert not len(links.through(*sheet(0.52, 0.2), leg()))
