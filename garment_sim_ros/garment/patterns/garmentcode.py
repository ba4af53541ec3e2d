"""Sewing patterns in the JSON specification of GarmentCode, read as they are.

The format (Korosteleva & Sorkine-Hornung 2023, "GarmentCode: Programming parametric sewing
patterns", section 3, and the data set of Korosteleva & Lee 2021 before it): lengths in units of
``units_in_meter``; y up, z forward; a panel is rotated by Euler angles in degrees, about x, y, z
of the world in this order, then moved. Control points of curves are in shares of the edge along
and to the left of it (``curvature_coords: relative``) or in the panel's coordinates (absolute).
Panels whose outline runs clockwise have their right side backwards.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.garment.patterns.checking import MOST_EDGES, MOST_PANELS, check
from garment_sim_ros.garment.patterns.curves import signed_area
from garment_sim_ros.garment.patterns.pattern import (
    Arc,
    Edge,
    Panel,
    Pattern,
    Placement,
    Seam,
    Stitch,
)
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.input_file import read_text, said_of
from garment_sim_ros.plain_data import PlainDataError, parse_json

MAX_FILE_BYTES = 8 * 2**20
_MOST_STITCHES = 4096
_FARTHEST = 1e4
"""Largest number that is a coordinate, in the file's units."""
_FLATTEST = 1e6
"""Largest radius of an arc, in distances of its ends."""
_TURNED = "right_wrong"
"""What a stitch says that turns one of its pieces over."""


def read_garmentcode(path: str | Path) -> Pattern:
    """A pattern from a GarmentCode specification.

    Raises:
        InputFileError: The file is missing, no JSON, or not such a pattern; the message names the
            panel, edge or stitch.
    """
    try:
        content = parse_json(read_text(path, limit=MAX_FILE_BYTES))
    except PlainDataError as error:
        raise InputFileError(path, f"is not plain JSON ({error})") from None
    with said_of(path):
        pattern = _pattern(Path(path).stem, content)
        check(pattern)
    return pattern


def _pattern(name: str, content: object) -> Pattern:
    top = _mapping("the file", content)
    body = _mapping("'pattern'", top.get("pattern"))
    properties = _mapping("'properties'", top.get("properties", {}))
    per_metre = _number("'units_in_meter'", properties.get("units_in_meter", 100))
    if not per_metre > 0.0:
        raise GeometryError(f"'units_in_meter' is {per_metre:g}; allowed: above 0")
    coordinates = properties.get("curvature_coords", "relative")
    if coordinates not in ("relative", "absolute"):
        raise GeometryError(
            f"'curvature_coords' is {coordinates!r:.40}; allowed: relative, absolute"
        )
    of_name = _mapping("'panels'", body.get("panels"))
    if not 1 <= len(of_name) <= MOST_PANELS:
        raise GeometryError(f"found {len(of_name)} panels; allowed: 1 to {MOST_PANELS}")
    order: dict[str, list[int]] = {}
    panels = {}
    for key, entry in of_name.items():
        panels[key], order[key] = _panel(
            key, _mapping(f"panel {key!r}", entry), 1.0 / per_metre, coordinates == "relative"
        )
    stitches = body.get("stitches", [])
    if not isinstance(stitches, list) or len(stitches) > _MOST_STITCHES:
        raise GeometryError(f"'stitches' is no list of up to {_MOST_STITCHES}")
    return Pattern(
        name=name,
        panels=panels,
        stitches=tuple(_stitch(i, entry, order) for i, entry in enumerate(stitches)),
    )


def _panel(
    name: str, entry: Mapping[str, Any], metre: float, relative: bool
) -> tuple[Panel, list[int]]:
    """A panel, and where each edge of the file is in it."""
    what = f"panel {name!r}"
    corners = _points(f"{what} vertices", entry.get("vertices"), 2) * metre
    listed = entry.get("edges")
    if not isinstance(listed, list) or not 2 <= len(listed) <= MOST_EDGES:
        raise GeometryError(f"{what}: 'edges' is no list of 2 to {MOST_EDGES}")
    edges = [_edge(f"{what} edge {i}", e, corners, metre, relative) for i, e in enumerate(listed)]
    chain, edges = _in_order(what, edges)
    turn = np.eye(4)
    turn[:3, :3] = AXES_FROM_Y_UP @ _rotation(_vector(f"{what} rotation", entry, "rotation"))
    turn[:3, 3] = AXES_FROM_Y_UP @ _vector(f"{what} translation", entry, "translation") * metre
    outline = np.concatenate(
        [c[:-1] for c in _made(name, corners, [edges[k] for k in chain], turn).curves]
    )
    clockwise = signed_area(outline) < 0.0
    if clockwise:  # its right side is backwards: seen from behind it is flipped
        turn = turn @ np.diag([-1.0, 1.0, -1.0, 1.0])
        corners = corners * [-1.0, 1.0]
        edges = [edge.flipped for edge in edges]
    panel = replace(
        _made(name, corners, [edges[k] for k in chain], turn),
        label=str(entry.get("label", ""))[:60],
        clockwise=clockwise,
    )
    place = [0] * len(edges)
    for position, k in enumerate(chain):
        place[k] = position
    return panel, place


