"""Signed-distance colliders of whole bodies: everything contained, joints, files."""

import dataclasses
import json

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.collider_params import SdfSettings
from garment_sim_ros.colliders.description import from_json, to_json
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.report.fit_report import skin_distance
from garment_sim_ros.colliders.report.motion_report import motion_report
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.colliders.signed_distance import fit_signed_distances
from garment_sim_ros.contact.kinds.distance_grid import DistanceGrid
from garment_sim_ros.errors import GeometryError, MessageError, ParameterError
from garment_sim_ros.geometry.closest_sweep import grid_distances
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.transforms import invert_transform
from garment_sim_ros.params import ColliderOptions

COARSE = SdfSettings(voxel=0.02)
"""An eighth of the samples."""


@pytest.fixture(scope="module")
def mannequin():
    return load_body("mannequin:vertices=1500")


@pytest.fixture(scope="module")
def fit(mannequin):
    return fit_signed_distances(mannequin, COARSE)


def test_the_skin_is_inside_and_near_the_surface(mannequin, fit):
    assert all(shape.outside == 0 for shape in fit.shapes)
    distance = skin_distance(mannequin, fit.colliders)
    assert distance.max() < 0.0
    assert -0.003 < np.median(distance) < -0.001
    assert distance.min() > -0.012
    count = sum(c.kind != "frame" for c in fit.colliders.colliders)
    assert len(fit.report()) == len(fit.shapes) == count


def test_a_body_from_a_file(data_file):
    body = load_body(data_file("bodies", "CesiumMan.glb"))
    distance = skin_distance(body, fit_signed_distances(body, SdfSettings(voxel=0.015)).colliders)
    assert distance.max() < 0.0
    assert np.median(distance) > -0.005


def bent(body, name, degrees):
    """World transforms of the bind pose with one joint and all below it turned about y."""
    T = invert_transform(body.skin.T_bone_bind)
    turn = np.radians(degrees)
    R = np.eye(4)
    R[:3, :3] = [
        [np.cos(turn), 0.0, np.sin(turn)],
        [0.0, 1.0, 0.0],
        [-np.sin(turn), 0.0, np.cos(turn)],
    ]
    top = body.rig.index(name)
    at = np.eye(4)
    at[:3, 3] = T[top, :3, 3]
    below = {top}
    for joint in range(top + 1, len(T)):
        if int(body.rig.parent[joint]) in below:
            below.add(joint)
    for joint in below:
        T[joint] = at @ R @ invert_transform(at) @ T[joint]
    return T


def test_a_joints_grid_closes_the_gap_at_a_bent_knee(mannequin, fit):
    pose = bent(mannequin, "leftLowerLeg", 100.0)
    plain = fit_signed_distances(mannequin, COARSE, bend=False)
    assert len(plain.shapes) < len(fit.shapes)
    bare, covered = (
        motion_report(mannequin, c, [pose])["outside_mm_max"]
        for c in (plain.colliders, fit.colliders)
    )
    assert bare > 10.0
    assert covered < 0.3 * bare


def test_surfaces_are_closed_and_where_the_distance_is_zero(fit):
    collider = fit.colliders.colliders[0]
    grid = DistanceGrid.of(collider.geometry)
    fine, coarse = surface(collider), surface(collider, finest=0.05)
    assert len(coarse[1]) < 0.3 * len(fine[1])
    for (x, triangles), off in ((fine, 0.1 * grid.cell), (coarse, 0.015)):
        edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], -1), -1)
        _, count = np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)
        assert (count == 2).all()
        assert np.percentile(np.abs(grid.value(x)), 95) < off
        a, b, c = x[triangles].transpose(1, 0, 2)
        assert np.einsum("tk,tk->", a, np.cross(b, c)) > 0.0


