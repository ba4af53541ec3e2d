"""What the two papers compare themselves with, in the walk of Sun et al.'s Fig. 9.

    python bench/comparators.py [--seconds 2]

Beside `sun2007` and `gong2018`: ellipsoids placed one to a region, with particles that ride on the
nearest one (Rudomin, [11] of Sun et al.); truncated ellipsoids and spheres with relative
simulation (Oh, [12]); ellipsoids without segmentation (Tang Y., [19] of Gong et al.); the exact
mesh (Tang M., [27]). All have the T-shirt and the short skirt, the cloth, three sweeps and the
step of 0.033 s of both papers, on the body of 1,425 vertices. What differs from their papers is
told in `docs/papers.md`.
"""

import argparse
import time

import numpy as np
from papers import BODY, SHORT, told
from presets import Clip, Wearer

from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import EllipsoidSettings
from garment_sim_ros.colliders.ellipsoids.ellipsoid_binding import ellipsoid_colliders
from garment_sim_ros.colliders.ellipsoids.ellipsoids import ellipsoids_around
from garment_sim_ros.colliders.hulls.hull import convex_hull
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.kinds.sphere import SPHERE
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.geometry.transforms import transform_from, transform_points
from garment_sim_ros.presets import Choice, chosen

ONE_EACH = {"segmentation": "table1", "paths": "edges", "cover": "vertices"} | dict.fromkeys(
    ("mu_torso", "mu_limb"), 1.0
)
"""One smallest ellipsoid to each of the 15 regions, as a hand would place them."""
_CUTS, _AROUND = 7, 14
"""Rings of corners along a truncated ellipsoid, corners on a ring."""


def words(node: str, values: dict[str, object]) -> list[str]:
    """As ``--set`` takes them."""
    return [
        f"{node}.{k}={str(v).lower() if isinstance(v, bool) else v}" for k, v in values.items()
    ]


ELLIPSOIDS = words("collider_node", {"method": "ellipsoids", "refit": False, **ONE_EACH})


def truncated(body: Body, fitted: ColliderSet) -> ColliderSet:
    """The 15 ellipsoids cut where their regions end, and the spheres at joints of `fitted`.

    What is left of an ellipsoid between two planes across its longest axis is convex: it is a
    hull of rings of points.
    """
    fit = ellipsoids_around(body, EllipsoidSettings(**ONE_EACH))
    angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    shapes = []
    for e, members, c in zip(fit.ellipsoids, fit.members, ellipsoid_colliders(body, fit, 0.0)):
        along = (members.of(body.skin.vertices) - e.centre) @ e.axes[:, 0]
        z = np.linspace(max(along.min(), -e.radii[0]), min(along.max(), e.radii[0]), _CUTS)
        width = np.sqrt(np.maximum(1.0 - (z / e.radii[0]) ** 2, 1e-4))
        ring = [np.cos(angle) * e.radii[1], np.sin(angle) * e.radii[2]]
        rings = [[np.full(_AROUND, a), w * ring[0], w * ring[1]] for a, w in zip(z, width)]
        hull = convex_hull(np.concatenate([np.stack(r, axis=-1) for r in rings]))
        geometry = {"vertices": hull.vertices, "faces": hull.faces}
        shapes.append(
            Collider(
                **{"name": c.name, "kind": HULL.name, "bone": c.bone},
                **{"position": c.position, "orientation": c.orientation, "geometry": geometry},
            )
        )
    others = [c for c in fitted.colliders if c.is_frame or c.record is SPHERE]
    return ColliderSet(colliders=(*shapes, *others), thickness=fitted.thickness)


class Riding(Wearer):
    """Particles go with the nearest ellipsoid first, and then the cloth is simulated."""

    def advance(self, n: int) -> None:
        """Each particle as a part of the ellipsoid that it is nearest to; then a step."""
        before, after = self.poses[n - 1], self.poses[n]
        for name in self.simulation.names:
            state = self.simulation.state(name)
            x = state.x.astype(np.float64).reshape(-1, 3) + self.simulation.origin
            ridden = self._ridden(x, before, after) - self.simulation.origin
            state.x[:] = ridden.astype(np.float32).reshape(state.x.shape)
        self.simulation.advance(after, after, self.frame_time)

    def _ridden(self, x: np.ndarray, before: ColliderPoses, after: ColliderPoses) -> np.ndarray:
        """Positions moved with the nearest ellipsoid, by the distance along its centre's ray."""
        nearest, least = np.zeros(len(x), np.int64), np.full(len(x), np.inf)
        moved = []
        for i, c in enumerate(self.avatar.colliders.colliders):
            T = transform_from(before.position[i], before.orientation[i])
            local = transform_points(np.linalg.inv(T), x)
            then = transform_from(after.position[i], after.orientation[i])
            moved.append(transform_points(then, local))
            if c.is_frame:
                continue
            far = np.linalg.norm(local, axis=1)
            inside = np.linalg.norm(local / np.asarray(c.geometry["radii"]), axis=1)
            distance = np.abs(far - far / np.maximum(inside, 1e-9))
            closer = distance < least
            least[closer], nearest[closer] = distance[closer], i
        result: np.ndarray = np.array(moved)[nearest, np.arange(len(x))]
        return result


def variants() -> dict[str, tuple[Choice, type[Wearer], object]]:
    """What is compared: preset and words, how frames are played, what is made of colliders."""
    world = words("cloth_node", {"root_linear_inertia": 1.0})
    count = words("collider_node", {"segmentation": "none", "mu_torso": 0.012, "mu_limb": 0.012})
    mesh = ["collider_node.method=mesh", "cloth_node.contact=union", "cloth_node.response=surface"]
    return {
        "sun2007": (chosen("sun2007", []), Wearer, None),
        "gong2018": (chosen("gong2018", []), Wearer, None),
        "[11]": (chosen("sun2007", [*ELLIPSOIDS, *world]), Riding, None),
        "[11] without riding": (chosen("sun2007", [*ELLIPSOIDS, *world]), Wearer, None),
        "[12]": (chosen("sun2007", []), Wearer, truncated),
        "[19]": (chosen("gong2018", count), Wearer, None),
        "[27]": (chosen("gong2018", mesh), Wearer, None),
    }


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--only", nargs="+", choices=list(variants()), default=list(variants()))
    options = parser.parse_args()
    for name, (choice, kind, change) in variants().items():
        if name not in options.only:
            continue
        began = time.process_time()
        wearer = kind(choice, Clip("walk", "walk"), options.seconds, BODY, SHORT, change)
        took = time.process_time() - began
        shapes = sum(not c.is_frame for c in wearer.avatar.colliders.colliders)
        told(f"{name}, {shapes} shapes, ready after {took:.1f} s", wearer, options.seconds)


if __name__ == "__main__":
    main()