def _made(name: str, corners: FloatArray, edges: Sequence[Edge], turn: FloatArray) -> Panel:
    return Panel(
        name=name,
        corners=corners,
        edges=tuple(edges),
        placement=Placement(T_world_panel=turn),
    )


def _edge(what: str, entry: object, corners: FloatArray, metre: float, relative: bool) -> Edge:
    known = _mapping(what, entry)
    ends = known.get("endpoints")
    if (
        not isinstance(ends, list)
        or len(ends) != 2
        or any(isinstance(e, bool) or not isinstance(e, int) for e in ends)
        or not all(0 <= e < len(corners) for e in ends)
    ):
        raise GeometryError(
            f"{what} has the endpoints {ends!r:.60}; allowed: two corners, 0 to {len(corners) - 1}"
        )
    start, end = ends
    if start == end:
        raise GeometryError(f"{what} has no length; allowed: two different corners")
    curvature = known.get("curvature")
    label = str(known.get("label", ""))[:60]
    if curvature is None or curvature == {} or curvature == []:
        return Edge(start=start, end=end, label=label)
    if isinstance(curvature, list):  # the data set of 2021: one control point
        curvature = {"type": "quadratic", "params": [curvature]}
    kind = _mapping(f"{what} curvature", curvature)
    params = kind.get("params")
    bare = isinstance(params, list) and not any(isinstance(p, list) for p in params)
    if kind.get("type") == "quadratic" and bare:
        params = [params]  # the one control point itself, not a list of it
    if kind.get("type") == "circle":
        if not isinstance(params, list) or len(params) != 3:
            raise GeometryError(f"{what}: a circle needs radius, large and right")
        radius = _number(f"{what} radius", params[0]) * metre
        chord = float(np.hypot(*(corners[end] - corners[start])))
        if not 0.5 * chord * (1.0 - 1e-9) <= radius <= _FLATTEST * chord:
            raise GeometryError(
                f"{what} is an arc of radius {radius:.4g} m between points {chord:.4g} m apart; "
                f"allowed: {0.5 * chord:.4g} m to {_FLATTEST * chord:.2g} m"
            )
        return Edge(
            start=start,
            end=end,
            label=label,
            arc=Arc(radius=radius, large=bool(params[1]), right=bool(params[2])),
        )
    count = {"quadratic": 1, "cubic": 2}.get(str(kind.get("type")))
    if count is None:
        raise GeometryError(
            f"{what}: the curvature {kind.get('type')!r:.40} is unknown; allowed: quadratic, "
            "cubic, circle"
        )
    points = _points(f"{what} curvature", params, 2)
    if len(points) != count:
        raise GeometryError(f"{what}: found {len(points)} control points; allowed: {count}")
    if relative:
        a, along = corners[start], corners[end] - corners[start]
        left = np.array([-along[1], along[0]])
        points = a + points[:, :1] * along + points[:, 1:] * left
    else:
        points = points * metre
    return Edge(
        start=start, end=end, label=label, controls=tuple((float(x), float(y)) for x, y in points)
    )


