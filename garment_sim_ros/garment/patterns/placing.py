"""Panels around a body before they are sewn: none touches it, each faces outwards."""

from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.pattern import Panel, Placement
from garment_sim_ros.garment.patterns.pieces import Pieces
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.topology import vertex_normals

CLEARANCE = 0.02
"""Distance that flat panels keep from the body at the start [m]."""
_ROLLED = 0.01
"""Distance that rolled ones keep, which are all around a limb [m]."""
_STEPS = 60
_FARTHEST = 0.8
"""How far a panel is moved at most [m]."""
_TOO_FAR = 1.0
"""Distance from the body at which a pattern is not around it [m]."""


def placed_clear(pieces: Pieces, body: MeshDistance, body_name: str) -> Pieces:
    """The pieces with every panel moved out until it is clear of the body.

    A flat panel moves along its outside, a rolled one along the limb that it is rolled around,
    away from the trunk.

    Args:
        pieces: The cut pattern.
        body: The skin that they must not touch.
        body_name: What messages call it.

    Raises:
        GeometryError: A panel is nowhere near the body, faces it with the wrong side, or does not
            come clear of it; the message names it.
    """
    pattern = pieces.pattern
    panels = {}
    x = pieces.placed()
    for k, (name, panel) in enumerate(pattern.panels.items()):
        own = pieces.panel == k
        triangles = pieces.triangles[own[pieces.triangles[:, 0]]] - int(np.flatnonzero(own)[0])
        what = f"pattern {pattern.name!r}: panel {name!r}"
        start = x[own]
        _check_side(what, start, triangles, body, body_name)
        way = _way_out(what, panel, start, body, body_name)
        T = panel.placement.T_world_panel.copy()
        T[:3, 3] += way
        panels[name] = replace(
            panel, placement=Placement(T_world_panel=T, bend=panel.placement.bend)
        )
    return pieces.with_pattern(replace(pattern, panels=panels))


def away(panel: Panel) -> FloatArray:
    """Direction in which a panel gets away from the body, shape [3]."""
    T = panel.placement.T_world_panel
    return -T[:3, 1] if np.isfinite(panel.placement.bend) else T[:3, 2]


def _check_side(
    what: str, x: FloatArray, triangles: FloatArray, body: MeshDistance, body_name: str
) -> None:
    gap, closest, _ = body.signed_distance(x)
    if np.abs(gap).min() > _TOO_FAR:
        raise GeometryError(
            f"{what} is {np.abs(gap).min():.3g} m away from {body_name}; allowed: a pattern "
            "around it (another unit of length, or another body?)"
        )
    normal = np.zeros_like(x)
    vertex_normals(x, np.ascontiguousarray(triangles, np.int32), normal)
    outward = (x - closest) * np.sign(gap)[:, None]
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)
    if (normal * outward).sum(axis=1).mean() < -0.2:
        raise GeometryError(
            f"{what} is mirrored: its right side faces {body_name}; allowed: right sides outwards"
        )


def _way_out(
    what: str, panel: Panel, x: FloatArray, body: MeshDistance, body_name: str
) -> FloatArray:
    """How far to move a panel [m], shape [3]."""
    direction = away(panel)
    moved = 0.0
    clear = _ROLLED if np.isfinite(panel.placement.bend) else CLEARANCE
    for _ in range(_STEPS):
        gap = float(body.signed_distance(x + moved * direction)[0].min())
        if gap >= clear:
            return moved * direction
        moved += max(clear - gap, 0.005)
        if moved > _FARTHEST:
            break
    raise GeometryError(
        f"{what} does not come clear of {body_name} within {_FARTHEST:g} m; allowed: a place "
        "beside the body"
    )
