"""Where on a garment something is: by number, rule, open edge, height, colour or group."""

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.attachments import shoulder_pins
from garment_sim_ros.garment.holds import Place
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.geometry.topology import boundary_loops, edge_table

RULES = ("waist", "neck", "shoulders", "cuffs", "left_cuff", "right_cuff", "hem")
"""Places by what they are for.

The waist is the highest open edge of what hangs from it, or a ring at the body's waist of what
hangs from the shoulders; the neck is the highest open edge of that. Cuffs are open edges that lie
wholly on one side of the body; the hem is the lowest one that does not.
"""
_SAME_COLOUR = 0.1
"""How far a colour may be from the one that is asked for, in each of red, green and blue."""
_RING = 0.6
"""Half the height of a ring around the waist, in edges of median length."""


def vertices_at(
    place: Place, mesh: GarmentMesh, measures: Measures, hangs_from_shoulders: bool, what: str
) -> IntArray:
    """Vertices of a garment at a place, rising, shape [n].

    Args:
        place: The place.
        mesh: The garment as it is put on.
        measures: The body, in that pose.
        hangs_from_shoulders: Whether it does, rather than from the waist.
        what: What messages call it, as "garment 'skirt': attachment 'waist'".

    Raises:
        GeometryError: There is no such place on the garment; the message names it.
    """
    if place.vertices is not None:
        wrong = [v for v in place.vertices if not 0 <= v < len(mesh.vertices)]
        if wrong:
            raise GeometryError(
                f"{what}: vertices {wrong[:5]} do not exist; allowed: 0 to "
                f"{len(mesh.vertices) - 1}"
            )
        return np.array(place.vertices, np.int32)
    if place.rule is not None:
        found = _by_rule(place.rule, mesh, measures, hangs_from_shoulders, what)
    elif place.loop is not None:
        found = _loop(place.loop, mesh, what)
    elif place.band is not None:
        found = _between(mesh.vertices, measures, *place.band)
        if not len(found):
            z = mesh.vertices[:, 2] - measures.sole
            raise GeometryError(
                f"{what}: no vertices between {place.band[0]:g} and {place.band[1]:g} m; allowed: "
                f"heights over the soles in {z.min():.3g} to {z.max():.3g} m"
            )
    elif place.colour is not None:
        found = _painted(place.colour, mesh, what)
    else:
        found = _of_group(str(place.group), mesh, what)
    return np.sort(found).astype(np.int32)


def loops_from_above(mesh: GarmentMesh) -> list[IntArray]:
    """Open edges, the highest first, each as its vertices in order."""
    return sorted(
        boundary_loops(mesh.triangles), key=lambda loop: -float(mesh.vertices[loop, 2].mean())
    )


def _loop(number: int, mesh: GarmentMesh, what: str) -> IntArray:
    loops = loops_from_above(mesh)
    if number >= len(loops):
        raise GeometryError(
            f"{what}: there is no open edge {number}; allowed: 0 to {len(loops) - 1}, from above"
            if loops
            else f"{what}: the garment has no open edge; allowed: another place"
        )
    return loops[number]


def _by_rule(
    rule: str, mesh: GarmentMesh, measures: Measures, hangs_from_shoulders: bool, what: str
) -> IntArray:
    if rule == "shoulders":
        try:
            return shoulder_pins(measures, mesh)
        except GeometryError as error:
            raise GeometryError(f"{what}: {error}") from error
    if rule == "waist" and hangs_from_shoulders:
        edges = edge_table(mesh.triangles)[0]
        half = _RING * float(
            np.median(np.linalg.norm(np.subtract(*mesh.vertices[edges.T]), axis=1))
        )
        middle = measures.waist - measures.sole
        found = _between(mesh.vertices, measures, middle - half, middle + half)
        if len(found):
            return found
    elif rule in ("waist", "neck") and hangs_from_shoulders == (rule == "neck"):
        return _loop(0, mesh, what)
    elif rule not in ("waist", "neck"):
        chosen = _on_sides(rule, mesh, measures)
        if chosen:
            return np.concatenate(chosen)
    raise GeometryError(
        f"{what}: the garment has no {rule.replace('_', ' ')}; allowed: a place that it has"
    )


def _on_sides(rule: str, mesh: GarmentMesh, measures: Measures) -> list[IntArray]:
    """Cuffs, or the hem."""
    mid = 0.5 * float(measures.vertices[:, 1].min() + measures.vertices[:, 1].max())
    left: list[IntArray] = []
    right: list[IntArray] = []
    across: list[IntArray] = []
    for loop in loops_from_above(mesh):
        y = mesh.vertices[loop, 1] - mid
        (left if y.min() > 0.0 else right if y.max() < 0.0 else across).append(loop)
    if rule == "hem":
        return across[-1:] if len(across) > 1 else []  # the other one is the waist or the neck
    sides = {"left_cuff": left, "right_cuff": right, "cuffs": [*left, *right]}
    return sides[rule]


def _between(x: FloatArray, measures: Measures, low: float, high: float) -> IntArray:
    """Vertices between two heights over the soles [m]."""
    z = x[:, 2] - measures.sole
    return np.flatnonzero((z >= low) & (z <= high)).astype(np.int32)


def _painted(colour: tuple[float, float, float], mesh: GarmentMesh, what: str) -> IntArray:
    if mesh.colours is None:
        raise GeometryError(
            f"{what}: the mesh has no colours; allowed: an .obj, .ply or .glb with colours of its "
            "vertices"
        )
    found = np.flatnonzero((np.abs(mesh.colours - colour) <= _SAME_COLOUR).all(axis=1))
    if not len(found):
        raise GeometryError(f"{what}: nothing is painted so; allowed: a colour that the mesh has")
    return found.astype(np.int32)


def _of_group(group: str, mesh: GarmentMesh, what: str) -> IntArray:
    if group not in mesh.groups:
        known = ", ".join(sorted(mesh.groups))[:200] or "none, as the mesh has no groups"
        raise GeometryError(f"{what}: there is no group {group[:60]!r}; allowed: {known}")
    found = mesh.groups[group]
    if not len(found):
        raise GeometryError(f"{what}: group {group!r} has no vertices; allowed: one that has")
    return found