def _in_order(what: str, edges: Sequence[Edge]) -> tuple[list[int], list[Edge]]:
    """Numbers of the edges as they follow each other; all edges, those that ran back turned."""
    at: dict[int, list[int]] = {}
    for i, edge in enumerate(edges):
        for corner in (edge.start, edge.end):
            at.setdefault(corner, []).append(i)
            if len(at[corner]) > 2:
                first, second, third = at[corner]
                raise GeometryError(
                    f"{what}: edges {first}, {second} and {third} meet in one corner; allowed: "
                    "one closed outline"
                )
    chain, along = [0], list(edges)
    while True:
        last = chain[-1]
        following = [i for i in at[along[last].end] if i != last]
        if not following:
            raise GeometryError(
                f"{what} is open at the end of edge {last}; allowed: a closed outline"
            )
        (n,) = following
        if n == 0:
            break
        if along[n].start != along[last].end:
            along[n] = along[n].backwards
        chain.append(n)
    if len(chain) < len(edges):
        raise GeometryError(f"{what} has more than one outline; allowed: one")
    if 2 * sum(a is not b for a, b in zip(along, edges, strict=True)) > len(edges):
        # Most run the other way round, which tells the right side.
        chain, along = [chain[0], *chain[:0:-1]], [edge.backwards for edge in along]
    return chain, along


def _stitch(index: int, entry: object, order: Mapping[str, Sequence[int]]) -> Stitch:
    """A stitch of two sides, each an edge or several, and perhaps a word on how they lie."""
    what = f"stitch {index}"
    turned = False
    if isinstance(entry, Mapping):  # {"from": side, "to": side}
        entry = [entry.get("from"), entry.get("to")]
    if isinstance(entry, list) and len(entry) == 3 and not isinstance(entry[2], Mapping | list):
        if entry[2] not in (_TURNED, True, False, None):
            raise GeometryError(f"{what} says {entry[2]!r:.40}; allowed: {_TURNED}")
        turned = entry[2] in (_TURNED, True)
        entry = entry[:2]
    if not isinstance(entry, list) or len(entry) != 2:
        raise GeometryError(f"{what} does not have two sides; allowed: [side, side]")
    a, b = (_side(what, side, order) for side in entry)
    return Stitch(sides=(a, b), turned=turned)


def _side(what: str, entry: object, order: Mapping[str, Sequence[int]]) -> tuple[Seam, ...]:
    parts = entry if isinstance(entry, list) else [entry]
    seams = []
    for part in parts:
        known = _mapping(f"{what}, a side", part)
        panel = known.get("panel")
        if not isinstance(panel, str) or panel not in order:
            raise GeometryError(
                f"{what}: there is no panel {panel!r:.60}; allowed: {', '.join(order)[:200]}"
            )
        edge = known.get("edge", known.get("edges"))
        numbers = edge if isinstance(edge, list) else [edge]
        for number in numbers:
            if isinstance(number, bool) or not isinstance(number, int):
                raise GeometryError(
                    f"{what}: the edge {number!r:.40} of {panel!r} is no whole number"
                )
            if not 0 <= number < len(order[panel]):
                raise GeometryError(
                    f"{what}: panel {panel!r} has no edge {number}; allowed: 0 to "
                    f"{len(order[panel]) - 1}"
                )
        seams.append(Seam(panel=panel, edges=tuple(order[panel][n] for n in numbers)))
    if not seams:
        raise GeometryError(f"{what} has an empty side; allowed: panel and edge")
    return tuple(seams)


def _mapping(what: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise GeometryError(f"{what} is {str(value)[:40]!r}; allowed: an object")
    return value


def _number(what: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise GeometryError(f"{what} is {value!r:.40}; allowed: a finite number")
    return float(value)


def _points(what: str, value: object, size: int) -> FloatArray:
    if not isinstance(value, list) or not 1 <= len(value) <= 4 * MOST_EDGES:
        raise GeometryError(f"{what}: found no list; allowed: points of {size} numbers")
    rows = []
    for point in value:
        if not isinstance(point, list) or len(point) != size:
            raise GeometryError(f"{what}: found {point!r:.40}; allowed: {size} numbers")
        rows.append([_number(what, number) for number in point])
    points = np.array(rows)
    if np.abs(points).max() > _FARTHEST:
        raise GeometryError(f"{what}: found {np.abs(points).max():.3g}; allowed: to {_FARTHEST:g}")
    return points


def _vector(what: str, entry: Mapping[str, Any], key: str) -> FloatArray:
    return _points(what, [entry.get(key, [0.0, 0.0, 0.0])], 3)[0]


def _rotation(degrees: FloatArray) -> FloatArray:
    """Rotation about the fixed axes x, y, z in this order, shape [3, 3]."""
    cx, cy, cz = np.cos(np.radians(degrees))
    sx, sy, sz = np.sin(np.radians(degrees))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return about_z @ about_y @ about_x
