"""PC2 point caches, each beside an OBJ of the first frame with the same vertices and axes."""

import struct
from pathlib import Path
from typing import Any

from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.recording.export.frames import Frames, Progress
from garment_sim_ros.recording.export.obj import write_obj


def write_pc2(frames: Frames, folder: Path, *, progress: Progress) -> dict[str, Any]:
    """``garments/skirt.obj`` and ``garments/skirt.pc2``, and so on; one sample a frame."""
    count = len(frames.times)
    for surface in frames.surfaces():
        path = folder / f"{surface.name}.pc2"
        path.parent.mkdir(exist_ok=True)
        x = surface.at(0)
        write_obj(path.with_suffix(".obj"), x, surface.triangles)
        with path.open("wb") as file:
            # Version 1, vertices, first frame, frames from one sample to the next, samples.
            file.write(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, len(x), 0.0, 1.0, count))
            for k in progress(range(count), f"writing {surface.name}", count):
                y_up = surface.at(k) @ AXES_FROM_Y_UP.astype("f4")
                file.write(y_up.astype("<f4").tobytes())
    return {"error_mm": 0.0}
