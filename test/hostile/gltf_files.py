"""glTF files of a column of skin on three joints, whole or changed."""

import numpy as np
import trimesh

from garment_sim_ros.body.loaders.gltf_file import DRACO
from garment_sim_ros.glb_writer import GlbWriter


class Builder(GlbWriter):
    """A glTF document under construction; tests change `json` before it is written."""

    def __init__(self):
        super().__init__()
        for name in ("nodes", "meshes", "skins", "accessors", "bufferViews"):
            self.json[name] = []

    def accessor(self, array, dtype, normalized=False):
        return super().accessor(np.asarray(array, dtype="<" + dtype), normalized=normalized)

    def values(self, accessor):
        """What an accessor holds, a row for each element."""
        entry = self.json["accessors"][accessor]
        view = self.json["bufferViews"][entry["bufferView"]]
        dtype = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[entry["componentType"]]
        data = self.binary[view["byteOffset"] :][: view["byteLength"]]
        return np.frombuffer(data, dtype).reshape(entry["count"], -1)

    def glb(self, path):
        self.write(path)
        return path


SIZE = np.array([0.4, 1.8, 0.2])


def column(seams=False):
    """A closed box 1.8 m high standing on y = 0, its weights shared by two joints by height."""
    box = trimesh.creation.box(extents=SIZE).subdivide().subdivide()
    box.apply_translation([0.0, SIZE[1] / 2, 0.0])
    if seams:
        box.unmerge_vertices()
    upper = np.clip(box.vertices[:, 1] / SIZE[1], 0.0, 1.0)
    return np.asarray(box.vertices), np.asarray(box.faces), upper


def document(*, seams=False, weight=("f4", 1.0, False), scale=1.0, root_scale=1.0, index="u2"):
    """Nodes: 0 armature, 1 'low', 2 'high' at half height, 3 the mesh.

    The mesh is `scale` times as large as the armature's nodes show it after `root_scale`.
    """
    b = Builder()
    x, faces, upper = column(seams)
    dtype, factor, normalized = weight
    w = np.zeros((len(x), 4))
    w[:, 0], w[:, 1] = (1 - upper) * factor, upper * factor
    joints = np.zeros((len(x), 4))
    joints[:, 1] = 1
    half = SIZE[1] / 2 / root_scale
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 1, 3] = -half
    bind = bind @ np.diag([scale / root_scale] * 3 + [1.0])
    b.json["nodes"] = [
        {"name": "armature", "children": [1], "scale": [root_scale] * 3},
        {"name": "low", "children": [2]},
        {"name": "high", "translation": [0.0, half, 0.0]},
        {"name": "mesh", "mesh": 0, "skin": 0},
    ]
    b.json["skins"] = [
        {"joints": [1, 2], "inverseBindMatrices": b.accessor(bind.transpose(0, 2, 1), "f4")}
    ]
    b.json["meshes"] = [
        {
            "primitives": [
                {
                    "attributes": {
                        "POSITION": b.accessor(x / scale, "f4"),
                        "JOINTS_0": b.accessor(joints, "u1"),
                        "WEIGHTS_0": b.accessor(w, dtype, normalized),
                    },
                    "indices": b.accessor(faces.reshape(-1), index),
                }
            ]
        }
    ]
    return b


def compressed(b, *, keep_order=True):
    """A document whose primitives Draco holds; its accessors have no data of their own."""
    import DracoPy

    for primitive in (p for mesh in b.json["meshes"] for p in mesh["primitives"]):
        arrays = {key: b.values(a) for key, a in primitive["attributes"].items()}
        others = [key for key in arrays if key != "POSITION"]
        data = DracoPy.encode(
            arrays["POSITION"],
            b.values(primitive["indices"]).reshape(-1, 3),
            quantization_bits=20,
            preserve_order=keep_order,
            generic_attributes={n: arrays[key] for n, key in enumerate(others, start=7)},
        )
        mesh = DracoPy.decode(data)
        first = next(a["unique_id"] for a in mesh.attributes if a["attribute_type"] == 0)
        ids = {"POSITION": first} | {key: n for n, key in enumerate(others, start=7)}
        primitive["extensions"] = {DRACO: {"bufferView": b.view(data), "attributes": ids}}
        for accessor in (*primitive["attributes"].values(), primitive["indices"]):
            b.json["accessors"][accessor].pop("bufferView")
    b.json["extensionsRequired"] = b.json["extensionsUsed"] = [DRACO]
    return b
