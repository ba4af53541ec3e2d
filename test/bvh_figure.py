"""BVH files of a standing figure."""

import numpy as np

# A standing person in metres, y up, facing +z: name, parent, offset.
FIGURE = (
    ("Hips", None, (0.0, 0.0, 0.0)),
    ("Spine", "Hips", (0.0, 0.25, 0.0)),
    ("Neck", "Spine", (0.0, 0.30, 0.0)),
    ("Head", "Neck", (0.0, 0.10, 0.0)),
    ("LeftArm", "Spine", (0.18, 0.25, 0.0)),
    ("LeftForeArm", "LeftArm", (0.28, 0.0, 0.0)),
    ("LeftHand", "LeftForeArm", (0.25, 0.0, 0.0)),
    ("RightArm", "Spine", (-0.18, 0.25, 0.0)),
    ("RightForeArm", "RightArm", (-0.28, 0.0, 0.0)),
    ("RightHand", "RightForeArm", (-0.25, 0.0, 0.0)),
    ("LeftUpLeg", "Hips", (0.09, 0.0, 0.0)),
    ("LeftLeg", "LeftUpLeg", (0.0, -0.42, 0.0)),
    ("LeftFoot", "LeftLeg", (0.0, -0.42, 0.0)),
    ("RightUpLeg", "Hips", (-0.09, 0.0, 0.0)),
    ("RightLeg", "RightUpLeg", (0.0, -0.42, 0.0)),
    ("RightFoot", "RightLeg", (0.0, -0.42, 0.0)),
)
ENDS = {
    "Head": (0.0, 0.2, 0.0),
    "LeftHand": (0.15, 0.0, 0.0),
    "RightHand": (-0.15, 0.0, 0.0),
    "LeftFoot": (0.0, -0.07, 0.15),
    "RightFoot": (0.0, -0.07, 0.15),
}
POSITIONS = "Xposition Yposition Zposition"


def bvh_text(
    frames,
    *,
    joints=FIGURE,
    ends=ENDS,
    turn=None,
    unit=1.0,
    order="ZXY",
    root=None,
    newline="\n",
    frame_time="0.01",
):
    """BVH text; `frames` has one row of numbers per frame, `turn` turns the offsets."""
    turn = np.eye(3) if turn is None else turn
    lines = ["HIERARCHY"]
    rotations = " ".join(f"{axis}rotation" for axis in order)

    def offset(v):
        return "OFFSET " + " ".join(f"{x:.9g}" for x in turn @ np.array(v) / unit)

    def add(name, above, v):
        lines.append(f"{'JOINT' if above else 'ROOT'} {name}")
        lines.extend(("{", offset(v)))
        channels = rotations if above else (root or f"{POSITIONS} {rotations}")
        lines.append(f"CHANNELS {len(channels.split())} {channels}")
        for child in joints:
            if child[1] == name:
                add(*child)
        if name in ends:
            lines.extend(("End Site", "{", offset(ends[name]), "}"))
        lines.append("}")

    add(*joints[0])
    lines += ["MOTION", f"Frames: {len(frames)}", f"Frame Time: {frame_time}"]
    lines += [" ".join(f"{x:.9g}" for x in row) for row in frames]
    return newline.join(lines) + newline


def standing_rows(count, *, height=0.91, unit=1.0, turn=None):
    """Frames of the figure standing, nodding a little with every joint."""
    turn = np.eye(3) if turn is None else turn
    rows = np.zeros((count, 3 + 3 * len(FIGURE)))
    rows[:, :3] = turn @ np.array([0.0, height, 0.0]) / unit
    rows[:, 3:] = 2.0 * np.sin(0.1 * np.arange(count))[:, None]
    return rows
