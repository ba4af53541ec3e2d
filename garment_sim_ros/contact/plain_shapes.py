"""Plain colliders by their measures, for scenes without a body."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.contact.kinds.capsule import CAPSULE
from garment_sim_ros.contact.kinds.ellipsoid import ELLIPSOID
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.kinds.sphere import SPHERE
from garment_sim_ros.contact.shapes import WORLD, Collider
from garment_sim_ros.errors import GeometryError

Vector = Sequence[float] | FloatArray

_ORIGIN = (0.0, 0.0, 0.0)
_UNTURNED = (0.0, 0.0, 0.0, 1.0)
_BOX_FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def sphere(
    radius: float, position: Vector = _ORIGIN, *, name: str = SPHERE.name, bone: str = WORLD
) -> Collider:
    """A sphere.

    Args:
        radius: Its radius [m].
        position: Its centre in the bone's frame [m], shape [3].
        name: Its name; `ColliderSet.of` makes names unique.
        bone: What carries it, see `ColliderSet.poses`.

    Raises:
        GeometryError: A measure that is not positive and finite.
    """
    geometry = {"radius": _length("radius", radius)}
    return Collider(
        name=name, kind=SPHERE.name, bone=bone, position=np.asarray(position), geometry=geometry
    )


def capsule(
    start: Vector,
    end: Vector,
    radius: float,
    end_radius: float | None = None,
    *,
    name: str = CAPSULE.name,
    bone: str = WORLD,
) -> Collider:
    """A capsule: a cylinder or cone with round ends.

    Args:
        start: Centre of its first end in the bone's frame [m], shape [3].
        end: Centre of its other end [m], shape [3].
        radius: Radius at its first end [m].
        end_radius: Radius at its other end [m]; the same where None.
        name: As for `sphere`.
        bone: As for `sphere`.

    Raises:
        GeometryError: A measure that is not positive and finite.
    """
    start, end = np.asarray(start, np.float64), np.asarray(end, np.float64)
    length = _length("length", float(np.linalg.norm(end - start)))
    x, y, z = (end - start) / length
    # Half-way between the z axis and the capsule's; about x where they are opposite.
    turn = np.array([-y, x, 0.0, 1.0 + z]) if z > -1.0 + 1e-12 else np.array([1.0, 0.0, 0.0, 0.0])
    return Collider(
        name=name,
        kind=CAPSULE.name,
        bone=bone,
        position=start,
        orientation=turn / np.linalg.norm(turn),
        geometry={
            "radius0": _length("radius", radius),
            "radius1": _length("end_radius", radius if end_radius is None else end_radius),
            "length": length,
        },
    )


def ellipsoid(
    radii: Vector,
    position: Vector = _ORIGIN,
    orientation: Vector = _UNTURNED,
    *,
    name: str = ELLIPSOID.name,
    bone: str = WORLD,
) -> Collider:
    """An ellipsoid.

    Args:
        radii: Its radii [m], shape [3].
        position: Its centre in the bone's frame [m], shape [3].
        orientation: Unit quaternion (x, y, z, w) of its axes there.
        name: As for `sphere`.
        bone: As for `sphere`.

    Raises:
        GeometryError: A measure that is not positive and finite.
    """
    lengths = np.array([_length("radii", radius) for radius in radii])
    if lengths.shape != (3,):
        raise GeometryError(f"radii: found {len(lengths)} of them; allowed: 3")
    return Collider(
        name=name,
        kind=ELLIPSOID.name,
        bone=bone,
        position=np.asarray(position),
        orientation=np.asarray(orientation),
        geometry={"radii": lengths},
    )


def hull(
    vertices: FloatArray,
    faces: NDArray[np.integer],
    position: Vector = _ORIGIN,
    orientation: Vector = _UNTURNED,
    *,
    name: str = HULL.name,
    bone: str = WORLD,
) -> Collider:
    """A convex hull.

    Args:
        vertices: Its corners in its own frame [m], shape [n, 3].
        faces: Corner indices of its triangles, counter-clockwise seen from outside, shape [f, 3].
        position: Origin of its own frame in the bone's [m], shape [3].
        orientation: Unit quaternion (x, y, z, w) of its own frame in the bone's.
        name: As for `sphere`.
        bone: As for `sphere`.
    """
    geometry = {
        "vertices": np.asarray(vertices, np.float64),
        "faces": np.asarray(faces, np.int32),
    }
    return Collider(
        name=name,
        kind=HULL.name,
        bone=bone,
        position=np.asarray(position),
        orientation=np.asarray(orientation),
        geometry=geometry,
    )


def box(
    size: Vector,
    position: Vector = _ORIGIN,
    orientation: Vector = _UNTURNED,
    *,
    name: str = "box",
    bone: str = WORLD,
) -> Collider:
    """A box, as a hull.

    Args:
        size: Its extent along its own axes [m], shape [3].
        position: Its centre in the bone's frame [m], shape [3].
        orientation: Unit quaternion (x, y, z, w) of its axes there.
        name: As for `sphere`.
        bone: As for `sphere`.

    Raises:
        GeometryError: A measure that is not positive and finite.
    """
    half = 0.5 * np.array([_length("size", extent) for extent in size])
    if half.shape != (3,):
        raise GeometryError(f"size: found {len(half)} extents; allowed: 3")
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    faces = np.array([[f[0], f[i], f[i + 1]] for f in _BOX_FACES for i in (1, 2)], np.int32)
    return hull(corners, faces, position, orientation, name=name, bone=bone)


def _length(label: str, value: float) -> float:
    """A positive, finite number of metres."""
    value = float(value)
    if not 0.0 < value < np.inf:
        raise GeometryError(f"{label}: found {value:g} m; allowed: above 0 m, finite")
    return value
