"""Small patterns for tests."""

import numpy as np

from garment_sim_ros.garment.patterns.pattern import Panel, Pattern, Placement, Seam, Stitch, loop


def panel(name, corners, x=0.3, **of_edge):
    T = np.eye(4)
    T[:3, :3] = np.column_stack([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    T[0, 3] = x
    corners = np.array(corners, dtype=float)
    return Panel(
        name=name,
        corners=corners,
        edges=loop(corners, **of_edge),
        placement=Placement(T_world_panel=T),
    )


def seam(*names_and_edges):
    a, b = ((Seam(panel=n, edges=(e,)),) for n, e in names_and_edges)
    return Stitch(sides=(a, b))


def tube(width=0.4, other=0.4, height=0.5):
    """Two rectangles sewn at both sides; the second may be higher."""
    first = panel("front", [[0, 0], [width, 0], [width, height], [0, height]])
    second = panel("back", [[0, 0], [width, 0], [width, other], [0, other]], x=-0.3)
    return Pattern(
        name="tube",
        panels={"front": first, "back": second},
        stitches=(seam(("front", 1), ("back", 3)), seam(("front", 3), ("back", 1))),
    )
