"""The built-in body: a smooth, closed, skinned mannequin of any height, sex and build.

It is generated from published body proportions (see `mannequin.proportions`), so that the package
works without any file. Fingers and face are left out. Rest pose: upright, facing +x, arms 45
degrees below the horizontal, feet on z = 0 about a hip's breadth apart.
"""

import importlib.resources
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.rig import Dofs, Rig
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.disk_cache import cached_arrays, code_digest
from garment_sim_ros.params import parameter, validated


@dataclass(frozen=True, kw_only=True)
class MannequinOptions:
    """What the mannequin looks like."""

    height: float = parameter(1.70, "Stature.", unit="m", minimum=1.0, maximum=2.5)
    sex: float = parameter(0.0, "From 0, female, to 1, male.", minimum=0.0, maximum=1.0)
    build: float = parameter(0.5, "From 0, slim, to 1, heavy.", minimum=0.0, maximum=1.0)
    vertices: int = parameter(4000, "Number of vertices.", minimum=1000, maximum=10000)


_PARENTS = {
    "hips": "",
    "spine": "hips",
    "chest": "spine",
    "upperChest": "chest",
    "neck": "upperChest",
    "head": "neck",
    "Shoulder": "upperChest",
    "UpperArm": "Shoulder",
    "LowerArm": "UpperArm",
    "Hand": "LowerArm",
    "UpperLeg": "hips",
    "LowerLeg": "UpperLeg",
    "Foot": "LowerLeg",
    "Toes": "Foot",
}


def mannequin(
    *, height: float = 1.70, sex: float = 0.0, build: float = 0.5, vertices: int = 4000
) -> Body:
    """The mannequin; the same options always give the same body.

    Args:
        height: Stature [m].
        sex: 0 for female to 1 for male.
        build: 0 for slim to 1 for heavy.
        vertices: Number of vertices, reached up to one.

    Raises:
        ParameterError: An option is out of its range.
    """
    values = {"height": height, "sex": sex, "build": build, "vertices": vertices}
    return _mannequin(validated(MannequinOptions, values))


def _edge_length(x: FloatArray, joints: dict[str, FloatArray], unit: float) -> FloatArray:
    """Relative edge length wanted at points [n, 3]: shorter at head, arms, hands and feet."""
    folded = np.column_stack([x[:, 0], np.abs(x[:, 1]), x[:, 2]])
    elbow, wrist = joints["leftLowerArm"], joints["leftHand"]
    spots = (
        (joints["head"] + [0.05 * unit, 0.0, 0.02 * unit], 0.12 * unit, 0.3),
        (wrist + 0.4 * (wrist - elbow), 0.11 * unit, 0.35),
        (0.5 * (joints["leftToes"] + joints["leftFoot"]), 0.14 * unit, 0.3),
    )
    length = 1.0 - 0.2 * np.clip(folded[:, 1] / (0.1 * unit) - 2.4, 0.0, 1.0)
    for centre, radius, less in spots:
        length -= less * np.exp(-((((folded - centre) ** 2).sum(axis=1) / radius**2) ** 2))
    return length


def _bones() -> dict[str, str]:
    """Parent of each bone, of both sides."""
    parent: dict[str, str] = {}
    for bone, above in _PARENTS.items():
        for side in ("left", "right") if bone[0].isupper() else ("",):
            parent[side + bone] = side + above if above[:1].isupper() else above
    return parent


def _rest(left: dict[str, FloatArray]) -> FloatArray:
    """Rest transforms without rotation, from joint centres of the middle and left [m]."""
    bones = _bones()
    centre = {
        bone: left[bone.replace("right", "left")] * [1.0, -1.0 if "right" in bone else 1.0, 1.0]
        for bone in bones
    }
    T = np.tile(np.eye(4), (len(bones), 1, 1))
    for i, (bone, above) in enumerate(bones.items()):
        T[i, :3, 3] = centre[bone] - (centre[above] if above else 0.0)
    return T


@lru_cache(maxsize=8)
def _mannequin(options: MannequinOptions) -> Body:
    if options == MannequinOptions():
        made = _shipped()
    else:
        made = cached_arrays(
            "bodies", f"{options} {code_digest('body', 'geometry')}", lambda: grown(options)
        )
    bones = _bones()
    names = tuple(bones)
    return Body(
        name="mannequin",
        rig=Rig(
            joint_names=names,
            parent=np.array([names.index(a) if a else -1 for a in bones.values()], np.int32),
            T_parent_joint=made["T_parent_joint"],
            dofs=Dofs.none(),
        ),
        skin=Skin(
            vertices=made["vertices"],
            triangles=made["triangles"],
            bone=made["bone"],
            weight=made["weight"],
            T_bone_bind=made["T_bone_bind"],
        ),
        humanoid={name: name for name in names},
    )


def _shipped() -> dict[str, NDArray[Any]]:
    """The default mannequin, grown once for all: the same bits everywhere, and at once."""
    file = importlib.resources.files("garment_sim_ros.body.mannequin") / "mannequin_default.npz"
    with file.open("rb") as data, np.load(data, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def grown(options: MannequinOptions) -> dict[str, NDArray[Any]]:
    """The arrays of rig and skin, by name; `make mannequin` writes those of the default.

    Args:
        options: What it looks like.
    """
    # Only where no such mannequin was made before: what it takes is slow to import, too.
    from garment_sim_ros.body.mannequin.figure import figure
    from garment_sim_ros.body.mannequin.mesh import symmetric_mesh
    from garment_sim_ros.body.mannequin.weights import skin_weights

    shape = figure(options.height, options.sex, options.build)
    skin = shape.surface
    unit = options.height / 1.7
    x, triangles = symmetric_mesh(
        skin.sample,
        skin.project,
        lambda points: _edge_length(points, shape.joints, unit),
        np.array([-0.3, 0.0, -0.03]) * unit,
        np.array([0.35, 0.9, 1.73]) * unit,
        0.01 * unit,
        options.vertices,
    )
    folded = np.column_stack([x[:, 0], np.abs(x[:, 1]), x[:, 2]])
    arm = np.min([skin.part(i, folded) for i in shape.arm], axis=0)
    lead = skin.without(shape.arm)(x) - arm

    # The coarser the mesh, the more its top and soles fall short of the surface's.
    low, high = x[:, 2].min(), x[:, 2].max()
    scale = options.height / (high - low)
    x = (x - [0.0, 0.0, low]) * scale
    T_parent_joint = _rest(
        {name: (place - [0.0, 0.0, low]) * scale for name, place in shape.joints.items()}
    )
    bones = list(_bones().items())
    T_bone_bind = np.tile(np.eye(4), (len(bones), 1, 1))
    index = {bone: i for i, (bone, _) in enumerate(bones)}
    for i, (_, above) in enumerate(bones):
        T_bone_bind[i, :3, 3] = -T_parent_joint[i, :3, 3]
        if above:
            T_bone_bind[i, :3, 3] += T_bone_bind[index[above], :3, 3]
    bone, weight = skin_weights(
        x, tuple(index), -T_bone_bind[:, :3, 3], scale * lead, options.height
    )
    return {
        "vertices": x,
        "triangles": triangles,
        "bone": bone,
        "weight": weight,
        "T_parent_joint": T_parent_joint,
        "T_bone_bind": T_bone_bind,
    }
