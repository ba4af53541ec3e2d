"""The exact skin as a collider of a set: described, posed from frames, met by cloth."""

import json

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.cli import main as cli
from garment_sim_ros.colliders.description import from_json, load_colliders, to_json
from garment_sim_ros.colliders.exact_mesh import fit_mesh
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.mesh.skin import SkinContact
from garment_sim_ros.contact.mesh.skinned import SkinnedMesh
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError, MessageError, ParameterError
from garment_sim_ros.garment.garment import Garment, without_bones
from garment_sim_ros.params import Material
from garment_sim_ros.sim.simulation import Simulation

RADIUS = 0.1


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin:vertices=1000")


def ball_set(**changes):
    """A ball on one frame."""
    ball = trimesh.creation.icosphere(3, radius=RADIUS)
    geometry = {
        "vertices": np.array(ball.vertices),
        "triangles": np.array(ball.faces),
        "frame": np.zeros((len(ball.vertices), 1), np.int32),
        "weight": np.ones((len(ball.vertices), 1)),
        "bind": np.eye(4)[None, :3],
    }
    mesh = Collider(name="skin", kind="mesh", bone="bone", geometry={**geometry, **changes})
    frame = Collider(name="frame_bone", kind="frame", bone="bone")
    return ColliderSet(colliders=(frame, mesh))


def poses_at(*position):
    poses = ColliderPoses.identity(2)
    poses.position[0] = position
    return poses


def cloth(size=15):
    side = np.linspace(-0.12, 0.12, size)
    x, y = np.meshgrid(side, side)
    vertices = np.column_stack([x.ravel(), y.ravel(), np.full(size * size, RADIUS + 0.01)])
    i = np.arange(size * size).reshape(size, size)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Garment.from_mesh(vertices, triangles, material=Material(friction=0.5), bone="bone")


def test_frames_carry_the_skin_as_the_rig_does(body):
    colliders = fit_mesh(body)
    read = from_json(to_json(colliders))
    assert read.revision == colliders.revision
    rng = np.random.default_rng(0)
    kinematics = ForwardKinematics(body.rig)
    for scale in (0.0, 0.5):
        T = kinematics.from_dofs(scale * rng.normal(size=len(body.rig.dofs)))
        expected = skin_vertices(body.skin, T)
        # Shapes taken away do not change which frames are meant.
        for given in (colliders, read, without_bones(read, ["no such bone"])):
            posed = SkinnedMesh.only(given).vertices(ColliderPoser(given, body).poses(T))
            np.testing.assert_allclose(posed, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bind": np.zeros((2, 3, 4))}, "bind has shape"),
        ({"frame": np.full((642, 1), 3)}, "frame must be indices"),
        ({"triangles": [[0, 1, 642]]}, "triangles must be indices"),
        ({"triangles": np.zeros((0, 3))}, "triangles has shape"),
        ({"weight": np.full((642, 1), 0.5)}, "sum to 1"),
        ({"weight": np.ones((641, 1))}, "weight has shape"),
        ({"vertices": "text"}, "needs numbers"),
    ],
)
def test_what_cannot_be_posed_is_refused_by_name(changes, message):
    with pytest.raises(GeometryError, match=message):
        Simulation((cloth(),), ball_set(**changes), solver="relaxation")
    if not isinstance(changes.get("vertices"), str):
        with pytest.raises(MessageError, match=message):
            from_json(to_json(ball_set(**changes)))


def test_a_mesh_is_alone_and_only_for_the_relaxation_solver():
    both = (
        *ball_set().colliders,
        Collider(name="s", kind="sphere", bone="bone", geometry={"radius": 1}),
    )
    with pytest.raises(GeometryError, match="only shape of its set"):
        Simulation((cloth(),), ColliderSet(colliders=both), solver="relaxation")
    with pytest.raises(ParameterError, match="relaxation"):
        Simulation((cloth(),), ball_set(), solver="xpbd")


