"""Signed-distance grids per bone against hulls: tightness, posed skin outside, cost of a query.

    python bench/signed_distance.py [--data DIR] [--body mannequin] [--cell 0.01] [--delta 0.003]

An experiment, not a kind of collider: every region of the hulls' fit, closed by lids, and for each
joint the band of skin that both its bones move, which turns halfway, are sampled on a grid in the
bone's frame; the union is the least of all. Against the default hulls: in the bind pose, over 15
poses of each of three clips, and by the time that one particle near the skin takes with all pieces
asked (neither is culled). Distances are those of skin to the union in mm, by area; processor time.
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.loaders import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.convex_parts import _lids, _rims, split
from garment_sim_ros.colliders.fatness import Union
from garment_sim_ros.colliders.hulls import fit_hulls
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.regions import region_surface, skin_regions, vertex_areas
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.transforms import invert_transform, transform_points
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import sample

CLIPS = ("cmu_14_14_jumping_jacks_30fps", "rokoko_jesse_dance", "cmu_131_03_hop_spin")
AROUND = 0.03
"""How far grids go beyond their piece [m]."""
FAR = np.float32(1.0)
BAND = (0.1, 0.9)


class Grids:
    """Sampled distances of all pieces of a body."""

    def __init__(self, body: Body, cell: float, delta: float) -> None:
        self._body, self._cell = body, np.float32(cell)
        regions = skin_regions(body)
        pieces = [(m, False, region_surface(body.skin, regions, m)) for m in range(len(regions))]
        for m in range(len(regions)):
            if regions.parent[m] < 0:
                continue
            below = {m}
            for k in range(m + 1, len(regions)):
                if int(regions.parent[k]) in below:
                    below.add(k)
            weight = regions.weight[:, sorted(below)].sum(axis=1)
            corners = np.column_stack([body.skin.vertices, weight])[body.skin.triangles]
            for side, bound in ((1, BAND[0]), (0, BAND[1])):
                corners = split(corners, corners[..., 3] - bound)[side]
            if len(corners) > 8:
                pieces.append((m, True, corners[..., :3]))
        self._bones = [(int(regions.joint[m]), half) for m, half, _ in pieces]
        low, size, value = [], [], []
        for (joint, _), (_, _, surface) in zip(self._bones, pieces):
            surface = np.concatenate([surface, *_lids(*_rims(surface))])
            local = transform_points(body.skin.T_bone_bind[joint], surface.reshape(-1, 3))
            points, corner = np.unique(np.round(local, 7), axis=0, return_inverse=True)
            triangles = corner.reshape(-1, 3).astype(np.int32)
            distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
            low.append(points.min(axis=0) - AROUND)
            count = np.ceil((points.max(axis=0) + AROUND - low[-1]) / cell).astype(int) + 1
            at = low[-1] + cell * np.indices(count).reshape(3, -1).T
            skin = MeshDistance(points, triangles[distinct])
            value.append((skin.signed_distance(at)[0] - delta).astype(np.float32))
            size.append(count)
        self._low, self._size = np.array(low, np.float32), np.array(size, np.int32)
        self._first = np.cumsum([0, *map(len, value)])
        self.value = np.concatenate(value)
        self.move(invert_transform(body.skin.T_bone_bind))

    def move(self, T_world_joint: np.ndarray) -> None:
        """Pose all pieces."""
        T = np.array([self._pose(T_world_joint, *bone) for bone in self._bones])
        self._rotation = np.ascontiguousarray(T[:, :3, :3], np.float32)
        self._origin = np.ascontiguousarray(T[:, :3, 3], np.float32)

    def _pose(self, T: np.ndarray, joint: int, half: bool) -> np.ndarray:
        if not half:
            return T[joint]
        above, bind = self._body.rig.parent[joint], self._body.skin.T_bone_bind[:, :3, :3]
        unturned = T[above, :3, :3] @ bind[above] @ bind[joint].T
        turn = Rotation.from_matrix(unturned.T @ T[joint, :3, :3]).as_rotvec()
        posed = T[joint].copy()
        posed[:3, :3] = unturned @ Rotation.from_rotvec(0.5 * turn).as_matrix()
        return posed

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Least signed distance of points [n, 3] to all pieces; 1 m where it is not known."""
        result = np.empty(len(points), np.float32)
        single = np.ascontiguousarray(points, np.float32)
        grids = (self._low, self._size, self._first, self.value, self._cell)
        _ask(*grids, self._rotation, self._origin, single, result)
        return result


