"""The way of a collider set through the sub-steps of a step."""

from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.packed import Bounds, PosedShapes, Poses, pose_shapes
from garment_sim_ros.geometry.copying import copy
from garment_sim_ros.geometry.transforms import interpolate_poses
from garment_sim_ros.jit import kernel


class Path(NamedTuple):
    """Poses in the sub-steps from one search for contacts to the next, k at most.

    Sub-step s of a step is in slot s modulo k.

    Attributes:
        position: World positions at the end of each sub-step [m], shape [k, n, 3].
        orientation: Unit quaternions, shape [k, n, 4].
    """

    position: FloatArray
    orientation: FloatArray

    @classmethod
    def room_for(cls, sub_steps: int, colliders: int) -> "Path":
        """For so many sub-steps."""
        return cls(np.zeros((sub_steps, colliders, 3)), np.zeros((sub_steps, colliders, 4)))


@kernel(forceinline=True)
def same_poses(a, b):
    """Whether two `Poses` are equal, number for number."""
    for i in range(a.position.shape[0]):
        for k in range(3):
            if a.position[i, k] != b.position[i, k]:
                return False
        for k in range(4):
            if a.orientation[i, k] != b.orientation[i, k]:
                return False
    return True


class Way(NamedTuple):
    """A collider set on its way through a step, as the kernel has it.

    Attributes:
        start: Poses at the start of the step.
        end: At its end.
        before: When the last of the sub-steps that are taken at once starts.
        now: When it ends.
        searched: At the last search for contacts.
        path: At the end of each sub-step since then.
        shapes: The shapes.
        origin: World position of the local origin [m], shape [3].
        posed: The shapes at `now`, their `carry` from `before`.
        since: Their `carry` from `searched` to `now`, shape [m, 3, 4].
        scratch: Shape [3, 3, 3].
    """

    start: Poses
    end: Poses
    before: Poses
    now: Poses
    searched: Poses
    path: Path
    shapes: Bounds
    origin: FloatArray
    posed: PosedShapes
    since: SingleArray
    scratch: FloatArray


@kernel(inner=True)
def _assign(poses, others):
    copy(others.position, poses.position)
    copy(others.orientation, poses.orientation)


@kernel()
def begin(way):
    """Begins a step, for which the shapes are posed.

    Args:
        way: `Way`, changed in place.

    Returns:
        Whether nothing moves in it, and whether it starts with the poses that the last one ended
        with.
    """
    still, goes_on = same_poses(way.start, way.end), same_poses(way.start, way.now)
    _assign(way.now, way.start)
    _assign(way.searched, way.start)
    if still:
        copy(way.posed.carry, way.since)
        for s in range(way.path.position.shape[0]):
            copy(way.start.position, way.path.position[s])
            copy(way.start.orientation, way.path.orientation[s])
    return still, goes_on


@kernel()
def follow(way, first, last, count, searches):
    """Goes through some sub-steps of a step.

    Args:
        way: `Way`, changed in place.
        first: The first sub-step, from 0.
        last: The one to stop before.
        count: Number of sub-steps of the step.
        searches: Whether contacts are searched for in the last of them.
    """
    before, now, path, searched = way.before, way.now, way.path, way.searched
    for s in range(first, last):
        _assign(before, now)
        if s + 1 == count:  # To the last digit, by which the next step knows them again.
            _assign(now, way.end)
        else:
            interpolate_poses(
                way.start.position,
                way.start.orientation,
                way.end.position,
                way.end.orientation,
                (s + 1) / count,
                now.position,
                now.orientation,
            )
        slot = s % path.position.shape[0]
        copy(now.position, path.position[slot])
        copy(now.orientation, path.orientation[slot])
    if searches:
        pose_shapes(way.shapes, searched, now, way.origin, way.scratch, way.posed)
        copy(way.posed.carry, way.since)
        _assign(searched, now)
    pose_shapes(way.shapes, before, now, way.origin, way.scratch, way.posed)
