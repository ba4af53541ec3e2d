"""What is painted on a glTF file's surfaces: colours and groups of their vertices.

Groups are named by the node, the mesh or the material that a vertex belongs to, and by attributes
of the file's own, whose names begin with ``_`` (glTF 2.0, section 3.7.2.1): vertices where such a
scalar is over one half. Colours are those of ``COLOR_0``, which glTF stores as light.
"""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, LongArray
from garment_sim_ros.body.loaders.gltf_file import GltfFile
from garment_sim_ros.body.loaders.gltf_scene import Piece
from garment_sim_ros.errors import InputFileError

_MOST_GROUPS = 256


class GltfMarks:
    """Collects them, piece by piece.

    Args:
        file: The file.
    """

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._count = 0
        self._colours: list[FloatArray] = []
        self._painted = True
        self._texture: list[FloatArray] = []
        self._mapped = True
        self._groups: dict[str, list[tuple[int, NDArray[np.bool_]]]] = {}

    def add(self, piece: Piece) -> None:
        """Adds the vertices of a piece."""
        count = len(piece.vertices)
        colours = self._colours_of(piece)
        self._painted &= colours is not None
        self._colours.append(np.zeros((count, 3)) if colours is None else colours)
        texture = self._texture_of(piece)
        self._mapped &= texture is not None
        self._texture.append(np.zeros((count, 2)) if texture is None else texture)
        for name in self._names(piece):
            self._mark(name, np.ones(count, bool))
        for key in piece.attributes:
            if key.startswith("_") and len(key) > 1:
                values = self._scalar(piece, key)
                if values is not None:
                    self._mark(key[1:], values > 0.5)
        self._count += count

    def colours(self) -> FloatArray | None:
        """Colours of all vertices, shape [v, 3]; None where not all pieces have some."""
        return np.concatenate(self._colours) if self._painted and self._colours else None

    def texture(self) -> LongArray | None:
        """Number of each vertex's texture point, shape [v]; None where some have none."""
        if not (self._mapped and self._texture):
            return None
        number = np.unique(np.concatenate(self._texture), axis=0, return_inverse=True)[1]
        return number.ravel().astype(np.int64)

    def groups(self) -> dict[str, NDArray[np.bool_]]:
        """Vertices in each group, shape [v]."""
        found = {}
        for name, parts in self._groups.items():
            found[name] = np.zeros(self._count, bool)
            for start, inside in parts:
                found[name][start : start + len(inside)] |= inside
        return found

    def _mark(self, name: str, inside: NDArray[np.bool_]) -> None:
        if name in self._groups or len(self._groups) < _MOST_GROUPS:
            self._groups.setdefault(name, []).append((self._count, inside))

    def _names(self, piece: Piece) -> set[str]:
        """Names of the node, the mesh and the material of a piece."""
        node = self._file.list_of("nodes")[piece.node]
        meshes, materials = self._file.list_of("meshes"), self._file.list_of("materials")
        owners = [node, meshes[self._file.index(node, "mesh", len(meshes))]]
        number = piece.material
        if isinstance(number, int) and 0 <= number < len(materials):
            owners.append(materials[number])
        names = (owner.get("name") for owner in owners)
        return {name for name in names if isinstance(name, str) and name}

    def _scalar(self, piece: Piece, key: str) -> FloatArray | None:
        """An attribute of one number for each vertex; None where it is another."""
        try:
            values = self._file.accessor(piece.attributes, key, "SCALAR").astype(np.float64)
        except InputFileError:
            return None  # not for us, whatever it is
        return values if len(values) == len(piece.vertices) else None

    def _texture_of(self, piece: Piece) -> FloatArray | None:
        if "TEXCOORD_0" not in piece.attributes:
            return None
        try:
            points = self._file.accessor(piece.attributes, "TEXCOORD_0", "VEC2")
        except InputFileError:
            return None
        good = len(points) == len(piece.vertices) and np.isfinite(points).all()
        return points.astype(np.float64) if good else None

    def _colours_of(self, piece: Piece) -> FloatArray | None:
        if "COLOR_0" not in piece.attributes:
            return None
        for kind in ("VEC3", "VEC4"):
            try:
                light = self._file.accessor(piece.attributes, "COLOR_0", kind)
            except InputFileError:
                continue
            if len(light) == len(piece.vertices) and np.isfinite(light).all():
                return _shown(np.clip(light[:, :3].astype(np.float64), 0.0, 1.0))
        return None


def _shown(light: FloatArray) -> FloatArray:
    """Colours as screens show them (IEC 61966-2-1) from light."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)
