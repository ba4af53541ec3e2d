"""Preset `auto` in a node: the stepper's frames, without any node or clock."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")
import garment_sim_ros as gs
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import ClothNodeParameters, ImplicitSettings, XpbdSettings
from garment_sim_ros.recording.worn_watch import WornWatch
from garment_sim_ros.ros import pace as module
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.ros.garment_quality import GarmentQuality
from garment_sim_ros.ros.pace import Pace, check_pace
from garment_sim_ros.sim.auto.levels import LEVELS, START
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import longest_step
from garment_sim_ros.sim.strain import StrainMeter

SECOND = 10**9
FRAME = SECOND // 60
AT_FIRST = [level.name for level in LEVELS].index(START)


class Run:
    """A sheet over a ball that moves evenly; each frame takes as long as one says."""

    def __init__(self, monkeypatch, preset="auto", **parameters):
        self.p = ClothNodeParameters(delay=0.0, **parameters)
        self.now, self.log, self.asked = 0.0, [], []
        monkeypatch.setattr(
            module, "time", SimpleNamespace(perf_counter=lambda: self.now), raising=True
        )
        ball = gs.ColliderSet.of(gs.sphere(0.1))
        self.simulation = Simulation(
            gs.Garment.sheet(0.4, 0.4, edge=0.1, at=(0.0, 0.0, 0.12)),
            ball,
            solver_step=longest_step("xpbd", self.p.solver_step),
        )
        advance = self.simulation.advance

        def watched(start, end, dt=None):
            step = self.simulation.solver_step if dt is None else dt
            steps = math.ceil(step / self.simulation.solver_step - 1e-6)
            self.asked.append((step, steps, self.simulation.parameters.settings.sub_step))
            advance(start, end, dt)

        self.simulation.advance = watched
        self.stepper = ClothStepper.with_parameters(self.simulation, self.p)
        self.pace = Pace(self.stepper, self.p, preset, self.log.append, LEVELS)
        self.stamp = 0
        for _ in range(2):
            self.frame(0.0, frames=0)

    def frame(self, took, *, frames=1, waited=0.0):
        """One that takes so long [ms]; so many are due."""
        for _ in range(frames):
            self.stamp += FRAME
            poses = self.simulation.collider_set.poses()
            poses.position[:, 0] = 0.2 * self.stamp / SECOND
            self.stepper.add(self.stamp, poses, self.stamp)
        if not self.stepper.has_poses:
            self.stepper.add(0, self.simulation.collider_set.poses(), 0)
        self.asked.clear()
        ticker = SimpleNamespace(is_simulated=False, now=lambda: round(1e6 * waited))
        self.pace.wait(ticker, 0)
        self.pace.begin()
        moved = self.stepper.advance(self.pace.look(self.stepper.target(self.stamp)))
        self.now += took / 1e3
        self.pace.end(moved=moved)

    @property
    def level(self):
        return self.pace.figures()["auto_level"]


def test_frames_over_the_budget_make_it_fall_and_calm_makes_it_come_back(monkeypatch):
    run = Run(monkeypatch)
    assert run.pace.figures()["frame_budget_ms"] == pytest.approx(0.7 * 1e3 / 60)
    for _ in range(10):
        run.frame(3.0)
    assert run.level == AT_FIRST
    assert [steps for _, steps, _ in run.asked] == [1]
    for _ in range(4):
        run.frame(20.0)
    assert run.level == 0
    told = run.pace.figures()
    assert told["auto_name"] == "fast"
    assert "frames take 20 ms of 11.7 ms" in told["auto_cause"]
    assert "from balanced to" in run.log[-1]
    run.frame(2.0)
    # All that is due is one step, of nine sub-steps now.
    assert [(round(60 * 9 * sub, 6), steps) for _, steps, sub in run.asked] == [(1.0, 1)]
    assert run.asked[0][0] == pytest.approx(1 / 60, rel=1e-4)
    for _ in range(60 * 40):
        run.frame(0.5)
        if run.level == len(LEVELS) - 1:
            break
    assert run.level == len(LEVELS) - 1
    assert run.stepper.skipped == 0
    assert run.stepper.resets == 0


def test_what_was_waited_counts(monkeypatch):
    run = Run(monkeypatch)
    for _ in range(6):
        run.frame(6.0, waited=6.0)
    assert run.level < AT_FIRST


def in_two_parts(run, ahead, rest, late=0.0):
    """A frame worked at before it was due [ms], and after; the first part ends `late` [ms]."""
    run.stamp += FRAME
    run.stepper.add(run.stamp, run.simulation.collider_set.poses(), run.stamp)
    clock = SimpleNamespace(is_simulated=False, now=lambda: round(1e9 * run.now))
    due = round(1e9 * run.now) + FRAME
    run.now = 1e-9 * (due + round(1e6 * (late - ahead)))
    run.pace.begin()
    moved = run.stepper.advance(run.pace.look(run.stepper.target(run.stamp)))
    run.now += ahead / 1e3
    run.pace.rest(clock)
    run.now = max(run.now, 1e-9 * due)
    run.pace.wait(clock, due)
    run.pace.begin()
    run.now += rest / 1e3
    run.pace.end(moved=moved)


@pytest.mark.parametrize(
    ("ahead", "rest", "late", "falls"),
    [(7.0, 2.0, -8.0, False), (7.0, 2.0, 3.0, False), (10.5, 2.0, -8.0, True)],
)
def test_work_ahead_of_a_frame_counts_once(monkeypatch, ahead, rest, late, falls):
    """11.7 ms are allowed: idle time before the frame is due is no work, nor work a wait."""
    run = Run(monkeypatch)
    for _ in range(10):
        in_two_parts(run, ahead, rest, late)
    assert (run.level < AT_FIRST) == falls


def test_time_and_motion_are_the_same_at_any_level(monkeypatch):
    """The cloth's time is that of the poses, whole steps of the node, at each level."""
    for level in range(len(LEVELS)):
        run = Run(monkeypatch)
        run.pace._pacer._controller.level = level
        run.pace.apply()
        for _ in range(20):
            run.frame(6.0)
            assert run.level == level
        quantum = round(run.p.solver_step * SECOND)
        assert 0 <= run.stamp - run.stepper.time < quantum
        assert run.simulation.time == pytest.approx(run.stepper.time / SECOND, rel=1e-5)


