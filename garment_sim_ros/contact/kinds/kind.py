"""What the package needs to know about one kind of collider: its record."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.contact.kinds.entries import Entries

Geometry = Mapping[str, object]
"""Shape of a collider in its own frame [m]; which entries there are depends on the kind."""
Size = tuple[float, float, float, float]
"""Up to four numbers that kernels read as ``shapes.size[k]``; the kind says what they are."""
NO_SIZE: Size = (0.0, 0.0, 0.0, 0.0)


class Own(NamedTuple):
    """The shapes of one kind in a set, for the arrays that its kernels need.

    Attributes:
        geometry: By the collider's name, in the set's order.
        size: Size numbers of all shapes of the set, other kinds among them, shape [m, 4].
        longest: Length of the longest of all shapes [m].
        T_world_rest: Where the kind's shapes are at rest, NaN where that is not known, shape
            [own, 4, 4]; None if it is not for any.
    """

    geometry: Mapping[str, Geometry]
    size: SingleArray
    longest: float
    T_world_rest: FloatArray | None


class Core(NamedTuple):
    """The middle of a shape's long axis.

    Attributes:
        ends: Its ends [m], shape [2, 3].
        depth: Distance that it keeps from the surface at least [m].
    """

    ends: FloatArray
    depth: float


class Cloud(NamedTuple):
    """Points whose convex hull stands for a shape or a part of it.

    Attributes:
        points: In the frame of what carries them [m], shape [n, 3].
        frame: Which of the set's frames carries them, counted from 0; None: the collider itself.
    """

    points: FloatArray
    frame: int | None = None


class Surface(NamedTuple):
    """A closed triangle mesh.

    Attributes:
        vertices: In the collider's frame [m], shape [v, 3].
        triangles: Counter-clockwise seen from outside, shape [t, 3].
    """

    vertices: FloatArray
    triangles: IntArray


class Shape(NamedTuple):
    """What a kind says that has a rigid shape of its own.

    Attributes:
        size: The size numbers of a geometry. Raises `GeometryError` where it cannot be used.
        bound: A capsule that holds the shape: start, end and radius [m], 7 numbers.
        inscribed_radius: Radius of a ball that fits into the shape [m]; 0 where that is not known.
        surface: Its surface, of about so many points where the shape is round, and in triangles of
            no less than so many metres where it is sampled.
        table: Field of `contact.packed.PackedShapes` for the arrays of all shapes of the kind;
            empty where the size numbers are enough.
        arrays: Makes these arrays, and boxes that hold the shapes better than their capsules:
            lowest and highest corner [m], shape [own, 6], or None. Needed with `table`.
        core: The core of a geometry, whose length is so much of the long axis'; None where there
            is none, or where `clouds` tell it.
        distance: Signed distances of points [n, 3] in double precision [m]; None: those to the
            surface are as good.
        radii: Half axes of a shape that is an ellipsoid [m], shape [3]; None for others.
    """

    size: Callable[[Geometry], Size]
    bound: Callable[[Geometry], tuple[float, ...]]
    inscribed_radius: Callable[[Geometry], float]
    surface: Callable[[Geometry, int, float], Surface]
    table: str = ""
    arrays: Callable[[Own], tuple[object, SingleArray | None]] | None = None
    core: Callable[[Geometry, float], Core] | None = None
    distance: Callable[[Geometry, FloatArray], FloatArray] | None = None
    radii: Callable[[Geometry], FloatArray] | None = None


def _no_clouds(geometry: Geometry) -> Iterable[Cloud]:
    return ()


def _taken_as_given(entries: Entries) -> dict[str, object]:
    return {key: entries.array(key) for key in entries.keys}


@dataclass(frozen=True, eq=False, kw_only=True)
class Kind:
    """One kind of collider.

    Attributes:
        name: What `Collider.kind` and collider descriptions call it.
        code: Its number in `PackedShapes.kind`, for kernels; unique.
        keys: Entries that every geometry has.
        optional: Entries that it may have.
        parse: Checked geometry from entries that nobody has checked; as numbers where not given.
        shape: Its rigid shape; None for a frame, which has none, and for skin.
        clouds: Convex solids that stand for a geometry in the test of what runs through cloth.
        is_skin: Whether it is a mesh that follows the set's frames, see `contact.mesh`.
        is_bare: Whether it is such a mesh that cloth does not meet, but is shown over.
        variants: An example of each sort of geometry that runs code of its own, by a name for it.
        variant: Which of these a geometry is; the kind's name where there is one only.
    """

    name: str
    code: int
    keys: tuple[str, ...]
    optional: tuple[str, ...] = ()
    parse: Callable[[Entries], dict[str, object]] = _taken_as_given
    shape: Shape | None = None
    clouds: Callable[[Geometry], Iterable[Cloud]] = _no_clouds
    is_skin: bool = False
    is_bare: bool = False
    variants: Mapping[str, Geometry]
    variant: Callable[[Geometry], str] | None = None

    @property
    def is_met(self) -> bool:
        """Whether cloth meets it."""
        return self.shape is not None or self.is_skin

    @property
    def is_frame(self) -> bool:
        """Whether it is a place that others move with, and nothing else."""
        return not (self.is_met or self.is_bare)

    def variant_of(self, geometry: Geometry) -> str:
        """Which of `variants` a geometry is."""
        return self.name if self.variant is None else self.variant(geometry)


def number(geometry: Geometry, key: str) -> float:
    """An entry that is a number."""
    return float(geometry[key])  # type: ignore[arg-type]


def numbers(geometry: Geometry, key: str) -> FloatArray:
    """An entry that is an array of numbers."""
    return np.asarray(geometry[key], np.float64)
