"""A clip's skeleton as a URDF whose joints are exactly the clip's channels, and what it adds.

A joint with several channels becomes a chain of massless links at one place, the last of which has
the joint's name. One fixed joint at the root turns the file's axes to z up. What retargeting needs
beyond that (a reference pose, ends of bones, hinges) stands in an extra element that URDF parsers
ignore.
"""

from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.anatomy import SourceReference
from garment_sim_ros.body.loaders.urdf_xml import numbers, root_element
from garment_sim_ros.body.rig import ROTATION
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.mocap.clip import Clip

REFERENCE_TAG = "garment_sim_reference"
_FAR = 1e6
"""Limit of a position channel [m]; URDF wants one for prismatic joints."""


def urdf_from_clip(clip: Clip, frame_id: str = "world") -> str:
    """The URDF of a clip's source skeleton.

    Args:
        clip: The clip.
        frame_id: Name of the root link: the world frame.

    Returns:
        URDF text; `parse_urdf` makes a rig of it that has the clip's channels, in their order if
        the clip's joints stand depth first, and whose joints of the same names move alike.
    """
    rig, dofs = clip.rig, clip.rig.dofs
    robot = Element("robot", name=clip.name)
    links, taken = set(rig.joint_names), {*rig.joint_names, *dofs.names}
    base = None if _has_world_link(clip) else _world_link(robot, clip, frame_id, taken)
    for j, name in enumerate(rig.joint_names):
        parent = int(rig.parent[j])
        above = rig.joint_names[parent] if parent >= 0 else base
        channels = np.flatnonzero(dofs.joint == j)
        T = rig.T_parent_joint[j]
        if len(channels) == 0:
            SubElement(robot, "link", name=name)
            if above is not None:
                joint = _joint(robot, _unused(f"{name}_fixed", taken), "fixed", above, name)
                _origin(joint, T)
        for c in channels:
            link = name if c == channels[-1] else _unused(dofs.names[c], links)
            SubElement(robot, "link", name=link)
            _origin(_moving_joint(robot, clip, int(c), str(above), link), T)
            T = np.eye(4)
            above = link
    _add_reference(robot, clip.source_reference)
    indent(robot)
    return tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def _has_world_link(clip: Clip) -> bool:
    """Whether the rig itself begins with a link that never moves, as one read from a URDF."""
    roots = np.flatnonzero(clip.rig.parent < 0)
    moves = np.isin(roots, clip.rig.dofs.joint).any()
    T = clip.T_world_file @ clip.rig.T_parent_joint[roots[0]]
    return len(roots) == 1 and not moves and np.array_equal(T, np.eye(4))


def _world_link(robot: Element, clip: Clip, frame_id: str, taken: set[str]) -> str:
    """Add the world, and fixed to it the frame of the file's axes, whose name is returned."""
    world, axes = _unused(frame_id, taken), _unused("file_axes", taken)
    for link in (world, axes):
        SubElement(robot, "link", name=link)
    joint = _joint(robot, _unused(f"{world}_to_{axes}", taken), "fixed", world, axes)
    _origin(joint, clip.T_world_file)
    return axes


def _unused(name: str, taken: set[str]) -> str:
    """The name, or the name with a number that makes it unique; it is then taken."""
    free, count = name, 1
    while free in taken:
        count += 1
        free = f"{name}_{count}"
    taken.add(free)
    return free


def _joint(robot: Element, name: str, kind: str, parent: str, child: str) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    return joint


def _moving_joint(robot: Element, clip: Clip, c: int, parent: str, child: str) -> Element:
    dofs = clip.rig.dofs
    lower, upper = float(dofs.lower[c]), float(dofs.upper[c])
    limited = bool(np.isfinite([lower, upper]).all())
    kind = "prismatic"
    if dofs.kind[c] == ROTATION:
        kind = "revolute" if limited else "continuous"
    elif not limited:
        lower, upper, limited = -_FAR, _FAR, True
    joint = _joint(robot, dofs.names[c], kind, parent, child)
    SubElement(joint, "axis", xyz=_text(dofs.axis[c]))
    if limited:
        SubElement(joint, "limit", lower=repr(lower), upper=repr(upper), effort="0", velocity="0")
    leader = int(dofs.mimic_source[c])
    if leader >= 0:
        SubElement(
            joint,
            "mimic",
            joint=dofs.names[leader],
            multiplier=repr(float(dofs.mimic_multiplier[c])),
            offset=repr(float(dofs.mimic_offset[c])),
        )
    return joint


def _origin(joint: Element, T: FloatArray) -> None:
    if np.array_equal(T, np.eye(4)):
        return
    rpy = Rotation.from_matrix(T[:3, :3].copy()).as_euler("xyz")  # old ones want to write
    SubElement(joint, "origin", xyz=_text(T[:3, 3]), rpy=_text(rpy))


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _add_reference(robot: Element, reference: SourceReference) -> None:
    element = SubElement(robot, REFERENCE_TAG)
    if reference.ankle_height is not None:
        element.set("ankle_height", repr(reference.ankle_height))
    for name, value in reference.values.items():
        SubElement(element, "pose", joint=name, value=repr(float(value)))
    vectors: tuple[tuple[str, Mapping[str, FloatArray]], ...] = (
        ("end_site", reference.end_sites),
        ("hinge", reference.hinges),
        ("sole", reference.soles),
    )
    for tag, named in vectors:
        for link, vector in named.items():
            SubElement(element, tag, link=link, xyz=_text(vector))


def reference_from_urdf(text: str, source: str = "robot_description") -> SourceReference:
    """What `urdf_from_clip` added to a URDF; the empty reference for any other URDF.

    Args:
        text: The URDF.
        source: What to call it in errors.

    Raises:
        InputFileError: Not a URDF, or the extra element holds something that is not allowed.
    """
    element = root_element(text, source).find(REFERENCE_TAG)
    if element is None:
        return SourceReference()

    def named(child: Element, key: str) -> str:
        name = child.get(key)
        if not name:
            raise InputFileError(source, f"<{child.tag}> has no {key}", "allowed: a name")
        return name

    def vectors(tag: str) -> dict[str, FloatArray]:
        return {
            named(child, "link"): numbers(child, "xyz", "", 3, source)
            for child in element.findall(tag)
        }

    height = None
    if "ankle_height" in element.keys():  # noqa: SIM118 (an Element iterates over its children)
        height = float(numbers(element, "ankle_height", "", 1, source)[0])
    return SourceReference(
        values={
            named(child, "joint"): float(numbers(child, "value", "", 1, source)[0])
            for child in element.findall("pose")
        },
        end_sites=vectors("end_site"),
        hinges=vectors("hinge"),
        soles=vectors("sole"),
        ankle_height=height,
    )
