"""What an outfit file says of what holds a garment: attachments, elastic bands, limits."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from garment_sim_ros.declaration import nearest
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.garment.holds import (
    ARMS,
    AUTOMATIC,
    NONE,
    Attachment,
    Elastic,
    Holds,
    Place,
    VertexDistance,
)
from garment_sim_ros.garment.places import RULES
from garment_sim_ros.sim.holds.skin_limits import SKIN_LIMITS

SHORTEST = 1e-6
"""Shortest distance that cloth may be away [m]: none would be no distance but a pin."""
_STRETCH = 0.02
"""What tethers allow where the file does not say."""
_MOST_ENTRIES = 1000
_MOST_LOOPS = 1000
_FARTHEST = 1e3
"""Largest height [m]."""
_MOST_TENSION = 1e4
"""Of an elastic band [N]."""
_LEAST_SLACK = 0.1
_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
_LONGEST_NAME = 60
_PLACES = ("vertices", "rule", "loop", "band", "colour", "group")
_TELLS_WHERE = f"one of {', '.join(_PLACES)}"


def holds_of(values: Mapping[str, Any]) -> Holds:
    """What holds a garment beside its pins, from the keys of its entry.

    Raises:
        ParameterError: A value that is not allowed; the message names the key.
    """
    tethers = values.get("tethers", False)
    if isinstance(tethers, bool):
        tethers = _STRETCH if tethers else None
    else:
        tethers = number("tethers", tethers, "true, false, or a stretch from 0 to 1", most=1.0)
    return Holds(
        skin_limits={
            name: _distances(name, values[name])
            for name in SKIN_LIMITS
            if values.get(name) is not None
        },
        tethers=tethers,
        stiffness=number(
            "attachment_stiffness",
            values.get("attachment_stiffness", math.inf),
            "a number of N/m from 0, .inf for pins",
        ),
        damping=number(
            "attachment_damping", values.get("attachment_damping", 0.0), "a number of N s/m from 0"
        ),
        elastic=_elastic(values.get("elastic", [])),
    )


def attachments_of(value: object) -> str | tuple[Attachment, ...]:
    """Attachments: a word, or a list of them.

    Raises:
        ParameterError: Neither, or an entry that is not allowed.
    """
    allowed = (
        f"{AUTOMATIC}, {ARMS}, {NONE}, or a list of {{vertices: [...]}}, or with {_TELLS_WHERE}, "
        "each also with a bone, a name, a stiffness in N/m and a damping in N s/m"
    )
    if isinstance(value, str) and value in (AUTOMATIC, ARMS, NONE):
        return value
    attachments = []
    for entry in _entries("attachments", value, allowed):
        known = mapping("attachments", entry, ("bone", *_PLACES, "name", "stiffness", "damping"))
        bone = known.get("bone", "")
        if not isinstance(bone, str) or ("bone" in known and not bone):
            raise ParameterError("attachments", f"found {repr(entry)[:60]}", f"allowed: {allowed}")
        attachments.append(
            Attachment(
                bone=bone,
                place=_place("attachments", known, allowed),
                name=_name("attachments", known),
                **{
                    key: number(f"attachments.{key}", known[key], allowed)
                    for key in ("stiffness", "damping")
                    if key in known
                },
            )
        )
    return tuple(attachments)


def _elastic(value: object) -> tuple[Elastic, ...]:
    allowed = (
        f"a list of {{rule: waist, tension: N}}, or with {_TELLS_WHERE}; each also with a name "
        "and a slack"
    )
    bands = []
    for entry in _entries("elastic", value, allowed):
        known = mapping("elastic", entry, (*_PLACES, "tension", "slack", "name"))
        bands.append(
            Elastic(
                place=_place("elastic", known, allowed),
                tension=number(
                    *("elastic.tension", known.get("tension")),
                    f"a number of N from 0 to {_MOST_TENSION:g}",
                    most=_MOST_TENSION,
                ),
                slack=number(
                    *("elastic.slack", known.get("slack", Elastic.slack)),
                    f"a share of the length from {_LEAST_SLACK:g} to below 1",
                    least=_LEAST_SLACK,
                    most=1.0 - 1e-3,
                ),
                name=_name("elastic", known),
            )
        )
    return tuple(bands)


def _entries(key: str, value: object, allowed: str) -> list[object]:
    if not isinstance(value, list) or len(value) > _MOST_ENTRIES:
        raise ParameterError(key, f"found {repr(value)[:60]}", f"allowed: {allowed}")
    return value


def _place(key: str, known: Mapping[str, Any], allowed: str) -> Place:
    """The one place that an entry tells."""
    told = [name for name in _PLACES if name in known]
    if len(told) != 1:
        found = " and ".join(told) or "none"
        raise ParameterError(key, f"where it is: found {found}", f"allowed: {allowed}")
    way = told[0]
    values: dict[str, Any] = {way: _READERS[way](key, known[way], allowed)}
    return Place(**values)


def _rule(key: str, value: object, _allowed: str) -> str:
    if value not in RULES:
        raise ParameterError(
            f"{key}.rule", f"found {repr(value)[:60]}", "allowed: " + ", ".join(RULES)
        )
    return str(value)


def _loop(key: str, value: object, _allowed: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _MOST_LOOPS:
        raise ParameterError(
            f"{key}.loop",
            f"found {repr(value)[:60]}",
            "allowed: the number of an open edge, 0 for the highest",
        )
    return value


def _band(key: str, value: object, _allowed: str) -> tuple[float, float]:
    allowed = "two heights over the soles in m, [from, to]"
    if not isinstance(value, list) or len(value) != 2:
        raise ParameterError(f"{key}.band", f"found {repr(value)[:60]}", f"allowed: {allowed}")
    low, high = (number(f"{key}.band", v, allowed, -_FARTHEST, _FARTHEST) for v in value)
    if not low < high:
        raise ParameterError(f"{key}.band", f"found {low:g} to {high:g}", f"allowed: {allowed}")
    return low, high


def _painted(key: str, value: object, _allowed: str) -> tuple[float, float, float]:
    if not isinstance(value, str) or not _COLOUR.fullmatch(value):
        raise ParameterError(
            f"{key}.colour", f"found {repr(value)[:60]}", 'allowed: text, as "#ff0000"'
        )
    red, green, blue = (int(value[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue


def _group(key: str, value: object, _allowed: str) -> str:
    if not isinstance(value, str) or not value:
        raise ParameterError(
            f"{key}.group",
            f"found {repr(value)[:60]}",
            "allowed: the name of a group of the mesh",
        )
    return value


def vertices_of(key: str, value: object, allowed: str) -> tuple[int, ...]:
    """A list of whole numbers.

    Raises:
        ParameterError: Something else.
    """
    if not isinstance(value, list):
        raise ParameterError(key, f"found {repr(value)[:60]}", f"allowed: {allowed}")
    if not all(isinstance(v, int) and not isinstance(v, bool) for v in value):
        raise ParameterError(key, "a vertex is not a whole number", f"allowed: {allowed}")
    return tuple(value)


_READERS: Mapping[str, Callable[[str, object, str], object]] = {
    "vertices": vertices_of,
    "rule": _rule,
    "loop": _loop,
    "band": _band,
    "colour": _painted,
    "group": _group,
}


def _name(key: str, known: Mapping[str, Any]) -> str:
    value = known.get("name", "")
    if not isinstance(value, str) or len(value) > _LONGEST_NAME or not value.isprintable():
        raise ParameterError(
            f"{key}.name",
            f"found {repr(value)[:60]}",
            f"allowed: text of up to {_LONGEST_NAME} characters",
        )
    return value


def _distances(name: str, value: object) -> tuple[VertexDistance, ...]:
    """One distance for all vertices, or a list of distances with the vertices that have them."""
    allowed = "a number of metres above 0, or a list of {distance: M, vertices: [...]}"
    if not isinstance(value, list) or len(value) > _MOST_ENTRIES:
        value = [{"distance": value}]
    distances = []
    for entry in value:
        known = mapping(name, entry, ("distance", "vertices"))
        vertices = known.get("vertices")
        distances.append(
            VertexDistance(
                distance=number(name, known.get("distance"), allowed, least=SHORTEST),
                vertices=None if vertices is None else vertices_of(name, vertices, allowed),
            )
        )
    return tuple(distances)


def number(
    name: str, value: object, allowed: str, least: float = 0.0, most: float = math.inf
) -> float:
    """A number from `least` to `most`.

    Raises:
        ParameterError: Something else.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise ParameterError(name, f"found {repr(value)[:60]}", f"allowed: {allowed}")
    return float(value)


def mapping(where: str, value: object, keys: Sequence[str] = ()) -> Mapping[str, Any]:
    """A mapping with text keys, only known ones where `keys` are given.

    Raises:
        ParameterError: Something else.
    """
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise ParameterError(where, f"found {repr(value)[:60]}", "allowed: a mapping of names")
    unknown = sorted(set(value) - set(keys)) if keys else []
    if unknown:
        alike = nearest(unknown[0], keys)
        raise ParameterError(
            where,
            f"unknown key {unknown[0][:60]!r}{f', perhaps {alike}' if alike else ''}",
            "allowed: " + ", ".join(keys),
        )
    return value
