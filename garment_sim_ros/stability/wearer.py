"""Whether the garments of a dressed scene are still worn, by the measures of ``docs/worn.md``."""

import itertools
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.contact.pierced import PiercedSoFar
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.recording.metrics import GarmentMesh, crossed
from garment_sim_ros.sim.placement import blend, find_frames
from garment_sim_ros.stability.layer_order import under


class HowWorn(NamedTuple):
    """How garments are worn in one pose.

    Attributes:
        pierced: Bones that run through a garment, those that meet several counted for each.
        inside: Largest share of a garment's area that is in the skin.
        moved: How far each garment as a whole is from where it would be as skin, in heights of
            the body, shape [g, 3].
        crossed: Largest share of a garment's edges that run through another garment.
        under: Largest share of what lies on a garment that is under it instead.
    """

    pierced: int
    inside: float
    moved: FloatArray
    crossed: float
    under: float


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
        self._garments = garments
        self._meshes = {g.name: GarmentMesh.of(g) for g in garments}
        self._skin = SkinFromPoses(colliders, body)
        self._body = MeshDistance(body.skin.vertices, body.skin.triangles)
        self._cloth = {g.name: MeshDistance(g.vertices, g.triangles) for g in garments}
        self._height = float(np.ptp(body.skin.vertices[:, 2]))
        self._pierced = PiercedSoFar(colliders, list(self._meshes))

    def begin(self) -> None:
        """Another run begins."""
        self._pierced = PiercedSoFar(self._colliders, list(self._meshes))

    def pierced(self, poses: ColliderPoses, positions: Mapping[str, NDArray[np.floating]]) -> int:
        """Bones that run through garments in the next frame; arguments as for `look`."""
        poses, x = self._at_own_size(poses, positions)
        self._pierced.add(poses, {g.name: (x[g.name], g.triangles) for g in self._garments})
        return sum(map(len, self._pierced.now.values()))

    def look(self, poses: ColliderPoses, positions: Mapping[str, NDArray[np.floating]]) -> HowWorn:
        """At garments in the frame that `pierced` was asked of.

        Args:
            poses: World poses of the scene's colliders.
            positions: World positions of the scene's garments [m], shape [v, 3].
        """
        poses, x = self._at_own_size(poses, positions)
        self._body.refit(self._skin.vertices(poses))
        inside, moved = [], []
        for garment in self._garments:
            mesh, at = self._meshes[garment.name], x[garment.name]
            self._cloth[garment.name].refit(at)
            inside.append(mesh.inside(self._body.signed_distance(mesh.samples(at))[0]))
            frames = find_frames(garment.name, garment.frames, self._colliders)
            place = blend(garment, frames.world(poses))
            moved.append((at - place).mean(axis=0) / self._height)
        through, below = [0.0], [0.0]
        for inner, outer in itertools.permutations(self._garments, 2):
            mesh, other = self._meshes[outer.name], self._meshes[inner.name]
            through.append(crossed(mesh, x[outer.name], other, x[inner.name]))
            if inner.layer < outer.layer:
                cloth = (self._cloth[inner.name], x[inner.name], inner.triangles)
                below.append(under(mesh, x[outer.name], cloth, self._body))
        pierced = sum(map(len, self._pierced.now.values()))
        return HowWorn(pierced, max(inside), np.array(moved), max(through), max(below))

    def _at_own_size(
        self, poses: ColliderPoses, positions: Mapping[str, NDArray[np.floating]]
    ) -> tuple[ColliderPoses, dict[str, FloatArray]]:
        here, origin = poses.copy(), poses.position[0].copy()
        here.position = (poses.position - origin) / self._scale
        return here, {n: (p - origin) / self._scale for n, p in positions.items()}
