"""Convex-hull colliders: the figures of Sun et al. measured, and hulls against capsules.

    python bench/hulls.py [--data DIR] [--parts fig8 queries fits clips bare] [--json]

``fig8``: a model like theirs (508 triangles, mean edge 0.084, hull of 224 faces), simplified at
several deltas and floors, and its outer map of 96 cells. ``queries``: nanoseconds per point of the
ways to ask a hull. ``fits``: how fat hulls and capsules are on all bodies. ``clips``: how far the
posed skin leaves both. ``bare``: how much of it is outside of hulls by more than 2 mm, and how far
these stand off the skin at rest. Processor time of one thread, medians, after one warm-up. What
collisions cost: `hull_contact.py`.
"""

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders.capsules.capsules import fit_capsules
from garment_sim_ros.colliders.hulls.hull import Hull, clearance, convex_hull, inflate_vertices
from garment_sim_ros.colliders.hulls.hull_placement import QUADRIC, VOLUME
from garment_sim_ros.colliders.hulls.hull_simplify import Simplification, simplify_hull
from garment_sim_ros.colliders.hulls.hulls import fit_hulls
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.report.fatness import Union, fatness
from garment_sim_ros.colliders.report.motion_report import motion_report, range_report
from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.kinds.packed_hulls import hull_planes
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.papers.hull_location import HullLocator
from garment_sim_ros.contact.papers.outer_map import outer_map
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.geometry.obb import oriented_box
from garment_sim_ros.geometry.transforms import invert_transform
from garment_sim_ros.mocap.clip_poses import clip_poses
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.tradeoff.waisted_limb import waisted_limb

BODIES = (
    "mannequin",
    "bodies/mh_female_young.glb",
    "bodies/CesiumMan.glb",
    "urdf/human_1m65.urdf",
    "bodies/f_smpl_average_A40.obj",
    "bodies/m_smpl_average_A40.obj",
    "bodies/mh_proxy_female1605.obj",
    "bodies/makehuman/base.obj",
)
RIGGED = ("mannequin:height=1.5", *BODIES[:3], "mannequin:height=1.95", BODIES[-1])
CLIPS = (
    "cmu_131_03_hop_spin",
    "cmu_14_14_jumping_jacks_30fps",
    "fair_wave_hello",
    "rokoko_jesse_dance",
    "deepmimic_walk",
    "deepmimic_run",
    "deepmimic_jump",
    "deepmimic_cartwheel",
    "deepmimic_spinkick",
    "deepmimic_dance_a",
)


def median(
    rounds: int, work: Callable[[], object], clock: Callable[[], float] = time.thread_time
) -> float:
    """Median time of `work` [s] after one warm-up, by default processor time of this thread."""
    times = []
    for _ in range(rounds + 1):
        begin = clock()
        work()
        times.append(clock() - begin)
    return float(np.median(times[1:]))


def fig8() -> dict[str, Any]:
    """Faces against delta, floor and volume; outer map of 96 cells."""
    x, triangles = waisted_limb()
    hull = convex_hull(x)
    print(f"model {len(triangles)} triangles, hull {len(hull.faces)} faces (paper: 508, 224)")
    rows = []
    for delta in (0.0025, 0.005, 0.01, 0.02):
        start = inflate_vertices(hull, delta)
        excess = start.volume / hull.volume - 1
        print(
            f"delta {delta}: inflated {len(start.faces)} faces, volume +{100 * excess:.1f} %, "
            f"clearance min {clearance(start, hull).min() / delta:.2f} delta"
        )
        for reach in (1.0, 2.0, 3.0, 5.0, 10.0):
            for floor in (4, 40, 60, 80, 116):
                for name, objective in (("quadric", QUADRIC), ("volume", VOLUME)):
                    how = Simplification(
                        max_faces=floor, outside=reach * delta, objective=objective
                    )
                    result = simplify_hull(start, hull, how)
                    assert not result.outside(x).any()
                    rows.append(
                        {
                            "delta": delta,
                            "reach": reach,
                            "floor": floor,
                            "placement": name,
                            "faces": len(result.faces),
                            "volume_excess": result.volume / hull.volume - 1,
                            "inflated_volume_excess": excess,
                            "clearance_mean": clearance(result, hull).mean() / delta,
                        }
                    )
        for name in ("quadric", "volume"):
            ours = [r for r in rows if r["delta"] == delta and r["placement"] == name]
            free = [min(r["faces"] for r in ours if r["reach"] == k) for k in (1.0, 2.0, 3.0)]
            slim = min(r["faces"] for r in ours if r["volume_excess"] <= excess)
            print(
                f"  {name}: least faces with reach 1, 2, 3 delta: {free}; "
                f"not fatter than inflation alone: {slim}"
            )
    start = inflate_vertices(hull, 0.005)
    paper = simplify_hull(start, hull, Simplification(max_faces=116, outside=0.01))
    box = oriented_box(paper.vertices, paper.faces)
    tables = {}
    for around, per_row in ((12, 8), (24, 16), (48, 32)):
        table = outer_map(
            box.local(paper.vertices), paper.faces, around=around, rows=per_row, kind="cylinder"
        )
        lengths = np.diff(table.start)
        tables[f"{around}x{per_row}"] = (int(lengths.max()), float(lengths.mean()))
        print(
            f"map cylinder {around} x {per_row} of {len(paper.faces)} faces: longest list "
            f"{lengths.max()}, mean {lengths.mean():.2f} (paper, 12 x 8: 8 and 3)"
        )
    return {"curve": rows, "outer_map": tables}


