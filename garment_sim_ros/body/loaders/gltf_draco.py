"""Primitives of glTF files that Draco has compressed, as avatars for the web often are.

Follows KHR_draco_mesh_compression. The package DracoPy (Apache-2.0) does the work where it is
installed. How many elements an accessor has is taken from the compressed data, as viewers do.
"""

from typing import Any

import numpy as np

from garment_sim_ros.body.loaders.gltf_file import DRACO, GltfFile


def decompress(file: GltfFile, primitive: dict[str, Any]) -> None:
    """Give a file's accessors what Draco holds of a primitive.

    Where the primitive is not compressed, or is there uncompressed, too, nothing is done.

    Args:
        file: The file.
        primitive: One of a mesh's primitives.

    Raises:
        InputFileError: DracoPy is not installed, or the data is damaged.
    """
    extension = file.extension_of(primitive, DRACO)
    attributes = primitive.get("attributes")
    if extension is None or not isinstance(attributes, dict):
        return
    wanted = {key: a for key, a in attributes.items() if file.lacks_data(a)}
    lists_corners = file.lacks_data(primitive.get("indices"))
    if not wanted and not lists_corners:
        return
    mesh = _decoded(file, file.view_of(extension))
    ids = extension.get("attributes")
    found = {a["unique_id"]: np.asarray(a["data"]) for a in mesh.attributes}
    for key, accessor in wanted.items():
        number = ids.get(key) if isinstance(ids, dict) else None
        if not isinstance(number, int) or number not in found:
            raise file.error(f"has no {key} in its Draco data")
        file.give(accessor, found[number].reshape(len(mesh.points), -1))
    if lists_corners:
        if primitive.get("mode", 4) != 4:
            raise file.error("has Draco data of other than triangles", "allowed: mode 4")
        file.give(primitive["indices"], np.asarray(mesh.faces).reshape(-1, 1))


def _decoded(file: GltfFile, data: bytes) -> Any:
    try:
        import DracoPy
    except ImportError:
        raise file.error(
            "is compressed by Draco, which needs the package DracoPy",
            "install it with: pip install 'garment_sim_ros[draco]'",
        ) from None
    try:
        mesh = DracoPy.decode(data)
        if len(mesh.points) and len(mesh.faces):
            return mesh
    # The package raises what it likes where data is damaged.
    except Exception as error:
        raise file.error(f"has damaged Draco data ({error})") from error
    raise file.error("has no triangles in its Draco data")
