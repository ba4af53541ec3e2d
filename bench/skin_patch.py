"""A trial: skin that leaves all shapes as a collider of its own, beside the hulls.

    python bench/skin_patch.py BODY,OUTFIT,CLIP ... [--without] [--seconds S] [--pictures DIR]

Triangles of the skin that are over 3 mm outside of all shapes in more than 8 % of random poses
make an open patch. It follows the poses of the colliders; particles that face it at rest and are
up to 3 cm behind it are moved out along its normal, at 0.5 m/s more than the skin moves. Figures
are those of `worn.py`; what it gives is in `docs/tried.md`. The search looks at all triangles, in
each sub-step in Python: the times are not those of a collider.
"""

import argparse

import numpy as np
import worn

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.random_poses import random_poses
from garment_sim_ros.colliders.report.fatness import Union
from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.jit import exact_kernel
from garment_sim_ros.sim.holds.constraint import Constraint
from garment_sim_ros.sim.simulation import Simulation

POSES = 48
OPEN = 0.003  # skin that is farther outside of the shapes is bare [m]
SHARE = 0.08  # of the poses in which a triangle of the patch is bare
AT_REST = 0.12  # particles farther from the patch at rest do not meet it [m]
REACH = 0.05  # nor do those that are farther from it now [m]
THICKNESS, DEPTH = 0.002, 0.03  # kept from the skin; what is deeper is left alone [m]
SPEED = 0.5  # at which particles come out [m/s]
EDGE = 0.05  # how far beyond a triangle its plane counts, in barycentric coordinates
FIGURES = "pierced inside_p99 inside_median strain_max strain_p95 jump_cm crossed_p99 ms_median"


def bare_triangles(body, colliders):
    """Triangles that are often outside of all shapes."""
    poser, skinner = ColliderPoser(colliders, body), Skinner(body.skin)
    triangles, union = body.skin.triangles, None
    bare = np.zeros(len(triangles))
    for joints in random_poses(body, POSES, seed=7):
        placed = poser.poses(joints)
        union = union or Union(colliders, placed)
        union.move(placed)
        x = skinner.vertices(joints)
        height = union.distance(np.concatenate([x, x[triangles].mean(axis=1)]))
        corners, centre = height[: len(x)][triangles], height[len(x) :]
        bare += np.maximum(corners.max(axis=1), centre) > OPEN
    return np.flatnonzero(bare > SHARE * POSES)


@exact_kernel()
def plane_place(corner, point, out):
    """Barycentric coordinates b and c, into out, of a point's foot on a triangle's plane."""
    uu = uv = vv = wu = wv = 0.0
    for d in range(3):
        u, v = corner[1, d] - corner[0, d], corner[2, d] - corner[0, d]
        w = point[d] - corner[0, d]
        uu += u * u
        uv += u * v
        vv += v * v
        wu += w * u
        wv += w * v
    area2 = max(uu * vv - uv * uv, 1e-20)
    out[0] = (vv * wu - uv * wv) / area2
    out[1] = (uu * wv - uv * wu) / area2


@exact_kernel()
def find_nearest(corners, x, which, near):
    """The triangle that is nearest to each of some particles, -1 for none in reach."""
    place = np.zeros(2)
    for n in range(which.size):
        best, near[n] = REACH * REACH, -1
        for t in range(len(corners)):
            plane_place(corners[t], x[which[n]], place)
            b, c = min(max(place[0], 0.0), 1.0), min(max(place[1], 0.0), 1.0)
            b, c = b / max(b + c, 1.0), c / max(b + c, 1.0)
            squared = 0.0
            for d in range(3):
                corner = corners[t]
                foot = (1.0 - b - c) * corner[0, d] + b * corner[1, d] + c * corner[2, d]
                squared += (x[which[n], d] - foot) ** 2
            if squared < best:
                best, near[n] = squared, t


