"""The visual geometry of a URDF as a rigid skin: every vertex moves with one link."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlparse
from xml.etree.ElementTree import Element

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from garment_sim_ros.body.loaders.mesh_file import read_mesh
from garment_sim_ros.body.loaders.urdf_xml import numbers, origin_transform
from garment_sim_ros.body.loaders.welding import weld
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.body.skin import Skin
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.geometry.transforms import invert_transform, transform_points

if TYPE_CHECKING:
    import trimesh

FloatArray = NDArray[np.float64]

MAX_SIZE = 100.0
"""Largest measure of a primitive [m]."""

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
            return next(filter(Path.is_file, self._candidates(uri)))
        except (StopIteration, ValueError, OSError):
            raise InputFileError(
                self.source, f"names the mesh {uri[:200]!r}, which is not there"
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
                self.source, f"names the mesh {uri!r}", "allowed: files, file:// and package://"
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
    parts = _parts(robot, rig, "visual", finder)
    if not parts:
        parts = _parts(robot, rig, "collision", finder)
        notes = ("no visual geometry; collision geometry taken as the skin",)
    if not parts:
        raise InputFileError(finder.source, "has no visual geometry", "allowed: links with shapes")
    vertices, triangles, link = [], [], []
    count = 0
    for index, T_link_part, mesh in parts:
        vertices.append(transform_points(T_root_link[index] @ T_link_part, mesh.vertices))
        triangles.append(mesh.faces + count)
        link.append(np.full(len(mesh.vertices), index))
        count += len(mesh.vertices)
    owner = np.concatenate(link)
    W = sp.csr_matrix((np.ones(count), (np.arange(count), owner)), shape=(count, len(rig)))
    x, faces, W = weld(np.concatenate(vertices), np.concatenate(triangles).astype(np.int32), W)
    skin = Skin(
        vertices=x,
        triangles=faces,
        bone=W.indices[:, None],
        weight=np.ones((len(x), 1)),
        T_bone_bind=invert_transform(T_root_link),
    )
    return skin, notes


def _parts(
    robot: Element, rig: Rig, tag: str, finder: MeshFinder
) -> list[tuple[int, FloatArray, trimesh.Trimesh]]:
    """Link, transform in the link, and triangles of every <visual> or <collision>."""
    parts = []
    total = 0
    for link in robot.findall("link"):
        for element in link.findall(tag):
            geometry = element.find("geometry")
            if geometry is None or len(geometry) == 0:
                raise InputFileError(
                    finder.source, f"link {link.get('name')!r} has a <{tag}> without geometry"
                )
            mesh = _triangulated(geometry[0], finder)
            total += len(mesh.vertices)
            if total > MAX_VERTICES:
                raise InputFileError(finder.source, f"has over {MAX_VERTICES} vertices")
            T_link_part = origin_transform(element, finder.source)
            parts.append((rig.index(link.get("name", "")), T_link_part, mesh))
    return parts


def _triangulated(shape: Element, finder: MeshFinder) -> trimesh.Trimesh:
    import trimesh  # takes most of a second, which URDFs without geometry need not wait

    def size(key: str, count: int = 1) -> FloatArray:
        value = numbers(shape, key, "", count, finder.source)
        if not ((value > 0.0) & (value <= MAX_SIZE)).all():
            raise InputFileError(
                finder.source,
                f"<{shape.tag} {key}={shape.get(key)!r}>",
                f"allowed: above 0 to {MAX_SIZE:g} m",
            )
        return value

    if shape.tag == "box":
        return _even(trimesh.creation.box(extents=size("size", 3)))
    if shape.tag == "sphere":
        return trimesh.creation.icosphere(subdivisions=2, radius=size("radius")[0])
    if shape.tag in ("cylinder", "capsule"):
        make = getattr(trimesh.creation, shape.tag)
        return _even(make(radius=size("radius")[0], height=size("length")[0]))
    if shape.tag == "mesh":
        mesh = finder.mesh(shape.get("filename", "")).copy()
        scale = numbers(shape, "scale", "1 1 1", 3, finder.source)
        mesh.vertices = mesh.vertices * scale
        if np.prod(scale) < 0.0:
            mesh.invert()
        return mesh
    raise InputFileError(
        finder.source,
        f"has the shape <{shape.tag}>",
        "allowed: box, sphere, cylinder, capsule, mesh",
    )


def _even(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same shape with vertices all over it, which fitting colliders needs."""
    import trimesh

    vertices, faces = trimesh.remesh.subdivide_to_size(
        mesh.vertices, mesh.faces, max_edge=mesh.extents.max() / 6.0
    )[:2]
    return trimesh.Trimesh(vertices, faces, process=False)
