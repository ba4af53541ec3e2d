"""The colliders in a step and in its sub-steps, the same for all garments."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.ellipsoid_refit import EllipsoidRefit
from garment_sim_ros.contact.mesh.skin import SkinContact
from garment_sim_ros.contact.packed import Bounds, PackedShapes, PosedShapes, Poses, pack, pose
from garment_sim_ros.contact.papers.rays.tables import RayTables, ray_tables
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.contact.sweep import Sweep
from garment_sim_ros.jit import compiled
from garment_sim_ros.sim.bare_skin import BareSkin
from garment_sim_ros.sim.world.path import Path, Way, begin, follow


@dataclass(kw_only=True, eq=False)
class ColliderState:
    """Colliders during one step: shared by all garments.

    Attributes:
        collider_set: The set.
        shapes: The shapes that can be touched.
        start: World poses of the whole set when the step starts.
        end: World poses when it ends.
        before: World poses when the sub-step starts.
        now: World poses when it ends.
        path: Poses at the end of each sub-step since then.
        searched: World poses at the last search for contacts.
        thickness: Distance that the set asks cloth to keep [m].
        origin: World position that particle positions are relative to [m], shape [3].
        posed: The shapes posed for the sub-step; until the first one for the step.
        since: The same, with the way since the last search for contacts.
        sweep: What finding those needs that would pass through cloth in one step.
        refit: Those of them that change with the pose.
        skin: The exact skin in the place of shapes; None without one.
        bare: Skin that leaves the shapes; None without any.
        still: Whether nothing moves in the step.
        goes_on: Whether the step starts with the poses that the last one ended with.
        way: The same arrays for kernels; None before the first step.
        ways: The same by sub-steps for each search: steps in parts have several in turn.
        code: Machine code of `world.path`.
    """

    collider_set: ColliderSet
    shapes: PackedShapes
    start: ColliderPoses
    end: ColliderPoses
    before: ColliderPoses
    now: ColliderPoses
    path: Path
    searched: ColliderPoses
    thickness: float
    origin: FloatArray
    posed: PosedShapes
    since: PosedShapes
    sweep: Sweep
    refit: EllipsoidRefit
    skin: SkinContact | None = None
    bare: BareSkin | None = None
    still: bool = True
    goes_on: bool = False
    way: Way | None = None
    ways: dict[int, Way] = field(default_factory=dict)
    code: tuple[Callable[..., Any], Callable[..., Any]] | None = None

    @classmethod
    def of(
        cls,
        colliders: ColliderSet,
        T_world_rest: FloatArray | None = None,
    ) -> "ColliderState":
        """All that one set needs, to be posed; its rest as in `contact.packed.pack`.

        Raises:
            GeometryError: A collider that cannot be simulated.
        """
        n = len(colliders)
        shapes = pack(colliders, T_world_rest)
        posed = PosedShapes.room_for(shapes)
        return cls(
            collider_set=colliders,
            shapes=shapes,
            start=ColliderPoses.identity(n),
            end=ColliderPoses.identity(n),
            before=ColliderPoses.identity(n),
            now=ColliderPoses.identity(n),
            path=Path.room_for(1, n),
            searched=ColliderPoses.identity(n),
            thickness=colliders.thickness,
            origin=np.zeros(3),
            posed=posed,
            # Both are at the same places, and only came there from others.
            since=posed._replace(carry=np.zeros_like(posed.carry)),
            sweep=Sweep.of(colliders, shapes),
            refit=EllipsoidRefit(colliders, shapes),
            skin=SkinContact(colliders) if colliders.has_skin else None,
            bare=BareSkin(colliders) if colliders.has_bare_skin else None,
        )

    @cached_property
    def rays(self) -> RayTables:
        """What contact along rays needs of the hulls, computed where it is asked for."""
        return ray_tables(self.collider_set)

    def pose(self) -> None:
        """Poses the shapes for the step from `start` to `end`."""
        pose(self.shapes, self.start, self.end, self.origin, self.posed)
        self.refit.pose(self.end, self.origin, self.shapes, self.posed)
        if self.skin is not None:
            self.skin.move(self.start, self.end, self.origin)

    def pose_bare_skin(self) -> None:
        """Poses the skin that leaves the shapes for the end of the step."""
        if self.bare is not None:
            self.bare.pose(self.end, self.origin)

    def begin(self, search_every: int) -> None:
        """Begins the sub-steps of the step from `start` to `end`, for which the set is posed.

        Args:
            search_every: Sub-steps for each search for contacts.
        """
        if search_every not in self.ways:
            self.ways[search_every] = self._way(
                Path.room_for(search_every, len(self.start.position))
            )
        self.way = self.ways[search_every]
        self.path = self.way.path
        if self.code is None:
            self.code = compiled(follow, self.way, 0, 1, 1, True), compiled(begin, self.way)
        self.still, self.goes_on = self.code[1](self.way)

    def move(self, first: int, last: int, count: int, searches: bool) -> None:
        """Moves all colliders through sub-steps of the step, up to the next search at most.

        Shapes are posed for the last of them.

        Args:
            first: The first of them, from 0.
            last: The one to stop before.
            count: Number of sub-steps of the step.
            searches: Whether contacts are searched for in the last one.
        """
        if self.still:
            return
        assert self.way is not None
        assert self.code is not None
        self.code[0](self.way, first, last, count, searches)
        if len(self.refit):
            self.refit.pose(self.now, self.origin, self.shapes, self.posed)

    def _way(self, path: Path) -> Way:
        return Way(
            start=Poses.of(self.start),
            end=Poses.of(self.end),
            before=Poses.of(self.before),
            now=Poses.of(self.now),
            searched=Poses.of(self.searched),
            path=path,
            shapes=Bounds.of(self.shapes),
            origin=self.origin,
            posed=self.posed,
            since=self.since.carry,
            scratch=np.zeros((3, 3, 3)),
        )