def test_where_much_is_due_it_is_at_the_floor_in_that_frame_and_nothing_else_is_coarse(
    monkeypatch,
):
    run = Run(monkeypatch)
    coarse = []
    run.simulation.advance_coarsely = lambda *of: coarse.append(of)
    for _ in range(5):
        run.frame(1.0)
    run.frame(1.0, frames=9)  # 150 ms: more than catch_up
    assert run.level == 1
    assert {round(60 * 9 * sub, 6) for _, _, sub in run.asked} == {1.0}
    assert "the cloth is behind" in run.log[-1]
    assert run.stepper.lag > 0
    assert run.stepper.coarse == 0
    for _ in range(10):
        run.frame(1.0)
    assert run.stepper.lag == 0
    assert coarse == []


def test_frames_that_stand_or_put_on_do_not_count(monkeypatch):
    run = Run(monkeypatch)
    run.stepper.restart()
    for _ in range(6):
        run.frame(100.0, frames=0)
    assert run.level == AT_FIRST


def test_other_presets_and_poses_are_left_alone(monkeypatch):
    for options in ({"preset": "balanced"}, {"step_on": "poses"}):
        run = Run(monkeypatch, **options)
        before = run.simulation.parameters
        for _ in range(10):
            run.frame(50.0)
        assert run.pace.figures() == {}
        assert run.simulation.parameters is before
    assert run.log == [module._NOT]


def test_the_budget_may_be_set(monkeypatch):
    run = Run(monkeypatch)
    run.pace.take(ClothNodeParameters(frame_budget_ms=20.0))
    for _ in range(10):
        run.frame(15.0)
    assert run.level == AT_FIRST


def test_what_it_moves_is_refused_and_nothing_else():
    p = ClothNodeParameters()
    check_pace("auto", XpbdSettings(), p)
    check_pace("auto", XpbdSettings(strain_limit=0.1, coarse=True), p)
    check_pace("auto", XpbdSettings(), ClothNodeParameters(solver_step=0.01))
    check_pace("fast", XpbdSettings(sub_step=0.001), p)
    check_pace("auto", XpbdSettings(sub_step=0.001), ClothNodeParameters(step_on="poses"))
    wrong = [
        (XpbdSettings(sub_step=0.001), p),
        (XpbdSettings(iterations=2), p),
        (ImplicitSettings(), p),
    ]
    for settings, parameters in wrong:
        with pytest.raises(
            ParameterError, match=r"preset auto (cannot control|controls it); allowed"
        ):
            check_pace("auto", settings, parameters)


def test_the_same_frames_give_the_same_cloth(monkeypatch):
    found = []
    for _ in range(2):
        run = Run(monkeypatch)
        for n in range(120):
            run.frame(12.0 if 20 < n < 30 else 1.0)
        found.append(run.simulation.positions("sheet").tobytes())
    assert found[0] == found[1]
    assert np.isfinite(np.frombuffer(found[0], np.float32)).all()


@pytest.mark.parametrize("share", [1.0, 0.25])
def test_quality_tells_the_strain_of_what_is_simulated_now(share):
    """Half of a sheet's edges are along x; that is made twice as wide."""
    sheet = gs.Garment.sheet(1.0, 1.0, edge=0.05)
    simulation = Simulation(sheet, gs.ColliderSet.of())
    watch = WornWatch(simulation.collider_set, load_body("mannequin"), [sheet])
    quality = GarmentQuality("sheet", simulation, watch)
    simulation.step()
    for now in (0.25, share):
        simulation.detail = now
        simulation.state("sheet").x[:, 0] *= 2.0
        told = {v.key: float(v.value) for v in quality.status({}, resets=0).values}
        strain = StrainMeter(simulation.model("sheet")).read(simulation.state("sheet"))
        assert told["strain_p95"] == pytest.approx(strain.p95, abs=1e-3)
        assert told["strain_max"] == pytest.approx(1.0, abs=0.05)
        simulation.state("sheet").x[:, 0] /= 2.0
