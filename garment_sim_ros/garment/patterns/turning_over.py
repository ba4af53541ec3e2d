"""Panels of which another side becomes the outside than the one that was drawn.

Seams of a folded piece, as of a lapel, join the right side of one panel to the wrong side of the
other. A surface has one outside: the folded panels are turned over, so that it goes on behind the
fold, and their right sides are what is seen.

Who draws one half of a front as the mirror image of the other keeps the order of its corners: its
outline runs clockwise then, which puts its right side backwards (`garmentcode`). Where it starts
tells what is meant: a panel whose right side would face the body, and which is drawn clockwise, is
taken as seen from outside.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.garment.patterns.pattern import Panel, Pattern, Seam, Stitch
from garment_sim_ros.geometry.mesh_distance import MeshDistance

INWARDS = -0.2
"""Mean cosine of right side and way out of the body below which a panel faces the body."""


def unfolded(pattern: Pattern) -> Pattern:
    """A pattern, those of its panels turned over that stitches fold over.

    Where no choice of panels gives one outside, it stays as it is, and `pieces.cut` says so.

    Args:
        pattern: A pattern from a file.
    """
    if not any(stitch.turned for stitch in pattern.stitches):
        return pattern
    ways: dict[str, list[tuple[str, bool]]] = {name: [] for name in pattern.panels}
    for stitch in pattern.stitches:
        for a, b in product(*stitch.sides):
            ways[a.panel].append((b.panel, stitch.turned))
            ways[b.panel].append((a.panel, stitch.turned))
    over: dict[str, bool] = {}
    folded: set[str] = set()
    for name in pattern.panels:
        if name in over:
            continue
        over[name], part = False, [name]
        for at in part:
            for other, turned in ways[at]:
                if other not in over:
                    over[other] = over[at] ^ turned
                    part.append(other)
                elif over[other] != over[at] ^ turned:
                    return pattern
        sides = [{n for n in part if over[n] is side} for side in (False, True)]
        # What is folded over is the smaller part of a garment.
        folded |= min(sides, key=lambda side: sum(pattern.panels[n].area for n in side))
    panels = {
        n: replace(_turned_over(p), folded=True) if n in folded else p
        for n, p in pattern.panels.items()
    }
    counts = {n: len(pattern.panels[n].edges) for n in folded}
    return replace(
        pattern,
        panels=panels,
        stitches=tuple(_followed(s, counts) for s in pattern.stitches),
    )


def facing(x: FloatArray, normal: FloatArray, body: MeshDistance) -> float:
    """Mean cosine of the angles of a surface's right side to the ways out of a body.

    Args:
        x: Points of the surface [m], shape [n, 3].
        normal: Out of its right side there, unit length, shape [n, 3] or [3].
        body: The skin.
    """
    gap, closest, _ = body.signed_distance(x)
    out = (x - closest) * np.sign(gap)[:, None]
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
    return float((normal * out).sum(axis=1).mean())


def facing_outwards(pattern: Pattern, body: MeshDistance) -> Pattern:
    """A pattern, those of its panels turned over that were drawn as a mirror image.

    Args:
        pattern: A pattern from a file.
        body: The skin that it is placed around.
    """
    over = {
        name
        for name, panel in pattern.panels.items()
        if panel.clockwise and _faces(panel, body) < INWARDS
    }
    if not over:
        return pattern
    panels = {n: _turned_over(p) if n in over else p for n, p in pattern.panels.items()}
    counts = {n: len(pattern.panels[n].edges) for n in over}
    names = ", ".join(map(repr, sorted(over)))
    return replace(
        pattern,
        panels=panels,
        stitches=tuple(_followed(s, counts) for s in pattern.stitches),
        notes=(
            *pattern.notes,
            f"panel {names}: drawn clockwise, its right side would face the body; taken as seen "
            "from outside",
        ),
    )


def _faces(panel: Panel, body: MeshDistance) -> float:
    x = panel.placement.placed(panel.outline)
    return facing(x, panel.placement.T_world_panel[:3, 2], body)


def _turned_over(panel: Panel) -> Panel:
    """The same cloth where it is, its other side the right one; edge i becomes the i-th last."""
    place = panel.placement
    T = place.T_world_panel @ np.diag([-1.0, 1.0, -1.0, 1.0])
    return replace(
        panel,
        corners=panel.corners * [-1.0, 1.0],
        edges=tuple(edge.flipped.backwards for edge in reversed(panel.edges)),
        placement=replace(place, T_world_panel=T),
        grain=(-panel.grain[0], panel.grain[1]),
        clockwise=False,
    )


def _followed(stitch: Stitch, counts: dict[str, int]) -> Stitch:
    """A stitch after panels were turned over, of which the numbers of edges are told.

    Once all right sides are outwards, sides that are sewn run against each other; a stitch that
    said that one is turned over meant just this.
    """
    over = [any(seam.panel in counts for seam in side) for side in stitch.sides]
    a, b = (_followed_side(side, counts) for side in stitch.sides)
    return Stitch(sides=(a, b), turned=stitch.turned and over[0] == over[1])


def _followed_side(side: tuple[Seam, ...], counts: dict[str, int]) -> tuple[Seam, ...]:
    seams = tuple(
        Seam(panel=s.panel, edges=tuple(counts[s.panel] - 1 - e for e in reversed(s.edges)))
        if s.panel in counts
        else s
        for s in side
    )
    return seams[::-1] if all(s.panel in counts for s in side) else seams
