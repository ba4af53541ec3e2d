"""How far an exported GLB is from the recording in Blender: first, middle and last frame.

    python bench/export_in_blender.py walk.glb walk

with a Python that has `bpy`. `walk` is the same recording, exported with ``--format mdd``; each
cache is read here, and by Blender's modifier, too.
"""

import struct
import sys
from pathlib import Path

import numpy as np

_RATE = 60
_IN_BLENDER = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""What its importers make of y up."""


def cache(path):
    """Times [s] and positions, y up, as shape [m, v, 3]."""
    data = path.read_bytes()
    count, width = struct.unpack_from(">ii", data)
    times = np.frombuffer(data, ">f4", count, 8).astype(float)
    x = np.frombuffer(data, ">f4", offset=8 + 4 * count).reshape(count, width, 3)
    return times, x.astype(float)


def shown(thing, frame):
    """World positions of an object as Blender shows it."""
    bpy.context.scene.frame_set(int(frame), subframe=frame - int(frame))
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    x = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", x)
    T = np.array(evaluated.matrix_world)
    evaluated.to_mesh_clear()
    return x.reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]


def main(glb, folder):
    """Print a line for each surface and way."""
    for path in sorted(folder.rglob("*.mdd")):
        times, x = cache(path)
        for way in ("glb", "mdd"):
            bpy.ops.wm.read_factory_settings(use_empty=True)
            bpy.context.scene.render.fps = _RATE
            if way == "glb":
                bpy.ops.import_scene.gltf(filepath=str(glb.resolve()))
                thing = bpy.data.objects[path.stem]
            else:
                bpy.ops.wm.obj_import(filepath=str(path.with_suffix(".obj").resolve()))
                thing = bpy.context.selected_objects[0]
                modifier = thing.modifiers.new("cache", "MESH_CACHE")
                modifier.cache_format, modifier.filepath = "MDD", str(path.resolve())
                modifier.frame_start = 0.0
            apart = []
            for k in (0, len(times) // 2, len(times) - 1):
                there = shown(thing, times[k] * _RATE if way == "glb" else float(k))
                apart.append(1e3 * np.linalg.norm(there - x[k] @ _IN_BLENDER.T, axis=1).max())
            print(f"{path.stem} by {way}: " + ", ".join(f"{a:.4f}" for a in apart) + " mm")


if __name__ == "__main__":
    import bpy

    main(Path(sys.argv[1]), Path(sys.argv[2]))
