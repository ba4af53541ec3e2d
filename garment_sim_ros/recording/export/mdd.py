"""MDD point caches, each beside an OBJ of the first frame with the same vertices and axes."""

import struct
from pathlib import Path
from typing import Any

from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.recording.export.frames import Frames, Progress
from garment_sim_ros.recording.export.obj import write_obj


def write_mdd(frames: Frames, folder: Path, *, progress: Progress) -> dict[str, Any]:
    """``garments/skirt.obj`` and ``garments/skirt.mdd``, and so on; with each frame's time [s]."""
    count = len(frames.times)
    for surface in frames.surfaces():
        path = folder / f"{surface.name}.mdd"
        path.parent.mkdir(exist_ok=True)
        x = surface.at(0)
        write_obj(path.with_suffix(".obj"), x, surface.triangles)
        with path.open("wb") as file:
            file.write(struct.pack(">ii", count, len(x)))
            file.write(frames.times.astype(">f4").tobytes())
            for k in progress(range(count), f"writing {surface.name}", count):
                y_up = surface.at(k) @ AXES_FROM_Y_UP.astype("f4")
                file.write(y_up.astype(">f4").tobytes())
    return {"error_mm": 0.0}
