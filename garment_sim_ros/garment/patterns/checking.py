"""What is wrong with a pattern, in one line that names the piece."""

from collections import Counter

import numpy as np

from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.patterns.curves import self_crossing
from garment_sim_ros.garment.patterns.pattern import Panel, Pattern, Seam, Stitch

LARGEST = 5.0
"""Largest extent of a panel [m]."""
SMALLEST = 0.005
"""Smallest extent of a panel [m]."""
SMALLEST_PATTERN = 0.1
"""Smallest extent of the largest panel of a pattern [m]."""
SHORTEST = 1e-4
"""Shortest edge [m]."""
MOST_PANELS = 256
MOST_EDGES = 512
"""Of one panel."""
MOST_EASE = 6.0
"""Longest side of a stitch, in lengths of the other one."""


def check(pattern: Pattern) -> None:
    """Sees whether a pattern can be cut and sewn.

    Raises:
        GeometryError: It cannot; the message names the panel, edge or stitch.
    """
    if not 1 <= len(pattern.panels) <= MOST_PANELS:
        raise _fault(pattern, f"has {len(pattern.panels)} panels", f"1 to {MOST_PANELS}")
    for panel in pattern.panels.values():
        _check_panel(pattern, panel)
    extent, name = max(
        (float(np.ptp(p.outline, axis=0).max()), n) for n, p in pattern.panels.items()
    )
    if extent < SMALLEST_PATTERN:
        raise _fault(
            pattern,
            f"its largest panel, {name!r}, is {extent:.3g} m long: another unit of length?",
            f"{SMALLEST_PATTERN:g} m on",
        )
    for stitch in pattern.stitches:
        _check_stitch(pattern, stitch)
    _check_once(pattern)
    _check_joined(pattern)


def _fault(pattern: Pattern, problem: str, allowed: str) -> GeometryError:
    return GeometryError(f"pattern {pattern.name!r}: {problem}; allowed: {allowed}")


def _check_panel(pattern: Pattern, panel: Panel) -> None:
    what = f"panel {panel.name!r}"
    n = len(panel.corners)
    if not 2 <= len(panel.edges) <= MOST_EDGES:
        raise _fault(pattern, f"{what} has {len(panel.edges)} edges", f"2 to {MOST_EDGES}")
    if not np.isfinite(panel.corners).all():
        raise _fault(pattern, f"{what} has a corner that is not finite", "finite coordinates")
    for i, edge in enumerate(panel.edges):
        if not (0 <= edge.start < n and 0 <= edge.end < n):
            raise _fault(
                pattern, f"{what} edge {i} names a corner beyond {n - 1}", f"0 to {n - 1}"
            )
        after = panel.edges[(i + 1) % len(panel.edges)]
        if edge.end != after.start:
            raise _fault(
                pattern,
                f"{what} is open: edge {i} ends at corner {edge.end}, the next one starts at "
                f"{after.start}",
                "a closed outline",
            )
    if len({edge.start for edge in panel.edges}) < len(panel.edges):
        raise _fault(pattern, f"{what} passes through a corner twice", "one closed outline")
    extent = np.ptp(panel.corners[[e.start for e in panel.edges]], axis=0)
    if extent.max() > LARGEST:
        raise _fault(
            pattern,
            f"{what} is {extent.max():.3g} m long: centimetres read as metres?",
            f"up to {LARGEST:g} m",
        )
    try:
        curves = panel.curves
    except GeometryError as error:
        raise _fault(pattern, f"{what}: {str(error).partition('; ')[0]}", "a wider one") from None
    for i, length in enumerate(panel.lengths):
        if length < SHORTEST:
            raise _fault(
                pattern, f"{what} edge {i} has no length ({length:.2g} m)", f"{SHORTEST:g} m on"
            )
    extent = np.ptp(np.concatenate(curves), axis=0)
    if not SMALLEST <= extent.max() <= LARGEST:
        raise _fault(
            pattern,
            f"{what} is {extent.max():.3g} m long: another unit of length?",
            f"{SMALLEST:g} to {LARGEST:g} m",
        )
    if self_crossing(panel.outline[:: max(1, len(panel.outline) // 1500)]):
        raise _fault(pattern, f"{what} crosses itself", "an outline that does not")
    if abs(panel.area) < SHORTEST * extent.max():
        raise _fault(
            pattern, f"{what} has no area ({panel.area:.2g} m^2)", "a panel wider than a thread"
        )
    if not panel.area > 0.0:
        raise _fault(pattern, f"{what} is mirrored: it runs clockwise", "counter-clockwise")


def _length(pattern: Pattern, side: tuple[Seam, ...]) -> float:
    return sum(float(pattern.panels[s.panel].lengths[list(s.edges)].sum()) for s in side)


def _check_stitch(pattern: Pattern, stitch: Stitch) -> None:
    what = f"stitch {stitch}"
    for side in stitch.sides:
        for seam in side:
            if seam.panel not in pattern.panels:
                known = ", ".join(pattern.panels)[:200]
                raise _fault(pattern, f"{what}: there is no panel {seam.panel!r}", known)
            count = len(pattern.panels[seam.panel].edges)
            wrong = [e for e in seam.edges if not 0 <= e < count]
            if wrong or not seam.edges:
                raise _fault(
                    pattern,
                    f"{what}: panel {seam.panel!r} has no edge {wrong[0] if wrong else '(none)'}",
                    f"0 to {count - 1}",
                )
    a, b = ({(s.panel, e) for s in side for e in s.edges} for side in stitch.sides)
    if a & b:
        panel, edge = sorted(a & b)[0]
        raise _fault(
            pattern, f"{what}: panel {panel!r} edge {edge} is sewn to itself", "two edges"
        )
    short, long = sorted(_length(pattern, side) for side in stitch.sides)
    if long > MOST_EASE * short:
        raise _fault(
            pattern,
            f"{what}: {1e3 * long:.0f} mm to {1e3 * short:.0f} mm",
            f"a ratio up to {MOST_EASE:g}",
        )


def _check_once(pattern: Pattern) -> None:
    """No edge is sewn twice: chains and cycles of edges have no place in a surface."""
    used = Counter(
        (seam.panel, edge)
        for stitch in pattern.stitches
        for side in stitch.sides
        for seam in side
        for edge in seam.edges
    )
    for (panel, edge), times in used.items():
        if times > 1:
            raise _fault(
                pattern,
                f"panel {panel!r} edge {edge} is sewn {times} times: its stitches make a cycle or "
                "a branch",
                "once",
            )


def _check_joined(pattern: Pattern) -> None:
    """Every panel is sewn to something; a pattern may have parts that are worn apart."""
    sewn = {seam.panel for stitch in pattern.stitches for side in stitch.sides for seam in side}
    loose = [name for name in pattern.panels if name not in sewn]
    if loose and len(pattern.panels) > 1:
        raise _fault(
            pattern, f"panel {loose[0]!r} is not sewn to anything", "panels with stitches"
        )
