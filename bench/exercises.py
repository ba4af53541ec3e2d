"""Writes a clip of poses that clothes are hard to wear in, as BVH: a minute, made here.

    python bench/exercises.py FILE.bvh [--only NAME ...] [--speed S]
    python bench/worn.py --clip FILE.bvh --body mannequin:height=1.75 --pictures

Arms raised, crossed, behind the back, on hips and head; a deep squat, a crouch, both splits, a
lunge, knees up, a heel to the seat, bending over, sitting, kneeling, on one knee bent over the
other, and all fours; a press-up, lying on back, face and side, and on the shoulders. Every pose is
reached in a second and held for half of one, with the stand between.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

RATE = 30.0
GO, STAY = 1.0, 0.5
FLOOR = {
    **{"LeftFoot": 0.09, "RightFoot": 0.09, "LeftLeg": 0.06, "RightLeg": 0.06, "Hips": 0.12},
    **{"Neck": 0.09, "Head": 0.1, "LeftArm": 0.06, "RightArm": 0.06},
}
"""How far joints keep from the floor [m]; the lowest one stands on it."""
JOINTS: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "Hips": (None, (0.0, 0.0, 0.0)),
    "Spine": ("Hips", (0.0, 0.12, 0.0)),
    "Chest": ("Spine", (0.0, 0.16, 0.0)),
    "Neck": ("Chest", (0.0, 0.22, 0.0)),
    "Head": ("Neck", (0.0, 0.10, 0.02)),
    **{
        side + name: (parent if parent in ("Hips", "Chest") else side + parent, (s * x, y, z))
        for side, s in (("Left", 1.0), ("Right", -1.0))
        for name, parent, (x, y, z) in (
            ("Shoulder", "Chest", (0.04, 0.18, 0.0)),
            ("Arm", "Shoulder", (0.13, 0.0, 0.0)),
            ("ForeArm", "Arm", (0.0, -0.28, 0.0)),
            ("Hand", "ForeArm", (0.0, -0.25, 0.0)),
            ("UpLeg", "Hips", (0.09, -0.04, 0.0)),
            ("Leg", "UpLeg", (0.0, -0.42, 0.0)),
            ("Foot", "Leg", (0.0, -0.41, 0.0)),
        )
    },
}
"""Parent and offset from it [m]; y is up, the body faces z, its arms hang."""
ENDS = {"Head": (0.0, 0.18, 0.0), "Hand": (0.0, -0.17, 0.0), "Foot": (0.0, -0.07, 0.14)}
STAND = {"Arm": (0, 0, 12), "ForeArm": (-8, 0, 0)}
"""Turns about x, y and z, one after the other [degrees]; without a side: both, mirrored."""
POSES: dict[str, dict[str, tuple[float, float, float]]] = {
    "arms_up": {"Arm": (0, 0, 172), "ForeArm": (-5, 0, 0)},
    "arms_aside": {"Arm": (0, 0, 90)},
    "arms_ahead": {"Arm": (-90, 0, 0)},
    "arms_crossed": {"Arm": (-55, 0, -5), "ForeArm": (-20, -95, 0)},
    "hug": {"Arm": (-85, -40, 0), "ForeArm": (0, -70, 0)},
    "hands_on_head": {"Arm": (-20, 0, 125), "ForeArm": (-130, 0, 0)},
    "hands_on_hips": {"Arm": (35, 0, 50), "ForeArm": (-20, -85, 0)},
    "hands_behind": {"Arm": (40, 0, 10), "ForeArm": (-20, -80, 0)},
    "squat": {
        **{"UpLeg": (-120, 0, 20), "Leg": (135, 0, 0), "Foot": (-25, 0, 0)},
        **{"Spine": (25, 0, 0), "Arm": (-80, 0, 0)},
    },
    "crouch": {
        **{"Hips": (10, 0, 0), "UpLeg": (-125, 0, 10), "Leg": (160, 0, 0), "Foot": (-35, 0, 0)},
        **{"Spine": (15, 0, 0), "Arm": (-60, 0, 10)},
    },
    "front_split": {
        **{"LeftUpLeg": (-80, 0, 0), "RightUpLeg": (75, 0, 0), "RightLeg": (15, 0, 0)},
        **{"Arm": (0, 0, 80)},
    },
    "side_split": {"UpLeg": (-15, 0, 78), "Arm": (0, 0, 80)},
    "lunge": {
        **{"LeftUpLeg": (-85, 0, 0), "LeftLeg": (85, 0, 0)},
        **{"RightUpLeg": (30, 0, 0), "RightLeg": (60, 0, 0), "Arm": (0, 0, 30)},
    },
    "knee_up": {"LeftUpLeg": (-125, 0, 0), "LeftLeg": (130, 0, 0), "Arm": (-30, 0, 20)},
    "kick_back": {"RightUpLeg": (40, 0, 0), "RightLeg": (120, 0, 0), "Arm": (-30, 0, 20)},
    "heel_to_seat": {"LeftUpLeg": (15, 0, 0), "LeftLeg": (160, 0, 0), "Arm": (-20, 0, 25)},
    "bend_over": {
        **{"Hips": (60, 0, 0), "UpLeg": (-60, 0, 3), "Spine": (35, 0, 0), "Chest": (25, 0, 0)},
        **{"Arm": (-100, 0, 0)},
    },
    "bend_aside": {"Spine": (0, 0, 25), "Chest": (0, 0, 20), "LeftArm": (0, 0, 20)},
    "twist": {"Spine": (0, 35, 0), "Chest": (0, 35, 0), "Arm": (0, 0, 70)},
    "sit": {"UpLeg": (-88, 0, 6), "Leg": (88, 0, 0), "Arm": (-35, 0, 10), "ForeArm": (-40, 0, 0)},
    "sit_on_floor": {"UpLeg": (-90, 0, 12), "Arm": (25, 0, 20)},
    "cross_legged": {"UpLeg": (-85, 55, 0), "Leg": (110, 0, 0), "Arm": (-25, 0, 15)},
    "kneel": {"UpLeg": (-20, 0, 5), "Leg": (110, 0, 0), "Arm": (-10, 0, 15)},
    "on_one_knee": {
        **{"Hips": (50, 0, 0), "Spine": (25, 0, 0), "Arm": (-100, 0, 10)},
        **{"LeftUpLeg": (-140, 0, 5), "LeftLeg": (105, 0, 0), "LeftFoot": (-15, 0, 0)},
        **{"RightUpLeg": (-55, 0, 10), "RightLeg": (110, 0, 0), "RightFoot": (45, 0, 0)},
    },
    "all_fours": {
        **{"Hips": (85, 0, 0), "UpLeg": (-85, 0, 4), "Leg": (85, 0, 0), "Arm": (-85, 0, 5)},
        **{"Foot": (60, 0, 0)},
    },
    "press_up": {"Hips": (68, 0, 0), "Arm": (-68, 0, 5)},
    "on_back": {"Hips": (-90, 0, 0), "Foot": (30, 0, 0), "Arm": (0, 0, 35)},
    "face_down": {
        **{"Hips": (90, 0, 0), "Foot": (60, 0, 0), "Arm": (0, 0, 130)},
        **{"ForeArm": (-70, 0, 0), "Neck": (0, 60, 0)},
    },
    "on_side": {
        **{"Hips": (0, 0, 90), "UpLeg": (-50, 0, 0), "Leg": (70, 0, 0), "Foot": (30, 0, 0)},
        **{"RightArm": (-150, 0, 0), "LeftArm": (-50, 0, 20)},
    },
    "shoulder_stand": {
        **{"Hips": (-150, 0, 0), "UpLeg": (-60, 0, 0), "Leg": (40, 0, 0), "Neck": (75, 0, 0)},
        **{"Arm": (45, 0, 25)},
    },
}


def turns(pose: dict[str, tuple[float, float, float]]) -> dict[str, Rotation]:
    """Of all joints in a pose."""
    angles = dict.fromkeys(JOINTS, (0.0, 0.0, 0.0))
    for name, (x, y, z) in (STAND | pose).items():
        for sided in (name,) if name in JOINTS else ("Left" + name, "Right" + name):
            s = -1.0 if sided.startswith("Right") and sided != name else 1.0
            angles[sided] = (x, s * y, s * z)
    return {name: Rotation.from_euler("xyz", a, degrees=True) for name, a in angles.items()}


def height(pose: dict[str, Rotation]) -> float:
    """Of the hips where the lowest joint stands on the floor [m]."""
    at: dict[str | None, np.ndarray] = {None: np.zeros(3)}
    turned: dict[str | None, Rotation] = {None: Rotation.identity()}
    for name, (parent, offset) in JOINTS.items():
        at[name] = at[parent] + turned[parent].apply(offset)
        turned[name] = turned[parent] * pose[name]
    return max(least - at[name][1] for name, least in FLOOR.items())


def hierarchy(name: str, depth: int = 0) -> list[str]:
    """A joint and what is below it, as lines."""
    tab, (parent, offset) = "  " * depth, JOINTS[name]
    place = "" if parent else "Xposition Yposition Zposition "
    lines = [
        f"{tab}{'JOINT' if parent else 'ROOT'} {name}",
        f"{tab}{{",
        f"{tab}  OFFSET {' '.join(map(str, offset))}",
        f"{tab}  CHANNELS {3 if parent else 6} {place}Zrotation Yrotation Xrotation",
    ]
    for child in (n for n, (of, _) in JOINTS.items() if of == name):
        lines += hierarchy(child, depth + 1)
    for end, offset in ENDS.items():
        if name.removeprefix("Left").removeprefix("Right") == end:
            at = " ".join(map(str, offset))
            lines += [f"{tab}  End Site", f"{tab}  {{", f"{tab}    OFFSET {at}", f"{tab}  }}"]
    return [*lines, f"{tab}}}"]


def in_order(name: str = "Hips") -> list[str]:
    """All joints as the file lists them."""
    return [name, *(j for n, (of, _) in JOINTS.items() if of == name for j in in_order(n))]


def frame(pose: dict[str, Rotation]) -> str:
    """A line of numbers."""
    numbers = [0.0, height(pose), 0.0]
    for name in in_order():
        numbers += list(pose[name].as_euler("xyz", degrees=True)[::-1])
    return " ".join(f"{n:.4f}" for n in numbers)


def way(start: dict[str, Rotation], end: dict[str, Rotation], share: float) -> dict[str, Rotation]:
    """A pose between two, with an even start and end."""
    s = share * share * (3.0 - 2.0 * share)
    return {
        name: start[name] * Rotation.from_rotvec(s * (start[name].inv() * end[name]).as_rotvec())
        for name in start
    }


def main() -> None:
    """Writes."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", nargs="+", default=tuple(POSES), choices=POSES)
    parser.add_argument("--speed", type=float, default=1.0)
    options = parser.parse_args()
    stand = turns({})
    go, stay = (round(time * RATE / options.speed) for time in (GO, STAY))
    lines = [frame(stand)] * stay
    for name in options.only:
        pose = turns(POSES[name])
        lines += [frame(way(stand, pose, (n + 1) / go)) for n in range(go)]
        lines += [frame(pose)] * stay
        lines += [frame(way(pose, stand, (n + 1) / go)) for n in range(go)]
    head = ["HIERARCHY", *hierarchy("Hips"), "MOTION", f"Frames: {len(lines)}"]
    text = "\n".join([*head, f"Frame Time: {1 / RATE:.7f}", *lines]) + "\n"
    options.file.write_text(text)


if __name__ == "__main__":
    main()
