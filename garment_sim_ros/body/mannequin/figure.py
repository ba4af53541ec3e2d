"""The mannequin's figure: its joints, and the parts that make its surface.

Parts are drawn from the tables and scaled until every girth is the published one.
"""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.mannequin import tables
from garment_sim_ros.body.mannequin.drawing import UPRIGHT, Drawing, Tape
from garment_sim_ros.body.mannequin.girth import girth
from garment_sim_ros.body.mannequin.proportions import girths
from garment_sim_ros.body.mannequin.surface import Surface, surface


@dataclass(frozen=True)
class Figure:
    """A person's shape.

    Attributes:
        surface: The smooth surface of the whole body.
        joints: Joint centres of the middle and the left side by humanoid bone name [m].
        arm: Indices of the surface's parts that belong to the left arm.
        tapes: Centre, two directions and rough radius of the plane of each girth.
    """

    surface: Surface
    joints: dict[str, FloatArray]
    arm: tuple[int, ...]
    tapes: dict[str, Tape]

    def measured(self) -> dict[str, float]:
        """Circumferences at `tables.LANDMARKS` [m]; the arms are in no other tape."""
        armless = self.surface.without(self.arm)
        return {
            name: girth(self.surface if tables.LANDMARKS[name][0] == "arm" else armless, *tape)
            for name, tape in self.tapes.items()
        }


def figure(height: float, sex: float, build: float) -> Figure:
    """The figure of a person whose girths are the published ones.

    Args:
        height: Stature [m].
        sex: 0 for female to 1 for male.
        build: 0 for slim to 1 for heavy.
    """
    wanted = girths(height, sex, build)
    scale = dict.fromkeys(tables.LANDMARKS, 1.0)
    for _ in range(4):
        drawn = _Person(height / 170.0, sex, scale).finished()
        scale = {name: scale[name] * wanted[name] / v for name, v in drawn.measured().items()}
    return _Person(height / 170.0, sex, scale).finished()


