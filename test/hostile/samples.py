"""A small valid file of each format, and what reads it."""

import base64
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import trimesh
from gltf_figure import Figure, swing
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from simple_patterns import tube
from unit.test_collider_description import example_set
from unit.test_garment_mesh import ply
from unit.test_garmentcode import specification
from unit.test_obj_bodies import person, write_makehuman
from unit.test_recording import STORE, avatar
from unit.test_urdf import GRIPPER

from garment_sim_ros import disk_cache
from garment_sim_ros.body.humanoid import load_humanoid_overrides
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.description import load_colliders, save_colliders
from garment_sim_ros.garment.mesh import load_garment_mesh
from garment_sim_ros.garment.outfit_file import builtin_outfits, read_outfit
from garment_sim_ros.garment.patterns.garmentcode import read_garmentcode
from garment_sim_ros.garment.patterns.pieces import cut
from garment_sim_ros.garment.sewn_file import write_sewn
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.recording.bags import read_recording
from hostile.gltf_files import compressed, document

BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftUpLeg
  {
    OFFSET 10 -5 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT LeftLeg
    {
      OFFSET 0 -40 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0 -40 0
      }
    }
  }
  JOINT Spine
  {
    OFFSET 0 20 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 40 0
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.01
0 90 0 0 0 0 10 0 0 0 20 0 0 0 5
0 91 1 0 0 0 11 0 0 0 21 0 0 0 6
0 92 2 0 0 0 12 0 0 0 22 0 0 0 7
"""

BONES = "hips: pelvis\nleftUpperArm: arm_l\nrightFoot: null\n"

OUTFIT = """version: 1
garments:
  - name: shirt
    generator: tshirt
    options: {vertices: 500, ease: 0.02}
    material: {preset: cotton_jersey, friction: 0.4}
    layer: 1
    max_distance: [{distance: 0.1}, {distance: 0.02, vertices: [1, 2]}]
    tethers: 0.05
    attachments:
      - {bone: chest, vertices: [1, 2, 3], stiffness: 100.0}
  - name: scarf
    mesh: scarf.obj
    options: {unit: cm, up: z, edge_length: 0.02}
    self_collision: 0.004
    mu: left_thigh=0.03
colliders: {method: hulls, delta: 0.003}
"""


@dataclass(frozen=True)
class Sample:
    """One format.

    Attributes:
        file: The file to damage; those that belong to it lie beside it.
        read: What reads it.
    """

    file: Path
    read: Callable[[], object]


def samples(folder: Path) -> dict[str, Sample]:
    """Valid files made in a folder, by format."""
    made = {**_bodies(folder), **_garments(folder), **_texts(folder), **_bags(folder)}
    return {**made, **_cache(folder), **_real(folder)}


def _file(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def _bodies(folder: Path) -> dict[str, Sample]:
    made = {}
    for suffix in ("obj", "ply"):
        path = _file(folder / suffix, f"body.{suffix}", person().export(file_type=suffix))
        made[f"body {suffix}"] = Sample(path, partial(load_body, path))
    binary = document().glb(_file(folder / "glb", "body.glb", b""))
    made["body glb"] = Sample(binary, partial(load_body, binary))
    if find_spec("DracoPy"):
        draco = compressed(document()).glb(_file(folder / "draco", "body.glb", b""))
        made["body glb draco"] = Sample(draco, partial(load_body, draco))
    b = document()
    uri = "data:application/octet-stream;base64," + base64.b64encode(b.binary).decode()
    b.json["buffers"] = [{"byteLength": len(b.binary), "uri": uri}]
    b.json["extensions"] = {"VRMC_vrm": {"humanoid": {"humanBones": {"hips": {"node": 1}}}}}
    text = _file(folder / "gltf", "body.gltf", json.dumps(b.json))
    made["body gltf"] = Sample(text, partial(load_body, text))
    b.json["buffers"] = [{"byteLength": len(b.binary), "uri": "body.bin"}]
    path = _file(folder / "outer", "body.gltf", json.dumps(b.json))
    _file(folder / "outer", "body.bin", b.binary)
    made["body gltf with a file"] = Sample(path, partial(load_body, path))

    urdf = _file(folder / "urdf", "robot.urdf", GRIPPER)
    made["urdf"] = Sample(urdf, partial(load_body, urdf))
    for suffix in ("stl", "obj", "ply"):
        robot = _file(
            folder / f"urdf_{suffix}",
            "robot.urdf",
            f'<robot name="r"><link name="a"><visual><geometry><mesh filename="m.{suffix}"/>'
            "</geometry></visual></link></robot>",
        )
        mesh = _file(robot.parent, f"m.{suffix}", trimesh.creation.box().export(file_type=suffix))
        made[f"mesh {suffix}"] = Sample(mesh, partial(load_body, robot))

    human = folder / "makehuman"
    human.mkdir()
    body = write_makehuman(human)
    for name in ("mesh.obj", "rig.mhskel", "weights.mhw"):
        made[f"makehuman {name}"] = Sample(human / name, partial(load_body, body))
    return made


def _garments(folder: Path) -> dict[str, Sample]:
    x, y = np.meshgrid(np.arange(4) * 0.1, np.arange(5) * 0.1, indexing="ij")
    lines = [f"v {a:.3f} {b:.3f} 0.0" for a, b in zip(x.ravel(), y.ravel())]
    for i in range(3):
        for j in range(4):
            k = 5 * i + j + 1
            lines.append(f"f {k}/1 {k + 5}/2 {k + 6}/3 {k + 1}/4")
    made = {}
    obj = _file(folder / "cloth", "cloth.obj", "\n".join(lines) + "\n")
    made["garment obj"] = Sample(obj, partial(load_garment_mesh, obj, edge_length=0.05))
    for form in ("ascii", "binary_little_endian"):
        place = folder / f"cloth_{form}"
        place.mkdir()
        path = ply(place, f"{form} 1.0")
        made[f"garment ply {form}"] = Sample(path, partial(load_garment_mesh, path))
    for suffix in ("glb", "gltf"):
        source = folder / suffix / f"body.{suffix}"
        path = _file(folder / "cloth", f"cloth.{suffix}", source.read_bytes())
        made[f"garment {suffix}"] = Sample(path, partial(load_garment_mesh, path))
    pieces = cut(tube(other=0.5), 0.2)
    sewn = folder / "cloth" / "sewn.glb"
    write_sewn(
        *(sewn, pieces.joined(pieces.placed()), pieces.sewn_triangles, pieces.corners),
        *(pieces.panel[pieces.triangles[:, 0]], ("front", "back")),
    )
    made["sewn garment"] = Sample(sewn, partial(load_garment_mesh, sewn))
    return made


def _texts(folder: Path) -> dict[str, Sample]:
    made = {}
    bvh = _file(folder, "clip.bvh", BVH)
    made["bvh"] = Sample(bvh, partial(load_clip, bvh))
    figure = Figure(seed=1)
    figure.animation()
    for name, way in (("Spine", "LINEAR"), ("Head", "STEP")):
        figure.turn(name, [0.0, 0.1, 0.3], swing((0.0, 1.0, 0.0), np.arange(3.0)), way=way)
    moves = np.zeros((6, 3))
    moves[1::3] = [[0.0, 1.0, 0.0], [0.1, 1.0, 0.1]]
    figure.animate(figure.node["Hips"], "translation", [0.0, 0.3], moves, way="CUBICSPLINE")
    moving = figure.glb(_file(folder / "moving", "clip.glb", b""))
    made["clip glb"] = Sample(moving, partial(load_clip, moving))
    bones = _file(folder, "bones.yaml", BONES)
    made["bone names"] = Sample(bones, partial(load_humanoid_overrides, bones))
    outfit = _file(folder, "outfit.yaml", OUTFIT)
    made["outfit"] = Sample(outfit, partial(read_outfit, outfit))
    for name, text in builtin_outfits().items():
        path = _file(folder, f"{name}.yaml", text)
        made[f"outfit {name}"] = Sample(path, partial(read_outfit, path))
    pattern = _file(folder, "pattern.json", json.dumps(specification()))
    made["pattern"] = Sample(pattern, partial(read_garmentcode, pattern))
    colliders = folder / "colliders.json"
    save_colliders(colliders, example_set())
    made["colliders"] = Sample(colliders, partial(load_colliders, colliders))
    return made


def _bags(folder: Path) -> dict[str, Sample]:
    made = {}
    kinds = (
        *(("MCAP", "none"), ("MCAP", "storage"), ("MCAP", "file"), ("MCAP", "message")),
        *(("SQLITE3", "none"), ("SQLITE3", "file"), ("SQLITE3", "message")),
    )
    for plugin, packed in kinds:
        name = f"bag_{plugin}_{packed}".lower()
        writer = Writer(folder / name, version=9, storage_plugin=StoragePlugin[plugin])
        if packed != "none":
            writer.set_compression(CompressionMode[packed.upper()], CompressionFormat.ZSTD)
        with writer:
            connections = {}
            for topic, arrival, content in avatar(text=GRIPPER, joints_named=["left", "roll"]):
                kind = content.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
                data = STORE.serialize_cdr(content, kind)
                writer.write(connections[topic], arrival, data)
        file = next(f for f in (folder / name).iterdir() if f.suffix != ".yaml")
        if plugin == "SQLITE3":  # pages that nothing uses make it larger than what is damaged
            assert file.stat().st_size < 100_000
        for what in (file, file.parent / "metadata.yaml"):
            made[f"clip {name} {what.suffix}"] = Sample(what, partial(load_clip, file.parent))
            made[f"recording {name} {what.suffix}"] = Sample(
                what, partial(read_recording, file.parent)
            )
    return made


def _cache(folder: Path) -> dict[str, Sample]:
    """A damaged cache is made again; what comes back is what was asked for."""
    arrays = {"x": np.arange(600.0).reshape(200, 3), "i": np.arange(5, dtype=np.int32)}
    os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
    disk_cache.cached_arrays("f", "key", lambda: arrays)
    path = next((folder / "cache").rglob("*.npz"))

    def read() -> None:
        found = disk_cache.cached_arrays("f", "key", lambda: arrays)
        assert found.keys() == arrays.keys()
        assert all(np.array_equal(found[name], arrays[name]) for name in arrays)

    return {"cache": Sample(path, read)}


def _real(folder: Path) -> dict[str, Sample]:
    """Copies of small real files, where they are there."""
    here = Path(__file__).resolve().parents[3] / "shared" / "data"
    data = Path(os.environ.get("GARMENT_SIM_DATA") or here)
    readers = {
        "mocap/deepmimic_walk.bvh": load_clip,
        "urdf/human_1m65.urdf": load_body,
        "garments/skirt_short_female.obj": load_garment_mesh,
        "patterns/shirt_mean_specification.json": read_garmentcode,
    }
    made = {}
    for name, read in readers.items():
        if (data / name).is_file():
            path = folder / "real" / Path(name).name
            path.parent.mkdir(exist_ok=True)
            shutil.copyfile(data / name, path)
            made[f"real {path.name}"] = Sample(path, partial(read, path))
    return made
