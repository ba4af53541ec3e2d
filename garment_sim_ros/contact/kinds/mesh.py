"""The kind ``mesh``: a skin that follows the frames of its set; see `contact.mesh.skinned`."""

from collections.abc import Iterator

import numpy as np

from garment_sim_ros.contact.kinds.kind import Cloud, Geometry, Kind, numbers

_FEWEST = 20
"""Vertices that a frame has to move most for them to stand for a body part."""


def _clouds(geometry: Geometry) -> Iterator[Cloud]:
    """The vertices that each frame of a skin moves most, in that frame."""
    weight, bind = numbers(geometry, "weight"), numbers(geometry, "bind")
    frame = np.asarray(geometry["frame"], np.int64)
    x = numbers(geometry, "vertices")
    most = np.take_along_axis(frame, weight.argmax(axis=1)[:, None], axis=1)[:, 0]
    for f in np.unique(most):
        if np.count_nonzero(most == f) >= _FEWEST:
            yield Cloud(x[most == f] @ bind[f, :, :3].T + bind[f, :, 3], int(f))


MESH = Kind(
    name="mesh",
    code=5,
    keys=("vertices", "triangles", "frame", "weight", "bind"),
    clouds=_clouds,
    is_skin=True,
    variants={
        "mesh": {
            "vertices": 0.1 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
            "triangles": np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32),
            "frame": np.zeros((4, 1)),
            "weight": np.ones((4, 1)),
            "bind": np.eye(4)[None, :3],
        }
    },
)
