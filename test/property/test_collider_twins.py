"""Small kernels of collider fits against numpy, from their definitions."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime, minimize_scalar
from scipy.spatial import ConvexHull

from garment_sim_ros.colliders.capsules.capsule_fit import _normal_equations
from garment_sim_ros.colliders.hulls.convex_parts import _AROUND, _BETWEEN, _estimate
from garment_sim_ros.colliders.joint_shapes import _lower_to_hull

CHECKED = settings(derandomize=True, deadline=None, max_examples=15)
SEEDS = st.integers(0, 10**6)


@CHECKED
@given(SEEDS)
def test_heights_over_a_hull(seed):
    rng = np.random.default_rng(seed)
    planes = ConvexHull(rng.normal(size=(20, 3))).equations * [1.0, 1.0, 1.0, -1.0]
    points = 2.0 * rng.normal(size=(50, 3))
    before = rng.normal(size=50)
    before[::5] = np.inf
    found = before.copy()
    _lower_to_hull(points, planes, found)
    over = [max(plane[:3] @ point - plane[3] for plane in planes) for point in points]
    np.testing.assert_allclose(found, np.minimum(before, over), atol=1e-12)
    assert 5 < (found < before).sum() < 50


def naive_hull_volume(points):
    """Of the farthest points in even directions, joined like those."""
    far = points[[int(np.argmax(points @ way)) for way in _AROUND.T]]
    return sum(np.linalg.det(far[f] - far[0]) for f in _BETWEEN) / 6.0


@CHECKED
@given(SEEDS)
def test_estimated_cuts(seed):
    """Both sides' hulls with the section's corners, of which most is in few directions."""
    rng = np.random.default_rng(seed)
    mesh = trimesh.creation.icosphere(subdivisions=2)
    corner = np.ascontiguousarray(mesh.faces, dtype=np.int64)
    points = mesh.vertices * rng.uniform(0.4, 1.0, (len(mesh.vertices), 1)) * [1.0, 0.6, 1.5]
    normal = rng.normal(size=(6, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    offset = [*rng.uniform(-0.4, 0.4, 5), 9.0]  # the last one has everything below it
    planes = np.column_stack([normal, offset])
    left = np.empty(6)
    _estimate(points, corner, points @ _AROUND, planes, _AROUND, _BETWEEN, left)
    for plane, found in zip(planes, left):
        height = points @ plane[:3] - plane[3]
        section = []
        for i, j in mesh.edges_unique:
            if height[i] * height[j] < 0.0:
                section.append(
                    (height[j] * points[i] - height[i] * points[j]) / (height[j] - height[i])
                )
        sides = [
            np.array([*points[side], *section])
            for side in (height <= 0.0, height > 0.0)
            if side.any()
        ]
        assert found == pytest.approx(sum(naive_hull_volume(side) for side in sides), rel=1e-9)
        exact = sum(ConvexHull(side).volume for side in sides)
        assert 0.75 * exact < found < exact * (1.0 + 1e-9)


def naive_distance(capsule, point):
    """The least distance from one of the balls that make up a tapered capsule."""

    def ball(t):
        centre = (1.0 - t) * capsule[:3] + t * capsule[3:6]
        return np.linalg.norm(point - centre) - (1.0 - t) * capsule[6] - t * capsule[7]

    options = {"xatol": 1e-12}
    inner = minimize_scalar(ball, bounds=(0.0, 1.0), method="bounded", options=options).fun
    return min(inner, ball(0.0), ball(1.0))


@settings(CHECKED, max_examples=5)
@given(SEEDS)
def test_normal_equations(seed):
    """Of what each point's capsule should do, by derivatives taken as differences."""
    rng = np.random.default_rng(seed)
    capsules = np.concatenate(
        [rng.uniform(-1.0, 1.0, (3, 6)), rng.uniform(0.1, 0.3, (3, 2))], axis=1
    )
    points, weight = rng.uniform(-1.2, 1.2, (40, 3)), rng.uniform(size=40)
    points[:10] = capsules[rng.integers(0, 3, 10), :3] + rng.uniform(-0.1, 0.1, (10, 3))
    foreign = rng.random(40) < 0.4
    matrix, gradient = np.empty((3, 8, 8)), np.empty((3, 8))
    cost = _normal_equations(capsules, points, weight, foreign, matrix, gradient)

    expected_cost = 1e-5 * np.sum((capsules[:, 3:6] - capsules[:, :3]) ** 2)
    D = np.hstack([-np.eye(3), np.eye(3), np.zeros((3, 2))])  # p1 - p0
    expected_matrix = np.tile(1e-5 * D.T @ D, (3, 1, 1))
    expected_gradient = capsules @ (1e-5 * D.T @ D)
    used = 0
    for point, share, not_own in zip(points, weight, foreign):
        distance = [naive_distance(capsule, point) for capsule in capsules]
        k = int(np.argmin(distance))
        if not_own and distance[k] >= 0.0:
            continue
        used += not_own
        w = share * (4.0 if distance[k] > 0.0 else 1.0)
        row = approx_fprime(capsules[k], naive_distance, 1e-7, point)
        expected_cost += w * distance[k] ** 2
        expected_gradient[k] += w * distance[k] * row
        expected_matrix[k] += w * np.outer(row, row)
    assert used > 0
    assert cost == pytest.approx(expected_cost, rel=1e-9)
    # Derivatives as differences are good to about 1e-6.
    np.testing.assert_allclose(gradient, expected_gradient, atol=2e-5)
    np.testing.assert_allclose(matrix, expected_matrix, atol=2e-5)