class _Person(Drawing):
    """The parts of a person."""

    def finished(self) -> Figure:
        """The figure in metres; the order of the parts is that of their smooth unions."""
        self.trunk()
        self.head()
        self.leg()
        self.foot()
        self.breast_and_buttock()
        self.arm()
        names = list(self.parts)
        return Figure(
            surface=surface(list(self.parts.values()), floor_blend=1.2 * self.unit),
            joints={name: self.unit * place for name, place in self.joints.items()},
            arm=(names.index("arm"), names.index("thumb")),
            tapes=self.tapes,
        )

    def trunk(self) -> None:
        """Torso, shoulders and the relief of the back.

        Between the landmarks of chest and neck the skeleton sets the size.
        """
        t = self.rows(tables.TORSO)
        z = t[:, 0]
        s = self.factor(z, "torso", ((141.0, 0.5 + 0.5 * self.scale["neck"]),))
        half = 0.5 * (t[:, 2] - t[:, 3])
        # Fat grows to the front more than to the back.
        centre = 0.5 * (t[:, 2] + t[:, 3]) + 0.3 * half * np.maximum(s - 1.0, 0.0)
        half, breadth = half * s, t[:, 1] * s
        self.add(
            "torso",
            np.zeros(3),
            UPRIGHT,
            z,
            np.column_stack([centre, 0 * s, half, half, breadth, breadth, t[:, 4]]),
            caps=(2.0, 1.5),
            blend=2.0,
        )
        self.tape("torso", z, UPRIGHT[0], UPRIGHT[1], np.column_stack([centre, 0 * s, z]), breadth)

        tip = self.joints["leftUpperArm"] + [0.0, 0.8, 2.0]
        self.between(
            "trapezius",
            self.mixed((-4.8, 4.2, 141.2), (-5.0, 4.8, 141.8)),
            tip,
            [(4.6, 3.0), (4.2, 2.6), (3.4, 2.2)],
            caps=(3.0, 2.0),
            blend=5.0,
        )
        self.between(
            "clavicle",
            self.mixed((1.8, 2.2, 138.6), (2.4, 2.4, 138.6)),
            tip + np.array([1.4, -1.5, 0.3]),
            [(0.9, 0.9), (1.0, 1.0), (0.9, 0.9)],
            caps=(0.9, 0.9),
            blend=2.5,
        )
        back = np.interp([96.0, 108.0, 120.0, 134.0], z, centre - half)
        self.between(
            "spine",
            np.array([back[0] - 1.3, 0.0, 96.0]),
            np.array([back[3] - 1.3, 0.0, 134.0]),
            [(1.6, 2.2)] * 3,
            caps=(8.0, 8.0),
            blend=4.0,
            bow=np.array([0.0, back[1:3].mean() - 0.5 * (back[0] + back[3]), 0.0]),
            mirrored=False,
            carved=True,
        )

    def head(self) -> None:
        """Neck and head."""
        low, high = np.array([-4.8, 0.0, 138.0]), np.array([0.2, 0.0, 156.5])
        radius = self.mixed(5.2, 5.9) * self.scale["neck"]
        self.between(
            "neck",
            low,
            high,
            [(k * radius, k * radius) for k in (1.12, 1.0, 1.0)],
            caps=(2.0, 3.0),
            blend=3.5,
            mirrored=False,
        )
        frame = self.parts["neck"].frame
        self.tape("neck", [0.0, 1.0], frame[0], frame[1], np.array([low, high]), [radius] * 2)
        h = self.rows(tables.HEAD)
        half = 0.5 * (h[:, 2] - h[:, 3])
        centre = 0.5 * (h[:, 2] + h[:, 3])
        jowl = 0.4 * (self.scale["neck"] - 1.0) * np.clip(h[:, 0] / 8.0 - 1.2, 0.0, 1.0)
        breadth = h[:, 1] * (1.0 + jowl)
        self.add(
            "head",
            np.array([0.0, 0.0, 170.0]),
            UPRIGHT,
            -h[:, 0],
            np.column_stack([centre, 0 * half, half, half, breadth, breadth, h[:, 4]]),
            caps=(0.6, h[-1, 0]),
            blend=2.0,
        )
        self.blob(
            "nose",
            self.mixed((8.2, 0.0, 154.2), (8.4, 0.0, 154.2)),
            np.array([1.0, 0.0, -0.2]),
            self.mixed((4.4, 1.6, 1.3, 1.3, 2.3), (4.6, 1.7, 1.5, 1.5, 2.5)),
            blend=2.0,
        )
        self.blob(
            "eye",
            self.mixed((10.6, 3.2, 158.8), (10.9, 3.3, 158.8)),
            np.array([1.0, 0.3, 0.0]),
            np.array([1.3, 1.3, 2.2, 1.8, 1.7]),
            blend=2.0,
            carved=True,
        )

    def leg(self) -> None:
        """Leg without foot.

        Its inner side stays in place, so that the thighs keep apart; it grows more in depth than
        in breadth, and at the hip with the buttocks.
        """
        g = self.rows(tables.LEG)[::-1]
        z = g[:, 0]
        s = self.factor(z, "leg", ((92.0, self.scale["buttock"]),))
        half, breadth = 0.5 * (g[:, 3] - g[:, 4]) * s**1.2, g[:, 2] * s**0.8
        centre = np.column_stack([0.5 * (g[:, 3] + g[:, 4]), g[:, 1] + breadth, z])
        self.add(
            "leg",
            np.zeros(3),
            UPRIGHT,
            z,
            np.column_stack([centre[:, :2], half, half, breadth, breadth, g[:, 5]]),
            caps=(3.0, 5.0),
            blend=5.0,
            mirrored=True,
            twin_blend=1.5,
        )
        self.tape("leg", z, UPRIGHT[0], UPRIGHT[1], centre, breadth)
        for name, at, back in (
            ("leftLowerLeg", tables.KNEE, 0.5),
            ("leftFoot", tables.ANKLE, 0.0),
        ):
            self.joints[name] = np.array([np.interp(at, z, c) for c in centre.T]) - [back, 0, 0]

    def foot(self) -> None:
        """Foot, with its sole cut flat by the floor."""
        f = self.rows(tables.FOOT)
        ahead = np.array([np.cos(tables.TOE_OUT), np.sin(tables.TOE_OUT), 0.0])
        outward = np.array([-ahead[1], ahead[0], 0.0])
        sole = self.joints["leftFoot"] * [1.0, 1.0, 0.0]
        self.joints["leftToes"] = sole + tables.TOES * ahead + [0.0, 0.0, 1.6]
        top = f[:, 3]
        self.add(
            "foot",
            sole,
            np.array([UPRIGHT[2], outward, ahead]),
            f[:, 0],
            np.column_stack(
                [0.3 * top, -f[:, 1], 0.7 * top, 0.5 * top, f[:, 2], f[:, 2], f[:, 4]]
            ),
            caps=(1.6, 2.0),
            blend=2.0,
            mirrored=True,
        )

    def breast_and_buttock(self) -> None:
        """Soft parts of the trunk; they grow with the girth around them."""
        size = self.factor(np.array([123.5]), "torso")[0]
        self.blob(
            "breast",
            self.mixed((6.6, 7.9, 123.4), (7.0, 7.6, 126.0)) * [size, size, 1.0],
            self.mixed((1.0, 0.22, -0.1), (1.0, 0.12, -0.05)),
            size * self.mixed((8.0, 5.2, 5.6, 5.6, 5.6), (6.0, 4.4, 7.0, 6.6, 3.8)),
            blend=5.0,
            twin_blend=3.0,
        )
        self.blob(
            "scapula",
            self.mixed((-7.4, 8.0, 129.5), (-7.7, 8.8, 129.5)) * [size, size, 1.0],
            np.array([-1.0, 0.25, 0.15]),
            np.array([7.0, 9.0, 6.0, 5.5, 4.0]),
            blend=6.0,
        )
        size = self.factor(np.array([87.5]), "torso")[0]
        self.blob(
            "buttock",
            self.mixed((-5.2, 7.6, 87.6), (-5.2, 7.2, 88.4)) * [size, size, 1.0],
            np.array([-1.0, 0.1, 0.0]),
            size * self.mixed((10.0, 7.4, 8.0, 6.4, 7.6), (9.0, 7.0, 7.4, 6.4, 7.0)),
            blend=5.0,
            twin_blend=1.5,
        )

    def arm(self) -> None:
        """Arm with a mitten of a hand; the forearm is a little flexed."""
        along = np.array([0.0, np.cos(tables.ARM_ANGLE), -np.sin(tables.ARM_ANGLE)])
        across = np.array([0.0, np.sin(tables.ARM_ANGLE), np.cos(tables.ARM_ANGLE)])
        a = self.rows(tables.ARM)
        d = a[:, 0]
        s = self.factor(d, "arm")
        flexion = np.tan(tables.FOREARM_FLEXION)
        ahead = np.maximum(d - tables.ELBOW, 0.0) * flexion
        curl = -0.15 * np.maximum(d - tables.WRIST, 0.0) ** 2 / tables.HAND
        shoulder = self.joints["leftUpperArm"]
        frame = np.array([UPRIGHT[0], across, along])
        self.add(
            "arm",
            shoulder,
            frame,
            d,
            np.column_stack([ahead, curl, a[:, 1:5] * s[:, None], a[:, 5]]),
            caps=(3.0, 2.0),
            blend=4.0,
            mirrored=True,
        )
        centre = shoulder + np.column_stack([ahead, curl, d]) @ frame
        self.tape("arm", d, frame[0], across, centre, a[:, 1] * s)
        self.joints["leftLowerArm"] = shoulder + tables.ELBOW * along
        wrist = shoulder + tables.WRIST * along
        wrist[0] += flexion * (tables.WRIST - tables.ELBOW)
        self.joints["leftHand"] = wrist
        self.between(
            "thumb",
            wrist + np.array([2.0, -0.4, 2.2]) @ frame,
            wrist + np.array([6.2, -1.6, 8.2]) @ frame,
            [(1.5, 1.5), (1.35, 1.3), (0.95, 0.95)],
            caps=(1.3, 1.1),
            blend=1.6,
        )