@exact_kernel()
def push_out(x, v, corners, normals, velocities, which, near, touched, touched_normal, dt):
    """Moves particles out of the patch, but into no shape that they touch; how many."""
    held = 0
    place, weight = np.zeros(2), np.zeros(3)
    n, speed = np.zeros(3), np.zeros(3)
    for k in range(which.size):
        p, t = which[k], near[k]
        if t < 0:
            continue
        plane_place(corners[t], x[p], place)
        b, c = place
        if b < -EDGE or c < -EDGE or b + c > 1.0 + EDGE:
            continue
        weight[0], weight[1], weight[2] = 1.0 - b - c, b, c
        length = height = into = coming = moving = 0.0
        for d in range(3):
            n[d] = speed[d] = 0.0
            for m in range(3):
                n[d] += weight[m] * normals[t, m, d]
                speed[d] += weight[m] * velocities[t, m, d]
            length += n[d] * n[d]
        length = np.sqrt(length) + 1e-12
        for d in range(3):
            n[d] /= length
            foot = x[p, d]
            for m in range(3):
                foot -= weight[m] * corners[t, m, d]
            height += foot * n[d]
            into += touched_normal[p, d] * n[d]
            coming += speed[d] * n[d]
            moving += (v[p, d] - speed[d]) * n[d]
        short = THICKNESS - height
        if short <= 0.0 or short > DEPTH or (touched[p] >= 0 and into < -0.2):
            continue
        held += 1
        push = min(short, (SPEED + max(coming, 0.0)) * dt)
        for d in range(3):
            x[p, d] += push * n[d]
            v[p, d] -= min(moving, 0.0) * n[d]
    return held


class Patch(Constraint):
    """Keeps one garment out of bare skin; body and garment are at rest when it is made."""

    def __init__(self, one, colliders, body, skin, faces):
        self._colliders, self._skin, self._contacts = colliders, skin, one.workspace.contacts
        self._all, self._triangles = body.skin.triangles, body.skin.triangles[faces]
        self._key, self._step = None, 0.0
        normal = np.empty((len(one.model), 3))
        x = np.asarray(one.garment.vertices, np.float64)
        vertex_normals(x, one.garment.triangles, normal)
        free = one.model.vertex[: one.model.free_count]
        a, b, c = body.skin.vertices[self._triangles].transpose(1, 0, 2)
        way = np.linalg.norm(x[free][:, None] - ((a + b + c) / 3.0)[None], axis=2)
        outward = np.cross(b - a, c - a)[way.argmin(axis=1)]
        outward /= np.linalg.norm(outward, axis=1)[:, None] + 1e-12
        faces_it = np.einsum("ni,ni->n", normal[free], outward) > 0.2
        self._which = np.flatnonzero((way.min(axis=1) < AT_REST) & faces_it)
        self._near = np.full(len(self._which), -1)

    def hold(self, state, left, dt):
        """See `Constraint`."""
        colliders = self._colliders
        places = (colliders.start, colliders.end)
        key = b"".join(p.position.tobytes() + p.orientation.tobytes() for p in places)
        if key != self._key or left + dt > self._step:
            self._key, self._step = key, left + dt
            start, end = (self._posed(p) for p in places)
            self._end, self._way = end, (end[0] - start[0], end[1] - start[1])
            find_nearest(end[0], state.x, self._which, self._near)
        before = left / self._step
        corners, normals = (e - before * w for e, w in zip(self._end, self._way))
        velocities = self._way[0] / self._step
        touched = self._contacts.shape, self._contacts.normal
        own = state.x, state.v
        return int(
            push_out(*own, corners, normals, velocities, self._which, self._near, *touched, dt)
        )

    def _posed(self, poses):
        x = self._skin.vertices(poses).copy()
        normal = np.empty_like(x)
        vertex_normals(x, self._all, normal)
        return (x - self._colliders.origin)[self._triangles], normal[self._triangles]


def patched(body):
    """The simulation of a body whose bare skin is a patch."""

    class Patched(Simulation):
        def __init__(self, garments, colliders, **options):
            super().__init__(garments, colliders, **options)
            faces = bare_triangles(body, colliders)
            print(f"{len(faces)} of {len(body.skin.triangles)} triangles are in the patch")
            skin = SkinFromPoses(colliders, body)
            for one in self._worn.values() if len(faces) else ():
                patch = Patch(one, self._colliders, body, skin, faces)
                one.constraints = (*one.constraints, patch)

    return Patched


def main():
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("run", nargs="+", metavar="BODY,OUTFIT,CLIP")
    parser.add_argument("--without", action="store_true", help="no patch, for comparison")
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--pictures", default="")
    options = parser.parse_args()
    for asked in options.run:
        body, outfit, clip = asked.split(",")
        if not options.without:
            worn.Simulation = patched(load_body(worn.found(body, "bodies")))
        row = worn.run(
            worn.Asked(body, outfit, clip, "plain", "xpbd", options.seconds, options.pictures)
        )
        print(asked, ", ".join(f"{name} {row[name]}" for name in FIGURES.split()), flush=True)


if __name__ == "__main__":
    main()