def test_the_file_holds_every_bit(mannequin, fit):
    text = to_json(fit.colliders)
    read = from_json(text)
    assert read.revision == fit.colliders.revision
    assert to_json(read) == text
    for a, b in zip(fit.colliders.colliders, read.colliders):
        assert a.geometry.keys() == b.geometry.keys()
        if a.kind == "sdf":
            assert b.geometry["distance"].dtype == np.int16
            np.testing.assert_array_equal(a.geometry["distance"], b.geometry["distance"])
    nodes = sum(shape.nodes for shape in fit.shapes)
    assert len(text) < 3 * nodes  # 8/3 characters a sample, and some
    same = fit_colliders(mannequin, ColliderOptions(method="sdf", voxel=0.02))
    assert same.revision == read.revision


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cell": 0.0}, "cell is 0.0"),
        ({"step": "a"}, "step is 'a'"),
        ({"distance": [[1]]}, "required: ['int16', 'shape']"),
        ({"distance": {"shape": [3, 3], "int16": ""}}, "3 whole numbers"),
        ({"distance": {"shape": [3, 3, True], "int16": ""}}, "3 whole numbers"),
        ({"distance": {"shape": [3, 3, 3], "int16": "?"}}, "base64"),
        ({"distance": {"shape": [3, 3, 3], "int16": 5}}, "base64"),
        ({"distance": {"shape": [3, 3, 3], "int16": "AAAA"}}, "base64"),
        ({"distance": {"shape": [3, 3, 3], "int16": "AAA="}}, "1 samples"),
        ({"distance": {"shape": [-1, -1, 1], "int16": "AAA="}}, "1 samples"),
        ({"distance": {"shape": [1, 1, 1], "int16": "AAA="}}, "3 or more"),
        ({"more": 1}, "geometry has"),
    ],
)
def test_damaged_descriptions_are_refused(fit, change, message):
    document = json.loads(to_json(fit.colliders))
    document["colliders"][0]["geometry"].update(change)
    with pytest.raises(MessageError) as error:
        from_json(json.dumps(document))
    assert message in str(error.value)


def with_skin(body, **skin):
    return dataclasses.replace(body, skin=dataclasses.replace(body.skin, **skin))


@pytest.mark.parametrize("wrong", ["open", "inside-out", "flat", "one triangle"])
def test_bad_skins_are_contained_and_what_was_done_is_told(mannequin, wrong):
    skin = mannequin.skin
    if wrong == "open":
        body = with_skin(mannequin, triangles=skin.triangles[::2])
    elif wrong == "inside-out":
        body = with_skin(mannequin, triangles=skin.triangles[:, ::-1])
    elif wrong == "flat":
        body = with_skin(mannequin, vertices=skin.vertices * np.array([0.0, 1.0, 1.0]))
    else:
        body = with_skin(mannequin, triangles=skin.triangles[:1])
    fit = fit_signed_distances(body, COARSE, bend=False)
    used = np.unique(body.skin.triangles)
    assert skin_distance(body, fit.colliders)[used].max() < 0.0
    notes = " ".join(shape.note for shape in fit.shapes)
    told = {"inside-out": "turned", "flat": "nothing is inside", "one triangle": "nothing"}
    assert told.get(wrong, "") in notes


def test_settings_out_of_range_and_bodies_without_triangles_are_refused(mannequin):
    with pytest.raises(ParameterError, match="voxel"):
        fit_signed_distances(mannequin, SdfSettings(voxel=0.0))
    with pytest.raises(ParameterError, match="delta"):
        fit_signed_distances(mannequin, delta=-0.1)
    bare = with_skin(mannequin, triangles=np.zeros((0, 3), np.int32))
    with pytest.raises(GeometryError, match="no triangles"):
        fit_signed_distances(bare)


def test_swept_distances_are_those_of_the_mesh(mannequin):
    x = mannequin.skin.vertices
    low, cell = x.min(axis=0) - 0.1, 0.05
    count = np.ceil((x.max(axis=0) + 0.1 - low) / cell).astype(np.int64) + 1
    points = (x - low) / cell
    swept = grid_distances(points, mannequin.skin.triangles, count)
    at = np.indices(count).reshape(3, -1).T
    mesh = MeshDistance(points, mannequin.skin.triangles)
    exact = np.abs(mesh.signed_distance(at)[0]).reshape(count)
    over = swept - exact
    assert over.min() > -1e-9
    assert np.percentile(over, 99) < 0.1  # cells
    assert over.max() < 0.5
