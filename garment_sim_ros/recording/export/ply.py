"""Binary PLY files, z up as the world is."""

from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.recording.export.frames import Frames, Progress

_CORNERS = np.dtype([("count", "u1"), ("corner", "<i4", 3)])


def write_ply_sequence(frames: Frames, folder: Path, *, progress: Progress) -> dict[str, Any]:
    """One file a frame and surface: ``garments/skirt/0001.ply`` and so on."""
    for surface in frames.surfaces():
        own = folder / surface.name
        own.mkdir(parents=True)
        faces = np.zeros(len(surface.triangles), _CORNERS)
        faces["count"], faces["corner"] = 3, surface.triangles
        count = len(frames.times)
        for k in progress(range(count), f"writing {surface.name}", count):
            x = surface.at(k)
            head = (
                f"ply\nformat binary_little_endian 1.0\nelement vertex {len(x)}\n"
                "property float x\nproperty float y\nproperty float z\n"
                f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
            )
            data = head.encode() + x.astype("<f4").tobytes() + faces.tobytes()
            (own / f"{k + 1:04d}.ply").write_bytes(data)
    return {"error_mm": 0.0}
