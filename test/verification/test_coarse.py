"""A coarse level leaves less stretch where sub-steps are few, and the fabric as it is."""

import numpy as np
import pytest

from garment_sim_ros.geometry.shapes import ColliderPoses
from garment_sim_ros.geometry.topology import mesh_topology
from garment_sim_ros.params import XpbdSettings
from garment_sim_ros.sim import naive_xpbd
from garment_sim_ros.sim.elasticity import edge_stiffness
from garment_sim_ros.sim.kernels.coarse import pull_links
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.sim.solvers.coarse import coarse_level, prepare_links

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
    """Nearer to that than without, never much less, and in the end as without."""
    weight = longer(cloth, stiffness, 200, coarse=False)
    for sub_steps in (6, 20, 40):
        alone = longer(cloth, stiffness, sub_steps, coarse=False)
        linked = longer(cloth, stiffness, sub_steps, coarse=True)
        assert 0.97 * weight < linked < weight + 0.4 * (alone - weight)
    assert longer(cloth, stiffness, 100, coarse=True) == pytest.approx(weight, rel=0.03)


def level_of(cloth, rows=16, columns=12, pins=()):
    vertices, triangles = cloth.grid(rows, columns)
    garment = cloth.garment(vertices, triangles, pins=pins)
    simulation = Simulation((garment,), cloth.colliders(), solver="xpbd")
    model = simulation.model("cloth")
    particle = np.empty(len(model), np.int32)
    particle[model.vertex] = np.arange(len(model), dtype=np.int32)
    edges = mesh_topology(particle[model.triangles]).edges
    stiffness = edge_stiffness(model.rest, particle[model.triangles], edges, model.material)
    level, material = coarse_level(model, edges, stiffness)
    prepare_links(level, material, np.full(len(edges), 0.1, np.float32), 1.0, 1 / 600)
    return model, level


def moved_by(level, x):
    y = x.astype(np.float32)
    pull_links(y.reshape(-1), y.reshape(-1), False, level)
    return y


@pytest.mark.parametrize("pins", [(), (0, 1, 2, 3)])
def test_kernel_against_twin(cloth, pins):
    model, level = level_of(cloth, pins=pins)
    rng = np.random.default_rng(5)
    x = model.rest * np.linspace(0.99, 1.05, len(model))[:, None]
    x = (x + rng.normal(0.0, 1e-3, x.shape)).astype(np.float32)
    expected = naive_xpbd.pull_links(
        x,
        model.free_count,
        level.cell.astype(np.int32),
        model.mass.astype(np.float64),
        level.ends.reshape(-1, 2).astype(np.int32),
        level.links[:, 0].astype(np.float64),
        level.links[:, 1:].astype(np.float64),
    )
    found = moved_by(level, x)
    assert np.abs(found - x).max() > 1e-3
    assert np.abs(found - expected).max() < 1e-6
    apart = np.zeros_like(x)
    pull_links(x.reshape(-1), apart.reshape(-1), True, level)
    assert np.abs(x + apart - expected).max() < 1e-6


def test_links_let_cloth_bend_and_keep_momentum(cloth):
    """Folded or as it was cut, cloth is left alone; stretched, its centre of mass stays."""
    model, level = level_of(cloth)
    assert len(level.links) > 10
    assert np.abs(moved_by(level, model.rest) - model.rest).max() < 1e-6
    folded = (0.9 * model.rest).astype(np.float32)
    folded[:, 2] = np.abs(folded[:, 0])
    folded[:, 0] *= 0.3
    assert np.array_equal(moved_by(level, folded), folded)
    shorter = moved_by(level, 0.999 * model.rest)
    assert 1e-5 < np.abs(shorter - 0.999 * model.rest).max() < 0.001 * 0.15
    found = moved_by(level, 1.1 * model.rest)
    shift = (model.mass[:, None] * (found - 1.1 * model.rest)).sum(axis=0) / model.mass.sum()
    assert np.abs(found - 1.1 * model.rest).max() > 4e-3
    assert np.abs(shift).max() < 1e-6


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
