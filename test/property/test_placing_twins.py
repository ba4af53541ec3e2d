"""Skin places, hems and openings of garments against naive twins."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from garment_sim_ros.geometry.transforms import transform_from
from garment_sim_ros.sim.openings import Rims, find_beyond
from garment_sim_ros.sim.placement import blend
from garment_sim_ros.sim.riding_up import sums_over_hems

SEEDS = st.integers(0, 10**6)


@given(SEEDS)
@settings(derandomize=True, deadline=None, max_examples=20)
def test_blended_places(seed):
    """Of transforms, and of their differences, which give displacements; of all and of some."""
    rng = np.random.default_rng(seed)
    v, b, slots = 30, 5, 4
    rest, now, then = (
        transform_from(rng.normal(size=(b, 3)), Rotation.random(b, rng).as_quat())
        for _ in range(3)
    )
    weight = rng.dirichlet(np.ones(slots), v)
    weight[rng.random((v, slots)) < 0.2] = 0.0
    garment = SimpleNamespace(
        vertices=rng.normal(size=(v, 3)).astype(np.float32),
        frame_index=rng.integers(0, b, (v, slots)).astype(np.int32),
        frame_weight=weight,
        T_world_frame_rest=rest,
    )
    x1 = np.column_stack([garment.vertices, np.ones(v)]).astype(np.float64)
    for T in (now, now - then):
        motion = T @ np.linalg.inv(rest)
        each = np.einsum("vsij,vj->vsi", motion[garment.frame_index][:, :, :3], x1)
        expected = np.einsum("vs,vsi->vi", weight, each)
        np.testing.assert_allclose(blend(garment, T), expected, atol=1e-12)
        some = rng.integers(0, v, 7)
        np.testing.assert_allclose(blend(garment, T, some), expected[some], atol=1e-12)


@given(SEEDS)
@settings(derandomize=True, deadline=None, max_examples=20)
def test_sums_over_hems(seed):
    """Of several, one of them empty."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(40, 3)).astype(np.float32)
    vertex, held = rng.integers(0, 40, (2, 9)).astype(np.int32)
    skin, down, sums = rng.normal(size=(2, 9, 3)), rng.normal(size=3), np.zeros((3, 3))
    first = np.array([0, 4, 4, 9], np.int32)
    sums_over_hems(x, vertex, held, first, skin, down, sums)
    wide, way = x.astype(np.float64), skin[0] - skin[1]
    each = np.column_stack(
        [
            np.linalg.norm(way, axis=1),
            np.linalg.norm(wide[vertex] - wide[held], axis=1),
            way @ down,
        ]
    )
    expected = [each[:4].sum(axis=0), np.zeros(3), each[4:].sum(axis=0)]
    np.testing.assert_allclose(sums, expected, atol=1e-5)


def _crosses(edge, corners):
    """Whether a segment crosses a triangle, by a solution of three equations."""
    a, b, c = corners.astype(np.float64)
    columns = np.column_stack([b - a, c - a, edge[0] - edge[1]])
    u, v, s = np.linalg.solve(columns, edge[0] - a)
    return bool(u >= 0 and v >= 0 and u + v <= 1 and 0 <= s <= 1)


@given(SEEDS)
@settings(derandomize=True, deadline=None, max_examples=30)
def test_tips_beyond_openings(seed):
    """A chain of nodes with two branches through two openings of unequal size."""
    rng = np.random.default_rng(seed)
    before, tip = np.array([-1, 0, 1, 2, 2, 4]), np.array([0, 3, 5])
    nodes = rng.normal(size=(6, 3))
    edges = np.stack([nodes[before[1:]], nodes[1:]], axis=1)
    edge_of = [rng.normal(size=(n, 3)).astype(np.float32) for n in (7, 4)]
    rims = Rims.of(np.split(np.arange(11, dtype=np.int32), [7]))
    beyond = np.zeros((2, 3), bool)
    find_beyond(rims, np.concatenate(edge_of), edges, np.arange(1, 6), before, tip, beyond)
    for opening, edge in enumerate(edge_of):
        middle = edge.mean(axis=0)
        fan = [np.stack([middle, a, b]) for a, b in zip(edge, np.roll(edge, -1, axis=0))]
        side = np.zeros(6, bool)
        for node in range(1, 6):
            hits = sum(_crosses(edges[node - 1], corners) for corners in fan)
            side[node] = side[before[node]] ^ (hits % 2 == 1)
        assert beyond[opening].tolist() == side[tip].tolist()
