"""What contact along rays needs of all hulls of a set, computed once in their own frames.

Sun et al. 2007, sections 2.3 and 2.4: the oriented box, the upper and the lower planar mesh with
Kirkpatrick's hierarchies, and the outer map of each hull; here one after the other in flat arrays.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.kinds.kind import Geometry, numbers
from garment_sim_ros.contact.papers.hull_location import planar_meshes
from garment_sim_ros.contact.papers.kirkpatrick import Hierarchy, hierarchy
from garment_sim_ros.contact.papers.outer_map import OuterMap, outer_map
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.geometry.obb import oriented_box


class RayTables(NamedTuple):
    """Tables of h hulls.

    Attributes:
        frame: From each hull's frame to that of its oriented box, shape [h, 3, 4].
        box: Lowest and highest corner of it [m], shape [h, 2, 3].
        is_sphere: See `OuterMap`, as those up to `plane`, shape [h].
        around: Shape [h].
        rows: Shape [h].
        low: Shape [h].
        per_row: Shape [h].
        first: Where each map's cells begin in `start`, shape [h].
        start: Where each cell's faces start in `face`.
        face: Faces, counted over all hulls.
        plane: Outward unit normals and offsets of all faces, shape [f, 4].
        corner: See `Hierarchy`, as those up to `finer`: the triangles of all hierarchies.
        label: Faces, counted over all hulls.
        tree_start: Where each triangle's finer ones start in `finer`.
        finer: Triangles, counted over all hierarchies.
        tolerance: Of the upper and the lower mesh, shape [h, 2].
        root: Of the upper and the lower mesh, shape [h, 2].
    """

    frame: FloatArray
    box: FloatArray
    is_sphere: IntArray
    around: IntArray
    rows: IntArray
    low: FloatArray
    per_row: FloatArray
    first: IntArray
    start: IntArray
    face: IntArray
    plane: FloatArray
    corner: FloatArray
    label: IntArray
    tree_start: IntArray
    finer: IntArray
    tolerance: FloatArray
    root: IntArray


class _Hull(NamedTuple):
    """The tables of one hull."""

    frame: FloatArray
    box: FloatArray
    map: OuterMap
    trees: tuple[Hierarchy, Hierarchy]


def ray_tables(colliders: ColliderSet) -> RayTables:
    """The tables of a set's hulls, in its order."""
    hulls = [_hull(c.geometry) for c in colliders.colliders if c.kind == HULL.name]
    maps = [hull.map for hull in hulls]
    trees = [tree for hull in hulls for tree in hull.trees]
    faces = _begins([len(m.plane) for m in maps])
    lists = _begins([len(m.face) for m in maps])
    triangles = _begins([len(t.label) for t in trees])
    finer = _begins([len(t.finer) for t in trees])
    of_tree = np.repeat(faces[:-1], 2).tolist()
    return RayTables(
        frame=np.array([h.frame for h in hulls], np.float64).reshape(-1, 3, 4),
        box=np.array([h.box for h in hulls], np.float64).reshape(-1, 2, 3),
        is_sphere=np.array([m.is_sphere for m in maps], np.int32),
        around=np.array([m.around for m in maps], np.int32),
        rows=np.array([m.rows for m in maps], np.int32),
        low=np.array([m.low for m in maps], np.float64),
        per_row=np.array([m.per_row for m in maps], np.float64),
        first=_begins([len(m.start) for m in maps])[:-1],
        start=_joined([m.start + at for m, at in zip(maps, lists)]),
        face=_joined([m.face + at for m, at in zip(maps, faces)]),
        plane=np.concatenate([np.zeros((0, 4)), *(m.plane for m in maps)]),
        corner=np.concatenate([np.zeros((0, 3, 2)), *(t.corner for t in trees)]),
        label=_joined([_counted(t.label, at) for t, at in zip(trees, of_tree)]),
        tree_start=_joined([*(t.start[:-1] + at for t, at in zip(trees, finer)), finer[-1:]]),
        finer=_joined([t.finer + at for t, at in zip(trees, triangles)]),
        tolerance=np.array([t.tolerance for t in trees], np.float64).reshape(-1, 2),
        root=np.array([t.root + at for t, at in zip(trees, triangles)], np.int32).reshape(-1, 2),
    )


def _hull(geometry: Geometry) -> _Hull:
    vertices, faces = numbers(geometry, "vertices"), np.asarray(geometry["faces"], np.int32)
    box = oriented_box(vertices, faces)
    local = box.local(vertices)
    table = outer_map(local, faces)
    flat = np.ascontiguousarray(local[:, :2])
    own = []
    for chosen, triangles in planar_meshes(faces, table.plane[:, 2]):
        tree = hierarchy(flat, triangles)
        # Labels name the hull's faces, not those of the planar mesh.
        label = np.where(tree.label >= 0, chosen[np.maximum(tree.label, 0)], tree.label)
        own.append(tree._replace(label=label))
    return _Hull(
        frame=np.column_stack([box.axes.T, -box.axes.T @ box.centre]),
        box=np.stack([local.min(axis=0), local.max(axis=0)]),
        map=table,
        trees=(own[0], own[1]),
    )


def _begins(lengths: Sequence[int]) -> IntArray:
    """Where each of several lists begins when they are joined, and where the last one ends."""
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)


def _counted(label: IntArray, first: int) -> IntArray:
    """Labels of one hull counted over all, those that name no face as they are."""
    return np.where(label >= 0, label + first, label)


def _joined(lists: Sequence[IntArray]) -> IntArray:
    return np.concatenate([np.zeros(0, np.int32), *lists]).astype(np.int32)
