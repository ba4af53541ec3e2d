"""Reading Wavefront OBJ files: positions, polygons and groups.

Format: appendix B1 of the Advanced Visualizer manual. Lines other than ``v``, ``f``, ``vt``, ``g``
and ``o`` are passed over. A vertex may be painted, as many programs write it: ``v x y z r g b``.
"""

from array import array
from pathlib import Path

import numpy as np

from garment_sim_ros.arrays import FloatArray
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
    paint, texture, texture_points = array("d"), array("q"), 0
    groups: dict[str, int] = {"": 0}
    group = 0
    for number, line in enumerate(text.split("\n"), start=1):
        kind, *fields = line.split("#", 1)[0].split() or [""]
        try:
            if kind == "v":
                x, y, z = map(float, fields[:3])
                positions.extend((x, y, z))
                if len(fields) >= 6:
                    paint.extend(map(float, fields[3:6]))
            elif kind == "f":
                corners.extend(_indices(fields, len(positions) // 3))
                sizes.append(len(fields))
                texture.extend(_texture(fields, texture_points))
                groups_of_faces.append(group)
            elif kind == "vt":
                texture_points += 1
            elif kind in ("g", "o"):
                group = groups.setdefault(" ".join(fields), len(groups))
        except (ValueError, OverflowError):
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
            colours=_colours(paint, len(positions)),
            texture=np.array(texture) if len(texture) == len(corners) else None,
        ),
    )


def _texture(fields: list[str], count: int) -> list[int]:
    """Texture points of one face's corners, from 0; none where a corner has none.

    Raises:
        ValueError: Something else than whole numbers.
    """
    parts = [field.split("/", 2) for field in fields]
    if not all(len(part) > 1 and part[1] for part in parts):
        return []
    index = [int(part[1]) for part in parts]
    return [i - 1 if i > 0 else count + i for i in index]


def _colours(paint: "array[float]", count: int) -> FloatArray | None:
    """Colours where every vertex has one."""
    colours = np.array(paint)
    if not len(colours) or len(colours) != count or not np.isfinite(colours).all():
        return None
    return np.clip(colours, 0.0, 1.0).reshape(-1, 3)


def _indices(fields: list[str], count: int) -> list[int]:
    """Vertex indices from 0 of one face; negative ones in the file count back from the last.

    Raises:
        ValueError: Too few, none, or too large ones.
    """
    index = [int(field.split("/", 1)[0]) for field in fields]
    if len(index) < 3 or 0 in index or max(map(abs, index)) > MAX_VERTICES:
        raise ValueError
    return [i - 1 if i > 0 else count + i for i in index]
