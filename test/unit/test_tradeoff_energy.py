"""Energy drift: cases of known answer, and what the solvers lose in motion without losses."""

from dataclasses import replace

import numpy as np
import pytest

from garment_sim_ros.constants import GRAVITY
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import Material
from garment_sim_ros.sim.elastic import ElasticEdges
from garment_sim_ros.sim.energy import Elastic, energies
from garment_sim_ros.sim.model import build_model
from garment_sim_ros.tradeoff import scenes
from garment_sim_ros.tradeoff.energy import drift, energy_drift, undamped
from garment_sim_ros.tradeoff.points import Point, preset_point

DOWN = np.array([0.0, 0.0, -GRAVITY])
PAIR = Elastic(np.array([[0, 1]], np.int32), np.array([1.0]), np.array([300.0]))
MASS = np.array([1.0, 0.2])
XPBD = Point(kind="plain", solver="xpbd", sub_steps=8, passes=1)


def swung(stiffness, seconds=1.0, h=2e-5):
    """A pendulum of two particles, the first one held, from the horizontal; velocity Verlet."""
    pair = PAIR._replace(stiffness=np.array([stiffness]))
    x, v = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.zeros((2, 3))

    def pull(x):
        length = np.linalg.norm(x[1])
        return DOWN - stiffness * (length - 1.0) * x[1] / length / MASS[1]

    rows, a = [energies(MASS, DOWN, pair, x, v)], pull(x)
    for n in range(round(seconds / h)):
        v[1] += 0.5 * h * a
        x[1] += h * v[1]
        a = pull(x)
        v[1] += 0.5 * h * a
        if n % 500 == 499:
            rows.append(energies(MASS, DOWN, pair, x, v))
    return np.array(rows)


def sheet(pins="top corners", **material):
    """A sheet of 25 vertices, 0.6 s long."""
    of = {"width": 0.4, "height": 0.4, "edge": 0.1, "pins": pins}
    scene = scenes.Scene(text="", seconds=0.6, still=0.5, sheet=of | {"material": material})
    return scenes.staged(scene)


class TestKnown:
    @pytest.mark.parametrize("stiffness", [20.0, 3000.0])
    def test_a_pendulum_keeps_its_energy(self, stiffness):
        rows = swung(stiffness)
        assert abs(drift(rows)) < 1e-6
        # It does swing: nearly all of what it falls by becomes speed.
        assert np.ptp(rows[:, 1]) > 0.9 * MASS[1] * GRAVITY
        assert rows[:, 0].max() > 0.5 * np.ptp(rows[:, 1])

    def test_a_stretched_spring_at_rest_has_what_it_stores_and_no_drift(self):
        x = np.array([[0.0, 0.0, 0.0], [1.1, 0.0, 0.0]])
        row = energies(MASS, np.zeros(3), PAIR, x, np.zeros((2, 3)))
        assert row == pytest.approx([0.0, 0.0, 0.5 * 300.0 * 0.1**2])
        assert drift(np.array([row] * 5)) == 0.0

    def test_free_fall_has_no_drift_and_one_that_is_braked_has_what_it_lost(self):
        rows = []
        for t in np.linspace(0.0, 0.5, 30):
            x = np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0]]) + 0.5 * DOWN * t**2
            rows.append(energies(MASS, DOWN, PAIR, x, np.array([DOWN * t] * 2)))
        assert abs(drift(np.array(rows))) < 1e-12
        rows[-1][0] *= 0.75
        assert drift(np.array(rows)) == pytest.approx(-0.25)

    def test_what_is_made_is_above_zero(self):
        rows = np.array([[0.0, 1.0, 0.0], [0.5, 0.5, 0.0], [1.2, 0.0, 0.0]])
        assert drift(rows) == pytest.approx(0.2 / 1.2)

    def test_not_a_number_is_none(self):
        assert np.isnan(drift(np.array([[0.0, 1.0, 0.0], [np.nan, 0.0, 0.0]])))


