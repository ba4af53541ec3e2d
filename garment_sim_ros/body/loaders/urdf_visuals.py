"""The visual geometry of a URDF as a rigid skin: every vertex moves with one link."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlparse
from xml.etree.ElementTree import Element

import numpy as np
import scipy.sparse as sp

from garment_sim_ros.arrays import FloatArray, LongArray
from garment_sim_ros.body.loaders.mesh_file import read_mesh
from garment_sim_ros.body.loaders.urdf_shapes import box, capsule, cylinder, divisions_for, sphere
from garment_sim_ros.body.loaders.urdf_xml import numbers, origin_transform
from garment_sim_ros.body.loaders.welding import weld
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.body.skin import Skin
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.geometry.transforms import invert_transform, transform_points
from garment_sim_ros.input_file import is_file

if TYPE_CHECKING:
    import trimesh


MIN_SIZE, MAX_SIZE = 1e-6, 100.0
"""Smallest and largest measure of a shape [m]."""

MAX_SHAPES = 4096

_SIZES = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1},
}
"""What of a shape must not be 0 for it to have a volume, and how many numbers that is."""

MAX_VERTICES = 2_000_000
"""Largest number of vertices of the whole skin."""


class MeshFinder:
    """Finds and reads the mesh files that a URDF names.

    Args:
        source: The URDF's file; relative names start at its folder.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self._folder = Path(source).absolute().parent
        self._read: dict[str, trimesh.Trimesh] = {}

    def mesh(self, uri: str) -> trimesh.Trimesh:
        """The triangles of a mesh file.

        Raises:
            InputFileError: Not found, of another type, or not a usable mesh.
        """
        if uri not in self._read:
            self._read[uri] = read_mesh(self.path(uri))
        return self._read[uri]

    def path(self, uri: str) -> Path:
        """Where the file behind a relative, absolute, ``file://`` or ``package://`` name is.

        A package is looked for in the ament index (`AMENT_PREFIX_PATH`) and among the folders
        above the URDF.

        Raises:
            InputFileError: There is no such file.
        """
        try:
            return next(filter(is_file, self._candidates(uri)))
        except (StopIteration, ValueError):
            raise InputFileError(
                self.source,
                f"names the mesh {uri[:200]!r}, which is not there",
                "allowed: a file, or one of a package in AMENT_PREFIX_PATH or beside the URDF",
            ) from None

    def _candidates(self, uri: str) -> list[Path]:
        parts = urlparse(uri)
        if parts.scheme == "package":
            inside = unquote(parts.path).lstrip("/")
            prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
            candidates = [Path(prefix) / "share" / parts.netloc / inside for prefix in prefixes]
            for folder in (self._folder, *self._folder.parents):
                candidates.append(folder / parts.netloc / inside)
                if folder.name == parts.netloc:
                    candidates.append(folder / inside)
        elif parts.scheme in ("", "file"):
            candidates = [self._folder / unquote(parts.path)]
        else:
            raise InputFileError(
                self.source,
                f"names the mesh {uri[:200]!r}",
                "allowed: files, file:// and package://",
            )
        return candidates


def rigid_skin(
    robot: Element, rig: Rig, T_root_link: FloatArray, finder: MeshFinder
) -> tuple[Skin, tuple[str, ...]]:
    """The skin made of all <visual>, or where there is none all <collision>, geometry.

    Args:
        robot: The URDF's root element.
        rig: Its joint tree.
        T_root_link: Rest transforms of the links in the root link's frame, shape [n, 4, 4].
        finder: Reads mesh files.

    Returns:
        The skin and what was assumed.

    Raises:
        InputFileError: No geometry, or one that cannot be used.
    """
    notes: tuple[str, ...] = ()
    parts, empty = _parts(robot, rig, "visual", finder)
    if not parts:
        parts, empty = _parts(robot, rig, "collision", finder)
        notes = ("no visual geometry; collision geometry taken as the skin",)
    if empty:
        notes = (*notes, f"shapes without a volume, left out: {empty}")
    if not parts:
        raise InputFileError(finder.source, "has no visual geometry", "allowed: links with shapes")
    vertices, triangles, link = [], [], []
    count = 0
    for index, T_link_part, points, faces in parts:
        vertices.append(transform_points(T_root_link[index] @ T_link_part, points))
        triangles.append(faces + count)
        link.append(np.full(len(points), index))
        count += len(points)
    owner = np.concatenate(link)
    W = sp.csr_matrix((np.ones(count), (np.arange(count), owner)), shape=(count, len(rig)))
    everything = np.concatenate(vertices)
    if not np.isfinite(everything).all():
        raise InputFileError(finder.source, "has shapes at places that are not finite")
    try:
        x, welded, W = weld(everything, np.concatenate(triangles).astype(np.int32), W)
    except GeometryError as error:
        raise InputFileError(finder.source, str(error)) from error
    if len(welded) == 0:
        raise InputFileError(
            finder.source, "has shapes too thin for its size", "allowed: shapes with an area"
        )
    skin = Skin(
        vertices=x,
        triangles=welded,
        bone=W.indices[:, None],
        weight=np.ones((len(x), 1)),
        T_bone_bind=invert_transform(T_root_link),
    )
    return skin, notes


