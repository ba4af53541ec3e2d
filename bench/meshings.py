"""One garment meshed in several ways: how far apart its drapes are, with springs and triangles.

    python bench/meshings.py [--fabric polyester cotton_jersey]
        [--membrane triangles] [--garment FILE.obj --body FILE.glb]

Sheets of 0.8 m, meshed as a grid along the threads, in rows and at random, hang by two corners
(`corners`) or by one vertical side (`side`): distances between the same points of the cloth, of
`implicit` with 16 steps in 1/120 s after 5 s. With `--garment` a mesh is worn by a body that
stands, as it is and meshed anew with edges of 22 and of 23.5 mm: distances from the vertices of
one to the surface of the other, both ways, of `xpbd` with 72 sub-steps a frame after 4 s.
"""

import argparse
import dataclasses
import tempfile
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay

import garment_sim_ros as gs
from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.garment.materials import PRESETS
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.solver_params import MEMBRANES

SIZE, CELLS = 0.8, 25
FRAME = 1 / 60


def flat(mesh: str) -> tuple[FloatArray, IntArray]:
    """A square in weft and warp [m], and its triangles."""
    h = SIZE / CELLS
    if mesh == "rows":
        count = round(CELLS / np.sqrt(0.75))
        even = np.arange(CELLS + 1) * h
        odd = np.concatenate([[0.0], even[:-1] + 0.5 * h, [SIZE]])
        lines = [(odd if k % 2 else even, SIZE * k / count) for k in range(count + 1)]
        p = np.concatenate([np.stack([x, np.full(len(x), y)], axis=1) for x, y in lines])
    else:
        i, j = np.meshgrid(*[np.arange(CELLS + 1)] * 2, indexing="ij")
        p = h * np.stack([i.ravel(), j.ravel()], axis=1)
    if mesh == "grid":
        a = np.arange(len(p)).reshape(CELLS + 1, -1)[:-1, :-1].ravel()
        n = CELLS + 1
        halves = [np.stack([a, a + n, a + n + 1], 1), np.stack([a, a + n + 1, a + 1], 1)]
        return p, np.concatenate(halves).astype(np.int32)
    if mesh == "random":
        inner = ((p > 1e-9) & (p < SIZE - 1e-9)).all(axis=1)
        shift = np.random.default_rng(1).uniform(-0.35 * h, 0.35 * h, p.shape)
        p[inner] += shift[inner]
    triangles = Delaunay(p).simplices
    a, b, c = (p[triangles[:, k]] for k in range(3))
    (x, y), (z, w) = (b - a).T, (c - a).T
    return p, triangles[np.abs(x * w - y * z) > 1e-9].astype(np.int32)


def hung(mesh: str, fabric: str, membrane: str, held: str) -> tuple[FloatArray, ...]:
    """A square as cut, its triangles, and where it hangs."""
    p, triangles = flat(mesh)
    ends = [np.abs(p - corner).sum(axis=1).argmin() for corner in ((0.0, SIZE), (SIZE, SIZE))]
    pins = ends if held == "corners" else np.flatnonzero(p[:, 0] < 1e-9)
    cloth = gs.Garment.from_mesh(
        np.stack([0.0 * p[:, 0], p[:, 0], p[:, 1]], axis=1),
        triangles,
        material=dataclasses.replace(PRESETS[fabric].material, damping=4.0),
        pins=pins,
    )
    colliders = gs.ColliderSet.of(gs.sphere(0.01, (9.0, 9.0, 9.0)))
    simulation = gs.Simulation(
        cloth,
        colliders,
        solver="implicit",
        solver_step=FRAME,
        sub_step=FRAME / 2,
        iterations=16,
        membrane=membrane,
    )
    still = gs.ColliderPoses.identity(len(colliders))
    simulation.reset(still, settle=False)
    for _ in range(300):
        simulation.advance(still, still, FRAME)
    return p, triangles, simulation[cloth.name].positions.astype(np.float64)


def at(p: FloatArray, triangles: IntArray, x: FloatArray, points: FloatArray) -> FloatArray:
    """Where points of the cloth, as it was cut, are where its vertices are at x."""
    corners = p[triangles]
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    found = np.zeros((len(points), 3))
    for k, point in enumerate(points):
        share = np.linalg.solve(sides, (point - corners[:, 0])[:, :, None])[..., 0]
        share = np.concatenate([1.0 - share.sum(axis=1, keepdims=True), share], axis=1)
        t = share.min(axis=1).argmax()
        found[k] = share[t] @ x[triangles[t]]
    return found


def worn(garment: Path, body: Path, fabric: str, membrane: str) -> list[tuple[FloatArray, ...]]:
    """Where the same garment hangs, by way of meshing: vertices and triangles."""
    avatar = gs.Avatar.load(str(body))
    still = next(iter(avatar.play("walk", rate=60, seconds=0.1)))
    found = []
    for how, edge in (("never", 0.022), ("always", 0.022), ("always", 0.0235)):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "outfit.yaml")
            file.write_text(
                f"version: 1\ngarments:\n  - name: worn\n    mesh: {garment.resolve()}\n"
                f"    material: {fabric}\n    options: {{remesh: {how}, edge_length: {edge}}}\n"
            )
            simulation = gs.Simulation(
                *(avatar.dress(str(file)), avatar.colliders),
                solver="xpbd",
                solver_step=FRAME,
                sub_step=FRAME / 72,
                membrane=membrane,
            )
        simulation.reset(still)
        for _ in range(240):
            simulation.advance(still, still, FRAME)
        view = simulation["worn"]
        found.append((view.positions.astype(np.float64), view.triangles))
    return found


def told(title: str, apart: list[FloatArray]) -> None:
    """Prints distances [m], by pair of meshings."""
    figures = (
        f"{1e3 * np.sqrt((d**2).mean()):.2f} ({1e3 * np.percentile(d, 95):.2f})" for d in apart
    )
    print(f"{title:44}" + "".join(f"{f:>16}" for f in figures), flush=True)


def main() -> None:
    """Prints RMS distances, and in brackets those that 95 % of the points are within [mm]."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--fabric", nargs="+", default=["cotton_twill"], choices=PRESETS)
    parser.add_argument("--membrane", nargs="+", default=MEMBRANES, choices=MEMBRANES)
    parser.add_argument("--garment", type=Path, help="OBJ file; needs --body")
    parser.add_argument("--body", type=Path)
    options = parser.parse_args()
    ways = ("grid", "rows", "random")
    line = np.linspace(0.0, SIZE, 21)
    points = np.stack([c.ravel() for c in np.meshgrid(line, line)], axis=1)
    print(" " * 44 + "".join(f"{a + '-' + b:>16}" for a, b in combinations(ways, 2)))
    for fabric in options.fabric:
        for membrane in options.membrane:
            if options.garment:
                drapes = worn(options.garment, options.body, fabric, membrane)
                surfaces = [MeshDistance(x, triangles) for x, triangles in drapes]
                apart = [
                    np.abs(
                        np.concatenate(
                            [
                                surfaces[b].signed_distance(drapes[a][0])[0],
                                surfaces[a].signed_distance(drapes[b][0])[0],
                            ]
                        )
                    )
                    for a, b in combinations(range(3), 2)
                ]
                told(f"{options.garment.stem}, {fabric}, {membrane}", apart)
                continue
            for held in ("corners", "side"):
                places = [at(*hung(mesh, fabric, membrane, held), points) for mesh in ways]
                apart = [np.linalg.norm(a - b, axis=1) for a, b in combinations(places, 2)]
                told(f"{held}, {fabric}, {membrane}", apart)


if __name__ == "__main__":
    main()
