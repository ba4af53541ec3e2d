"""Panels that are sewn to themselves into a tube: rolled around what they are placed beside.

A sleeve or a skirt of one piece is such a panel. Flat, it would close beside the body. Files do
not say how it lies; what is nearest to it and fits into it is the limb, or the trunk, that it is
for.
"""

from dataclasses import replace

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.pattern import Panel, Pattern, Placement, Stitch
from garment_sim_ros.garment.patterns.tape_sections import girth_of, loops_at
from garment_sim_ros.geometry.transforms import invert_transform, transform_points

_LEVELS = np.linspace(0.05, 0.95, 10)
"""Where along a panel the body is looked at, in shares of its height."""
_ACROSS = 0.6
"""How far apart edges are that make a tube when they are sewn, in widths of the panel."""
_ALONG = 0.5
"""How much higher one of the sewn edges may be than the other, in distances between them."""
_GIVES = 1.1
"""Largest girth that a tube is pulled over, in its own: it is as wide as that until it is sewn."""
_CLEAR = 0.015
"""Distance from the body that the tube keeps at least [m]."""


def rolled_tubes(pattern: Pattern, skin: FloatArray, triangles: IntArray, body: str) -> Pattern:
    """A pattern, its flat panels that are sewn into tubes rolled around the body.

    Args:
        pattern: A pattern that was checked.
        skin: The body's skin [m], shape [v, 3].
        triangles: Shape [t, 3].
        body: What messages call it.

    Raises:
        GeometryError: Nothing of the body fits into the tube, or it is one across the panel.
    """
    panels = dict(pattern.panels)
    for stitch in pattern.stitches:
        name = _tube(pattern, stitch)
        if name is not None:
            what = f"pattern {pattern.name!r}: panel {name!r}, which is sewn to itself into a tube"
            left, right = _ends(what, panels[name], stitch)
            panels[name] = _rolled(what, panels[name], left, right, skin, triangles, body)
    return replace(pattern, panels=panels)


def _tube(pattern: Pattern, stitch: Stitch) -> str | None:
    """The flat panel that a stitch makes a tube of; sides of darts and pleats are nearer."""
    name, *others = {seam.panel for side in stitch.sides for seam in side}
    panel = pattern.panels[name]
    if others or panel.placement.rolled:
        return None
    a, b = _middles(panel, stitch)
    across = (b - a) / max(float(np.linalg.norm(b - a)), 1e-12)
    return name if (b - a) @ across > _ACROSS * np.ptp(panel.outline @ across) else None


def _middles(panel: Panel, stitch: Stitch) -> tuple[FloatArray, FloatArray]:
    """Middle of each side of a stitch in the panel's plane [m], shape [2]."""
    a, b = (
        np.mean([panel.curves[e].mean(axis=0) for seam in side for e in seam.edges], axis=0)
        for side in stitch.sides
    )
    return a, b


def _ends(what: str, panel: Panel, stitch: Stitch) -> tuple[float, float]:
    """Where the sewn edges are across the panel [m].

    Raises:
        GeometryError: They are above each other rather than beside.
    """
    (left, low), (right, high) = sorted(map(tuple, _middles(panel, stitch)))
    if abs(high - low) > _ALONG * (right - left):
        raise GeometryError(
            f"{what}, has the edges of {stitch} above each other; allowed: left and right of it, "
            "the tube's axis along y"
        )
    return float(left), float(right)


def _rolled(
    what: str,
    panel: Panel,
    left: float,
    right: float,
    skin: FloatArray,
    triangles: IntArray,
    body: str,
) -> Panel:
    """A panel around the widest part of the body that is near to it and fits into it."""
    middle, width = 0.5 * (left + right), right - left
    T = panel.placement.T_world_panel @ _shift(middle, 0.0)
    panel = panel.shifted(-middle)
    local = transform_points(invert_transform(T), skin)
    low, high = panel.outline[:, 1].min(), panel.outline[:, 1].max()
    near = []
    for y in low + _LEVELS * (high - low):
        loops = [p for p in loops_at(local, triangles, float(y), 1).points if len(p) > 5]
        if loops:  # as points (x, z) of the panel
            loop = min(loops, key=lambda p: float(np.linalg.norm(p, axis=1).min()))
            near.append((girth_of(loop), loop))
    fits = [(girth, loop) for girth, loop in near if girth < _GIVES * width]
    if not fits:
        found = f"is {min(g for g, _ in near):.3g} m around" if near else "is not beside it"
        raise GeometryError(
            f"{what}, is {width:.3g} m wide, {body} {found}; allowed: wider than what it is "
            "placed beside"
        )
    _, loop = max(fits, key=lambda fit: fit[0])
    x, z = 0.5 * (loop.min(axis=0) + loop.max(axis=0))
    radius = float(np.linalg.norm(loop - [x, z], axis=1).max()) + _CLEAR
    radius = max(radius, width / (2.0 * np.pi))
    return replace(
        panel, placement=Placement(T_world_panel=T @ _shift(x, z + radius), bend=radius)
    )


def _shift(x: float, z: float) -> FloatArray:
    T = np.eye(4)
    T[[0, 2], 3] = x, z
    return T