_Part = tuple[int, FloatArray, FloatArray, LongArray]
"""Link, transform of the shape in the link, vertices and triangles of the shape."""


def _parts(robot: Element, rig: Rig, tag: str, finder: MeshFinder) -> tuple[list[_Part], int]:
    """Every <visual> or <collision>, but for those without a volume, and how many these are."""
    elements = [
        (link.get("name", ""), e) for link in robot.findall("link") for e in link.findall(tag)
    ]
    if len(elements) > MAX_SHAPES:
        raise InputFileError(
            finder.source, f"has {len(elements)} <{tag}>", f"allowed: up to {MAX_SHAPES}"
        )
    number = {name: i for i, name in enumerate(rig.joint_names)}
    divisions = divisions_for(len(elements))
    parts = []
    total = nothing = 0
    for name, element in elements:
        geometry = element.find("geometry")
        if geometry is None or len(geometry) == 0:
            raise InputFileError(finder.source, f"link {name!r} has a <{tag}> without geometry")
        if _is_nothing(geometry[0]):
            nothing += 1
            continue
        vertices, triangles = _triangulated(geometry[0], finder, divisions)
        total += len(vertices)
        if total > MAX_VERTICES:
            raise InputFileError(finder.source, f"has over {MAX_VERTICES} vertices")
        T_link_part = origin_transform(element, finder.source)
        parts.append((number[name], T_link_part, vertices, triangles))
    return parts, nothing


def _is_nothing(shape: Element) -> bool:
    """Whether a shape has no volume: a stand-in of links on which nothing is seen."""
    sizes: list[float] = []
    for key, count in _SIZES.get(shape.tag, {}).items():
        try:
            found = [float(size) for size in shape.get(key, "").split()]
        except ValueError:
            return False
        if len(found) != count or not all(0.0 <= size <= MAX_SIZE for size in found):
            return False
        sizes += found
    return 0.0 in sizes


def _triangulated(
    shape: Element, finder: MeshFinder, divisions: int
) -> tuple[FloatArray, LongArray]:
    """Vertices and triangles of a shape."""

    def size(key: str, count: int = 1) -> FloatArray:
        value = numbers(shape, key, "", count, finder.source)
        if not ((value >= MIN_SIZE) & (value <= MAX_SIZE)).all():
            raise InputFileError(
                finder.source,
                f"<{shape.tag} {key}={shape.get(key)!r:.60}>",
                f"allowed: {MIN_SIZE:g} to {MAX_SIZE:g} m",
            )
        return value

    if shape.tag == "box":
        return box(size("size", 3), divisions)
    if shape.tag == "sphere":
        return sphere(float(size("radius")[0]))
    if shape.tag in ("cylinder", "capsule"):
        make = cylinder if shape.tag == "cylinder" else capsule
        return make(float(size("radius")[0]), float(size("length")[0]), divisions)
    if shape.tag == "mesh":
        mesh = finder.mesh(shape.get("filename", ""))
        scale = numbers(shape, "scale", "1 1 1", 3, finder.source)
        if not ((np.abs(scale) >= MIN_SIZE) & (np.abs(scale) <= 1.0 / MIN_SIZE)).all():
            raise InputFileError(
                finder.source,
                f"<mesh scale={shape.get('scale')!r:.60}>",
                f"allowed: {MIN_SIZE:g} to {1.0 / MIN_SIZE:g}",
            )
        vertices = mesh.vertices * scale
        if np.abs(vertices).max() > MAX_SIZE:
            raise InputFileError(
                finder.source,
                f"the mesh {shape.get('filename', '')!r:.200} reaches "
                f"{np.abs(vertices).max():.3g} m",
                f"allowed: up to {MAX_SIZE:g} m",
            )
        triangles = np.asarray(mesh.faces, np.int64)
        return vertices, triangles[:, ::-1] if np.prod(scale) < 0.0 else triangles
    raise InputFileError(
        finder.source,
        f"has the shape <{shape.tag}>",
        "allowed: box, sphere, cylinder, capsule, mesh",
    )
