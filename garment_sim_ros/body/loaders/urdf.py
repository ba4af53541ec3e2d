"""URDF: the joint tree as a rig, and a whole robot or human as a body.

A rig's joint is a link of the URDF and has its name: that is what frames, colliders and the
humanoid map refer to. A channel has the name of the URDF joint that moves it: that is what
`JointState` carries. Fixed joints give rig joints without channels; so do floating and planar
ones, which `JointState` cannot express. Elements that are not URDF are ignored.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from garment_sim_ros.body.humanoid import humanoid_of_rig
from garment_sim_ros.body.kinematics import followed_channels, rest_transforms
from garment_sim_ros.body.loaders.assembly import TURNED, upright_rotation
from garment_sim_ros.body.loaders.urdf_visuals import MeshFinder, rigid_skin
from garment_sim_ros.body.loaders.urdf_xml import MAX_TEXT, numbers, origin_transform, root_element
from garment_sim_ros.body.missing_head import with_head
from garment_sim_ros.body.rig import ROTATION, TRANSLATION, Dofs, Rig
from garment_sim_ros.body.skin import Body
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.input_file import read_text

MAX_LINKS = 4096

_SHOWN = 5
"""Names in a note."""

_MOVING = {"revolute": ROTATION, "continuous": ROTATION, "prismatic": TRANSLATION}
_RIGID = ("fixed", "floating", "planar")


def parse_urdf(text: str, source: str = "robot_description") -> Rig:
    """The joint tree of a URDF.

    Args:
        text: The URDF.
        source: What to call it in errors.

    Returns:
        A rig whose joints are the links, depth first; its root frame is the root link's.

    Raises:
        InputFileError: Not a URDF, or the links are not one tree.
    """
    return _rig(root_element(text, source), source)


def load_urdf(
    path: str | Path, *, humanoid_overrides: Mapping[str, str | None] | None = None
) -> Body:
    """The body in a URDF file, its visual geometry as a rigid skin; see `body_from_urdf`."""
    text = read_text(path, limit=MAX_TEXT)
    return body_from_urdf(text, str(path), humanoid_overrides=humanoid_overrides)


def body_from_urdf(
    text: str,
    source: str = "robot_description",
    *,
    humanoid_overrides: Mapping[str, str | None] | None = None,
) -> Body:
    """The body that a URDF describes, every part of its skin on one link.

    Args:
        text: The URDF.
        source: Its file, beside which meshes are looked for, or what to call it in errors.
        humanoid_overrides: Link name of some humanoid bones, or None for "has no such bone".

    Raises:
        InputFileError: Not a URDF, no geometry, or a mesh file that cannot be used.
    """
    robot = root_element(text, source)
    rig = _rig(robot, source)
    humanoid = humanoid_of_rig(rig, humanoid_overrides)
    T = rest_transforms(rig)
    R = upright_rotation({bone: T[rig.index(link), :3, 3] for bone, link in humanoid.items()})
    turned = not np.array_equal(R, np.eye(3))
    if turned:
        T_parent_joint = rig.T_parent_joint.copy()
        T_parent_joint[0, :3] = R @ T_parent_joint[0, :3]
        rig = replace(rig, T_parent_joint=T_parent_joint)
    skin, notes = rigid_skin(robot, rig, rest_transforms(rig), MeshFinder(source))
    if stay := _followers_of_nothing(_named(robot, "joint", source)):
        shown = ", ".join(stay[:_SHOWN]) + (", ..." if len(stay) > _SHOWN else "")
        note = f"joints that mimic one that is not there stay where they are: {shown}"
        notes = (*notes, note)
    body = Body(
        name=robot.get("name") or "robot",
        rig=rig,
        skin=skin,
        humanoid=humanoid,
        notes=(*notes, TURNED) if turned else notes,
    )
    given = humanoid_overrides or {}
    return body if given.get("head", "") is None else with_head(body)


def _followers_of_nothing(joints: Mapping[str, Element]) -> list[str]:
    """Moving joints that mimic one that is not there, or another one of these, in their order."""
    leader = {}
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") in _MOVING:
            leader[name] = mimic.get("joint", "")
    is_lost: dict[str, bool] = {}
    for name in leader:
        row: dict[str, bool] = {}
        at = name
        while at in leader and at not in is_lost and at not in row:
            row[at] = True
            at = leader[at]
        # Whoever mimics in a circle is told elsewhere.
        lost = is_lost.get(at, at not in joints)
        is_lost.update(dict.fromkeys(row, lost))
    return [name for name in leader if is_lost[name]]


def _named(robot: Element, tag: str, source: str) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in robot.findall(tag):
        name = element.get("name")
        if not name:
            raise InputFileError(source, f"has a <{tag}> without name")
        if name in found:
            raise InputFileError(source, f"has two {tag}s called {name!r}", "allowed: one")
        found[name] = element
    return found


def _rig(robot: Element, source: str) -> Rig:
    links = _named(robot, "link", source)
    joints = _named(robot, "joint", source)
    if not 0 < len(links) <= MAX_LINKS:
        raise InputFileError(source, f"has {len(links)} links", f"allowed: 1 to {MAX_LINKS}")
    above: dict[str, str] = {}
    children: dict[str, list[str]] = {link: [] for link in links}
    for name, joint in joints.items():
        ends = []
        for end in ("parent", "child"):
            element = joint.find(end)
            link = None if element is None else element.get("link")
            if link is None or link not in links:
                raise InputFileError(
                    source, f"joint {name!r} has the {end} link {link!r}", "allowed: a link's name"
                )
            ends.append(link)
        if ends[1] in above:
            raise InputFileError(source, f"link {ends[1]!r} has two parents", "allowed: one")
        above[ends[1]] = name
        children[ends[0]].append(ends[1])
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise InputFileError(
            source,
            f"has {len(roots)} links without parent: {', '.join(roots[:5])}",
            "allowed: one",
        )
    order: list[str] = []
    stack = roots[:]
    while stack:
        order.append(stack.pop())
        stack.extend(reversed(children[order[-1]]))
    if len(order) != len(links):
        reached = set(order)
        cyclic = next(link for link in links if link not in reached)
        raise InputFileError(source, f"link {cyclic!r} is its own ancestor", "allowed: a tree")

    index = {link: i for i, link in enumerate(order)}
    parent = np.full(len(order), -1)
    T_parent_joint = np.tile(np.eye(4), (len(order), 1, 1))
    for link, name in above.items():
        element = joints[name].find("parent")
        assert element is not None
        parent[index[link]] = index[element.get("link", "")]
        T_parent_joint[index[link]] = origin_transform(joints[name], source)
    try:
        rig = Rig(
            joint_names=tuple(order),
            parent=parent,
            T_parent_joint=T_parent_joint,
            dofs=_dofs(order, above, joints, source),
        )
        followed_channels(rig.dofs)
    except GeometryError as error:
        raise InputFileError(source, str(error)) from error
    return rig


def _dofs(
    order: list[str], above: Mapping[str, str], joints: Mapping[str, Element], source: str
) -> Dofs:
    """The channels of all moving joints, in the order of the links that they move."""
    moving: list[tuple[int, str]] = []
    stay = set(_followers_of_nothing(joints))
    for link_index, link in enumerate(order):
        if link not in above:
            continue
        kind = joints[above[link]].get("type")
        if above[link] in stay:
            continue
        if kind in _MOVING:
            moving.append((link_index, above[link]))
        elif kind not in _RIGID:
            raise InputFileError(
                source,
                f"joint {above[link]!r} has type {kind!r}",
                "allowed: " + ", ".join((*_MOVING, *_RIGID)),
            )
    d = len(moving)
    channel = {name: i for i, (_, name) in enumerate(moving)}
    axis = np.zeros((d, 3))
    lower, upper = np.full(d, -math.inf), np.full(d, math.inf)
    mimic_source = np.full(d, -1, dtype=np.int32)
    multiplier, offset = np.ones(d), np.zeros(d)
    for i, (_, name) in enumerate(moving):
        joint = joints[name]
        element = joint.find("axis")
        axis[i] = (1.0, 0.0, 0.0) if element is None else numbers(element, "xyz", "", 3, source)
        length = np.linalg.norm(axis[i])
        if length < 1e-9:
            raise InputFileError(source, f"joint {name!r} has no axis", "allowed: not all zero")
        axis[i] /= length
        limit = joint.find("limit")
        if limit is not None and joint.get("type") != "continuous":
            lower[i] = numbers(limit, "lower", "0", 1, source)[0]
            upper[i] = numbers(limit, "upper", "0", 1, source)[0]
        mimic = joint.find("mimic")
        if mimic is not None:
            leader = mimic.get("joint", "")
            if leader not in channel:
                raise InputFileError(
                    source, f"joint {name!r} mimics {leader!r}", "allowed: a moving joint's name"
                )
            mimic_source[i] = channel[leader]
            multiplier[i] = numbers(mimic, "multiplier", "1", 1, source)[0]
            offset[i] = numbers(mimic, "offset", "0", 1, source)[0]
    return Dofs(
        names=tuple(channel),
        joint=np.array([link_index for link_index, _ in moving], dtype=np.int32),
        kind=np.array([_MOVING[joints[name].get("type", "")] for _, name in moving], np.int8),
        axis=axis,
        lower=lower,
        upper=upper,
        mimic_source=mimic_source,
        mimic_multiplier=multiplier,
        mimic_offset=offset,
    )
