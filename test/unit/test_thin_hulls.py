"""Hulls of slices of skin get more of the body's inside; their cores are under the skin."""

import numpy as np
import pytest
import trimesh

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.hulls.hull import convex_hull
from garment_sim_ros.colliders.hulls.one_hull import Content, made_hull
from garment_sim_ros.colliders.hulls.thickening import thickened
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.cores import Cores, middle
from garment_sim_ros.geometry.mesh_distance import MeshDistance

RADIUS = 0.2
TRUNK = ("hips", "spine", "chest", "upperChest", "leftUpperLeg", "rightUpperLeg")


@pytest.fixture(scope="module")
def ball():
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32)


def depth(inner):
    """Least distance of the core to the surface of the collider that is made of a hull [m]."""
    content = Content("part", "hips", np.eye(4), inner, inner.vertices)
    hull = made_hull(content, HullSettings()).hull
    return -float(hull.height(middle(hull.vertices)).max())


@pytest.mark.parametrize("turn", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (-0.6, 0.64, 0.48)])
def test_a_slice_of_a_ball_gets_more_of_its_inside(ball, turn):
    vertices, triangles = ball
    thin = convex_hull(vertices[vertices @ np.array(turn) > 0.85 * RADIUS])
    assert depth(thin) < 0.003
    thick = thickened(thin, MeshDistance(vertices, triangles))
    assert depth(thick) > 0.005
    assert thick.height(thin.vertices).max() < 1e-9
    assert np.linalg.norm(thick.vertices, axis=1).max() <= RADIUS + 1e-9
    assert (thick.vertices @ np.array(turn)).min() > 0.0


def test_what_is_thick_stays_as_it_is(ball):
    vertices, triangles = ball
    half = convex_hull(vertices[vertices[:, 2] > 0.0])
    assert thickened(half, MeshDistance(vertices, triangles)) is half


@pytest.mark.parametrize("name", ["mannequin", "mh_female_young.glb"])
def test_cores_of_the_trunk_are_under_the_skin(name, data_file):
    # Two slices of this woman's buttocks had cores that came out of them by 11 mm.
    body = load_body(name if name == "mannequin" else data_file("bodies", name))
    colliders = fit_colliders(body)
    cores = Cores.of(colliders)
    poses = ColliderPoser(colliders, body).poses(rest_transforms(body.rig))
    skin = MeshDistance(body.skin.vertices, body.skin.triangles)
    trunk = {body.humanoid[bone] for bone in TRUNK if bone in body.humanoid}
    ends = cores.posed(poses)[[bone in trunk for bone in cores.bone]]
    share = np.linspace(0.0, 1.0, 9)[:, None]
    points = np.concatenate([(1.0 - share) * a + share * b for a, b in ends])
    assert skin.signed_distance(points)[0].max() < 0.0
