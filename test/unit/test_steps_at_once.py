"""Steps of a node that follow each other are one of the simulation, as far as a solver allows."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy")
import garment_sim_ros as gs
from garment_sim_ros.params import ClothNodeParameters
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.sim.solvers import SOLVERS, longest_step
from garment_sim_ros.sim.solvers.xpbd import workspace
from garment_sim_ros.sim.solvers.xpbd.given import Given

SECOND = 10**9
COLLIDERS = gs.ColliderSet.of(gs.sphere(0.1))


def pose_at(stamp):
    poses = COLLIDERS.poses()
    poses.position[:, 0] = 0.05 * np.sin(6.0 * stamp / SECOND)
    return poses


def simulation(**options):
    sheet = gs.Garment.sheet(0.4, 0.4, edge=0.04, at=(0.031, 0.017, 0.13))
    return gs.Simulation(sheet, COLLIDERS, **options)


def stepped(stamps, solver="xpbd"):
    """A simulation that a node's stepper led through stamps, and the times of its steps [s]."""
    p = ClothNodeParameters(delay=0.0)
    made = simulation(solver=solver, solver_step=longest_step(solver, p.solver_step))
    stepper, times, advance = ClothStepper.with_parameters(made, p), [], made.advance

    def watched(start, end, dt):
        times.append(dt)
        advance(start, end, dt)

    made.advance = watched
    for stamp in stamps:
        stepper.add(stamp, pose_at(stamp), stamp)
        stepper.advance(stamp)
    return made, times


FRAMES = [round(n * SECOND / 60) for n in range(60)]


def test_a_frame_is_one_step_and_its_cloth_that_of_the_simulation_by_itself():
    made, times = stepped(FRAMES)
    np.testing.assert_allclose(times, 1 / 60, rtol=1e-6)
    made, _ = stepped(FRAMES[:20])
    alone = simulation()
    for stamp in FRAMES[:20]:
        alone.step(pose_at(stamp), dt=1 / 60)
    assert np.ptp(made["sheet"].positions[:, 2]) > 0.03, "it hangs over the ball"
    # A step is rounded to nanoseconds; cloth that slides makes more of that.
    np.testing.assert_allclose(made["sheet"].positions, alone["sheet"].positions, atol=2e-4)


@pytest.mark.parametrize("solver", SOLVERS)
def test_solvers_whose_result_depends_on_the_step_take_each_by_itself(solver):
    _, times = stepped(FRAMES[:10], solver)
    one = solver == "xpbd"
    np.testing.assert_allclose(times, 1 / 60 if one else 1 / 180, rtol=1e-6)


def test_sub_steps_are_as_long_in_a_part_of_a_frame_and_nothing_is_prepared_anew(monkeypatch):
    """Poses come in thirds and two thirds of a frame: springs are those of one sub-step."""
    third = SECOND / 180
    stamps = np.cumsum([0] + [third, 2 * third, 3 * third, third] * 8)
    made, times = stepped([round(s) for s in stamps])
    assert {round(180 * dt) for dt in times} == {1, 2, 3}
    prepared = []
    monkeypatch.setattr(workspace, "prepare_hinges", lambda *given: prepared.append(given[5]))
    for k in (1, 2, 3):
        made.advance(pose_at(0), pose_at(0), k * 5_555_555 / SECOND)
        assert not prepared
    made.advance(pose_at(0), pose_at(0), 0.0167)
    assert prepared


def test_what_is_kept_for_several_kinds_of_steps_is_what_each_would_be_given_anew(monkeypatch):
    """Cloth is the same to the bit, with steps of several lengths, levels and winds in turn."""
    coarser = {"sub_step": 1 / 540, "search_every": 9}

    def cloth():
        made, seen, body = simulation(), [], pose_at(0)
        usual, wind = made.parameters, replace(made.parameters.environment, wind=(3.0, 0.0, 0.0))
        kinds = [usual, replace(usual, settings=replace(usual.settings, **coarser))]
        kinds.append(usual.in_environment(wind))
        made.step(body)
        for n in range(60):
            made.parameters = kinds[n // 20]
            at = pose_at(round((n + 1) * SECOND / 60))
            made.advance(body, at, (1 / 180, 2 / 180, 0.013, 1 / 60, 1 / 180)[n % 5])
            body = at
            seen.append(made["sheet"].positions.copy())
        return seen

    kept, prepare = cloth(), workspace.XpbdWorkspace.prepare

    def prepare_anew(self, *of):
        self.prepared_for, self.bent_for = (0.0, 0.0, *self.prepared_for[2:]), (0.0, 0.0)
        prepare(self, *of)

    monkeypatch.setattr(workspace.XpbdWorkspace, "prepare", prepare_anew)
    monkeypatch.setattr(Given, "fits", lambda self, step: False)
    for one, other in zip(kept, cloth(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_where_much_is_due_several_are_one_and_coarser():
    p = ClothNodeParameters(delay=0.0)
    made = simulation(solver_step=longest_step("xpbd", p.solver_step))
    stepper, asked = ClothStepper.with_parameters(made, p), []
    made.advance_coarsely = lambda start, end, dt, times: asked.append((round(180 * dt), times))
    stepper.add(0, pose_at(0), 0)
    stepper.advance(0)
    for n in range(1, 40):
        stepper.add(round(n * SECOND / 180), pose_at(n), n)
    stepper.advance(round(SECOND / 60))  # it has caught up with the body then
    assert not asked
    stepper.advance(stepper.newest)  # 0.2 s: more than catch_up
    assert asked
    assert set(asked) <= {(3, 3), (2, 3)}
    assert stepper.coarse > 0
