"""Contact by the earliest hit as an option of the solver."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.contact.papers.earliest.contact import _fill
from garment_sim_ros.contact.papers.earliest.poses import PosedEllipsoids
from garment_sim_ros.contact.shapes import Collider, ColliderPoses
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.transforms import quaternion_from_matrix
from garment_sim_ros.params import Environment, RelaxationSettings, XpbdSettings
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.simulation import Simulation

RADII = np.array([0.3, 0.2, 0.1])
STILL = ColliderPoses.identity(2)


def ellipsoid(**options):
    return Collider(name="e", kind="ellipsoid", bone="bone", geometry={"radii": RADII}, **options)


def dressed(cloth, collider, height, *, settings=None, environment=None, step=1 / 180, **material):
    x, t = cloth.grid(9, 9, 0.02)
    x[:, 2] += height
    simulation = Simulation(
        (cloth.garment(x, t, thickness=0.002, **material),),
        cloth.colliders(collider),
        settings=settings or RelaxationSettings(contact="earliest"),
        environment=environment,
        solver_step=step,
        solver="relaxation",
    )
    return simulation


def zeta(x, radii):
    return ((x / radii) ** 2).sum(axis=1)


def test_cloth_comes_to_rest_on_an_ellipsoid(cloth):
    simulation = dressed(cloth, ellipsoid(), 0.13, damping=3.0, friction=0.5)
    for _ in range(360):
        simulation.advance(STILL, STILL)
        # A micrometre is what single precision leaves.
        assert zeta(simulation.positions("cloth"), RADII + 0.002).min() > 1.0 - 4e-5
    health = simulation.health("cloth")
    assert health.contacts > 30
    assert health.rms_speed < 0.02


def test_a_fast_cloth_does_not_come_out_on_the_other_side(cloth):
    """At 60 m/s it would pass the whole ellipsoid in one step; out of the union it is swept."""
    for contact in ("earliest", "union"):
        simulation = dressed(
            cloth, ellipsoid(), 0.3, settings=RelaxationSettings(contact=contact), step=1 / 60
        )
        simulation.state("cloth").v[:, 2] = -60.0
        simulation.advance(STILL, STILL)
        assert simulation.positions("cloth")[:, 2].min() > 0.0


@pytest.mark.parametrize(
    ("settings", "speed"),
    [
        ({}, 0.0),
        ({"response": "inelastic", "restitution": 0.5}, 0.0),
        ({"restitution": 0.5}, 0.5),
        ({"response": "reflection"}, 1.0),
    ],
)
def test_what_a_hit_gives_back(cloth, settings, speed):
    """Above the middle, where the ray from the centre is nearly the normal."""
    simulation = dressed(
        cloth,
        Collider(name="e", kind="sphere", bone="bone", geometry={"radius": 0.5}),
        0.51,
        settings=RelaxationSettings(contact="earliest", sweeps=1, **settings),
        environment=Environment(gravity=(0.0, 0.0, 0.0)),
    )
    simulation.state("cloth").v[:, 2] = -2.0
    simulation.advance(STILL, STILL)
    v = simulation.state("cloth").v
    middle = np.argmin(np.linalg.norm(simulation.state("cloth").x[:, :2], axis=1))
    assert v[middle, 2] == pytest.approx(2.0 * speed, abs=0.02)


def test_rides_a_turning_and_moving_collider(cloth):
    """With much friction the cloth goes where the collider takes it."""
    simulation = dressed(cloth, ellipsoid(), 0.1021, friction=10.0, damping=1.0)
    start = STILL
    for n in range(1, 31):
        a = 0.004 * n
        R = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1.0]])
        end = ColliderPoses(
            position=np.tile([0.001 * n, 0.0, 0.0], (2, 1)),
            orientation=np.tile(quaternion_from_matrix(R), (2, 1)),
        )
        simulation.advance(start, end)
        start = end
    x = simulation.positions("cloth")
    middle = x[40]
    assert middle[:2] == pytest.approx([0.03, 0.0], abs=2e-3)
    along = x[76] - x[40]  # along x at first
    assert np.arctan2(along[1], along[0]) == pytest.approx(0.12, abs=0.02)


def test_only_where_it_is_asked_for_and_possible(cloth):
    simulation = dressed(cloth, ellipsoid(), 0.2, settings=RelaxationSettings())
    simulation.advance(STILL, STILL)
    assert simulation["cloth"].worn.workspace.earliest is None
    earliest = Parameters(
        environment=Environment(), settings=RelaxationSettings(contact="earliest")
    )
    tetrahedron = {"vertices": np.vstack([np.zeros(3), np.eye(3)])}
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    rigid = {"frame": np.zeros((4, 1)), "weight": np.ones((4, 1)), "bind": np.eye(4)[None, :3]}
    for kind, geometry in (
        ("capsule", {"radius0": 0.1, "radius1": 0.1, "length": 0.2}),
        ("hull", {**tetrahedron, "faces": faces}),
        ("mesh", {**tetrahedron, "triangles": faces, **rigid}),
    ):
        other = Collider(name="c", kind=kind, bone="bone", geometry=geometry)
        with pytest.raises(ParameterError, match=f"contact: found 'earliest' with {kind}"):
            dressed(cloth, other, 0.2)
        simulation = dressed(cloth, other, 0.2, settings=RelaxationSettings())
        with pytest.raises(ParameterError, match=kind):
            simulation.parameters = earliest
        assert simulation.parameters.settings.contact == "union"
    assert not hasattr(XpbdSettings(), "contact")


def test_tables_of_a_step_are_those_of_its_ends(cloth):
    """Shapes where they were and are, larger by the cloth's thickness."""
    rng = np.random.default_rng(2)
    ball = Collider(name="b", kind="sphere", bone="bone", geometry={"radius": 0.07})
    state = ColliderState.of(cloth.colliders(ellipsoid(), ball))
    state.origin[:] = 0.5, -0.25, 1.0
    ends = []
    for poses in (state.start, state.end):
        poses.position[:] = rng.normal(size=poses.position.shape)
        turn = Rotation.random(len(poses.position), rng)
        poses.orientation[:] = turn.as_quat()
        solid = state.shapes.collider
        ends.append(
            PosedEllipsoids(
                poses.position[solid] - state.origin,
                turn.as_matrix()[solid],
                np.stack([RADII, np.full(3, 0.07)]) + 0.002,
            ).table()
        )
    state.pose()
    found = np.zeros((2, 2, 15))
    _fill(state.shapes, state.posed, 0.002, *found)
    # Poses are in single precision; the maps to the unit ball are up to 10 / m.
    np.testing.assert_allclose(found, ends, atol=1e-5)