class TestElastic:
    FABRIC = Material(stretch_stiffness_warp=900.0, stretch_stiffness_weft=400.0)

    CLOTH = Garment.sheet(0.4, 0.4, edge=0.1, upright=True)

    def model(self, elastic=None, **values):
        fabric = replace(self.FABRIC, shear_stiffness=0.0, poisson_ratio=0.0, **values)
        return build_model("a", self.CLOTH.vertices, self.CLOTH.triangles, fabric, elastic=elastic)

    @pytest.mark.parametrize(("axis", "stiffness"), [(2, 900.0), (0, 400.0)])
    @pytest.mark.parametrize("kind", ["springs", "triangles"])
    def test_a_sheet_pulled_along_its_threads_stores_their_energy(self, kind, axis, stiffness):
        """Half of stiffness times squared strain, per area."""
        model = self.model(bending_stiffness=0.0)
        elastic, x = Elastic.of(model, kind), model.rest.copy()
        assert elastic.energy(x) == pytest.approx(0.0, abs=1e-12)
        x[:, axis] *= 1.02
        assert elastic.energy(x) == pytest.approx(0.5 * stiffness * 0.02**2 * 0.16, rel=0.02)

    @pytest.mark.parametrize("kind", ["springs", "triangles"])
    def test_a_band_stores_its_work_beside_the_cloth(self, kind):
        """From slack at s of length l, tension T at l: T / (1 - s) / l / 2 (length - s l)^2."""
        edges = mesh_topology(self.CLOTH.triangles).edges
        way = np.diff(self.CLOTH.vertices[edges], axis=1)[:, 0]
        edges = edges[np.abs(way[:, 0]) < 1e-9][:3].astype(np.int32)
        tension, slack, pulled = 5.0, 0.8, 1.1
        bands = ElasticEdges(edges, np.full(3, tension), np.full(3, slack))
        gained = []
        for elastic in (None, bands):
            model = self.model(elastic)
            stored, x = Elastic.of(model, kind), model.rest.copy()
            before = stored.energy(x)
            x[:, 2] *= pulled
            gained.append(stored.energy(x) - before)
        one = tension / (1.0 - slack) * 0.1 / 2.0 * ((pulled - slack) ** 2 - (1.0 - slack) ** 2)
        assert gained[1] - gained[0] == pytest.approx(3.0 * one, rel=1e-4)

    def test_a_bent_sheet_stores_half_of_its_rigidity_times_squared_curvature(self):
        model = self.model(bending_stiffness=0.01)
        flat, x, radius = model.rest, model.rest.copy(), 2.0
        x[:, 0] = radius * np.sin(flat[:, 0] / radius)
        x[:, 1] = radius * (1.0 - np.cos(flat[:, 0] / radius))
        none = np.zeros(0)
        soft = Elastic.of(model, "springs")._replace(
            edges=np.zeros((0, 2), np.int32), length=none, stiffness=none
        )
        # A border has no hinges.
        whole = 0.5 * 0.01 * (1.0 / radius) ** 2 * 0.16
        assert 0.6 * whole < soft.energy(x) < 1.3 * whole


class TestSolvers:
    @pytest.mark.parametrize("sub_steps", [2, 8, 32])
    def test_free_fall_loses_what_symplectic_steps_lose(self, sub_steps):
        """v' = v + h g, x' = x + h v': of energy h / (T + h), T the time of the fall.

        Many short steps round off a ten-thousandth in single precision.
        """
        h = 1 / 60 / sub_steps
        for solver in ("xpbd", "implicit"):
            point = replace(XPBD, solver=solver, sub_steps=sub_steps, passes=1)
            found = energy_drift(sheet(pins=()), point)
            assert found == pytest.approx(-h / (0.6 + h), rel=0.02, abs=2e-4), solver

    @pytest.mark.parametrize("kind", ["springs", "triangles"])
    def test_shorter_sub_steps_lose_less(self, kind):
        losses = [
            energy_drift(sheet(), replace(XPBD, sub_steps=n, membrane=kind)) for n in (8, 32, 128)
        ]
        assert losses[0] < 1.5 * losses[1] < 2.0 * losses[2] < 0.0
        assert losses[2] > -0.25

    def test_damping_air_and_friction_are_taken_out(self):
        lossy = sheet(damping=20.0, air_drag=2.0, friction=1.0)
        wind = {"wind": (3.0, 0.0, 0.0), "wind_drag": 1.2}
        lossy = replace(lossy, scene=replace(lossy.scene, environment=wind))
        found = undamped(lossy)
        fabric = found.garments[0].material
        assert (fabric.damping, fabric.air_drag, fabric.friction) == (0.0, 0.0, 0.0)
        assert energy_drift(lossy, XPBD) == energy_drift(sheet(damping=0.0), XPBD)

    def test_a_solver_that_throws_the_cloth_makes_energy(self, monkeypatch):
        from garment_sim_ros.sim.simulation import Simulation

        advance = Simulation.advance

        def thrown(self, *args):
            advance(self, *args)
            self.state("sheet").v[:] *= np.float32(1.05)

        monkeypatch.setattr(Simulation, "advance", thrown)
        assert energy_drift(sheet(), replace(XPBD, sub_steps=32)) > 0.5

    def test_presets_and_implicit_have_one_and_relaxation_has_none(self):
        assert energy_drift(sheet(), replace(XPBD, solver="implicit", passes=8)) < 0.0
        assert energy_drift(sheet(), preset_point("accurate", 1 / 60, "plain")) < 0.0
        assert energy_drift(sheet(), replace(XPBD, solver="relaxation", passes=3)) is None
        assert energy_drift(sheet(), preset_point("sun2007", 0.033, "plain")) is None
