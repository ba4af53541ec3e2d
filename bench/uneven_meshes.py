"""Fabrics on uneven meshes: stiffness of the springs over the fabric's own, and how cloth drapes.

    python bench/uneven_meshes.py [--drape polyester silk]

Multiples of the fabric's stiffness along warp, weft and both diagonals and in shear, all else
free, in float64 (the meshes and matrices of `test/naive/naive_membrane.py`). With
`--drape`, circles of cloth of 0.44 m, held within 0.18 m, hang for 4 s of `xpbd` with 40 sub-steps
a frame: how much they cover of the ring that they would flat, as in Cusick's test of drape.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from garment_sim_ros.garment.materials import PRESETS
from garment_sim_ros.geometry.topology import boundary_loops
from garment_sim_ros.params import Material

sys.path.insert(0, str(Path(__file__).parents[1] / "test"))
from naive.naive_membrane import MESHES, SPACING, cut, membrane, springs, stiffness
from textile_tests import hung

OUTER, INNER = 0.22, 0.09
FINE = 0.0125 / SPACING


def covered(mesh: str, fabric: Material) -> float:
    """Part of the ring that a hanging circle of cloth covers, seen from above."""
    p, triangles = MESHES[mesh]()
    p = FINE * p
    triangles = triangles[np.linalg.norm(p[triangles].mean(axis=1), axis=1) < OUTER]
    used, index = np.unique(triangles, return_inverse=True)
    p, triangles = p[used], index.reshape(-1, 3)
    flat = np.stack([p[:, 1], -p[:, 0], 0.0 * p[:, 0]], axis=1)  # The warp is along x.
    x = hung(flat, triangles, np.linalg.norm(p, axis=1) < INNER, fabric)
    rim = np.unique(np.concatenate(boundary_loops(triangles)))
    rim = rim[np.argsort(np.arctan2(flat[rim, 1], flat[rim, 0]))]
    x, y, _ = x[rim].T
    area = 0.5 * abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    return float((area - np.pi * INNER**2) / (np.pi * (OUTER**2 - INNER**2)))


def main() -> None:
    """Prints both tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--drape", nargs="*", default=[], choices=PRESETS, metavar="FABRIC")
    options = parser.parse_args()
    print(f"{'':32s}  warp  weft  bias        shear")
    for fabric, preset in PRESETS.items():
        for mesh, make in MESHES.items():
            p, triangles = cut(*make(), 0.4, 0.4)
            truth = stiffness(membrane(p, triangles, preset.material), p, triangles)
            found = stiffness(springs(p, triangles, preset.material), p, triangles) / truth
            print(f"{fabric:18s}{mesh:14s}" + "".join(f"{k:6.2f}" for k in found), flush=True)
    for fabric in options.drape:
        for mesh in ("grid", "rows", "random"):
            part = covered(mesh, PRESETS[fabric].material)
            print(f"{fabric:18s}{mesh:14s} covers {100 * part:.0f} %", flush=True)


if __name__ == "__main__":
    main()
