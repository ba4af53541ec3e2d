"""A person of bones in a glTF file who moves, and where the bones are by the file's own rules."""

import numpy as np
from hostile.gltf_files import Builder
from scipy.spatial.transform import Rotation

BONES = {
    "Hips": (None, (0.0, 1.0, 0.0)),
    "Spine": ("Hips", (0.0, 1.1, 0.0)),
    "Chest": ("Spine", (0.0, 1.3, -0.02)),
    "Neck": ("Chest", (0.0, 1.5, -0.02)),
    "Head": ("Neck", (0.0, 1.6, 0.0)),
    "LeftUpperArm": ("Chest", (0.18, 1.45, 0.0)),
    "LeftLowerArm": ("LeftUpperArm", (0.45, 1.45, 0.0)),
    "LeftHand": ("LeftLowerArm", (0.7, 1.45, 0.0)),
    "RightUpperArm": ("Chest", (-0.18, 1.45, 0.0)),
    "RightLowerArm": ("RightUpperArm", (-0.45, 1.45, 0.0)),
    "RightHand": ("RightLowerArm", (-0.7, 1.45, 0.0)),
    "LeftUpperLeg": ("Hips", (0.1, 0.95, 0.0)),
    "LeftLowerLeg": ("LeftUpperLeg", (0.1, 0.5, 0.01)),
    "LeftFoot": ("LeftLowerLeg", (0.1, 0.08, 0.0)),
    "LeftToes": ("LeftFoot", (0.1, 0.02, 0.12)),
    "RightUpperLeg": ("Hips", (-0.1, 0.95, 0.0)),
    "RightLowerLeg": ("RightUpperLeg", (-0.1, 0.5, 0.01)),
    "RightFoot": ("RightLowerLeg", (-0.1, 0.08, 0.0)),
    "RightToes": ("RightFoot", (-0.1, 0.02, 0.12)),
}
"""Parent and place [m] of each bone in a T-pose, y up, facing +z."""


class Figure(Builder):
    """The person, under an armature that may be scaled; `node` has the number of each bone.

    Args:
        seed: For how the axes of the joints lie at rest; None leaves them as the file's are.
        scale: Of the armature: bones are given in units of this length.
        size: Of the person, as a share of that of `BONES`.
    """

    def __init__(self, seed=None, scale=1.0, size=1.0):
        super().__init__()
        rng = np.random.default_rng(seed or 0)
        self.node = {name: k + 1 for k, name in enumerate(BONES)}
        self.Q = {
            name: Rotation.identity() if seed is None else Rotation.random(random_state=rng)
            for name in BONES
        }
        armature = {"name": "Armature", "scale": [scale] * 3, "children": [self.node["Hips"]]}
        self.json["nodes"] = [armature]
        for name, (parent, place) in BONES.items():
            above = self.Q[parent] if parent else Rotation.identity()
            offset = np.subtract(place, BONES[parent][1]) if parent else np.array(place)
            entry = {
                "name": name,
                "translation": (above.inv().apply(offset) * size / scale).tolist(),
                "rotation": (above.inv() * self.Q[name]).as_quat().tolist(),
            }
            if below := [self.node[b] for b, (p, _) in BONES.items() if p == name]:
                entry["children"] = below
            self.json["nodes"].append(entry)

    def animation(self, name="Move"):
        """Begin an animation."""
        return self.add("animations", {"name": name, "samplers": [], "channels": []})

    def animate(self, node, path, times, values, *, way=None, of=-1, dtype="f4", **accessor):
        """Add a channel to an animation, the last one if no other is named."""
        animation = self.json["animations"][of]
        sampler = {
            "input": self.accessor(np.asarray(times, np.float64), "f4"),
            "output": self.accessor(values, dtype, **accessor),
        }
        if way:
            sampler["interpolation"] = way
        animation["samplers"].append(sampler)
        target = {"node": node, "path": path}
        animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})

    def turn(self, name, times, rotations, **how):
        """A bone turns by some rotations about the axes that the file's are at rest."""
        at_rest = Rotation.from_quat(self.json["nodes"][self.node[name]]["rotation"])
        above = at_rest * self.Q[name].inv()  # to the axes of the bone above
        q = (above * rotations * above.inv() * at_rest).as_quat()
        q[1:] *= np.cumprod(np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))[:, None]
        self.animate(self.node[name], "rotation", times, q, **how)


