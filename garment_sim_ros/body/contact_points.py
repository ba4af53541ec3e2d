"""Points that a source and a body stand on: their feet and the ends of their arms."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.anatomy import SIDES
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.retarget_pass import Contacts
from garment_sim_ros.body.skeleton import Skeleton
from garment_sim_ros.body.skin import Body


def contacts_of(
    source: Skeleton,
    rest: Skeleton,
    body: Body,
    end_sites: Mapping[str, FloatArray],
    ankle_heights: tuple[float, float],
    *,
    wrists: bool = False,
) -> Contacts:
    """Points that both have.

    Args:
        source: Source skeleton in its reference pose.
        rest: The body's skeleton at rest.
        body: The body.
        end_sites: Joint name to where its bone ends, in the joint's frame [m], of the source.
        ankle_heights: Of a foot that stands, of the source and of the body [m].
        wrists: Whether a body with hands leans on its wrists where the source has none.
    """
    joints, offsets, heights = [], [], []
    for foot in ("leftFoot", "rightFoot"):
        if foot in source.bones and foot in rest.bones:
            joints.append((source.bones[foot], rest.bones[foot]))
            offsets.append(np.zeros((2, 3)))
            heights.append(ankle_heights)
    for side in SIDES:
        end_s = _arm_end(source, side, _skeleton_points(source, end_sites))
        end_t = _arm_end(rest, side, _skin_points(body))
        if wrists and f"{side}Hand" in rest.bones and f"{side}Hand" not in source.bones:
            end_t = rest.bones[f"{side}Hand"], np.zeros(3)
        if end_s is not None and end_t is not None:
            joints.append((end_s[0], end_t[0]))
            offsets.append(np.stack([end_s[1], end_t[1]]))
            heights.append((0.0, 0.0))
    return Contacts(
        joints=np.array(joints, np.int32).reshape(-1, 2),
        offset=np.array(offsets, np.float64).reshape(-1, 2, 3),
        height=np.array(heights, np.float64).reshape(-1, 2),
    )


def _skeleton_points(
    skeleton: Skeleton, end_sites: Mapping[str, FloatArray]
) -> tuple[FloatArray, NDArray[np.int32]]:
    """World positions of joints and end sites, and the joint that moves each."""
    T = skeleton.T_world_joint
    index = {name: j for j, name in enumerate(skeleton.rig.joint_names)}
    ended = [index[name] for name in end_sites if name in index]
    ends = [
        T[index[n], :3, :3] @ end_sites[n] + T[index[n], :3, 3] for n in end_sites if n in index
    ]
    points = np.concatenate([T[:, :3, 3], np.reshape(ends, (-1, 3))])
    # A joint's own place is moved by its parent.
    mover = np.concatenate([skeleton.rig.parent, np.array(ended, np.int32)])
    return points, mover


def _skin_points(body: Body) -> tuple[FloatArray, NDArray[np.int32]]:
    """Vertices and the joint that moves each most."""
    main = np.argmax(body.skin.weight, axis=1)
    return body.skin.vertices, body.skin.bone[np.arange(len(main)), main]


def forearm_ends(body: Body) -> dict[str, FloatArray]:
    """The middle of the skin, in the joint's frame, of forearms without a joint beyond them."""
    vertices, mover = _skin_points(body)
    T_world_joint = rest_transforms(body.rig)
    ends = {}
    for side in SIDES:
        name = body.humanoid.get(f"{side}LowerArm")
        if name is None:
            continue
        elbow = body.rig.index(name)
        moved = vertices[mover == elbow]
        if len(moved) and not (body.rig.parent == elbow).any():
            T = T_world_joint[elbow]
            ends[name] = T[:3, :3].T @ (moved.mean(axis=0) - T[:3, 3])
    return ends


def _arm_end(
    skeleton: Skeleton, side: str, points: tuple[FloatArray, NDArray[np.int32]]
) -> tuple[int, FloatArray] | None:
    """An arm's lowest joint and, in its frame, the point of the arm farthest from its elbow."""
    lowest = next((side + b for b in ("Hand", "LowerArm") if side + b in skeleton.bones), None)
    if lowest is None:
        return None
    joint = skeleton.bones[lowest]
    positions, mover = points
    moved = positions[(mover >= 0) & skeleton.rig.below(joint)[mover]]
    T = skeleton.T_world_joint[joint]
    if len(moved) == 0:
        return joint, np.zeros(3)
    elbow = skeleton.marks.joint.get(f"{side}LowerArm", T[:3, 3])
    end = moved[np.argmax(np.linalg.norm(moved - elbow, axis=1))]
    return joint, T[:3, :3].T @ (end - T[:3, 3])