@njit(nogil=True)
def _ask(shapes, posed, points, reach, out):
    for i in range(points.shape[0]):
        d, _, _, _ = shape_distance(
            shapes, posed, 0, points[i, 0], points[i, 1], points[i, 2], reach
        )
        out[i] = d


@njit(nogil=True, fastmath=True)
def _all_planes(planes, points, out):
    for i in range(points.shape[0]):
        best = np.float32(-1e9)
        for f in range(planes.shape[1]):
            h = (
                planes[0, f] * points[i, 0]
                + planes[1, f] * points[i, 1]
                + planes[2, f] * points[i, 2]
                - planes[3, f]
            )
            best = max(best, h)
        out[i] = best


def queries() -> dict[str, Any]:
    """Nanoseconds per point against the number of faces."""
    x, _ = waisted_limb()
    hull = convex_hull(x)
    start = inflate_vertices(hull, 0.005)
    results = {}
    for faces in (58, 116, 224, 1000):
        simple = simplify_hull(start, hull, Simplification(max_faces=faces, outside=0.05))
        if faces == 1000:
            way = np.random.default_rng(0).normal(size=(502, 3))
            half = np.ptp(hull.vertices, axis=0) / 2
            simple = convex_hull(way / np.linalg.norm(way, axis=1)[:, None] * half)
        results[len(simple.faces)] = row = query_row(simple)
        print(
            f"{len(simple.faces)} faces: " + "; ".join(f"{k} {v:.0f} ns" for k, v in row.items())
        )
    return results


def query_row(hull: Hull) -> dict[str, float]:
    """One hull, asked about points within 3 cm of its surface, where cloth is."""
    vertices = oriented_box(hull.vertices, hull.faces).local(hull.vertices)
    rng = np.random.default_rng(0)
    points = rng.uniform(vertices.min(0) - 0.02, vertices.max(0) + 0.02, (400_000, 3))
    planes = hull_planes(vertices, hull.faces)
    height = (points @ planes[:, :3].T - planes[:, 3]).max(axis=1)
    points = points[np.abs(height) < 0.03][:50_000]
    single = points.astype(np.float32)
    out = np.empty(len(points), np.float32)
    geometry = {"vertices": vertices, "faces": hull.faces}
    colliders = ColliderSet(
        colliders=(Collider(name="hull", kind="hull", bone="bone", geometry=geometry),)
    )
    shapes = pack(colliders)
    posed = PosedShapes.room_for(shapes)
    still = ColliderPoses.identity(1)
    pose(shapes, still, still, np.zeros(3), posed)
    flat = np.ascontiguousarray(planes.T.astype(np.float32))
    reach = np.float32(0.002)
    grid = HullLocator(vertices, hull.faces)
    tree = HullLocator(vertices, hull.faces, search="kirkpatrick")
    work = {
        "face grid (distance and way out)": lambda: _ask(shapes, posed, single, reach, out),
        "all planes": lambda: _all_planes(flat, single, out),
        "paper: inside, Kirkpatrick": lambda: tree.inside(points),
        "paper: inside, planar grid": lambda: grid.inside(points),
        "paper: response by outer map": lambda: grid.exits(points),
    }
    return {name: 1e9 * median(7, ask) / len(points) for name, ask in work.items()}


