"""Winding a garment back that is no longer worn right, see `rewinding`."""

from collections.abc import Callable

import numpy as np

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.geometry.transforms import (
    invert_transform,
    quaternion_from_matrix,
    transform_from,
)
from garment_sim_ros.sim.on_its_way import turn_with
from garment_sim_ros.sim.placement import blend
from garment_sim_ros.sim.rewinding import Kept, Rewinding, overstretched
from garment_sim_ros.sim.worn import Worn

_MOST, _MORE = 0.01, 0.002
"""Share of a garment's edges that may be overstretched when it is wound back, and that this may
add: skin stretches far."""


def moved_with_root(kept: Kept, poses: ColliderPoses, root: int) -> Kept:
    """Body and garment as they were, moved rigidly to where the root is now."""
    then = transform_from(kept.poses.position[root], kept.poses.orientation[root])
    now = transform_from(poses.position[root], poses.orientation[root])
    T = now @ invert_transform(then)
    moved = kept.poses.copy()
    _turn(moved, T)
    x = kept.x @ T[:3, :3].T + T[:3, 3]
    return Kept(x.astype(np.float32), moved)


def _turn(poses: ColliderPoses, T: FloatArray) -> None:
    """Moves poses by a rigid transform, in place."""
    there = T @ transform_from(poses.position, poses.orientation)
    poses.position[:] = there[:, :3, 3]
    poses.orientation[:] = quaternion_from_matrix(there[:, :3, :3])


def carried(worn: Worn, kept: Kept, poses: ColliderPoses) -> SingleArray:
    """A garment as it was, on a body in other poses: each vertex where its skin went.

    What it is off its place as skin turns with the skin.

    Args:
        worn: The garment.
        kept: What it was like.
        poses: World poses of the colliders now.

    Returns:
        World positions [m], shape [v, 3].
    """
    garment = worn.garment
    then, now = worn.frames.world(kept.poses), worn.frames.world(poses)
    off = kept.x - blend(garment, then)
    weight, index = np.asarray(garment.frame_weight), np.asarray(garment.frame_index)
    off = turn_with(off, index, weight, then[:, :3, :3], now[:, :3, :3])
    return (blend(garment, now) + off).astype(np.float32)


def wind_back(
    rewinding: Rewinding,
    worn: Worn,
    poses: ColliderPoses,
    replay: Callable[[Worn, Kept, ColliderPoses], None],
) -> bool:
    """Winds a garment back to what it was like while it was worn right.

    What it was like is first taken along as skin. Where that is not well, the body moves from
    where it was then to where it is, with the garment on. Where the part near the limbs that run
    through it is enough the rest stays as it is.

    Args:
        rewinding: Knows what it was like.
        worn: The garment.
        poses: World poses of the colliders.
        replay: Places it as it was and moves the body.

    Returns:
        Whether anything was found that is well; else it stays as it is.
    """
    name, origin = worn.garment.name, rewinding.origin
    before = worn.state.copy()
    seen = worn.seen(origin)
    x, v = rewinding.positions(worn), rewinding.skin_velocity(worn)
    whole, bears = np.ones(len(x)), may_stretch(worn, x)
    for kept in rewinding.candidates(name):
        for replays in (False, True) if rewinding.may_replay(name) else (False,):
            if replays:
                replay(worn, kept, poses)
                good = rewinding.positions(worn)
            else:
                good = carried(worn, kept, poses)
            if not rewinding.is_well(worn, good, poses, bears):
                continue
            worn.state.assign(before)
            share = rewinding.part(name, x, good)
            mixed = (x + share[:, None] * (good - x)).astype(np.float32)
            part = bool(share.min() < 1.0) and rewinding.is_well(worn, mixed, poses, bears)
            worn.wind_back(good.astype(np.float64), v, share if part else whole, origin)
            set_out(rewinding, worn, seen, poses)
            worn.health.rewound += not part
            worn.health.rewound_parts += part
            return True
    worn.state.assign(before)
    worn.wind_back(x.astype(np.float64), v, np.zeros(len(x)), origin)
    set_out(rewinding, worn, seen, poses)
    worn.health.not_rewound += 1
    return False


def may_stretch(worn: Worn, x: SingleArray) -> float:
    """Share of a garment's edges that may be overstretched where it is wound back to.

    Args:
        worn: The garment.
        x: Its vertices as they are [m], shape [v, 3].
    """
    return min(overstretched(worn, x), _MOST) + _MORE


def set_out(rewinding: Rewinding, worn: Worn, seen: SingleArray, poses: ColliderPoses) -> None:
    """Lets a garment that was seen somewhere be seen on its way to where it is."""
    off = seen.astype(np.float64) - rewinding.positions(worn)
    worn.on_its_way.begin(off, worn.frames.world(poses))
