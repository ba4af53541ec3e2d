"""A garment ready to be simulated: mesh, material, pins and how it follows the body."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.contact.shapes import WORLD, ColliderSet
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.materials import material_from
from garment_sim_ros.garment.mesh import mesh_from
from garment_sim_ros.geometry.sheet import pins_of, sheet
from garment_sim_ros.params import Material
from garment_sim_ros.sim.elastic import ElasticEdges
from garment_sim_ros.sim.placement import SoftAttachments
from garment_sim_ros.sim.self_collision.garment import own_distance


@dataclass(frozen=True, kw_only=True)
class Garment:
    """One garment on one body in rest pose.

    It needs nothing of the body at run time but the poses of the frames it names: each is a bone
    (the `frame` collider of that bone) or a collider's name.

    Attributes:
        name: Matches ``[a-z][a-z0-9_]*``.
        vertices: Positions in the body's rest pose, z up, file order [m], shape [v, 3]. Edges have
            their rest lengths here, unless `rest` or `flat` say otherwise.
        triangles: Vertex indices, counter-clockwise seen from outside, shape [t, 3].
        material: Its fabric.
        frames: Names of the frames that it follows, length b.
        T_world_frame_rest: Transforms of those frames in the pose of `vertices`, shape [b, 4, 4].
            A shirt is made with the arms away from the trunk, whatever the body's rest pose.
        frame_index: Frames that each vertex would follow if it were skin, shape [v, k].
        frame_weight: Weights of those frames, rows sum to 1, shape [v, k]. Used to place the
            garment on a pose far from the current one (start, reset, teleport).
        pins: Vertices with zero inverse mass, shape [p].
        pin_frame: Index into `frames` of the frame that each pin is fixed to, shape [p].
        passed_by: Bones whose colliders only brush it from outside: a hand that swings along a
            skirt would else press it through the thigh.
        layer: Garments with a higher number are worn over those with a lower one.
        skin_limits: Limits of how vertices lie to their places as skin, one for each vertex [m],
            shape [v], by name: ``max_distance`` is how far they may be from there, ``backstop``
            how far behind it, along the normal there; all: `sim.holds.skin_limits`.
        soft: Springs to places on its frames; None without.
        tethers: Part of its way over the cloth that a vertex may be farther away from its pins;
            None where nothing holds it.
        self_collision: The distance that its parts keep from each other [m]; None where it may
            pass through itself.
        T_world_bone_rest: Transforms of all bones that are known in the pose of `vertices`, by
            name, shape [4, 4]; those of `frames` need not be among them.
        flat: Where each triangle's corners lie in the panel that it was cut from, weft and warp
            [m], shape [t, 3, 2]: edges have their rest lengths there. None: in `vertices`.
        rest: Where its edges have their rest lengths: as it was before it was moved out of the
            body and carried over to it [m], shape [v, 3]. None: in `vertices`.
        stitches: Vertices with the same number are drawn together as the garment is sewn, -1 for
            none, shape [v]; None: nothing is to be sewn.
        elastic: Elastic bands along its edges; None: there are none.
        marks: What holds it, by name, and at which vertices, for pictures.
    """

    name: str
    vertices: FloatArray
    triangles: IntArray
    material: Material
    frames: tuple[str, ...]
    T_world_frame_rest: FloatArray
    frame_index: IntArray
    frame_weight: FloatArray
    pins: IntArray
    pin_frame: IntArray
    passed_by: tuple[str, ...] = ()
    layer: int = 0
    skin_limits: Mapping[str, FloatArray] = field(default_factory=dict)
    soft: SoftAttachments | None = None
    tethers: float | None = None
    self_collision: float | None = None
    T_world_bone_rest: Mapping[str, FloatArray] = field(default_factory=dict)
    flat: FloatArray | None = None
    rest: FloatArray | None = None
    stitches: IntArray | None = None
    elastic: ElasticEdges | None = None
    marks: Mapping[str, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        v = len(self.vertices)
        if not np.isfinite(self.vertices).all():
            raise GeometryError(f"garment {self.name!r}: vertices must be finite")
        if self.triangles.size and not 0 <= self.triangles.min() <= self.triangles.max() < v:
            raise GeometryError(f"garment {self.name!r}: triangle indices must lie in 0..{v - 1}")
        if self.pins.size and not 0 <= self.pins.min() <= self.pins.max() < v:
            raise GeometryError(f"garment {self.name!r}: pins must lie in 0..{v - 1}")

    @classmethod
    def from_mesh(
        cls,
        mesh: str | Path | FloatArray,
        triangles: Sequence[Sequence[int]] | NDArray[np.integer] | None = None,
        *,
        name: str = "cloth",
        material: Material | str | Mapping[str, object] | None = None,
        pins: Sequence[int] | NDArray[np.integer] = (),
        bone: str = WORLD,
        self_collision: bool | float = False,
        unit: str = "m",
        up: str = "y",
        edge: float | None = None,
        **more: Any,
    ) -> "Garment":
        """A garment attached to one bone, or to none: to what stands still in the world.

        Nothing but its pins follows the bone. To put a mesh on a body, see `Avatar.dress`.

        Args:
            mesh: Positions in the rest pose, z up [m], shape [v, 3]; or an OBJ, PLY or glTF file.
            triangles: Vertex indices, shape [t, 3]; only with positions.
            name: Its name.
            material: A fabric, the name of one of `garment.materials.PRESETS`, or values by name;
                cotton jersey where None.
            pins: Vertices with zero inverse mass.
            bone: The bone, whose rest pose is the world's frame.
            self_collision: Whether it is kept from passing through itself, or the distance that
                its parts keep from each other [m].
            unit: Length unit of the file: m, dm, cm, mm or in.
            up: Up axis of the file: y or z.
            edge: Longer edges are halved to about this [m]; None keeps the mesh.
            more: Other attributes of a garment, as `layer`.

        Raises:
            InputFileError: The file cannot be read, or its surface cannot be repaired.
            GeometryError: A mesh that cannot be used.
            ParameterError: An unknown fabric, unit or axis, or a value out of range.
        """
        made = mesh_from(mesh, triangles, unit=unit, up=up, edge_length=edge)
        fabric = material if isinstance(material, Material) else material_from(material)
        x, count = made.vertices, len(made.vertices)
        apart: float | None = None if self_collision is False else float(self_collision)
        if self_collision is True:
            apart = own_distance(x, made.triangles, fabric)
        return cls(
            name=name,
            vertices=x,
            triangles=made.triangles,
            material=fabric,
            frames=(bone,),
            T_world_frame_rest=np.eye(4)[None],
            frame_index=np.zeros((count, 1), np.int32),
            frame_weight=np.ones((count, 1)),
            pins=np.array(pins, dtype=np.int32),
            pin_frame=np.zeros(len(pins), np.int32),
            self_collision=apart,
            **more,
        )

    @classmethod
    def sheet(
        cls,
        width: float,
        height: float,
        *,
        edge: float = 0.02,
        at: Sequence[float] = (0.0, 0.0, 0.0),
        upright: bool = False,
        name: str = "sheet",
        material: Material | str | Mapping[str, object] | None = None,
        pins: str | Sequence[int] | IntArray = (),
        **more: Any,
    ) -> "Garment":
        """A rectangular piece of cloth.

        Args:
            width: Its extent along x [m].
            height: Its extent along y, or along z where it is upright [m].
            edge: Length of its edges, about [m].
            at: Its middle [m], shape [3].
            upright: Whether it hangs in the x-z plane instead of lying in the x-y plane.
            name: Its name.
            material: As for `from_mesh`.
            pins: Vertices with zero inverse mass; or "corners", "top" (the whole side of largest
                y or z) or "top corners". Vertices stand row by row from the top, along x.
            more: Other arguments of `from_mesh`, as `self_collision` and `layer`.

        Raises:
            ParameterError: A measure that is not positive, other words for pins.
        """
        vertices, triangles, columns = sheet(width, height, edge=edge, at=at, upright=upright)
        pinned = pins_of(pins, len(vertices), columns)
        return cls.from_mesh(
            vertices, triangles, name=name, material=material, pins=pinned, **more
        )


def without_bones(colliders: ColliderSet, bones: Sequence[str]) -> ColliderSet:
    """A set without the shapes on some bones; frames stay."""
    kept = (c for c in colliders.colliders if c.is_frame or c.bone not in bones)
    return replace(colliders, colliders=tuple(kept))