@njit(nogil=True, fastmath=True)
def _ask(low, size, first, value, cell, R, origin, x, result):
    for i in range(x.shape[0]):
        best = FAR
        for m in range(low.shape[0]):
            a, b, c = x[i, 0] - origin[m, 0], x[i, 1] - origin[m, 1], x[i, 2] - origin[m, 2]
            u = (R[m, 0, 0] * a + R[m, 1, 0] * b + R[m, 2, 0] * c - low[m, 0]) / cell
            v = (R[m, 0, 1] * a + R[m, 1, 1] * b + R[m, 2, 1] * c - low[m, 1]) / cell
            w = (R[m, 0, 2] * a + R[m, 1, 2] * b + R[m, 2, 2] * c - low[m, 2]) / cell
            if u < 0.0 or v < 0.0 or w < 0.0:
                continue
            p, q, r = int(u), int(v), int(w)
            if p >= size[m, 0] - 1 or q >= size[m, 1] - 1 or r >= size[m, 2] - 1:
                continue
            u, v, w = u - p, v - q, w - r
            y, z = size[m, 2], size[m, 1] * size[m, 2]
            k = first[m] + p * z + q * y + r
            d = np.float32(0.0)
            for corner in range(8):
                i0, i1, i2 = corner >> 2, (corner >> 1) & 1, corner & 1
                share = (u if i0 else 1 - u) * (v if i1 else 1 - v) * (w if i2 else 1 - w)
                d += share * value[k + i0 * z + i1 * y + i2]
            best = min(best, d)
        result[i] = best


def tell(name: str, distance: np.ndarray, area: np.ndarray) -> None:
    """Print how far skin is from a union."""
    known = distance < FAR
    order = np.argsort(distance)
    share = np.cumsum(area[order]) / area.sum()
    p99 = distance[order][np.searchsorted(share, 0.99)]
    mean = np.average(np.abs(distance[known]), weights=area[known])
    outside = area[distance > 1e-4].sum() / area.sum()
    print(
        f"  {name}: mean distance {1e3 * mean:.2f} mm; outside {100 * outside:.1f} % of the skin, "
        f"p99 {1e3 * p99:.1f} mm, max {1e3 * distance[known].max():.1f} mm"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    here = Path(__file__).resolve().parents[1]
    default = Path(os.environ.get("GARMENT_SIM_DATA") or here.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=default, help="folder with mocap")
    parser.add_argument("--body", default="mannequin")
    parser.add_argument("--cell", type=float, default=0.01)
    parser.add_argument("--delta", type=float, default=0.003)
    options = parser.parse_args()
    body = load_body(options.body)
    begin = time.thread_time()
    grids = Grids(body, options.cell, options.delta)
    print(f"grids: {time.thread_time() - begin:.1f} s, {grids.value.nbytes / 1e6:.1f} MB")
    hulls = fit_hulls(body).colliders
    poser = ColliderPoser(hulls, body)
    union = Union(hulls, poser.poses(invert_transform(body.skin.T_bone_bind)))
    x, area = body.skin.vertices, vertex_areas(body.skin)
    print("bind pose")
    tell("grids", grids.distance(x), area)
    tell("hulls", union.distance(x), area)
    rng = np.random.default_rng(0)
    near = x[rng.integers(len(x), size=3190)] + rng.normal(scale=0.008, size=(3190, 3))
    for name, ask in (("grids", grids.distance), ("hulls", union.distance)):
        took = []
        for _ in range(30):
            begin = time.thread_time()
            ask(near)
            took.append(time.thread_time() - begin)
        print(f"  {name}: {1e9 * np.median(took) / len(near):.0f} ns per particle")
    skinner, found = Skinner(body.skin), {"grids": [], "hulls": []}
    for name in CLIPS:
        clip = load_clip(options.data / "mocap" / f"{name}.bvh")
        retargeter = Retargeter(clip.rig, body, reference=clip.source_reference)
        for t in np.linspace(0.0, clip.duration, 15):
            T = retargeter.world_joints(sample(clip, float(t)))
            posed = skinner.vertices(T)
            grids.move(T)
            union.move(poser.poses(T))
            found["grids"].append(grids.distance(posed))
            found["hulls"].append(union.distance(posed))
    print("posed")
    for name, distances in found.items():
        tell(name, np.concatenate(distances), np.tile(area, len(distances)))


if __name__ == "__main__":
    main()
