"""The rigidity of fabrics, from the number of a published database to how cloth hangs."""

import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial import Delaunay

import garment_sim_ros as gs
from garment_sim_ros.garment.materials import OF_A_HINGE, PRESETS
from garment_sim_ros.garment.outfit_file import builtin_outfits
from garment_sim_ros.geometry.topology import hinge_vertices

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))
sys.path.insert(0, str(Path(__file__).parent))
from naive.naive_membrane import SPACING, rows
from textile_tests import bending_length, cantilever, drape_coefficient

RADIUS = 2.0


def angles(x, hinges):
    """Between the triangles of hinges [h, 4], 0 where flat [rad], shape [h]."""
    a, b, c, d = (x[hinges[:, k]] for k in range(4))
    n, m = np.cross(b - a, c - a), np.cross(d - a, b - a)
    return np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), (n * m).sum(axis=1))


def energy_of_hinges(flat, triangles, bent):
    """Of hinges of stiffness 1: sum of l^2 theta^2 / 8A (Bridson et al. 2003, energy of eq. 4)."""
    hinges = hinge_vertices(triangles)
    a, b, c, d = (flat[hinges[:, k]] for k in range(4))
    area = sum(0.5 * np.linalg.norm(np.cross(b - a, k - a), axis=1) for k in (c, d))
    length = np.linalg.norm(b - a, axis=1)
    return (length**2 * angles(bent, hinges) ** 2 / (8.0 * area)).sum()


@pytest.mark.parametrize("turned", [0.0, 25.0, 90.0])
def test_hinges_of_the_database_are_four_times_as_stiff_as_a_plate(turned):
    """Equilateral triangles bent to a cylinder in any direction store k/8 per area."""
    p = rows(12)
    triangles = Delaunay(p).simplices
    inner = np.abs(p[triangles].mean(axis=1)).max(axis=1) < 10.2 * SPACING
    triangles = triangles[inner]
    turn = np.radians(turned)
    along = p @ [np.cos(turn), np.sin(turn)]
    across = p @ [-np.sin(turn), np.cos(turn)]
    flat = np.stack([along, across, 0.0 * along], axis=1)
    angle = along / RADIUS
    bent = np.stack([RADIUS * np.sin(angle), across, RADIUS * np.cos(angle)], axis=1)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    area = 0.5 * np.abs(np.cross(b - a, c - a)[:, 2]).sum()
    per_area = energy_of_hinges(flat, triangles, bent) / area * RADIUS**2
    # Edges of the boundary have no hinge: a tenth of the triangles is there.
    assert per_area == pytest.approx(OF_A_HINGE / 2.0, rel=0.08)


@pytest.mark.parametrize(
    ("fabric", "length", "drape"), [("cotton_jersey", 0.014, 0.2), ("cotton_twill", 0.024, 0.6)]
)
def test_fabrics_hang_as_their_rigidity_says(fabric, length, drape):
    """Narrow strips are softer, as edges at their sides have no hinge."""
    material = PRESETS[fabric].material
    assert bending_length(material) == pytest.approx(length, abs=0.0005)
    assert 0.75 * length < cantilever("rows", 0.01, material) < 1.05 * length
    assert drape_coefficient("rows", 0.01, material) == pytest.approx(drape, abs=0.07)


@pytest.mark.slow
def test_a_fine_skirt_does_not_flutter():
    """With passes over the hinges 0.84 rad of swing apart its hem curled and whipped."""
    avatar = gs.Avatar.load("mannequin")
    outfit = yaml.safe_load(builtin_outfits()["tshirt_short_skirt"])
    outfit["garments"][0]["options"]["vertices"] = 5000
    outfit = avatar.dress(outfit)
    simulation = gs.Simulation(outfit, avatar.colliders)
    folds = hinge_vertices(outfit.garments[0].triangles)
    sharpest = []
    for poses in avatar.play("walk", rate=60, seconds=2.0):
        simulation.step(poses, dt=1 / 60)
        x = simulation["skirt"].positions.astype(float)
        sharpest.append(np.sqrt((angles(x, folds) ** 2).mean()))
    assert np.degrees(np.mean(sharpest[60:])) < 8.0
