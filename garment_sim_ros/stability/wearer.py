"""Whether the garments of a dressed scene are still worn, by the measures of ``docs/worn.md``."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.contact.pierced import PiercedSoFar
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.recording.metrics import GarmentMesh


class HowWorn(NamedTuple):
    """How garments are worn in one pose.

    Attributes:
        pierced: Bones that run through a garment, those that meet several counted for each.
        inside: Largest share of a garment's area that is in the skin.
    """

    pierced: int
    inside: float


class Wearer:
    """The body in a dressed scene, at any size: lengths are measured at the body's own.

    Args:
        body: The body.
        colliders: Its colliders.
        garments: What it wears.
        scale: How many times as large as these the scene is.
    """

    def __init__(
        self, body: Body, colliders: ColliderSet, garments: tuple[Garment, ...], scale: float
    ) -> None:
        self._scale = scale
        self._colliders = colliders
        self._triangles = {g.name: g.triangles for g in garments}
        self._meshes = {g.name: GarmentMesh.from_rest(g.vertices, g.triangles) for g in garments}
        self._skin = SkinFromPoses(colliders, body)
        self._distance = MeshDistance(body.skin.vertices, body.skin.triangles)

    def look(self, poses: ColliderPoses, positions: Mapping[str, NDArray[np.floating]]) -> HowWorn:
        """At garments in one pose.

        Args:
            poses: World poses of the scene's colliders.
            positions: World positions of the scene's garments [m], shape [v, 3].
        """
        poses, origin = poses.copy(), poses.position[0].copy()
        poses.position = (poses.position - origin) / self._scale
        x = {n: (p - origin) / self._scale for n, p in positions.items()}
        meter = PiercedSoFar(self._colliders, list(x))
        meter.add(poses, {n: (p, self._triangles[n]) for n, p in x.items()})
        self._distance.refit(self._skin.vertices(poses))
        inside = [
            self._meshes[n].inside(self._distance.signed_distance(self._meshes[n].samples(p))[0])
            for n, p in x.items()
        ]
        return HowWorn(sum(map(len, meter.now.values())), max(inside))
