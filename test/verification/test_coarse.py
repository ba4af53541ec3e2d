"""A coarse level leaves less stretch where sub-steps are few, and the fabric as it is."""

import numpy as np
import pytest
from naive import naive_xpbd

from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import XpbdSettings
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.sim.solvers.xpbd.coarse import coarse_level, prepare_cells
from garment_sim_ros.sim.solvers.xpbd.coarse_kernels import pull_cells

G = 9.81
ROWS, COLUMNS = 25, 9


def curtain(cloth, stiffness):
    """A cloth of 0.48 m x 0.16 m that hangs by its whole upper edge."""
    vertices, triangles = cloth.grid(ROWS, COLUMNS)
    hung = np.stack([vertices[:, 1] * 0.0, vertices[:, 1], -vertices[:, 0]], axis=1)
    return cloth.garment(
        hung,
        triangles,
        pins=range(COLUMNS),
        areal_density=0.2,
        stretch_stiffness_warp=stiffness,
        stretch_stiffness_weft=stiffness,
        shear_stiffness=stiffness / 4,
        bending_stiffness=0.0,
        damping=8.0,
    )


def longer(cloth, stiffness, sub_steps, *, coarse):
    """By how much it is longer at rest than as cut [m]."""
    simulation = Simulation(
        (curtain(cloth, stiffness),),
        cloth.colliders(),
        solver="xpbd",
        settings=XpbdSettings(sub_step=1 / 60 / sub_steps, coarse=coarse),
        solver_step=1 / 60,
    )
    still = ColliderPoses.identity(1)
    for _ in range(240):
        simulation.advance(still, still, 1 / 60)
    assert simulation.health("cloth").rms_speed < 2e-3
    z = simulation.positions("cloth").reshape(ROWS, COLUMNS, 3)[:, :, 2].mean(axis=1)
    return float(z[0] - z[-1]) - 0.02 * (ROWS - 1)


def test_a_stiff_curtain_is_stretched_by_a_quarter(cloth):
    """Of what edges alone leave with 6 sub-steps; its own weight stretches it by 0.05 mm."""
    alone = longer(cloth, 5000.0, 6, coarse=False)
    assert alone > 0.02
    assert 0.0 < longer(cloth, 5000.0, 6, coarse=True) < alone / 4


@pytest.mark.parametrize("stiffness", [50.0, 200.0])
def test_a_soft_curtain_is_stretched_by_its_weight(cloth, stiffness):
    """Nearer to that than without, never less, and in the end as without."""
    weight = longer(cloth, stiffness, 200, coarse=False)
    for sub_steps, most in ((6, 0.5), (20, 1.0), (40, 1.0)):
        alone = longer(cloth, stiffness, sub_steps, coarse=False)
        linked = longer(cloth, stiffness, sub_steps, coarse=True)
        assert weight < linked < weight + most * (alone - weight)
    alone = longer(cloth, stiffness, 100, coarse=False)
    assert longer(cloth, stiffness, 100, coarse=True) == pytest.approx(alone, rel=5e-3)


def level_of(cloth, rows=16, columns=12, pins=(), shape=lambda x: x):
    vertices, triangles = cloth.grid(rows, columns)
    vertices = shape(vertices)
    garment = cloth.garment(vertices, triangles, pins=pins)
    simulation = Simulation((garment,), cloth.colliders(), solver="xpbd")
    model = simulation.model("cloth")
    edges = mesh_topology(model.particle_triangles).edges
    level, threads = coarse_level(model, edges)
    prepare_cells(level, threads, 1.0, 1 / 600)
    return model, level, threads


def rolled(x, radius):
    """A flat cloth around a cylinder along y."""
    return np.stack(
        [radius * np.sin(x[:, 0] / radius), x[:, 1], radius * np.cos(x[:, 0] / radius)]
    ).T


def moved_by(level, x):
    y = x.astype(np.float32)
    pull_cells(y.reshape(-1), y.reshape(-1), False, level)
    return y


@pytest.mark.parametrize("pins", [(), (0, 1, 2, 3)])
def test_kernel_against_twin(cloth, pins):
    model, level, _ = level_of(cloth, pins=pins)
    rng = np.random.default_rng(5)
    x = model.rest * np.linspace(0.99, 1.05, len(model))[:, None]
    x = (x + rng.normal(0.0, 1e-3, x.shape)).astype(np.float32)
    expected = naive_xpbd.pull_cells(
        x,
        model.free_count,
        level.cell.astype(np.int32),
        model.mass.astype(np.float64),
        level.corners.reshape(-1, 3).astype(np.int32),
        level.strains.astype(np.float64),
        level.sides.astype(np.float64),
    )
    found = moved_by(level, x)
    assert np.abs(found - x).max() > 1e-3
    assert np.abs(found - expected).max() < 1e-6
    apart = np.zeros_like(x)
    pull_cells(x.reshape(-1), apart.reshape(-1), True, level)
    assert np.abs(x + apart - expected).max() < 1e-6


