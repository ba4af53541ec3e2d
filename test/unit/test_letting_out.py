"""Panels of sewn garments are let out where colliders ask for more than was sewn."""

import numpy as np
import pytest

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.garment.letting_out import let_out_panels
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.garment.outfit import load_outfit, make_outfit
from garment_sim_ros.garment.outfit_file import outfit_from
from garment_sim_ros.recording.metrics import GarmentMesh as Measured

TRIANGLES = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4]], np.int32)
FLAT = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 2.0]])
CORNERS = FLAT[TRIANGLES]


def surface(weft=1.0, warp=1.0):
    """The panel stretched along its threads."""
    return np.stack([weft * FLAT[:, 0], np.zeros(5), warp * FLAT[:, 1]], axis=1)


def sides(corners):
    return np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2)


def test_a_panel_is_let_out_along_the_threads_that_are_too_short():
    sewn = surface()
    longer = let_out_panels(CORNERS, TRIANGLES, sewn, surface(weft=1.2))
    assert sides(longer) == pytest.approx(sides((FLAT * [1.2, 1.0])[TRIANGLES]))
    skew = surface() @ np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, 0.0, 1.0]])
    longer = let_out_panels(CORNERS, TRIANGLES, sewn, skew)
    assert (sides(longer) >= sides(skew[TRIANGLES]) - 1e-9).all()


def test_it_is_as_taut_as_it_was_sewn_and_never_smaller():
    taut = let_out_panels(CORNERS, TRIANGLES, surface(weft=1.05), surface(weft=1.26))
    assert sides(taut) == pytest.approx(sides((FLAT * [1.2, 1.0])[TRIANGLES]))
    smaller = let_out_panels(CORNERS, TRIANGLES, surface(), surface(weft=0.8, warp=0.9))
    assert sides(smaller) == pytest.approx(sides(CORNERS))
    # What was pushed together as it was sewn has room to become as wide as it was cut.
    wider = let_out_panels(CORNERS, TRIANGLES, surface(weft=0.7), surface())
    assert sides(wider) == pytest.approx(sides(CORNERS))


def test_what_did_not_move_and_what_has_no_area_stays_as_it_is():
    sewn, worn = surface(), surface()
    worn[4] += [0.1, 0.0, 0.3]
    result = let_out_panels(CORNERS, TRIANGLES, sewn, worn)
    assert np.array_equal(result[:2], CORNERS[:2])
    assert not np.array_equal(result[2], CORNERS[2])
    corners = CORNERS.copy()
    for corners[2] in (0.0, np.nan):  # what is not a number is refused later on
        found = let_out_panels(corners, TRIANGLES, sewn, worn)
        assert np.array_equal(found, corners, equal_nan=True)
    of_others = CORNERS[:2]
    assert let_out_panels(of_others, TRIANGLES, sewn, worn) is of_others


def laid_flat(x, triangles):
    """Each triangle by itself, weft along its first side."""
    a, b, c = np.moveaxis(x[triangles], 1, 0)
    along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    u = ((c - a) * along).sum(axis=1)
    v = np.linalg.norm(c - a - u[:, None] * along, axis=1)
    zero = np.zeros(len(u))
    second = np.stack([np.linalg.norm(b - a, axis=1), zero], axis=1)
    return np.stack([np.zeros((len(u), 2)), second, np.stack([u, v], axis=1)], axis=1)


def test_a_garment_sewn_to_the_skin_is_not_stretched_by_fatter_colliders():
    avatar = Avatar.load("mannequin")
    body = avatar.body
    to_skin = load_outfit("tshirt_short_skirt", body).garments[1]
    tight = to_skin.vertices.copy()
    tight[:, :2] *= 0.9
    mesh = GarmentMesh(
        vertices=tight,
        triangles=to_skin.triangles,
        flat=laid_flat(tight, to_skin.triangles),
    )
    file = outfit_from(
        {
            "version": 1,
            "garments": [{"name": "skirt", "mesh": "sewn", "material": {"thickness": 0.004}}],
        }
    )
    made = {"colliders": avatar.colliders, "meshes": {"skirt": mesh}}
    (as_cut,) = make_outfit(file, body, **made, as_cut=True).garments
    (let_out,) = make_outfit(file, body, **made).garments
    assert np.array_equal(as_cut.flat, mesh.flat)
    assert np.array_equal(as_cut.vertices, let_out.vertices)
    stretched = Measured.of(as_cut).strain(as_cut.vertices)
    stays = Measured.of(let_out).strain(let_out.vertices)
    assert np.percentile(stretched, 95) > 0.05
    assert np.percentile(stays, 95) < 0.01
    # Nowhere else: what lies free of the body keeps its size.
    stays_there = (np.abs(as_cut.vertices - mesh.vertices) < 1e-7).all(axis=1)
    free = stays_there[mesh.triangles].all(axis=1)
    assert free.mean() > 0.1
    assert np.array_equal(let_out.flat[free], mesh.flat[free])
