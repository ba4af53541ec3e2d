"""Points that jump against the skin under them: cases of known answer."""

import numpy as np
import pytest
import trimesh


@pytest.fixture(scope="module")
def jump_meter(bench):
    return bench("jumps").JumpMeter


@pytest.fixture
def meter(jump_meter):
    vertices = np.asarray(trimesh.creation.icosphere(subdivisions=3, radius=0.3).vertices)
    return jump_meter(vertices), vertices


def cloth(vertices):
    return {"shirt": (vertices[::7] * 1.05).astype(np.float32)}


def test_what_goes_with_the_skin_does_not_jump_however_fast(meter):
    meter, skin = meter
    for n in range(4):
        shift = np.array([0.04 * n, 0.0, 0.0])
        meter.add(skin + shift, cloth(skin + shift / 1.05))
    assert meter.largest == pytest.approx(0.0, abs=1e-6)
    assert meter.frames == 0


def test_a_point_that_moves_alone_jumps_by_how_far_it_moved(meter):
    meter, skin = meter
    worn = cloth(skin)
    meter.add(skin, worn)
    worn["shirt"][4] += np.float32([0.0, 0.0, 0.03])
    meter.add(skin, worn)
    assert (meter.largest, meter.frames) == (pytest.approx(0.03, abs=1e-6), 0)
    worn["shirt"][9] *= 0.75
    jump = 0.25 / 0.75 * float(np.linalg.norm(worn["shirt"][9]))
    meter.add(skin, worn)
    assert (meter.largest, meter.frames) == (pytest.approx(jump, abs=1e-6), 1)
    meter.add(skin, worn)
    assert meter.frames == 1


def test_cloth_left_behind_by_the_skin_counts(meter):
    meter, skin = meter
    worn = cloth(skin)
    meter.add(skin, worn)
    meter.add(skin + np.array([0.0, 0.09, 0.0]), worn)
    assert meter.largest == pytest.approx(0.09, abs=1e-6)
    meter.forget()
    meter.add(skin, worn)
    assert meter.frames == 1, "the body was put elsewhere, which is no frame of it"


def test_a_hem_between_two_legs_may_go_with_either_but_not_beyond(jump_meter):
    legs = np.concatenate([np.full((20, 3), [0.0, y, 0.0]) for y in (-0.1, 0.1)])
    legs[:, 2] = np.tile(np.linspace(0.0, 1.0, 20), 2)
    meter = jump_meter(legs)
    hem = np.array([[0.0, 0.02, 0.5], [0.0, -0.02, 0.5], [0.0, 0.19, 0.5]], np.float32)
    stride = np.repeat([[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]], 20, axis=0)
    meter.add(legs, {"skirt": hem})
    meter.add(legs + stride, {"skirt": hem + np.float32([0.02, 0.0, 0.0])})
    assert meter.largest == pytest.approx(0.0, abs=1e-6)
    meter = jump_meter(legs)
    meter.add(legs, {"skirt": hem})
    meter.add(legs + 0.1 * stride, {"skirt": hem + np.float32([0.0, 0.0, 0.06])})
    assert meter.largest == pytest.approx(0.06, abs=1e-6)


def test_cloth_that_flies_free_has_no_skin_under_it(meter):
    meter, skin = meter
    free = {"cape": np.array([[0.0, 0.5, 0.0]], np.float32)}
    meter.add(skin, free)
    meter.add(skin, {"cape": free["cape"] + np.float32(0.3)})
    assert meter.largest == 0.0


def test_points_that_are_not_finite_are_passed_over(meter):
    meter, skin = meter
    worn = cloth(skin)
    meter.add(skin, worn)
    worn["shirt"] = worn["shirt"].copy()
    worn["shirt"][3] = np.nan
    meter.add(skin, worn)
    meter.add(skin, worn)
    assert meter.largest == 0.0
