"""What a clip is called by: a file, and one of its animations; and names that all can read."""

import re
from pathlib import Path

from garment_sim_ros.input_file import exists

GLTF = (".glb", ".gltf", ".vrm", ".vrma")
"""Endings of glTF files."""
OF_GLTF = ":animation="
"""What stands between a glTF file and the name or number of one of its animations."""

_MAX_NAME = 200


def file_and_animation(source: str | Path) -> tuple[str, str | None]:
    """A clip's file, and which of the file's animations it is, None where that is not said."""
    file, colon, animation = str(source).rpartition(OF_GLTF)
    if not colon or Path(file).suffix.lower() not in GLTF or exists(source):
        return str(source), None
    return file, animation


def plain_name(text: str) -> str:
    """A name as topics, logs and URDF take it: visible characters without spaces, 200 at most."""
    return re.sub(r"[^!-~\u00a1-\ud7ff\ue000-\ufffd]", "_", text)[:_MAX_NAME]