def test_cells_let_cloth_bend_and_keep_momentum(cloth):
    """Folded or as it was cut, cloth is left alone; stretched, its centre of mass stays."""
    model, level, _ = level_of(cloth)
    assert len(level.strains) > 10
    assert np.abs(moved_by(level, model.rest) - model.rest).max() < 1e-6
    folded = (0.9 * model.rest).astype(np.float32)
    folded[:, 2] = np.abs(folded[:, 0])
    folded[:, 0] *= 0.3
    assert np.abs(moved_by(level, folded) - folded).max() < 1e-7
    shorter = moved_by(level, 0.999 * model.rest)
    assert 1e-6 < np.abs(shorter - 0.999 * model.rest).max() < 0.001 * 0.15
    found = moved_by(level, 1.1 * model.rest)
    shift = (model.mass[:, None] * (found - 1.1 * model.rest)).sum(axis=0) / model.mass.sum()
    assert np.abs(found - 1.1 * model.rest).max() > 2e-3
    assert np.abs(shift).max() < 1e-6


@pytest.mark.parametrize(("radius", "off"), [(0.05, 0.04), (0.15, 0.005)])
def test_a_sleeve_is_as_the_flat_cloth(cloth, radius, off):
    """Centres of mass lie inside it; laid flat, nothing is stretched or short."""
    flat, _ = cloth.grid(16, 12)
    model, level, threads = level_of(cloth, shape=lambda x: rolled(x, radius))
    centre = np.zeros((len(level.centre), 3))
    np.add.at(centre, level.cell, level.part[:, None] * flat[model.vertex])
    a, b, c = centre[level.corners.reshape(-1, 3)].transpose(1, 0, 2)
    sides = np.stack([b - a, c - a], axis=1)
    metres = np.linalg.norm(threads.along @ sides, axis=2)
    assert 1.0 - off < metres.min() <= metres.max() < 1.0 + off
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert threads.area == pytest.approx(0.5 * doubled, rel=2 * off)


def test_cells_do_not_hold_the_bias(cloth):
    """Sheared by 10 degrees with threads as long as they were, cloth is left alone."""
    model, level, _ = level_of(cloth)
    shear = np.array([[1.0, 0.0, 0.0], [np.sin(0.17), np.cos(0.17), 0.0], [0.0, 0.0, 1.0]])
    sheared = (model.rest @ shear).astype(np.float32)
    assert np.abs(moved_by(level, sheared) - sheared).max() < 1e-6


def test_nothing_is_kept_unless_asked_for(cloth):
    vertices, triangles = cloth.grid(16, 12)
    model = Simulation(
        (cloth.garment(vertices, triangles),), cloth.colliders(), solver="xpbd"
    ).model("cloth")
    workspace = SOLVERS["xpbd"].workspace(model, 0)
    workspace.prepare(model, 1e-3, 0.0, 4)
    assert len(workspace.coarse.cell) == len(workspace.coarse.centre) == 0
    workspace.prepare(model, 1e-3, 0.0, 4, True)
    assert len(workspace.coarse.cell) == len(model)
    workspace.prepare(model, 1e-3, 0.0, 4, False)
    assert len(workspace.coarse.cell) == 0


@pytest.mark.parametrize(
    ("rows", "columns", "pins"), [(2, 2, ()), (30, 2, (0, 1)), (4, 4, range(16))]
)
def test_too_small_or_narrow_for_cells(cloth, rows, columns, pins):
    """It is simulated as without."""
    vertices, triangles = cloth.grid(rows, columns)
    ends = []
    for coarse in (False, True):
        simulation = Simulation(
            (cloth.garment(vertices, triangles, pins=pins),),
            cloth.colliders(),
            solver="xpbd",
            settings=XpbdSettings(coarse=coarse),
            solver_step=1 / 60,
        )
        still = ColliderPoses.identity(1)
        for _ in range(5):
            simulation.advance(still, still, 1 / 60)
        ends.append(simulation.positions("cloth").copy())
    assert ends[0].tobytes() == ends[1].tobytes()
