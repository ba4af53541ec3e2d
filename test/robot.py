"""A humanoid robot for tests: single hinges one after the other, a shape on each of its links.

Its zero pose is that of many: arms hang beside the trunk, forearms point ahead, and the head is
fixed to the chest at the chest's own origin. The hinge by which a thigh turns about itself is
half-way down to the knee.
"""

import itertools

SIDES = (("left", 1.0), ("right", -1.0))
LEG = (
    ("hip", "pitch", (0.0, 0.07, -0.05), "y", None),
    ("hip", "roll", (0.0, 0.03, -0.02), "x", ((0.0, 0.0, -0.07), 0.06, 0.10)),
    ("hip", "yaw", (0.01, 0.0, -0.15), "z", ((0.0, 0.0, -0.05), 0.07, 0.12)),
    ("knee", "pitch", (-0.01, 0.0, -0.15), "y", ((0.0, 0.0, -0.15), 0.045, 0.28)),
    ("ankle", "pitch", (0.0, 0.0, -0.32), "y", None),
    ("ankle", "roll", (0.0, 0.0, -0.01), "x", ((0.04, 0.0, -0.02), 0.03, 0.02)),
)
ARM = (
    ("shoulder", "pitch", (0.0, 0.13, 0.22), "y", None),
    ("shoulder", "roll", (0.0, 0.03, 0.0), "x", ((0.0, 0.0, -0.02), 0.04, 0.04)),
    ("shoulder", "yaw", (0.0, 0.0, -0.10), "z", ((0.0, 0.0, -0.03), 0.035, 0.10)),
    ("elbow", "pitch", (0.0, 0.0, -0.10), "y", ((0.09, 0.0, 0.0), 0.03, 0.12)),
    ("wrist", "roll", (0.18, 0.0, 0.0), "x", ((0.06, 0.0, 0.0), 0.03, 0.03)),
)
"""Part, turn, where its hinge is in the link before [m], its axis, and a capsule: middle in the
link, radius, length between its ends [m]. Left; across is mirrored."""

_AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


def robot_urdf(name=None, *, facing=0.0, lying=0.0, head="head_link", head_axis=None):
    """A URDF.

    Args:
        name: Function of side, part, turn and the hinge's number in its limb, to its name; None
            for names as ``left_hip_pitch_joint``. Links have numbers only.
        facing: Angle by which the robot is turned about the vertical in its root [rad].
        lying: Angle by which it is turned about its root's y axis [rad].
        head: Name of the head's link; "" for a head that is a shape of the chest.
        head_axis: Axis of its hinge; None for one that is fixed.
    """
    name = name or (lambda side, part, turn, k: f"{side}_{part}_{turn}_joint".lstrip("_"))
    links, joints, number = [], [], itertools.count()

    def link(*shapes):
        links.append((f"link{next(number)}", shapes))
        return links[-1][0]

    def joint(parent, child, called, place, axis=None, rpy="0 0 0"):
        kind = "fixed" if axis is None else "revolute"
        turn = "" if axis is None else f'<axis xyz="{_AXES[axis]}"/><limit lower="-3" upper="3"/>'
        xyz = " ".join(map(str, place))
        joints.append(
            f'<joint name="{called}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/>{turn}</joint>'
        )

    root = link()
    pelvis = link(_box((0.0, 0.0, 0.0), (0.14, 0.22, 0.12)))
    joint(root, pelvis, "base", (0, 0, 0), rpy=f"0 {lying} {facing}")
    waist = link(_capsule((0.0, 0.0, 0.03), 0.07, 0.06, "0 0 0"))
    joint(pelvis, waist, name("", "waist", "yaw", 0), (0, 0, 0.06), "z")
    top = _box((0.02, 0.0, 0.42), (0.16, 0.14, 0.18))
    chest = link(
        _box((0.0, 0.0, 0.14), (0.18, 0.24, 0.26)),
        _capsule((0, 0, 0.3), 0.045, 0.06),
        *(() if head else (top,)),
    )
    joint(waist, chest, name("", "waist", "pitch", 1), (0, 0, 0.04), "y")
    if head:
        links.append((head, (top,)))
        joint(chest, head, f"{head}_joint", (0, 0, 0), head_axis)
    for side, sign in SIDES:
        for limb, start in ((LEG, pelvis), (ARM, chest)):
            above = start
            for k, (part, turn, place, axis, shape) in enumerate(limb):
                ahead = limb is ARM and part in ("elbow", "wrist")
                pose = "0 1.5708 0" if ahead or "ankle" in part else "0 0 0"
                child = link() if shape is None else link(_capsule(*shape, pose))
                place = (place[0], sign * place[1], place[2])
                joint(above, child, name(side, part, turn, k), place, axis)
                above = child
    return "".join(
        (
            '<robot name="robot">',
            *(f'<link name="{called}">{"".join(shapes)}</link>' for called, shapes in links),
            *joints,
            "</robot>",
        )
    )


def _visual(middle, shape, rpy="0 0 0"):
    place = " ".join(map(str, middle))
    return f'<visual><origin xyz="{place}" rpy="{rpy}"/><geometry>{shape}</geometry></visual>'


def _capsule(middle, radius, length, rpy="0 0 0"):
    return _visual(middle, f'<capsule radius="{radius}" length="{length}"/>', rpy)


def _box(middle, size):
    return _visual(middle, f'<box size="{" ".join(map(str, size))}"/>')
