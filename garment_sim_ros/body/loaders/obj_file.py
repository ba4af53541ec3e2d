"""Reading Wavefront OBJ files: positions, polygons and groups.

Format: appendix B1 of the Advanced Visualizer manual. Lines other than ``v``, ``f``, ``g`` and
``o`` are passed over.
"""

from array import array
from pathlib import Path

import numpy as np

from garment_sim_ros.body.loaders.polygons import (
    MAX_MESH_BYTES,
    MAX_VERTICES,
    Polygons,
    checked,
)
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.input_file import read_text


def read_obj(path: str | Path) -> Polygons:
    """The polygons of an OBJ file with their groups (``g`` and ``o``).

    Raises:
        InputFileError: Missing, empty, not OBJ, not finite, or an index out of range.
    """
    text = read_text(path, limit=MAX_MESH_BYTES).replace("\\\n", " ").replace("\\\r\n", " ")
    positions, corners, sizes, groups_of_faces = array("d"), array("q"), array("q"), array("q")
    groups: dict[str, int] = {"": 0}
    group = 0
    for number, line in enumerate(text.split("\n"), start=1):
        kind, *fields = line.split("#", 1)[0].split() or [""]
        try:
            if kind == "v":
                x, y, z = map(float, fields[:3])
                positions.extend((x, y, z))
            elif kind == "f":
                corners.extend(_indices(fields, len(positions) // 3))
                sizes.append(len(fields))
                groups_of_faces.append(group)
            elif kind in ("g", "o"):
                group = groups.setdefault(" ".join(fields), len(groups))
        except ValueError:
            raise InputFileError(
                path, f"line {number} reads {line[:60]!r}", "allowed: v x y z, f i j k ..."
            ) from None
    return checked(
        path,
        Polygons(
            vertices=np.array(positions).reshape(-1, 3),
            corners=np.array(corners),
            sizes=np.array(sizes),
            group=np.array(groups_of_faces),
            groups=tuple(groups),
        ),
    )


def _indices(fields: list[str], count: int) -> list[int]:
    """Vertex indices from 0 of one face; negative ones in the file count back from the last.

    Raises:
        ValueError: Too few, none, or too large ones.
    """
    index = [int(field.split("/", 1)[0]) for field in fields]
    if len(index) < 3 or 0 in index or max(map(abs, index)) > MAX_VERTICES:
        raise ValueError
    return [i - 1 if i > 0 else count + i for i in index]
