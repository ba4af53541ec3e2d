"""OBJ files, y up as the format's readers expect."""

from pathlib import Path
from typing import Any

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.recording.export.frames import Frames, Progress


def write_obj_sequence(frames: Frames, folder: Path, *, progress: Progress) -> dict[str, Any]:
    """One file a frame and surface: ``garments/skirt/0001.obj`` and so on."""
    for surface in frames.surfaces():
        own = folder / surface.name
        own.mkdir(parents=True)
        count = len(frames.times)
        for k in progress(range(count), f"writing {surface.name}", count):
            write_obj(own / f"{k + 1:04d}.obj", surface.at(k), surface.triangles)
    return {"error_mm": 0.0}


def write_obj(path: Path, x: FloatArray, triangles: IntArray) -> None:
    """One surface; `x` is z up [m], shape [v, 3]."""
    rows = (x @ AXES_FROM_Y_UP.astype(x.dtype)).tolist()
    corners = (triangles + 1).tolist()
    with path.open("w", encoding="ascii") as file:
        file.writelines(f"v {a:.9g} {b:.9g} {c:.9g}\n" for a, b, c in rows)
        file.writelines(f"f {a} {b} {c}\n" for a, b, c in corners)
