"""Two tests of textile laboratories on simulated fabrics: bending length and drape coefficient.

    python bench/textile_tests.py [--fabrics cotton_jersey ...] [--spacing 0.01 0.02]

Bending length (Peirce; ISO 9073-7): a strip, 25 mm wide and cut along the warp, is pushed over an
edge until its tip lies 41.5 degrees below; the bending length is half of what overhangs. Here the
overhang is what Peirce's formula gives for the fabric's rigidity and weight, and the angle that it
comes to rest at gives the bending length back. Strips of long edges are four of them wide.

Drape coefficient (Cusick; ISO 9073-9): a disc of 0.30 m lies on one of 0.18 m; the ring that
hangs, seen from above, over what it covers flat.

Both hang for 4 s of `xpbd` with 40 sub-steps a frame and some damping, on a grid along the
threads, rows as of a skirt and a random mesh, with edges of the lengths given [m].
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from garment_sim_ros.constants import GRAVITY
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.garment.materials import PRESETS
from garment_sim_ros.geometry.topology import boundary_loops
from garment_sim_ros.params import Material, XpbdSettings
from garment_sim_ros.sim.simulation import Simulation

sys.path.insert(0, str(Path(__file__).parents[1] / "test"))
sys.path.insert(0, str(Path(__file__).parents[1] / "test" / "verification"))
from conftest import Cloth
from test_fabric_on_meshes import MESHES, SPACING, cut

FRAME = 1 / 60
FRAMES = 240
DISC, PEDESTAL = 0.15, 0.09
WIDTH = 0.025
KINDS = ("grid", "rows", "random")


def bending_length(fabric: Material) -> float:
    """What Peirce defines: the third root of rigidity over weight per area [m]."""
    return float((fabric.bending_stiffness / (fabric.areal_density * GRAVITY)) ** (1 / 3))


def hung(
    flat: np.ndarray, triangles: np.ndarray, held: np.ndarray, fabric: Material
) -> np.ndarray:
    """Where a piece of cloth comes to rest [m]; held where told."""
    garment = Cloth.garment(flat, triangles, np.flatnonzero(held))
    garment = replace(garment, material=replace(fabric, damping=3.0, air_drag=0.0, friction=0.0))
    simulation = Simulation(
        (garment,),
        Cloth.colliders(),
        solver="xpbd",
        settings=XpbdSettings(sub_step=FRAME / 40),
        solver_step=FRAME,
    )
    still = ColliderPoses.identity(1)
    for _ in range(FRAMES):
        simulation.advance(still, still, FRAME)
    return simulation["cloth"].simulated.astype(np.float64)


def upright(p: np.ndarray) -> np.ndarray:
    """Points of a plane of weft and warp, laid flat with the warp along x."""
    return np.stack([p[:, 1], -p[:, 0], 0.0 * p[:, 0]], axis=1)


def cantilever(mesh: str, spacing: float, fabric: Material) -> float:
    """Bending length found by the angle of a strip [m]."""
    overhang = 2.0 * bending_length(fabric)
    p, triangles = MESHES[mesh]()
    wide = max(WIDTH, 4.0 * spacing)
    p, triangles = cut(p * (spacing / SPACING), triangles, wide, 2.0 * overhang)
    flat = upright(p)
    x = hung(flat, triangles, flat[:, 0] < 0.0, fabric)
    # The strip begins where the last row that is held lies, and ends where it was cut.
    begin, end = flat[flat[:, 0] < 0.0, 0].max(), flat[:, 0].max()
    tip = flat[:, 0] > end - 0.6 * spacing
    across, down = x[tip, 0].mean() - begin, -x[tip, 2].mean()
    angle = np.arctan2(down, across)
    reach = float(flat[tip, 0].mean()) - begin
    return reach * float((np.cos(0.5 * angle) / (8.0 * np.tan(angle))) ** (1 / 3))


def drape_coefficient(mesh: str, spacing: float, fabric: Material) -> float:
    """Part of the ring that a hanging disc covers, seen from above."""
    p, triangles = MESHES[mesh]()
    p = p * (spacing / SPACING)
    triangles = triangles[np.linalg.norm(p[triangles].mean(axis=1), axis=1) < DISC]
    used, index = np.unique(triangles, return_inverse=True)
    p, triangles = p[used], index.reshape(-1, 3)
    flat = upright(p)
    held = np.linalg.norm(p, axis=1) < PEDESTAL
    x = hung(flat, triangles, held, fabric)
    rim = max(boundary_loops(triangles), key=len)
    return (_area(x[rim]) - np.pi * PEDESTAL**2) / (_area(flat[rim]) - np.pi * PEDESTAL**2)


def _area(loop: np.ndarray) -> float:
    """Area in a loop, seen from above [m^2]."""
    x, y, _ = loop.T
    return 0.5 * abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--fabrics", nargs="+", default=list(PRESETS), choices=PRESETS, metavar="F"
    )
    parser.add_argument("--spacing", nargs="+", type=float, default=[0.01, 0.02])
    options = parser.parse_args()
    print("| fabric | weight | rigidity | bending length | edges | found | drape |")
    print("|---|---|---|---|---|---|---|")
    for name in options.fabrics:
        fabric = PRESETS[name].material
        own = f"| {name} | {1e3 * fabric.areal_density:.0f} g/m^2 "
        own += (
            f"| {1e6 * fabric.bending_stiffness:.1f} uN m | {1e3 * bending_length(fabric):.0f} mm "
        )
        for spacing in options.spacing:
            lengths = [1e3 * cantilever(mesh, spacing, fabric) for mesh in KINDS]
            drapes = [100.0 * drape_coefficient(mesh, spacing, fabric) for mesh in KINDS]
            print(
                f"{own}| {1e3 * spacing:.0f} mm | "
                + ", ".join(f"{c:.0f}" for c in lengths)
                + " mm | "
                + ", ".join(f"{d:.0f}" for d in drapes)
                + " % |",
                flush=True,
            )


if __name__ == "__main__":
    main()
