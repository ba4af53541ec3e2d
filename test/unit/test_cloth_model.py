from itertools import pairwise

import numpy as np
import pytest

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.params import Material
from garment_sim_ros.sim.model import build_model, vertex_masses

FABRIC = Material(areal_density=0.2)


def test_masses_sum_to_area_times_density(cloth):
    vertices, triangles = cloth.grid(5, 9, 0.1)
    masses = vertex_masses(vertices, triangles, 0.2)
    assert masses.sum() == pytest.approx(0.2 * 0.4 * 0.8)


def test_free_particles_come_first_and_pinned_ones_weigh_nothing_inverse(cloth):
    vertices, triangles = cloth.grid(8, 8)
    pins = np.array([9, 3, 60, 3], dtype=np.int32)
    position = np.arange(12.0).reshape(4, 3)
    model = build_model(
        "c",
        vertices,
        triangles,
        FABRIC,
        pins=pins,
        pin_collider=np.array([5, 6, 7, 8]),
        pin_position=position,
    )
    assert model.free_count == 61
    assert model.vertex[61:].tolist() == [3, 9, 60]
    assert model.pin_collider.tolist() == [6, 5, 7]
    assert model.pin_position.tolist() == position[[1, 0, 2]].tolist()
    assert (model.inverse_mass[:61] > 0.0).all()
    assert (model.inverse_mass[61:] == 0.0).all()
    assert sorted(model.vertex.tolist()) == list(range(64))


def test_springs_between_pinned_particles_are_left_out(cloth):
    vertices, triangles = cloth.grid(4, 4)
    row = np.arange(4)
    model = build_model(
        "c",
        vertices,
        triangles,
        FABRIC,
        pins=row,
        pin_collider=np.zeros(4, int),
        pin_position=vertices[:4],
    )
    free = build_model("c", vertices, triangles, FABRIC)
    pairs = model.springs.particles.reshape(-1, 2)
    assert (pairs.min(axis=1) < model.free_count).all()
    assert len(free.springs) - len(model.springs) == 3
    assert np.isfinite(model.springs.share).all()


def test_colours_hold_no_particle_twice_and_bending_comes_first(cloth):
    vertices, triangles = cloth.grid(9, 7)
    springs = build_model("c", vertices, triangles, FABRIC).springs
    pairs = springs.particles.reshape(-1, 2)
    starts = springs.colour_start
    assert springs.bending in starts
    assert starts[-1] == len(springs)
    for begin, end in pairwise(starts):
        assert len(np.unique(pairs[begin:end])) == 2 * (end - begin)


def test_rest_lengths_are_those_of_the_mesh(cloth):
    vertices, triangles = cloth.grid(5, 5)
    model = build_model("c", vertices, triangles, FABRIC)
    a, b = vertices[model.vertex][model.springs.particles.reshape(-1, 2)].swapaxes(0, 1)
    assert model.springs.rest_length == pytest.approx(np.linalg.norm(a - b, axis=1))


def test_arrays_are_read_only(cloth):
    model = build_model("c", *cloth.grid(3, 3), FABRIC)
    with pytest.raises(ValueError, match="read-only"):
        model.springs.rest_length[0] = 1.0


def test_slivers_get_some_mass(cloth):
    vertices, triangles = cloth.grid(3, 3)
    vertices = np.concatenate([vertices, [vertices[8]]])
    triangles = np.concatenate([triangles, [[8, 7, 9]]]).astype(np.int32)
    model = build_model("c", vertices, triangles, FABRIC)
    assert np.isfinite(model.inverse_mass).all()
    assert model.mass.min() >= 0.0099 * model.mass.mean()


@pytest.mark.parametrize(
    ("vertices", "triangles", "message"),
    [
        (np.zeros((3, 3)), [[0, 1, 2]], "no area"),
        (np.eye(3) * np.nan, [[0, 1, 2]], "finite"),
        (np.eye(3), [[0, 1, 3]], "0..2"),
        (np.eye(3), np.zeros((0, 3)), "needs triangles"),
        (np.eye(5, 3), [[0, 1, 2]], "2 vertices belong to no triangle, the first is 3"),
    ],
)
def test_unusable_meshes_are_refused(vertices, triangles, message):
    with pytest.raises(GeometryError, match=message):
        build_model("shirt", vertices, np.array(triangles, np.int32), FABRIC)