TIMES = np.linspace(0.5, 2.5, 21)
"""Keys of `walking` [s]."""


def walking(seed=None, scale=1.0, size=1.0):
    """A figure whose arm, knees and trunk turn while it goes along."""
    figure = Figure(seed, scale, size)
    figure.animation()
    phase = np.pi * (TIMES - TIMES[0])
    figure.turn("LeftUpperArm", TIMES, swing((0.0, 0.6, 0.8), 70.0 * np.sin(phase)))
    figure.turn("RightLowerArm", TIMES, swing((0.0, 1.0, 0.0), 45.0 - 45.0 * np.cos(phase)))
    figure.turn("LeftLowerLeg", TIMES, swing((1.0, 0.0, 0.0), 40.0 - 40.0 * np.cos(phase)))
    figure.turn("RightUpperLeg", TIMES, swing((1.0, 0.0, 0.0), 30.0 * np.sin(phase)))
    figure.turn("Spine", TIMES, swing((0.0, 1.0, 0.0), 20.0 * np.sin(phase)))
    way = np.stack([0.1 * phase, 1.0 + 0.02 * np.sin(phase), 0.4 * phase], axis=1)
    figure.animate(figure.node["Hips"], "translation", TIMES, way * size / scale)
    return figure


def swing(axis, degrees):
    """Rotations about an axis."""
    return Rotation.from_rotvec(np.radians(degrees)[:, None] * np.asarray(axis, np.float64))


def nodes_at(file, animation, t):
    """Affine transforms of all nodes at a time, one node and channel after the other.

    The plain way of the glTF specification, for linear and stepped samplers.
    """
    nodes = file.list_of("nodes")
    parts = [
        {
            "translation": np.array(node.get("translation", (0.0, 0.0, 0.0))),
            "rotation": np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0))),
            "scale": np.array(node.get("scale", (1.0, 1.0, 1.0))),
        }
        for node in nodes
    ]
    for channel in animation["channels"]:
        target, sampler = channel["target"], animation["samplers"][channel["sampler"]]
        turns = target["path"] == "rotation"
        times = file.accessor(sampler, "input", "SCALAR")
        values = file.accessor(sampler, "output", "VEC4" if turns else "VEC3")
        k = max(int((times <= t).sum()) - 1, 0)
        s = 0.0
        if k + 1 < len(times) and sampler.get("interpolation") != "STEP":
            s = max(0.0, (t - times[k]) / (times[k + 1] - times[k]))
        value = values[k]
        if s > 0.0 and turns:
            first, second = Rotation.from_quat(values[k]), Rotation.from_quat(values[k + 1])
            way = (first.inv() * second).as_rotvec()
            value = (first * Rotation.from_rotvec(s * way)).as_quat()
        elif s > 0.0:
            value = (1.0 - s) * values[k] + s * values[k + 1]
        parts[target["node"]][target["path"]] = value

    def local(n):
        T = np.eye(4)
        if "matrix" in nodes[n]:
            return np.array(nodes[n]["matrix"]).reshape(4, 4).T
        T[:3, :3] = Rotation.from_quat(parts[n]["rotation"]).as_matrix() * parts[n]["scale"]
        T[:3, 3] = parts[n]["translation"]
        return T

    above = {child: n for n, node in enumerate(nodes) for child in node.get("children", ())}

    def world(n):
        return world(above[n]) @ local(n) if n in above else local(n)

    return [world(n) for n in range(len(nodes))]
