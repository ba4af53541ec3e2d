"""The XML of a URDF: parsed without DTD and entities, numbers checked."""

from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.errors import InputFileError

MAX_TEXT = 16 * 2**20
"""Longest URDF that is parsed [characters]."""
MAX_TAGS = 500_000
_PIECE = 2**20
MAX_DISTANCE = 1e4
"""Farthest from its parent that a joint or a shape may be [m]."""


def root_element(text: str, source: str) -> Element:
    """The <robot> element of a URDF.

    Raises:
        InputFileError: Not XML, XML with a DTD, another document, or xacro not yet expanded.
    """
    if len(text) > MAX_TEXT:
        raise InputFileError(source, f"has {len(text)} characters", f"allowed: at most {MAX_TEXT}")
    if text.count("<") > MAX_TAGS:
        raise InputFileError(source, f"has {text.count('<')} tags", f"allowed: at most {MAX_TAGS}")
    try:
        parser = DefusedXMLParser(forbid_dtd=True)
        # In pieces: while one is parsed, no other thread of the process runs.
        for start in range(0, len(text), _PIECE):
            parser.feed(text[start : start + _PIECE])
        robot = parser.close()
    except (ParseError, DefusedXmlException, ValueError) as error:
        raise InputFileError(
            source, f"is not usable XML ({error})", "allowed: URDF without DTD or entities"
        ) from error
    if robot.tag != "robot":
        raise InputFileError(
            source, f"has the root element <{robot.tag[:60]}>", "allowed: <robot>"
        )
    if any("xacro}" in str(element.tag) for element in robot.iter()):
        raise InputFileError(source, "holds xacro macros", "allowed: URDF expanded by xacro")
    return robot


def numbers(element: Element, key: str, default: str, count: int, source: str) -> FloatArray:
    """The `count` finite numbers of an attribute.

    Raises:
        InputFileError: It holds something else.
    """
    value = element.get(key, default)
    try:
        array = np.array([float(v) for v in value.split(maxsplit=count)])
    except ValueError:
        array = np.zeros(0)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise InputFileError(
            source, f"<{element.tag} {key}={value!r:.200}>", f"allowed: {count} finite numbers"
        )
    return array


def origin_transform(owner: Element, source: str) -> FloatArray:
    """The transform of an element's <origin>, identity where absent, shape [4, 4]."""
    T = np.eye(4)
    origin = owner.find("origin")
    if origin is not None:
        rpy = numbers(origin, "rpy", "0 0 0", 3, source)
        if rpy.any():
            T[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
        T[:3, 3] = numbers(origin, "xyz", "0 0 0", 3, source)
        if np.abs(T[:3, 3]).max() > MAX_DISTANCE:
            raise InputFileError(
                source,
                f"<origin xyz={origin.get('xyz')!r:.200}>",
                f"allowed: up to {MAX_DISTANCE:g} m",
            )
    return T