def collider_sets(body: Body) -> dict[str, ColliderSet]:
    """What is compared."""
    return {
        "hull": fit_hulls(body).colliders,
        "hull, volume": fit_hulls(body, HullSettings(placement="volume")).colliders,
        "hull, no joints": fit_hulls(body, HullSettings(joints="none")).colliders,
        "capsule": fit_capsules(body),
    }


def fits(data: Path) -> dict[str, Any]:
    """Fit time, fatness and skin outside in the bind pose."""
    results = {}
    for source in BODIES:
        body = load_body(source if source == "mannequin" else data / source)
        T = invert_transform(body.skin.T_bone_bind)
        seconds = median(3, lambda body=body: fit_hulls(body), time.perf_counter)  # type: ignore[misc]
        for name, colliders in collider_sets(body).items():
            poses = ColliderPoser(colliders, body).poses(T)
            figures: dict[str, Any] = dict(
                fatness(colliders, poses, body.skin.vertices, body.skin.triangles)
            )
            del figures["shapes"]
            used = np.unique(body.skin.triangles)
            distance = Union(colliders, poses).distance(body.skin.vertices[used])
            figures["skin_outside"] = int((distance > 1e-6).sum())
            figures["shapes"] = sum(c.kind != "frame" for c in colliders.colliders)
            results[f"{source}, {name}"] = figures
            print(f"{Path(source).name}, {name}: {figures}")
        print(f"{Path(source).name}: hulls fitted in {seconds:.2f} s")
    return results


def clips(data: Path) -> dict[str, Any]:
    """How far the posed skin leaves the union, by area over 25 poses of each clip."""
    results = {}
    for source in BODIES[:4]:
        body = load_body(source if source == "mannequin" else data / source)
        sets = {"hull": fit_hulls(body).colliders, "capsule": fit_capsules(body)}
        for clip_name in CLIPS:
            try:
                poses = clip_poses(load_clip(data / "mocap" / f"{clip_name}.bvh"), body, 25)
            except GarmentSimError as error:
                print(f"{Path(source).name}, {clip_name}: {error}")
                continue
            for name, colliders in sets.items():
                report = motion_report(body, colliders, poses)
                results[f"{source}, {clip_name}, {name}"] = report
                out, p99, most = (
                    report[f"outside_{figure}"] for figure in ("share", "mm_p99", "mm_max")
                )
                print(
                    f"{Path(source).name}, {clip_name}, {name}: {100 * out:.1f} % of the skin "
                    f"outside, p99 {p99:.1f} mm, max {most:.1f} mm"
                )
    return results


def bare(data: Path) -> dict[str, Any]:
    """Skin that is 2 mm out of hulls: mean over 10 poses of each clip, and over the range."""
    results = {}
    for source in RIGGED:
        body = load_body(source if source.startswith("mannequin") else data / source)
        colliders = fit_hulls(body).colliders
        rest = ColliderPoser(colliders, body).poses(invert_transform(body.skin.T_bone_bind))
        fat = fatness(colliders, rest, body.skin.vertices, body.skin.triangles)
        share = {"range": range_report(body, colliders)["bare_share"]}
        for clip_name in CLIPS:
            poses = clip_poses(load_clip(data / "mocap" / f"{clip_name}.bvh"), body, 10)
            share[clip_name] = motion_report(body, colliders, poses)["bare_share"]
        share["clips"] = float(np.mean([share[name] for name in CLIPS]))
        figures = {name: value for name, value in fat.items() if name != "shapes"}
        count = sum(c.kind != "frame" for c in colliders.colliders)
        results[source] = {"shapes": count, "bare_share": share, **figures}
        print(f"{Path(source).name}: {count} shapes, {figures}")
        print("  bare: " + ", ".join(f"{name} {100 * s:.2f} %" for name, s in share.items()))
    return results


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    here = Path(__file__).resolve().parents[1]
    default = Path(os.environ.get("GARMENT_SIM_DATA") or here.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=default, help="folder of real bodies")
    parts: dict[str, Callable[[], dict[str, Any]]] = {
        "fig8": fig8,
        "queries": queries,
        "fits": lambda: fits(options.data),
        "clips": lambda: clips(options.data),
        "bare": lambda: bare(options.data),
    }
    parser.add_argument("--parts", nargs="+", choices=parts, default=list(parts))
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    options = parser.parse_args()
    results = {}
    for part in options.parts:
        results[part] = parts[part]()
    if options.json:
        print(json.dumps(results))


if __name__ == "__main__":
    main()
