"""What one query of one collider costs, by kind.

    python bench/query_cost.py [--body mannequin] [--rounds 9]

Points up to 2 cm from the surface of each shape are asked for their signed distance, as contact
does. Median processor time in ns; of hulls also by their number of faces.
"""

import argparse
import time

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.capsules.capsules import fit_capsules, fit_spheres
from garment_sim_ros.colliders.ellipsoids.ellipsoid_binding import fit_ellipsoids
from garment_sim_ros.colliders.hulls.hulls import fit_hulls
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.contact.distance import shape_distance
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.jit import kernel

_POINTS = 4000
_REACH = np.float32(0.005)


@kernel()
def ask(shapes, posed, points):
    """Distances of all points to the one shape; their sum, so that none is left out."""
    total = np.float32(0.0)
    for p in range(points.shape[0]):
        d, _, _, _ = shape_distance(
            shapes, posed, 0, points[p, 0], points[p, 1], points[p, 2], _REACH
        )
        total += min(d, _REACH)
    return total


def query_ns(collider: Collider, rounds: int) -> float:
    """Median time of one query [ns]."""
    alone = ColliderSet(colliders=(collider,))
    shapes = pack(alone)
    posed = PosedShapes.room_for(shapes)
    poses = ColliderPoses.identity(1)
    pose(shapes, poses, poses, np.zeros(3), posed)
    vertices, triangles = surface(collider)
    rng = np.random.default_rng(0)
    a, b, c = vertices[triangles[rng.integers(len(triangles), size=_POINTS)]].transpose(1, 0, 2)
    share = rng.dirichlet(np.ones(3), _POINTS)
    points = share[:, :1] * a + share[:, 1:2] * b + share[:, 2:] * c
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    points = (points + normal * rng.uniform(-0.02, 0.02, (_POINTS, 1))).astype(np.float32)
    times = []
    for _ in range(rounds + 1):
        begin = time.thread_time()
        for _ in range(10):
            ask(shapes, posed, points)
        times.append((time.thread_time() - begin) / (10 * _POINTS))
    return float(1e9 * np.median(times[1:]))


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--body", default="mannequin")
    parser.add_argument("--rounds", type=int, default=9)
    options = parser.parse_args()
    body = load_body(options.body)
    sets = (
        fit_spheres(body),
        fit_capsules(body),
        fit_ellipsoids(body)[0],
        fit_hulls(body).colliders,
    )
    by_kind: dict[str, list[float]] = {}
    for colliders in sets:
        for c in colliders.colliders:
            if c.kind != "frame":
                ns = query_ns(c, options.rounds)
                by_kind.setdefault(c.kind, []).append(ns)
                if c.kind == "hull":
                    print(
                        f"hull {c.name}: {len(np.asarray(c.geometry['faces']))} faces, {ns:.0f} ns"
                    )
    for kind, values in by_kind.items():
        print(f"{kind}: {np.median(values):.0f} ns (median of {len(values)} shapes)")


if __name__ == "__main__":
    main()