def test_cloth_lies_on_the_skin_and_rides_it():
    simulation = Simulation((cloth(),), ball_set(), solver="relaxation")
    here = poses_at(0.0, 0.0, 0.0)
    simulation.reset(here)
    for _ in range(12):
        simulation.advance(here, here, 1 / 60)
    thickness = Material().thickness
    away = np.linalg.norm(simulation.positions("cloth"), axis=1)
    # Facets of the ball lie up to 0.4 mm within its radius.
    assert away.min() > RADIUS + thickness - 6e-4
    assert simulation.health("cloth").contacts > 20
    # Three metres away, and the ball moves by a fifth of itself per frame from below.
    for n in range(10):
        there = poses_at(0.0, 0.0, 0.02 * (n + 1))
        simulation.advance(here, there, 1 / 60)
        here = there
    away = np.linalg.norm(simulation.positions("cloth") - here.position[0], axis=1)
    assert away.min() > RADIUS + thickness - 6e-4


def test_a_limb_that_passes_in_one_step_takes_particles_along():
    contact = SkinContact(ball_set())
    x = np.random.default_rng(0).uniform([-0.05, -0.05, 0.3], [0.05, 0.05, 0.35], (50, 3))
    x = x.astype(np.float32)
    contacts = Contacts.room_for(len(x), 0)
    contact.move(poses_at(0.0, 0.0, 0.0), poses_at(0.0, 0.0, 1.0), np.zeros(3))
    count, carry = contact.meet(x, x.copy(), 0.002, 0.0, contacts)
    assert count == len(x)
    assert (x[:, 2] > 1.07).all()
    np.testing.assert_allclose(carry[:, :, 3], np.tile([0.0, 0.0, 1.0], (len(x), 1)), atol=1e-6)
    np.testing.assert_array_equal(contacts.shape, np.arange(len(x)))


@pytest.mark.parametrize("friction", [0.0, 0.3, 5.0])
def test_friction_takes_what_coulomb_allows_of_the_slip(friction):
    contact = SkinContact(ball_set())
    still = poses_at(0.0, 0.0, 0.0)
    contact.move(still, still, np.zeros(3))
    start = np.array([[0.0, 0.0, RADIUS + 0.002]], np.float32)
    x = start + np.array([[0.001, 0.0, -0.001]], np.float32)
    contact.meet(x, start, 0.002, friction, Contacts.room_for(1, 0))
    slipped = x[0, 0] - start[0, 0]
    # Facets lean by up to a quarter of what they are pushed.
    assert slipped == pytest.approx(0.001 * max(0.0, 1.0 - friction), abs=2.5e-4)


def test_a_turning_skin_carries_what_holds_to_it():
    contact = SkinContact(ball_set())
    end = poses_at(0.0, 0.0, 0.0)
    end.orientation[0] = Rotation.from_rotvec([0.0, 0.01, 0.0]).as_quat()
    contact.move(poses_at(0.0, 0.0, 0.0), end, np.zeros(3))
    start = np.array([[0.0, 0.0, RADIUS + 0.001]], np.float32)
    x = start - np.array([[0.0, 0.0, 0.001]], np.float32)
    contact.meet(x, start, 0.001, 5.0, Contacts.room_for(1, 0))
    assert x[0, 0] == pytest.approx(0.01 * RADIUS, abs=2.5e-4)


def test_fit_writes_a_mesh(tmp_path, capsys):
    out = tmp_path / "m.json"
    words = ["fit", "mannequin:vertices=1000", "--method", "mesh", "--out", str(out), "--json"]
    assert cli.main([*words, "--preview", str(tmp_path / "m.png")]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert summary["colliders"]["mesh"] == 1
    assert summary["outside_mm_max"] == summary["volume_excess"] == 0.0
    colliders = load_colliders(out)
    assert len(colliders.colliders[-1].geometry["vertices"]) == summary["vertices"]
