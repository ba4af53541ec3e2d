"""What is measured on a run; equations and units are in ``docs/tradeoff.md``.

A path is the world positions of one garment's vertices in every frame [m], shape [f, v, 3].
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.colliders.report.fatness import Union
from garment_sim_ros.contact.pierced import PiercedMeter
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh
from garment_sim_ros.recording.own_sides import OwnSides
from garment_sim_ros.stability.measures import Edges
from garment_sim_ros.tradeoff.scenes import Staged

Path = NDArray[np.floating]
Paths = Mapping[str, Path]

LAST = 10
"""Frames at the end of the still time that the rest speed is taken over."""
_LOOKS = 20
"""About so many frames are measured against the skin: a distance takes longer than a step."""


def distance_mm(here: Paths, there: Paths) -> float:
    """RMS distance of two runs, over garments, frames and vertices [mm]; nan if not finite."""
    squares = [_square(here[name], there[name]).ravel() for name in here]
    return 1e3 * float(np.sqrt(np.concatenate(squares).mean()))


def distances_mm(here: Paths, there: Paths) -> NDArray[np.float64]:
    """Distances of all vertices in all frames of two runs [mm]."""
    squares = [_square(here[name], there[name]).ravel() for name in here]
    return np.asarray(1e3 * np.sqrt(np.concatenate(squares)))


def _square(a: Path, b: Path) -> NDArray[np.float64]:
    apart = a.astype(np.float64) - b.astype(np.float64)
    return np.asarray((apart**2).sum(axis=-1))


def rest_speed_mm_s(paths: Paths, frame: float) -> float:
    """Largest RMS speed of a garment from one of the last frames to the next [mm/s].

    Args:
        paths: In the time in which everything stands still.
        frame: Time between two frames [s].
    """
    most = 0.0
    for x in paths.values():
        step = np.diff(x[-LAST - 1 :].astype(np.float64), axis=0)
        speed = np.sqrt((step**2).sum(axis=-1).mean(axis=1)) / frame
        most = max(most, float(speed.max()))
    return 1e3 * most


def is_finite(paths: Paths) -> bool:
    """Whether every position of every frame is finite."""
    return all(bool(np.isfinite(x).all()) for x in paths.values())


def worn_figures(staged: Staged, paths: Paths) -> dict[str, float]:
    """Stretch, and how garments lie on the body, or on the shapes where there is none.

    Args:
        staged: The scene.
        paths: Frames of its motion, the first at the start; finite.

    Returns:
        ``pierced``, ``inside``, ``penetration_mm``, ``gap_mm``, ``crossed``, ``strain_p95``,
        ``strain_max``.
    """
    meshes, looks = _meshes(staged), _looks(staged)
    on = _on_skin if staged.avatar is not None else _on_shapes
    figures = {"pierced": pierced(staged, paths), **on(staged, meshes, paths, looks)}
    edges, (p95, largest) = Edges(staged.garments), (0.0, 0.0)
    for n in range(1, staged.frames + 1):
        strain = edges.strain({name: x[n].astype(np.float64) for name, x in paths.items()})
        p95, largest = max(p95, strain.most), max(largest, strain.largest)
    return figures | {"strain_p95": p95, "strain_max": largest}


def _meshes(staged: Staged) -> dict[str, GarmentMesh]:
    return {g.name: GarmentMesh.of(g) for g in staged.garments}


def _looks(staged: Staged) -> Sequence[int]:
    """The frames that are measured against the skin."""
    return range(staged.frames, 0, -max(1, staged.frames // _LOOKS))


def crossed_own(staged: Staged, paths: Paths) -> float:
    """Share of a garment's edges that run through itself; arguments as for `worn_figures`.

    Returns:
        The largest of the garments, mean over frames.
    """
    edges = Edges(tuple(replace(g, self_collision=1.0) for g in staged.garments))
    each = [
        edges.crossed({name: path[n].astype(np.float64) for name, path in paths.items()})
        for n in _looks(staged)
    ]
    return float(np.mean(each))


def pierced(staged: Staged, paths: Paths) -> float:
    """Share of the frames in which the core of a body part runs through a garment."""
    if staged.avatar is None:
        return 0.0
    meter = PiercedMeter(staged.colliders)
    for n in range(1, staged.frames + 1):
        posed = {g.name: (paths[g.name][n], g.triangles) for g in staged.garments}
        meter.add(staged.poses[n], posed)
    return meter.result().share


def _on_skin(
    staged: Staged, meshes: Mapping[str, GarmentMesh], paths: Paths, looks: Sequence[int]
) -> dict[str, float]:
    avatar = staged.avatar
    assert avatar is not None
    skin = avatar.body.skin
    own = OwnSides.of(staged.garments, avatar.body)
    meter = ClothMeter(skin.vertices, skin.triangles, meshes, own)
    for n in looks:
        posed = {name: x[n].astype(np.float64) for name, x in paths.items()}
        meter.add(avatar.skin(staged.joints[n]), posed)
    found = meter.result()
    names = {
        "inside": "inside_p99",
        "penetration_mm": "penetration_mm_max",
        "gap_mm": "gap_mm_median",
        "crossed": "crossed_p99",
    }
    return {name: float(found[of] or 0.0) for name, of in names.items()}


def _on_shapes(
    staged: Staged, meshes: Mapping[str, GarmentMesh], paths: Paths, looks: Sequence[int]
) -> dict[str, float]:
    nothing = dict.fromkeys(("inside", "penetration_mm", "gap_mm", "crossed"), 0.0)
    if not any(c.is_met for c in staged.colliders.colliders):
        return nothing
    shapes = Union(staged.colliders, staged.poses[0])
    inside, deepest, gap = [], 0.0, []
    for n in looks:
        shapes.move(staged.poses[n])
        for name, mesh in meshes.items():
            x = paths[name][n].astype(np.float64)
            distance = shapes.distance(mesh.samples(x)).astype(np.float64)
            inside.append(mesh.inside(distance))
            deepest = max(deepest, float(-distance.min()))
            gap.append(distance[: len(x)])
    return nothing | {
        "inside": float(np.percentile(inside, 99.0)),
        "penetration_mm": 1e3 * deepest,
        "gap_mm": 1e3 * float(np.median(np.concatenate(gap))),
    }
