"""Bodies on the ground, and hands out of it, against their naive twin, from random poses."""

import numpy as np
import pytest
from naive import naive_lying
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.hands import lift_arms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.lying import look, rest
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.mocap.walk import walk


@pytest.fixture(scope="module", params=["mannequin:vertices=1500", "CesiumMan.glb"])
def retargeter(request, data_file):
    name = request.param
    body = load_body(name if name.startswith("mannequin") else data_file("bodies", name))
    clip = walk()
    return Retargeter(clip.rig, body, reference=clip.source_reference), clip


def lying(retargeter, seed):
    """A source and a body that lie somehow, near the ground, and random numbers."""
    r, clip = retargeter
    rng = np.random.default_rng(seed)
    q = clip.values[rng.integers(len(clip.values))] + rng.normal(
        scale=0.3, size=clip.values.shape[1]
    )
    T = r.world_joints(q).copy()
    T_source = r._kinematics.from_dofs(q).copy()
    turn = Rotation.from_rotvec(rng.normal(size=3) * [1.6, 1.6, 3.0]).as_matrix()
    for poses in (T, T_source):
        poses[:, :3, :] = turn @ poses[:, :3, :]
        poses[:, 2, 3] -= poses[:, 2, 3].min()
    T[:, 2, 3] += rng.uniform(-0.1, 0.2)
    T_source[:, 2, 3] += rng.uniform(-0.08, 0.1)
    return r, T_source, T, rng


@pytest.mark.parametrize("seed", range(16))
def test_bodies_rest_alike(retargeter, seed):
    r, T_source, T, rng = lying(retargeter, seed)
    of = r.lying
    upper, heights = naive_lying.look(T_source, T, of._parts, of._scale, of._limits)
    got = np.zeros(len(heights))
    assert look(T_source, T, of._parts, of._scale, of._limits, got) == pytest.approx(upper)
    np.testing.assert_allclose(got, heights, atol=1e-12)
    for lower in (0.0, 0.1):
        arguments = (
            *(of._parts, r.feet.legs, r.feet.soles, rng.uniform(size=(2, 2))),
            *(of._scale, of._limits, heights - lower, lower > 0.0),
        )
        expected, up = naive_lying.rest(T_source, T, *arguments)
        got = T.copy()
        assert rest(T_source, got, *arguments) == pytest.approx(up, abs=1e-12)
        np.testing.assert_allclose(got, expected, atol=1e-8)


def test_all_ways_of_lying_were_met(retargeter):
    """Of the poses above: some go up, some down, some neither, and the trunk lies in some."""
    shifts, upper = [], []
    for seed in range(16):
        r, T_source, T, _ = lying(retargeter, seed)
        r.lying.look(T_source, T)
        r.lying.rest(T_source, T, r.feet)
        shifts.append(r.lying.shift)
        upper.append(r.lying.lies)
    assert min(shifts) < -0.02
    assert max(shifts) > 0.02
    assert 0.0 in shifts
    assert min(upper) < 0.1
    assert max(upper) > 0.9


@pytest.mark.parametrize("seed", range(16))
def test_arms_are_lifted_alike(retargeter, seed):
    r, T_source, T, _ = lying(retargeter, seed)
    arms = r.hands._arms
    low = T[arms.joints, 2, 3].min()
    for under in (0.25, 0.1, 0.02):
        sunk = T.copy()
        sunk[:, 2, 3] -= low + under
        arguments = arms, r.scale, r.hands._deep
        expected = naive_lying.lift_arms(T_source, sunk, *arguments)
        got = sunk.copy()
        lift_arms(T_source, got, *arguments)
        np.testing.assert_allclose(got, expected, atol=1e-7)
        assert (got != sunk).any() or T_source[arms.source, 2, 3].max() < -r.hands._deep
